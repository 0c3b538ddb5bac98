/* What Python sees of waves.c; read by cffi too, so declarations alone. SI units. Arrays belong to numpy. */
#if !defined(COSSERAT_WAVES_H)
#define COSSERAT_WAVES_H

/* Cells lie between nodes 0 (drive) to cells (bit). See model.py for the method and for what a row holds. */
typedef struct {
    int cells, filters;
    double dt;
    double *down, *up;                       /* (cells,) M + Z om and M - Z om that reach the node below, above, next */
    const double *above, *below;             /* (nodes,) impedances of the cells beside a node */
    const double *share;                     /* (cells,) dt/(4 Z): energy of a wave over its square */
    const int *filtered;                     /* (filters,) cells whose travel time is no whole number of steps */
    const double *turn;                      /* (filters,) coefficients of their all-pass filters */
    double *down_kept, *up_kept;             /* (filters,) what the filters hold */
    const double *drag;                      /* (nodes,) N m s/rad */
    const double *hold, *slide, *decay;      /* (nodes,) static and kinetic torque, N m, and decay, rad/s; 0: at once */
    double *speed, *angle, *torque;          /* (nodes,) mean of the last step; at its end; of friction, its mean */
    double *moment;                          /* (nodes,) torque handed down to a node, its mean */
    double *last_speed, *last_moment;        /* (nodes,) of the step before */
    int stiff, bit;                          /* whether the drive imposes the speed; whether there is a bit */
    double drive_inertia, Kp, Ki, given;     /* torque of the drive: given + Kp (Om - om) + Ki integral */
    double bit_inertia;
    double drive_speed, integral, bit_speed; /* at the end of the last step; without inertia, its mean */
    double last_on_bit;                      /* torque on bit of the step before */
    double work, at_bit, at_wall, in_mud;    /* since the start, J */
    long long iterations;
} waves;

int advance(waves *w, int steps, const double *speeds, double first, int width, double *rows);
void energies(const waves *w, double *kinetic, double *strain);

#endif
