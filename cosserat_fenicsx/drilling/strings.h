/* The interface of the C code of this folder to Python; read by cffi too, so declarations alone. SI units. Arrays
   belong to numpy. */

#ifndef COSSERAT_STRINGS_H
#define COSSERAT_STRINGS_H

/* A law of friction that is a function in Python, see laws.py: tabulated over slip and load, or called. */
typedef struct {
    void *self;                     /* of `call_law`; or NULL: it is tabulated for all loads */
    int count, logarithmic;         /* cubics over s or ln s from `first` on; of ln s each is `width` wide */
    double first, width;
    const double *knots;            /* (count + 1,) where they begin and end */
    int rows;                       /* loads; 0: it is called, 1: it does not depend on them */
    const double *loads;            /* (rows,) N */
    const double *cubics, *rise;    /* (rows, count, 4) coefficients of the powers 3 to 0; of the slope by the load */
    const double *still;            /* (2, rows) at rest, and its slope by the load */
    double fall, drop;              /* its steepest fall where it is continuous; infinite, if it drops somewhere */
} curve;

/* A law of friction R against a slip s: anything up to `still` at rest; above that slipping + (still - slipping)
   exp(-s/decay), with decay = 0 if it drops at once. Or scale times a curve of reach s, then with `slipping` R just
   above rest, and decay 0. */
typedef struct {
    double still, slipping, decay;
    const curve *other;             /* or NULL */
    double scale, reach, load;      /* load: the weight on bit, N, for laws that are called */
} friction;

/* Numbers in a row of a motion: the time, SERIES and LEDGER of protocol.py; those of motors may follow. Most pairs of
   forces in a string. */
enum { ROW = 22, MOST_PAIRS = 6 };

#if 0
extern "Python" double call_law(void *self, double slip, double load, double *slope);
#endif

/* A linear control of the drive: x' = A x + B u, y = C x + D u, u = (Om - om, M - level), by the midpoint rule; y is
   its torque, or its speed less the one asked for. See linear_control.py. */
typedef struct {
    int size, late;                  /* of x; steps by which y acts late */
    int used, of_speed;              /* whether there is one; whether y is a speed */
    double level, step;              /* N m; length of a whole step, s */
    const double *A, *B, *C, *D;     /* (size, size), (size, 2), (size,), (2,) */
    double *state, *mean;            /* (size,) x at the end of the last step, its mean in this one */
    double *waiting;                 /* (late + 1,) means of y over past steps, that which acts now after the first */
    double *work;                    /* (size, 2 size): its right half is the inverse of 1 - h/2 A */
    double h, answer[2];             /* length of a part of a step, and y of the mean u of that part */
    double sum, spent;               /* of y over time, and time, in the parts of the present step */
} linear;

/* Cells lie between nodes 0 (drive) to cells (bit). See torsion.py for the method and for what a row holds. */
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
    double *hold, *slide;                    /* (nodes,) static and kinetic torque, N m */
    const double *decay;                     /* (nodes,) rad/s; 0: it drops at once */
    const double *grip, *reach;              /* (nodes,) scale of the wall's curve and of its slip, if it has one */
    curve wall, rock;                        /* laws of wall and bit that are functions in Python; empty: none */
    double load, per_weight[2];              /* weight on bit, N; static and kinetic torque per weight, if it changes */
    double *speed, *angle, *torque;          /* (nodes,) mean of the last step; at its end; of friction, its mean */
    double *moment;                          /* (nodes,) torque handed down to a node, its mean */
    double *last_speed, *last_moment;        /* (nodes,) of the step before */
    int stiff, bit;                          /* whether the drive imposes the speed; whether there is a bit */
    double drive_inertia, Kp, Ki, given;     /* torque of the drive: given + Kp (Om - om) + Ki integral */
    double bit_inertia;
    double slope, dragged;                   /* of a motor above the bit: torque over speed, 0: none; drag below */
    double lost;                             /* largest torque of the friction of its rotor */
    curve motor;                             /* its torque over its speed, less that at rest; empty: a line */
    const curve *motors;                     /* the same in each of the steps asked for, where its flow changes */
    const double *driven;                    /* torque that its flow gives it at rest, in each of the steps asked for */
    double bit_angle, turned, last_turned;   /* of the bit below a motor; its speed against the housing, see `speed` */
    double tools;                            /* work of the motor since the start, J */
    double drive_speed, integral, bit_speed; /* at the end of the last step; without inertia, its mean */
    double last_on_bit;                      /* torque on bit of the step before */
    double work, at_bit, at_wall, in_mud;    /* since the start, J */
    long long iterations;
    linear control;
} waves;

/* The condition of one unknown at the uppermost node, with a velocity asked for, the signal. */
typedef struct {
    int rigid;                      /* the node has the velocity of the signal; otherwise it feels the force */
    double given, proportional, integral; /* given + proportional (signal - w) + integral error */
    double error;                   /* the integral of signal - w over time */
    double inertia;                 /* of the drive alone; it is a part of the node's mass */
    double force;                   /* on the node, of the last step */
} upper;

/* The lower end. Its force against the motion of the last node is force + tangent w + the law. */
typedef struct {
    int over_time;                  /* whether its weight is given for every step */
    int law, weighs, rock;          /* whether there is a law of friction, whether its torques are per weight on bit,
                                       whether the bit stands on a rock */
    double stiffness;               /* of that rock, N/m; 0: it is rigid */
    friction given, rubs;           /* torque of the law, or per weight on bit; the same in the step being done */
    curve curve;                    /* of that law, if it is a function in Python */
    double flat;                    /* half the largest force of the flats of a worn bit; 0: none */
    double force[2], tangent[4];    /* given from Python before a step, for other laws: weight on bit and torque */
    double hanging;                 /* static weight on bit, with which the string hangs */
    double weight, torque;          /* of the last step, with the impulse of an impact on rigid rock */
    double recorded[2], share;      /* the same without it; its share of the weight */
    double mass;                    /* of the bit, a part of the last node's; of discs all of that */
    double slowed, slowing;         /* momentum of the last element not yet in the recorded weight, N s; its force, N */
    double impulse;                 /* of all impacts on rigid rock since the start, N s */
    double floor, sinking;          /* place of the rock's face at the end of the step, and its velocity downwards */
    double face, middle;            /* its place at the end and in the middle of the part of a step being done */
} lower;

/* Sums since the start, J. */
typedef struct {
    double drive, hook, tools, bit, wall, mud;
} books;

typedef struct {
    int nodes, dofs, pieces;
    int at_end;                     /* whether speeds are recorded at the end of a step, else means over it */
    const double *mass, *mass_off;  /* (nodes, dofs), (nodes - 1, dofs): tridiagonal mass matrix */
    const double *drag, *drag_off;  /* the same of what is proportional to the velocity */
    const double *spring;           /* (nodes - 1, dofs) stiffness of elements */
    const double *hanging;          /* (nodes - 1,) tension of elements at rest */
    double hanging_top;             /* and at the top */
    double *x, *v, *w;              /* (nodes, dofs) at the end of the last step, and mean velocity in it */
    double *force;                  /* (nodes, dofs) of friction against the slip; of the bit its torque */
    int *held;                      /* (nodes,) bits of unknowns that are held: by wall or rock */
    /* pieces of the string along the wall: element, nodes that take the friction of its two ends, share of the second,
       length, curvature, weight along normal and binormal, tension at rest, factor on friction, contact radius */
    const int *element, *first, *second;
    const double *share, *length, *curvature, *across, *aside, *tension, *factor, *radius;
    friction wall;                  /* coefficients of friction over the slip, m/s, or over the rotation, rad/s */
    curve curve;                    /* of that law, if it is a function in Python */
    int of_rotation, fixed;         /* which of these; whether the normal force is always that of the rest */
    double *limit;                  /* (nodes, 3) largest force at rest, in motion, and radius of contact */
    int pairs, shown;               /* pairs of forces between nodes; motors that rows have a column for */
    const int *pair, *pair_dof;     /* (pairs,) elements, and their unknowns */
    const double *pair_slope;       /* (pairs,) dampers, which count as tools; signals follow those of the top */
    const double *pair_lost;        /* (pairs,) largest friction between both sides */
    /* of each pair: torque of a motor over its speed, less that at rest, empty: a line; */
    curve drives[MOST_PAIRS];
    const curve *over[MOST_PAIRS];  /* the same in each of the intervals asked for, where its flow changes, or NULL; */
    double bends[MOST_PAIRS], softens[MOST_PAIRS]; /* what it adds to that of its damper, by value at rest and slope; */
    double applied[MOST_PAIRS];     /* force of the last step, friction included; */
    double rubbed[MOST_PAIRS], rubs[MOST_PAIRS]; /* friction between both sides; that which is a given force; */
    int stands[MOST_PAIRS];         /* whether it holds them: then the matrix has a damper; */
    double parted[MOST_PAIRS][3];   /* entries of the matrix without these */
    upper top[2];
    lower bit;
    books sums;
    double *a, *o, *rho;            /* (nodes, dofs) x 3: matrix of a step of the length h, and factors of the laws */
    double h, ease;                 /* length of that step; share of the factors that is taken */
    double *b, *y, *c, *q, *d;      /* work space: (nodes, dofs) x 3, (nodes, 4), (nodes, 3) */
    double *guess;                  /* (2, nodes, dofs) */
    int *mask, *broken;             /* (nodes,) */
    long halved, iterations, most;  /* counts: steps that were halved, iterations, most of them in a step */
    long long inner;                /* iterations for the slips that belong to forces */
    linear control;
} model;

int advance_waves(waves *w, int steps, const double *speeds, const double *weights, double *rows);
int advance_elements(model *m, int intervals, const double *interval, const double *weights, double *rows);
void limits(model *m);
int build(model *m, double h);
double steepest(model *m, double h);

#endif
