/* What Python sees of upwind_torsion.c; read by cffi too, so declarations alone. */
#if !defined(UPWIND_TORSION_H)
#define UPWIND_TORSION_H

/* Two uniform parts, pipe and collars. SI units. */
typedef struct {
    int cells[2];
    double courant[2], impedance[2];  /* c dt/dx; N m s/rad */
    double dt, drag, top;             /* s; 1/s; speed of the stiff drive, rad/s */
    double still, turning, decay;     /* law of the bit: N m, N m, rad/s */
    double inertia;                   /* of the bit, kg m^2 */
    double *down, *up;                /* (cells,) om + M/Z and om - M/Z */
    double bit;                       /* speed of the bit, rad/s */
} upwind;

void march(upwind *s, int steps, double *bit_speed, double *top_torque);

#endif
