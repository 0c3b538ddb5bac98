/* Declarations of the C code of this folder, for C and for cffi. Frames and units are those of the forms: all numbers
   are dimensionless. Arrays belong to numpy. */

#ifndef CHAIN_H
#define CHAIN_H

enum { LANES = 4, AT_ONCE = 6 }; /* problems that are solved at once; right-hand sides of one */

/* Values of a Function that change, and the first column of an element's packed coefficients that takes them. */
typedef struct {
    const double *values;
    const int *which; /* (elements, count) */
    int count, column;
} source;

/* A compiled form or expression with the coefficients of all elements. */
typedef struct kernel {
    void *tabulate;                /* FFCx's function for one element */
    int elements, size, width;     /* sizes of its result and of the coefficients of an element */
    double *w, *c;                 /* coefficients (elements, width), constants */
    int sources, constants;
    source *source;
    const double **constant;       /* values of constants that change */
    int *slot;                     /* their places in c */
    const double *x;               /* (points, 3) the mesh's geometry */
    const int *corners;            /* (elements, 2) */
    double *A;                     /* (size,) work space */
    void *together;                /* FFCx's function for LANES elements at once, of a vector; or 0 */
    double *lanes_w, *lanes_c, *lanes_x, *lanes_A; /* for it: (groups, width, LANES), (constants, LANES), (groups, 6,
                                      LANES) ends of elements, (size, LANES) work space */
    int symmetric;                 /* n where the symmetric part of its matrices (n, n) is taken; or 0 */
    struct kernel *next;           /* another part of the same form, which is added; or 0 */
} kernel;

/* Elimination of the unknowns of elements in turn, along the rods. A segment is a run of elements that share unknowns
   with the next; its first and last element may have unknowns of the interface, which are kept. The matrix of an
   element in turn, its front, has the unknowns [delayed | left | own | right | start]: those that earlier elements
   could not eliminate, those shared with the element before, its own, those shared with the next (or, at the end,
   kept), and those of the interface where the segment began. The first three are eliminated. */
typedef struct {
    int elements, width;           /* unknowns of an element, for the kernel */
    int size, room, delays, kept;  /* unknowns of this rank; largest front; most delayed unknowns; of the interface */
    const int *order;              /* (elements,) the kernel's number of the element in turn */
    const int *place;              /* (elements, width) places in the front of the kernel's unknowns; -1: fixed */
    const int *shape;              /* (elements, 4) numbers of left, own, right, start */
    const int *rows;               /* (elements, room) unknowns in the front, delayed ones left out; the interface has
                                      the numbers from size on */
    const int *ends;               /* (elements,) -1; at the end of a segment the first of its `delays` numbers in the
                                      interface for delayed unknowns, or -2 where it has none */
    const int *block;              /* (elements,) at the end of a segment where its matrix is in condensed; else -1 */
    int wide;                      /* room, rounded up to a multiple of 4 */
    double *front;                 /* (2, wide, wide) of the element in turn and of the one before */
    double *factor, *inverse;      /* factors by columns, of the elements one after another; (elements, room) of the
                                      pivots */
    const int *start;              /* (elements + 1,) where those of an element begin, over 4 */
    int *row, *column, *done;      /* (elements, room) order of rows, unknowns of columns; (elements, 2) size of the
                                      front, eliminated */
    double *forward, *condensed;   /* (elements, wide); matrices of the segments on the interface */
    double *diagonal;              /* (interface,) sum of the elements' diagonals there */
    double *carry, *work;          /* (room,), (2 room + LANES,) */
    int negative, zero;            /* pivots, after `count` */
    double logarithm;              /* of the product of their absolute values, after `count` */
    double zero_pivot;             /* of `eliminate`, relative to the largest number in the column; less is zero */
} chain;

/* A small system of the unknowns that elimination leaves, as a dense matrix. */
typedef struct {
    int size, entries, condensed;   /* entries that are added, those of segments first */
    const int *entry;               /* (entries,) places in the matrix; -1: left out */
    double *matrix, *factors, *scale, *work; /* (size, size), with rows of a multiple of LANES numbers, (size,),
                                       (2 size + LANES,) */
    int *row, *column;              /* (size,) */
} dense;

/* Constraint equations of supports and joints, see ties.c and algebra/tie_rows.py. */
typedef struct {
    int count, nodes, pairs, added, turning, block; /* ties; tied nodes; pairs of these; ties that are equations of the
                                       system; ties whose gradient changes; unknowns of a node */
    int width, at_load_factor, at_multiplier, plane; /* of the numbers of a tie; whether the unknowns are (r, theta) in
                                                        a plane, else (r, q, ..) */
    void *value, *changes;          /* FFCx's functions of the numbers: (13,) c and its gradient; (12, 12) */
    const int *ends, *pair;         /* (ties, 2) nodes, (ties, 2, 2) pairs; -1 for the ground */
    const int *first, *second, *mirrored, *own; /* (pairs,) nodes of rows, of columns, exchanged pair; (nodes,) */
    const int *turns, *equation;    /* (turning,), (added,) ties */
    const int *rows, *multiplier;   /* (nodes, block), (added,) unknowns of this rank, or -1 */
    double *numbers;                /* (ties, width) see forms/ties.py */
    const double *axes, *offset, *at_rest; /* of a plane: (3, 3) rows, (nodes, 3) the constant part of the positions;
                                              (nodes, block) */
    double *nodal, *multipliers;    /* (nodes, block), (ties,) of the state */
    double share;                   /* where in a step reactions act, see TieRows */
    double *start, *shift;          /* (nodes, block) at the start of a step; (ties,) values that are required of c */
    double *test, *turned;          /* (nodes, block, 6) rows of forces; (nodes, block, block) their change, or 0 */
    int known, known_change;        /* whether what follows belongs to the state and the load factor */
    double known_at, held;          /* the latter: of springs over the stiffness of the elements */
    double *acting, *found, *amid;  /* (nodes, block); (ties, 13) at the state, and where reactions act */
    double *change, *forces, *derivatives; /* (pairs, 6, 6), (nodes, 6), see `TieRows.tangent_blocks` */
    void *self;                     /* for the hook that finds `test` and `turned`, or 0 */
} ties;

/* Contribution of ties to a part of the second variation. */
typedef struct {
    ties *ties;
    int size;                       /* unknowns of a node */
    const double *axes;             /* (size, 6) */
    const int *places;              /* (nodes, size) on the interface, or -1 */
    double *blocks, *resistance, *stiffness; /* (pairs, size, size), (nodes, size), (ties,) */
} tied_variation;

/* Contact of nodes with the wall of a tube in a time step, whose nodes move linearly with the forces: see contact.c.
   All vectors are inertial. */
typedef struct {
    int nodes, reach, at_end, most; /* nodes that may touch; how many on each side of one its force moves much; whether
                                       forces are those of the end of the step, not of its mean; sweeps */
    int lanes, positions;           /* LANES nodes are solved at once, or 1 where all are close: node i is the one at
                                       position i % positions in lane i / positions */
    const double *clearance, *stiffness, *friction, *damping, *arm; /* (nodes,); arm: radius of the rod's surface */
    double h, known_for;            /* the step, and that for which the compliance was found */
    double share, smallest;         /* changes that end the sweeps, of the first one and of all */
    double *tangent, *across, *start; /* (nodes, 3) of the tube, and an axis u across it, v = tangent x u; (nodes, 2)
                                       from the tube's axis to the rod at the start, by u and v */
    float *compliance;              /* (positions, 4, 6, LANES) by each unit force of a node its own motion. Forces:
                                       along u and v, friction along the tube, and round it its moment alone; motions:
                                       see `motion_of`, and rotations about u and v */
    float *right, *left;            /* (positions, 6, 6, LANES) by each motion of the last node between two elements
                                       before or after it, which forces beyond cause, that of a node */
    float *preceding, *following;   /* (positions, inside, 4, 6, LANES) by each force of a node inside its element and
                                       before or after it, the nearest first */
    int inside;                     /* most nodes inside an element */
    const int *inner, *parted;      /* (nodes,) whether they are; whether the motion of one does not tell that of the
                                       next, on another rod */
    double *responses;              /* (3, nodes, 2 inside + 3, 6, 6) by each unit force or moment of a node the motions
                                       of its own and of those of its elements; see contact.c */
    double *motion, *forces, *late; /* (positions, 6, LANES) motions; (positions, 4, LANES) forces of these kinds, and
                                       of their changes what later sweeps take along */
    double *passing;                /* (2, 6 + 4 inside, LANES) from lane to lane, to the right and to the left */
    double *walled, *axes;          /* (positions, 11, LANES), (positions, 10, LANES) work space, see wall_law.c */
    double *moved;                  /* (nodes, 6) displacement and rotation in the step with the forces */
    double *force, *law;            /* (nodes, 6) force and moment; (nodes, 3) normal force, friction round and along */
    double *multiplier;             /* (nodes,) of friction at its bound, the last ones */
    const int *rows;                /* (nodes, 7) unknowns of this rank, or -1; nodes at one point follow each other */
    const double *fixed;            /* (nodes, 7) values where clamped, else 0 */
    double *before, *now;           /* (nodes, 7) unknowns at the start and with the last motion */
    double *free, *last;            /* (nodes, 6) motion and forces before the last ones were found */
    double *load, *response;        /* (unknowns,) of this rank */
    double *loads, *responded, *substituted; /* (unknowns, AT_ONCE) twice, and work space for `substitute`; or 0 */
    int stale, exact;               /* whether the compliance must be found again; whether all responses are exact */
    double usual, worse, least, rounding; /* error of the motion by the compliance, relative: the smallest one, at least
                                       `least`; this many times it, and the compliance is stale; smallest motions that
                                       are compared */
    double missing, omitted;        /* the last of these errors; by it, norm of what the last response leaves out */
} contact;

/* The axis of a tube: circular arcs and straight lines one after another, see well/path.py. */
typedef struct {
    int sections;
    const double *start, *length, *bend; /* (sections,) depth where each starts; size of the curvature */
    const double *position, *tangent, *curvature; /* (sections, 3) there */
} arcs;

/* Contacts of rods with each other in a time step, see contact.c. Each has a normal force and, with friction, two
   forces across it; their motions are the gap at the end of the step and two slips in it. */
typedef struct {
    int count, parts, most;         /* contacts; 1, or 3 with friction; sweeps */
    double friction, share, smallest; /* coefficient; changes that end the sweeps, of the first one and of all */
    const double *compliance;       /* by each unit force the motions that it changes, force by force: */
    const int *start, *place, *own; /* (count parts + 1,) where each begins; the motions; where its own contact's are */
    const double *gap, *normal, *slope; /* (count,) the normal force at a gap, and its slope by the depth */
    double *motion, *force;         /* (count, parts) with the forces */
    double *multiplier;             /* (count,) of friction at its bound, the last ones */
} pairs;

/* The equations of a problem. */
typedef struct {
    kernel *residual, *tangent, *advance; /* the last one, of the carried contact force, or 0 */
    double *matrices;               /* (elements, width, width) where a hook changes the elements' matrices; or 0 */
    chain *chain;
    const int *dofs, *advance_dofs; /* (elements, size) local degrees of freedom; entries of carried */
    int size, locals, frees, carries, serial, hooks;
    const int *free, *of_free;      /* (frees,) local degrees of freedom that have unknowns, and these */
    double *state, *before, *step;  /* (locals,) */
    double *local, *carried;        /* (locals,) work space; (carries,) */
    const double *load[3], *factor[3]; /* vectors that are subtracted from the residual, and their factors; or 0 */
    double *interface;              /* (interfaces,) */
    const int *of_interface;        /* (interfaces,) this rank's unknowns there, or -1 */
    int interfaces, singular;
    dense *system;                  /* of the interface, or 0 where Python solves it */
    ties *ties;                     /* or 0 */
    const double *tie_load_factor;  /* of prescribed motions */
    int turns;                      /* nodes whose rotation since the tangent was found is taken in, or 0 */
    const double *now;              /* (unknowns,) of the state; with `turns` alone */
    double *turned;                 /* (7 turns,) of them when the tangent was found */
    contact *contact;               /* nodes that may touch a wall, or 0 */
    void *self;                     /* for the hooks */
} problem;

/* Why Newton's method stopped; words in newton.py. */
enum { ITERATING, CONVERGED, SINGULAR, NOT_A_NUMBER, GROWN, RAN_OUT };

/* Newton's method for an equilibrium. */
typedef struct {
    problem *problem;
    int nodes, block, motion;       /* of this rank; unknowns of a node, and those of them that are motion */
    double root;                    /* of the number of motions of all ranks */
    double increment, rounding, loads; /* limits of the increment and of the residual: rounding + 1e-6 (1 + loads) */
    int period, contracts;          /* steps that are compared; whether quadratic convergence is expected */
    int most, iterations, verdict;
    int keeps;                      /* whether the next step, on return the last one, is by the tangent before */
    double norm, steps[4];          /* of the residual; sizes of the last steps, the latest first */
    double *b, *change;             /* (unknowns,) residual, and the step that is subtracted */
} newton;

/* Newton's method of a time step, see `Iteration` in dynamics/stepper.py. */
typedef struct {
    problem *problem;
    int motions, turning;           /* nodal unknowns of this rank; nodes with quaternions */
    double root;                    /* of the number of nodal unknowns on all ranks */
    double increment, smallest, rounding, rate, price, diverged;
    int most;
    double *x, *start, *b, *change; /* (unknowns,) each; x from the guess to the solution, start: before the step */
    int fresh, served, iterations, verdict;
    double spent, enough;
    double noise, of_noise;         /* rounding of the increments, from earlier steps; allowed errors over it */
} stepping;

/* The second variation, in parts that are decoupled. */
typedef struct {
    int parts, hooked;              /* whether Python completes the counts of the parts */
    kernel *form[2];
    chain *chain[2];
    dense *system[2];               /* of the interface, or 0 where Python completes the counts */
    tied_variation *tied[2];        /* or 0 */
    const double *tie_load_factor;
    int sideways[2];                /* whether a part leaves the plane */
    double logarithm;               /* of the absolute value of the determinant, after a count */
    void *self;                     /* for the hook */
} second_variation;

/* How long the steps of a continuation are, and which of them it accepts: see `Limits` in statics/path/track.py. */
typedef struct {
    double far, intended, slight, leap; /* distances from the predictor */
    int easy, hard;                 /* Newton iterations */
    double linear, first;           /* see `is_linear`; largest growth after a first step that is */
    double step, smallest, largest; /* the next step; bounds */
    double usual;                   /* the first step where the next one is a longer one that is tried first, else 0 */
    double shrink;                  /* factor of a step that is rejected */
    int rejections, patience, accepted; /* rejected steps without two accepted ones between, and most of them; whether
                                           the last one was accepted */
} step_control;

/* Verdicts on a step (the last three reject it), and reasons why a sweep returned. */
enum { ACCEPTED, UNSURE, REJECTED, TOO_FAR, OPPOSITE };
enum { DONE, LEFT, LATER, FULL, GOING };

/* A continuation in the load factor, see statics/path/load_control.py. */
typedef struct {
    newton *newton;
    second_variation *stability;
    step_control *control;
    double *x, *load_factor;
    int numbers, moves, known, negative; /* of a point: unknowns, then carried ones; displacements of a node; points */
    double turn, loads;
    double *points, known_load_factors[3]; /* (3, numbers), the last one is the current */
    double change, patience;        /* of the load factor for its derivative; seconds after which to return */
    const double *load_factors;     /* to reach, in this order */
    int count, next, every;         /* whether every step is recorded, or these alone */
    kernel *fields;                 /* of results, or 0 */
    int records, room, iterations, steps;
    double *recorded, *recorded_fields, *recorded_load_factors; /* (room, unknowns), (room, elements, size), (room,) */
    int *recorded_iterations, *recorded_steps;
    double *work;                   /* (6, numbers) */
} sweep;

/* A kernel of LANES problems at once, see lanes.c; numbers of the lanes are next to each other. */
typedef struct lane_kernel {
    void *tabulate;                 /* FFCx's function for one element of each lane */
    int constants;
    double *w, *c;                  /* coefficients (elements, width, LANES), constants (constants, LANES) */
    struct lane_kernel *next;
} lane_kernel;

/* Those of problems without an interface, and work space: of an element; (elements, room, room + 1) fronts;
   (unknowns,); all of them times LANES. */
typedef struct {
    lane_kernel *residual, *tangent, *second[2];
    double *A, *front, *x;
} lock_step;

/* Sweeps that advance in lock step, each for itself where `together` is 0. */
typedef struct {
    int count;
    sweep *sweep[LANES];
    lock_step *together;
} group;

/* Numbers that differ from case to case: to[place[j]] = values[which[j]] of the case. */
typedef struct {
    double *to;
    const int *place, *which;
    int count;
} written;

/* Unknowns of a model: theta, q, (r, theta) or (r, q). */
enum { IN_PLANE, IN_SPACE, PLANAR, SPATIAL };

/* A mesh of rods and its last state. Elements and nodes are in the order of the scene; a rod's first node is p times
   its first element plus the number of the rod. Frames and units are those of the forms. What follows `coupled` is of
   many cases alone. */
typedef struct {
    int rods, elements, nodes, p, points;
    const int *first;               /* (rods + 1,) elements */
    const double *at_gauss, *slopes, *from_slopes, *by_fields, *by_densities, *leading, *weights; /* ElementRule's */
    const double *sizes;            /* (elements,) lengths */
    const double *gyrations, *limits; /* (rods,) radii; rounding of n and of m, least stiffness J, of bending, relative
                                       rounding of the motion; the last three of many cases alone */
    double length;                  /* of the longest rod */
    double *motion, *gauss, *contact; /* (nodes, 7) displacement and q, (elements, points, 9) n, m and r', (elements,
                                         p + 1, 6) n and m */
    const double *density;          /* (elements, points, 6) loads per length, or 0 */
    int kind, components;           /* of a node's unknowns */
    const int *order;               /* (rods, 3) of a tree, from the clamps on: rod, its element end there, node of the
                                       rod before or -1 */
    const double *reference, *axes; /* (nodes, 3) positions; (3, 3) rows */
    const double *R_R, *v_R, *known, *lasting; /* (elements, points, n): reference, n at load factor 1 where statics
                                                  gives it, and at any load factor, or 0 */
    const double *K, *J, *coupled; /* (elements, points, 3), or matrices (elements, points, 3, 3, 3) of strain by n and,
                                       subtracted, by the change of curvature, by which that gives m; or 0 */
    sweep *sweep;
    int forces;                     /* of n */
    const int *from, *field_from;   /* (nodes, components) unknowns, or -1 where held at rest; (elements, points, n) */
    const double *at_rest, *rest;   /* a point of the sweep; (nodes, components) */
    double longest;                 /* element */
    double *nodal, *fields;         /* (nodes, components); (elements, points, n) */
} mesh;

/* kind: position, rotation, force or moment; place: among displacement, q, n and m. */
typedef struct {
    int kind, place, rod, cell;
    const double *weights;          /* (p + 1,) */
    double offset, unit;            /* of the value: offset + unit * number */
} query;

/* Two meshes that are compared, see compared.c; the constants are those of results/accuracy.py. */
typedef struct {
    mesh *coarse, *fine;
    int places, equal, single; /* places of a coarse element; fine elements are of one length; one is a rod */
    int queries, moves, numbers;
    const double *inside, *weights; /* (places, p + 1) of a coarse element; (all places, p + 1) of the fine ones */
    const int *cells;               /* (all places,) fine elements */
    const double *start, *move_weight; /* (numbers,) a point of the fine mesh at rest; numbers of what is added to it */
    const int *move_to, *move_from; /* the coarse state, each (moves,): unknowns of the nodes, then n at Gauss points */
    double held[2];                 /* force and moment that actions without stress would need */
    double ahead, far, of_ends, safety, safety_below, asymptotic;
    double resolved, tol, in_layer, turned;
    query *query;
} comparison;

/* Many cases, see compared.c. */
typedef struct {
    comparison *meshes[LANES];
    written *written[LANES];
    group coarse, fine;
    int lanes, parts, count, next, width; /* cases that are solved at once; of `written`; cases; .. */
    const double *values;           /* (cases, width) */
    double first, near, patience;   /* first step; largest motion of a correction; seconds after which to return */
    double *found, *errors;         /* (cases, queries) */
    int *undecided;                 /* (cases,) */
} cases;

void pack(kernel *k);
void add_vector(kernel *k, const int *dofs, double *values);
void put_values(kernel *k, const int *dofs, double *values);
void tabulate_all(kernel *k, double *values);
int eliminate(chain *s, kernel *k, const double *matrices);
void count(chain *s, kernel *k);
void forward(chain *s, const double *b, double *interface);
void backward(chain *s, const double *interface, double *x);
void substitute(const chain *s, const double *b, double *x, double *work);
void spread(int count, const int *sizes, const int *where, int *rows, int *columns);
int number_entries(int size, int count, const int *rows, const int *columns, int *starts, int *distinct, int *entry,
                   int *order);

void see_ties(ties *t, const double *x);
void find_ties(ties *t, double load_factor);
void react(ties *t, double load_factor, const double *multipliers, double *forces);
int add_ties(ties *t, double load_factor, double *b);
int differentiate_ties(ties *t, double load_factor);
void vary_ties(ties *t, double load_factor, const double *axes, int n, double *out);
void spring_ties(ties *t, double load_factor, const double *axes, int n, const double *resistance, double *stiffness,
                 double *out);
void hold_variation(const tied_variation *v, double load_factor, const double *diagonal);
void assemble_dense(dense *d, const double *condensed, const double *others);
int factor_matrix(dense *d, double zero);
void solve_matrix(const dense *d, double *b);
int is_positive(dense *d, double *logarithm);

int take_state(problem *p, const double *x);
int residual(problem *p, const double *x, double *b);
int tangent(problem *p);
int solve(problem *p, const double *b, double *x);
void advance(problem *p);
int begin_residual(problem *p, const double *x);
int end_residual(problem *p, const double *x, double *b);
void equilibrate(const group *g, int *in);
void begin_newton(newton *n);
int judge_residual(newton *n, const double *b, const double *change);
int iterate(stepping *s);

void begin_contact(contact *c, const int *slots, int count, const double *away, const double *tangent);
void pack_contact(contact *c);
void unit_forces(const contact *c, int first, int apart, int component, double *forces);
void keep_responses(contact *c, int first, int apart, int component, const double *q, const double *changes);
int find_transfers(contact *c, int apart);
void find_motion(int nodes, int width, const double *before, const double *now, double *moved);
void aim(contact *c);
int settle(contact *c);
int broken(const contact *c);
void slips(const contact *c, double *size);
double gained(const contact *c);
double lost(const contact *c, const double *before);

int settle_pairs(pairs *c);

void nearest_on_arcs(const arcs *a, int count, const double *points, int whole, double *md, double *position,
                     double *tangent, double *curvature);

double step_goal(const step_control *c, double here, double load_factor);
double step_growth(const step_control *c, double off, int order, int iterations, int linear);
int is_linear(const step_control *c, const newton *n, int known);
int judge_step(step_control *c, int known, double off, double along, double size, double apart);
void accept_step(step_control *c, double taken, double growth);
int reject_step(step_control *c, double taken);

int negative_modes(second_variation *v, int *sideways);
void take_lanes(const group *g);
void residuals(const group *g, int *in, double *const *x, double *const *b);
void directions(const group *g, int *in, double *const *b, double *const *x);
void count_negative(const group *g, const int *in, int *negative);
void run_all(const group *g, int *why);
int run(sweep *s);
int correct(sweep *s, const double *starts, const int *expected, double near);
int run_cases(cases *c);
void expand_all(const mesh *m, int count, const double *load_factors, const double *nodal, const double *fields,
                double *rq, double *gauss);
void recover_all(const mesh *m, int count, const double *gauss, const double *density, double *contact);
void find_leading(const mesh *m, int count, const double *motion, double *found);
void measure(const mesh *m, int count, const double *motion, const double *gauss, const double *held, double *sizes,
             int *turning, int *still, double *largest);
void compare_all(const comparison *p, int count, const double *coarse_motion, const double *coarse_contact,
                 const double *motion, const double *contact, const int *turning, const int *still, double *found);
void spread_errors(int quantities, int count, int known, const int *which, const double *indicator,
                   const double *sizes, const double *errors, const double *between, int of_mesh, double *work,
                   double *found);

#if 0
extern "Python" int python_hook(void *self, int what, double *a, double *b);
#endif

#endif
