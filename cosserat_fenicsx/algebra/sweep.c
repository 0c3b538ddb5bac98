/* Negative modes, and a sweep over load factors: predictor, Newton's method, and the checks of
   statics/path/load_control.py. A step that is neither accepted nor halved is left to Python. */
#include "chain.h"

#include <math.h>
#include <string.h>
#include <time.h>

enum { COUNT = 128, FAILED_COUNT = -100 };
enum { NEARLY_LINEAR = 4 }; /* most Newton iterations of a first step that is nearly linear */

#define EACH(k, g, in) for (int k = 0; k < (g)->count; k++) if ((in)[k])

/* ---- negative modes --------------------------------------------------------------------------------------------- */

/* Relative to the diagonal before elimination, smaller pivots of a symmetric matrix are zero to rounding. */
static const double ZERO_PIVOT = 2e-15;

/* Signs of the pivots of the first m rows and columns of a symmetric F, the largest on the diagonal first;
   whole: their diagonal before, against which zero is judged, whatever the scale of an unknown. Returns the logarithm
   of the product of their absolute values. */
static double signs(double *F, int n, int wide, int m, double *whole, int *negative, int *zero)
{
    double product = 1;
    int power = 0, exponent;
    for (int i = 0; i < m; i++) whole[i] = fabs(F[(size_t)i * wide + i]);
    for (int k = 0; k < m; k++) {
        int at = k;
        for (int i = k + 1; i < m; i++)
            if (fabs(F[(size_t)i * wide + i]) > fabs(F[(size_t)at * wide + at])) at = i;
        if (at != k) {
            swap_rows(F + (size_t)k * wide, F + (size_t)at * wide, n);
            swap(F + k, F + at, n, wide);
            swap(whole + k, whole + at, 1, 1);
        }
        const double pivot = F[(size_t)k * wide + k];
        if (!(fabs(pivot) > ZERO_PIVOT * whole[k])) {
            ++*zero;
            continue;
        }
        *negative += pivot < 0;
        product = frexp(product * pivot, &exponent), power += exponent;
        subtract_pivot(F, n, wide, k);
    }
    return log(fabs(product)) + power * log(2);
}

/* Reduce a symmetric F, of which the upper half is read, by its first m pivots if these are surely positive: in turn,
   without the exchanges of `signs`. Returns whether they are, with the logarithm of their product; whole: (m,) work
   space. */
static int reduce_definite(double *F, int n, int wide, int m, double *restrict whole, double *logarithm)
{
    double product = 1, by[BESIDE], inverse[BESIDE];
    int power = 0, exponent;
    for (int i = 0; i < m; i++) whole[i] = fabs(F[(size_t)i * wide + i]);
    for (int first = 0, end; first < m; first = end) {
        const double *u = F + (size_t)first * wide;
        end = first + BESIDE < m ? first + BESIDE : m;
        for (int i = first; i < n; i++) {
            double *row = F + (size_t)i * wide;
            const int known = (i < end ? i : end) - first;
            for (int l = 0; l < known; l++) by[l] = u[(size_t)l * wide + i] * inverse[l];
            for (int j = round_down(i); j < n; j += BESIDE) { /* what is left of the diagonal does not matter */
                vector v = load(row + j);
                for (int l = 0; l < known; l++) v -= load(u + (size_t)l * wide + j) * by[l];
                keep(v, row + j);
            }
            if (i >= end) continue;
            if (!(row[i] > POSITIVE_PIVOT * whole[i])) return 0;
            inverse[i - first] = 1 / row[i];
            product = frexp(product * row[i], &exponent), power += exponent;
        }
    }
    for (int i = m; i < n; i++)
        for (int j = m; j < i; j++) F[(size_t)i * wide + j] = F[(size_t)j * wide + i];
    *logarithm = log(product) + power * log(2);
    return 1;
}

/* The negative and zero pivots of a symmetric sum of elements; the interface's matrices are condensed too. */
void count(chain *s, kernel *k)
{
    const double *before = 0;
    int n_before = 0, k_before = 0;
    s->negative = s->zero = 0, s->logarithm = 0;
    memset(s->diagonal, 0, s->kept * sizeof *s->diagonal);
    take_constants(k);
    for (int t = 0; t < s->elements; t++) {
        const int *shape = s->shape + 4 * t, m = shape[0] + shape[1], n = m + shape[2] + shape[3];
        double *F = s->front + (size_t)(t % 2) * s->wide * s->wide; /* of earlier ones nothing is needed */
        double logarithm;
        assemble(s, k, 0, F, t, 0, before, n_before, k_before, s->diagonal);
        if (!reduce_definite(F, n, s->wide, m, s->work, &logarithm)) {
            assemble(s, k, 0, F, t, 0, before, n_before, k_before, 0);
            logarithm = signs(F, n, s->wide, m, s->work, &s->negative, &s->zero);
        }
        s->logarithm += logarithm;
        before = F, n_before = n, k_before = m;
        if (s->ends[t] != -1) condense(s, t, F, n, m, 0), before = 0;
    }
}

static int python_hook(void *self, int what, double *a, double *b);

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

/* Complete the count of a part with the unknowns of the interface; 0 where these have eigenvalues that are not
   positive, which Python finds. */
static int completed(const second_variation *v, int k)
{
    double logarithm;
    if (!v->system[k]) return !v->hooked;
    if (v->tied[k]) hold_variation(v->tied[k], *v->tie_load_factor, v->chain[k]->diagonal);
    assemble_dense(v->system[k], v->chain[k]->condensed, v->tied[k] ? v->tied[k]->blocks : 0);
    if (!is_positive(v->system[k], &logarithm)) return 0;
    v->chain[k]->logarithm += logarithm;
    return 1;
}

/* The number of negative eigenvalues of the second variation at the state; -1 where it is singular to rounding. */
int negative_modes(second_variation *v, int *sideways)
{
    int negative = 0, zero = 0;
    *sideways = 0, v->logarithm = 0;
    for (int k = 0; k < v->parts; k++) {
        chain *s = v->chain[k];
        count(s, v->form[k]);
        if (!completed(v, k) && python_hook(v->self, COUNT + k, 0, 0)) return FAILED_COUNT;
        negative += s->negative, zero += s->zero, v->logarithm += s->logarithm;
        if (v->sideways[k]) *sideways += s->negative;
    }
    return zero ? -1 : negative;
}

/* Largest displacement or rotation in a change of the unknowns. */
static double largest(const sweep *s, const double *a, const double *b)
{
    const newton *n = s->newton;
    double moved = 0, turned = 0;
    for (int i = 0; i < n->nodes; i++) {
        double r = 0, q = 0;
        for (int j = 0; j < n->motion; j++) {
            const double c = a[i * n->block + j] - b[i * n->block + j];
            if (j < s->moves) r += c * c;
            else q += c * c;
        }
        if (!isfinite(r + q)) return NAN; /* fmax would leave it out */
        moved = fmax(moved, r), turned = fmax(turned, q);
    }
    return sqrt(fmax(moved, s->turn * s->turn * turned));
}

/* ---- step control, for Python too ------------------------------------------------------------------------------ */

/* The load factor that the next step from `here` to a load factor ends at. */
double step_goal(const step_control *c, double here, double load_factor)
{
    const double left = load_factor - here, step = fmin(c->step, c->largest);
    if (fabs(left) <= fmin(1.2 * step, c->largest)) return load_factor;
    return fabs(left) < 2 * step ? here + left / 2 : here + copysign(step, left);
}

/* Whether the first step of a path is nearly linear: what follows Newton's first step is a small share of it. */
int is_linear(const step_control *c, const newton *n, int known)
{
    double later = 0;
    if (known > 1 || n->iterations > NEARLY_LINEAR) return 0;
    for (int i = 0; i < n->iterations - 1; i++) later += n->steps[i];
    return n->iterations == 0 || later <= c->linear * n->steps[n->iterations - 1];
}

/* Factor from an accepted step's length to the next one's; off: distance from the predictor, whose error is of an order
   in the length; linear: see `is_linear`, which does not count where longer first steps were rejected, as of slender
   wires. */
double step_growth(const step_control *c, double off, int order, int iterations, int linear)
{
    const double most = linear && c->rejections == 0 ? c->first : 2;
    const double growth = fmin(fmax(pow(c->intended / fmax(off, 1e-12), 1.0 / order), 0.5), most);
    if (iterations >= c->hard) return 0.5;
    return iterations > c->easy ? fmin(growth, 1) : growth;
}

/* What to do with a step whose end is `off` the predictor, from the number of known points and, of the increments to
   the end and to the predictor, their inner product, the latter's square, and the square of their difference. */
int judge_step(step_control *c, int known, double off, double along, double size, double apart)
{
    c->shrink = 0.5;
    if (off <= c->slight) return ACCEPTED;
    if (off > c->far) {
        c->shrink = fmin(fmax(pow(c->intended / off, 1.0 / known), 0.1), 0.5);
        return TOO_FAR;
    }
    /* The mirrored branch of a nearly perfect pitchfork is stable about a section's stiff axis, so that neither the
       distance nor the number of negative modes reveals it. */
    if (known > 1 && along <= 0 && size > 0) return OPPOSITE;
    return known > 1 && apart <= c->leap * c->leap * size ? ACCEPTED : UNSURE;
}

void accept_step(step_control *c, double taken, double growth)
{
    c->step = growth >= 1 ? fmax(c->step, taken * growth) : taken * growth;
    if (c->accepted) c->rejections = 0;
    c->accepted = 1, c->usual = 0;
}

/* Whether to give up. */
int reject_step(step_control *c, double taken)
{
    if (c->usual) {
        c->step = c->usual, c->usual = 0;
        return 0;
    }
    c->rejections++, c->accepted = 0;
    c->step = taken * c->shrink;
    return c->step < c->smallest || c->rejections >= c->patience;
}

/* ---- the sweep --------------------------------------------------------------------------------------------------- */

/* What to do with a step, see `judge_step`. */
static int judge(const sweep *s, const double *here, const double *guess, const double *found, double off)
{
    const newton *n = s->newton;
    double along = 0, size = 0, apart = 0;
    for (int i = 0; i < n->nodes; i++)
        for (int j = i * n->block; j < i * n->block + n->motion; j++) {
            const double move = found[j] - here[j], increment = guess[j] - here[j];
            along += move * increment, size += increment * increment;
            apart += (move - increment) * (move - increment);
        }
    return judge_step(s->control, s->known, off, along, size, apart);
}

/* The polynomial through the known points at a load factor; 0 where two of them have the same. */
static int predict(const sweep *s, double load_factor, double *guess)
{
    memset(guess, 0, s->numbers * sizeof *guess);
    for (int a = 0; a < s->known; a++) {
        double weight = 1;
        for (int b = 0; b < s->known; b++) {
            if (b == a) continue;
            if (s->known_load_factors[a] == s->known_load_factors[b]) return 0;
            weight *= (load_factor - s->known_load_factors[b]) / (s->known_load_factors[a] - s->known_load_factors[b]);
        }
        const double *point = s->points + (size_t)a * s->numbers;
        for (int i = 0; i < s->numbers; i++) guess[i] += weight * point[i];
    }
    return 1;
}

/* Set the state and the load factor. */
static int put(const sweep *s, const double *numbers, double load_factor)
{
    const problem *p = s->newton->problem;
    *s->load_factor = load_factor;
    memcpy(s->x, numbers, p->size * sizeof *numbers);
    memcpy(p->carried, numbers + p->size, p->carries * sizeof *numbers);
    return take_state(s->newton->problem, numbers);
}

static void take(const sweep *s, double *numbers)
{
    const problem *p = s->newton->problem;
    memcpy(numbers, s->x, p->size * sizeof *numbers);
    memcpy(numbers + p->size, p->carried, p->carries * sizeof *numbers);
}

/* The derivatives of x by the load factor at the states, whose unknowns are x; see `Problem.load_derivative`. Who fails
   leaves. */
static void slopes(const group *g, int *in, double *const *x, double *const *out)
{
    double *ahead[LANES], *behind[LANES], load_factor[LANES], change[LANES];
    for (int k = 0; k < g->count; k++) {
        const sweep *s = g->sweep[k];
        ahead[k] = s->work + 4 * s->numbers, behind[k] = ahead[k] + s->numbers;
        load_factor[k] = *s->load_factor, change[k] = s->change * fmax(1, fabs(load_factor[k]));
        if (in[k]) *s->load_factor = load_factor[k] + change[k];
    }
    residuals(g, in, x, ahead);
    EACH(k, g, in) *g->sweep[k]->load_factor = load_factor[k] - change[k];
    residuals(g, in, x, behind);
    for (int k = 0; k < g->count; k++) {
        const sweep *s = g->sweep[k];
        *s->load_factor = load_factor[k];
        for (int i = 0; in[k] && i < s->newton->problem->size; i++)
            ahead[k][i] = (behind[k][i] - ahead[k][i]) * 0.5 / change[k];
    }
    residuals(g, in, x, behind);
    EACH(k, g, in) g->sweep[k]->newton->keeps = 0; /* as an iteration that failed may have left it */
    directions(g, in, ahead, out);
    EACH(k, g, in) in[k] = !g->sweep[k]->newton->problem->singular;
}

/* Whether steps are longer than twice the mean slope of their ends allows, see `Continuation._jumped`; judged: those
   that are UNSURE, on return what they are. */
static void jumped(const group *g, int *judged, double *const *here, double *const *found, const double *goal)
{
    double *at_end[LANES], *at_start[LANES];
    int in[LANES], asked[LANES];
    for (int k = 0; k < g->count; k++) {
        const sweep *s = g->sweep[k];
        at_end[k] = s->work + 2 * s->numbers, at_start[k] = at_end[k] + s->numbers;
        in[k] = asked[k] = judged[k] == UNSURE;
    }
    slopes(g, in, found, at_end);
    EACH(k, g, in) in[k] = !put(g->sweep[k], here[k], g->sweep[k]->known_load_factors[g->sweep[k]->known - 1]);
    slopes(g, in, here, at_start);
    for (int k = 0; k < g->count; k++) {
        const sweep *s = g->sweep[k];
        const newton *n = s->newton;
        double both = 0, moves = 0;
        if (!asked[k] || !in[k] || put(s, found[k], goal[k])) continue;
        for (int i = 0; i < n->nodes; i++)
            for (int j = i * n->block; j < i * n->block + n->motion; j++) {
                const double sum = at_end[k][j] + at_start[k][j], move = found[k][j] - here[k][j];
                both += sum * sum, moves += move * move;
            }
        const double change = goal[k] - s->known_load_factors[s->known - 1];
        judged[k] = both * change * change >= moves ? ACCEPTED : REJECTED; /* also what is not a number */
    }
}

/* Record a point whose state is the present one. */
static int record(sweep *s, const double *here, double load_factor)
{
    const int k = s->records++;
    s->recorded_load_factors[k] = load_factor;
    s->recorded_iterations[k] = s->iterations, s->recorded_steps[k] = s->steps;
    s->iterations = 0;
    memcpy(s->recorded + (size_t)k * s->newton->problem->size, here, s->newton->problem->size * sizeof *here);
    if (s->fields) tabulate_all(s->fields, s->recorded_fields + (size_t)k * s->fields->elements * s->fields->size);
    return s->records == s->room;
}

static int record_here(sweep *s)
{
    return record(s, s->points + (size_t)(s->known - 1) * s->numbers, s->known_load_factors[s->known - 1]);
}

/* Newton's method at load factors from starts; where it is ACCEPTED, it has converged, to `found`. judged: GOING where
   a sweep takes part. */
static void reach(const group *g, int *judged, double *const *start, const double *load_factor, double *const *found)
{
    int in[LANES];
    for (int k = 0; k < g->count; k++) {
        const sweep *s = g->sweep[k];
        in[k] = judged[k] == GOING;
        if (!in[k]) continue;
        s->newton->loads = fabs(load_factor[k]) * s->loads;
        judged[k] = UNSURE, in[k] = !put(s, start[k], load_factor[k]);
    }
    equilibrate(g, in);
    EACH(k, g, in) {
        sweep *s = g->sweep[k];
        s->iterations += s->newton->iterations;
        judged[k] = s->newton->verdict == CONVERGED ? ACCEPTED : REJECTED;
        if (judged[k] == ACCEPTED) take(s, found[k]);
    }
}

/* The same; those leave that do not end within `near` of the start, with as many negative modes as expected. */
static void stay_near(const group *g, int *in, double *const *start, const double *load_factor, int expected,
                      double near)
{
    double *found[LANES];
    int judged[LANES], negative[LANES];
    for (int k = 0; k < g->count; k++) judged[k] = in[k] ? GOING : REJECTED, found[k] = g->sweep[k]->work;
    reach(g, judged, start, load_factor, found);
    EACH(k, g, in) in[k] = judged[k] == ACCEPTED && largest(g->sweep[k], found[k], start[k]) <= near;
    count_negative(g, in, negative);
    EACH(k, g, in) in[k] = negative[k] == expected;
}

/* The end of a step of one sweep becomes its last point. */
static void take_step(sweep *s, const double *found, double goal, double off)
{
    double *factors = s->known_load_factors;
    const double taken = fabs(goal - factors[s->known - 1]);
    const int order = s->known < 2 ? 1 : 2, linear = is_linear(s->control, s->newton, s->known);
    if (s->known == 3) {
        memmove(s->points, s->points + s->numbers, 2 * (size_t)s->numbers * sizeof *found);
        memmove(factors, factors + 1, 2 * sizeof *factors);
    } else {
        s->known++;
    }
    memcpy(s->points + (size_t)(s->known - 1) * s->numbers, found, s->numbers * sizeof *found);
    factors[s->known - 1] = goal;
    s->steps++;
    accept_step(s->control, taken, step_growth(s->control, off, order, s->newton->iterations, linear));
}

/* A step of each sweep that is GOING to its load factor. */
static void attempt(const group *g, int *judged, const double *goal)
{
    double *guess[LANES], *found[LANES], *here[LANES], off[LANES];
    int in[LANES], unsure[LANES], negative[LANES], most[LANES];
    for (int k = 0; k < g->count; k++) {
        sweep *s = g->sweep[k];
        guess[k] = s->work, found[k] = s->work + s->numbers, here[k] = s->points + (size_t)(s->known - 1) * s->numbers;
        if (judged[k] != GOING) continue;
        s->control->shrink = 0.5;
        if (!predict(s, goal[k], guess[k])) judged[k] = UNSURE;
    }
    for (int k = 0; k < g->count; k++) {
        in[k] = judged[k] == GOING, most[k] = g->sweep[k]->newton->most;
        if (g->sweep[k]->control->usual) g->sweep[k]->newton->most = NEARLY_LINEAR;
    }
    reach(g, judged, guess, goal, found);
    for (int k = 0; k < g->count; k++) {
        const sweep *s = g->sweep[k];
        s->newton->most = most[k];
        in[k] = in[k] && judged[k] == ACCEPTED;
        if (!in[k]) continue;
        off[k] = largest(s, found[k], guess[k]);
        judged[k] = isfinite(off[k]) ? judge(s, here[k], guess[k], found[k], off[k]) : REJECTED;
        if (judged[k] == UNSURE && is_linear(s->control, s->newton, s->known)) judged[k] = ACCEPTED;
    }
    for (int k = 0; k < g->count; k++) unsure[k] = in[k] ? judged[k] : REJECTED; /* not where others fail */
    jumped(g, unsure, here, found, goal);
    for (int k = 0; k < g->count; k++) {
        if (in[k]) judged[k] = unsure[k];
        in[k] = in[k] && judged[k] == ACCEPTED;
    }
    count_negative(g, in, negative);
    EACH(k, g, in) {
        if (negative[k] == g->sweep[k]->negative) take_step(g->sweep[k], found[k], goal[k], off[k]);
        else judged[k] = UNSURE;
    }
}

/* Record the load factors that a sweep has reached. Returns whether it continues, to `goal`; else `why` not. */
static int find_goal(sweep *s, double *goal, int *why)
{
    while (s->next < s->count) {
        const double here = s->known_load_factors[s->known - 1], wanted = s->load_factors[s->next];
        if (here != wanted) {
            *goal = step_goal(s->control, here, wanted);
            return 1;
        }
        s->next++, s->control->rejections = s->control->accepted = 0;
        if (!s->every && record_here(s)) {
            *why = FULL;
            return 0;
        }
    }
    *why = DONE;
    return 0;
}

/* What follows a step that was accepted or not: GOING, or why the sweep stops; before: its iterations so far. */
static int conclude(sweep *s, int judged, double goal, int before, double began)
{
    const double here = s->known_load_factors[s->known - 1];
    if (judged == ACCEPTED) {
        if (s->every && record_here(s)) return FULL;
        return now() - began > s->patience ? LATER : GOING;
    }
    put(s, s->points + (size_t)(s->known - 1) * s->numbers, here);
    if (judged == UNSURE) {
        s->iterations = before; /* Python counts them when it repeats the step */
        return LEFT;
    }
    return reject_step(s->control, fabs(goal - here)) ? LEFT : GOING;
}

/* Advance to the load factors in turn those that are GOING; on return why they stopped. */
void run_all(const group *g, int *why)
{
    const double began = now();
    double goal[LANES];
    int judged[LANES], before[LANES], asked[LANES], any = 1;
    while (any) {
        any = 0;
        for (int k = 0; k < g->count; k++) {
            asked[k] = why[k] == GOING && find_goal(g->sweep[k], goal + k, why + k);
            judged[k] = asked[k] ? GOING : LEFT, before[k] = g->sweep[k]->iterations, any |= asked[k];
        }
        if (any) attempt(g, judged, goal);
        for (int k = 0; k < g->count; k++)
            if (asked[k]) why[k] = conclude(g->sweep[k], judged[k], goal[k], before[k], began);
    }
}

/* Advance one sweep. Returns why it stopped. */
int run(sweep *s)
{
    const group g = {1, {s}, 0};
    int why = GOING;
    run_all(&g, &why);
    return why;
}

/* Newton's method at the load factors in turn, each from its start (count, numbers). DONE; LATER or FULL where some are
   left; LEFT where one is not found, farther than `near` from its start, or with another number of negative modes than
   expected (count,). */
int correct(sweep *s, const double *starts, const int *expected, double near)
{
    const double began = now();
    const group g = {1, {s}, 0};
    while (s->next < s->count) {
        const int k = s->next;
        double *start = (double *)starts + (size_t)k * s->numbers;
        int in = 1;
        stay_near(&g, &in, &start, s->load_factors + k, expected[k], near);
        if (!in) return LEFT;
        s->next++, s->steps++;
        if (record(s, s->work, s->load_factors[k])) return FULL;
        if (now() - began > s->patience) return LATER;
    }
    return DONE;
}
