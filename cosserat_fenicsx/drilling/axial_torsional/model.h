/* What Python sees of the C code of this folder; read by cffi too, so declarations alone. SI units. A string is a row
   of nodes, from the top drive down, with one unknown each (the angle), or two (the displacement downwards, the angle);
   of two the axial one comes first. Arrays belong to numpy. */

#ifndef AXIAL_TORSIONAL_H
#define AXIAL_TORSIONAL_H

/* What moves the uppermost node in one of its unknowns, by a velocity that is asked for, the signal. */
typedef struct {
    int rigid;                      /* the node has the velocity of the signal; otherwise it feels the force */
    double constant, proportional, integral; /* constant + proportional (signal - w) + integral error */
    double error;                   /* the integral of signal - w over time */
    double inertia;                 /* of the drive alone; it is a part of the node's mass */
    double force;                   /* on the node, of the last step */
} upper;

/* The lower end. Its force against the motion of the last node is force + tangent w + the law. */
typedef struct {
    int law, weighs, rock;          /* whether there is a Stribeck law, whether its torques are per weight on bit,
                                       whether the bit stands on a rock */
    double stiffness;               /* of that rock, N/m; 0: it is rigid */
    double still, slipping, decay;  /* torques of the law, or per weight, and speed; 0: it drops at once */
    double flat;                    /* half the largest force of the flats of a worn bit; 0: none */
    double force[2], tangent[4];    /* given from Python before a step, for other laws: weight on bit and torque */
    double hanging;                 /* static weight on bit, with which the string hangs */
    double weight, torque;          /* of the last step, with the impulse of an impact on rigid rock */
    double told[2], share;          /* the same without it; the share of the weight that this leaves */
    double mass;                    /* of the bit, a part of the last node's; of discs all of that */
    double slowed, slowing;         /* momentum of the last element that the told weight lacks, N s; its force, N */
    double impulse;                 /* of all impacts on rigid rock since the start, N s */
    double floor, sinking;          /* place of the rock's face at the end of the step, and its velocity downwards */
    double face, middle;            /* its place at the end and in the middle of the part of a step being done */
    double factor;                  /* of the next step, on the law's torques */
} lower;

/* Sums since the start, J. */
typedef struct {
    double drive, hook, bit, wall, mud;
} books;

typedef struct {
    int nodes, dofs, pieces;
    int at_end;                     /* whether speeds are told at the end of a step; otherwise means over it */
    const double *mass, *mass_off;  /* (nodes, dofs), (nodes - 1, dofs): tridiagonal mass matrix */
    const double *drag, *drag_off;  /* the same of what is proportional to the velocity */
    const double *spring;           /* (nodes - 1, dofs) stiffness of elements */
    const double *hanging;          /* (nodes - 1,) tension of elements at rest */
    double hanging_top;             /* and at the top */
    double *x, *v, *w;              /* (nodes, dofs) at the end of the last step, and mean velocity in it */
    double *force;                  /* (nodes, dofs) of friction against the slip; of the bit its torque */
    int *held;                      /* (nodes,) bits of unknowns that are held: by wall or rock */
    /* pieces of the string along the wall: element, nodes that take the friction of its two ends, share of the second,
       length, curvature, weight along normal and binormal, tension at rest, coefficients, contact radius */
    const int *element, *first, *second;
    const double *share, *length, *curvature, *across, *aside, *tension, *still, *slipping, *radius;
    double decay;                   /* speed of the law of friction, m/s or rad/s; 0: it drops at once */
    int of_rotation, fixed;         /* meaning of decay; whether the normal force is always that of the rest */
    double *limit;                  /* (nodes, 3) largest force at rest, in motion, and radius of contact */
    upper top[2];
    lower bit;
    books sums;
    double *a, *o, *rho;            /* (nodes, dofs) x 3: matrix of a step of the length h, and factors of the laws */
    double h, ease;                 /* length of that step; share of the factors that is taken */
    double *b, *y, *c, *q, *d;      /* work space: (nodes, dofs) x 3, (nodes, 4), (nodes, 3) */
    double *guess;                  /* (2, nodes, dofs) */
    int *mask, *broken;             /* (nodes,) */
    long halved, iterations, most;  /* counts: steps that were halved, iterations, most of them in a step */
} model;

int advance(model *m, int intervals, const double *interval, double *record);
void limits(model *m);
int build(model *m, double h);
double steepest(model *m, double h);

#endif
