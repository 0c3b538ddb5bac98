/* A sweep over load factors: predictor, Newton's method, and the checks of statics/path/load_control.py. A step that is
   neither accepted nor halved is left to Python. */
#include "chain.h"

#include <math.h>
#include <string.h>
#include <time.h>

enum { COUNT = 128, FAILED_COUNT = -100 };

static int python_hook(void *self, int what, double *a, double *b);

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

/* Complete the count of a part with the unknowns of the interface; 0 where these have eigenvalues that are not positive,
   which Python finds. */
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

/* ---- step control, for Python too ---------------------------------------------------------------------------------- */

/* The load factor that the next step from `here` to a load factor ends at. */
double step_goal(const step_control *c, double here, double load_factor)
{
    const double left = load_factor - here, step = fmin(c->step, c->largest);
    if (fabs(left) <= fmin(1.2 * step, c->largest)) return load_factor;
    return fabs(left) < 2 * step ? here + left / 2 : here + copysign(step, left);
}

/* Factor from an accepted step's length to the next one's; off: distance from the predictor, whose error is of an order
   in the length. */
double step_growth(const step_control *c, double off, int order, int iterations)
{
    const double growth = fmin(fmax(pow(c->intended / fmax(off, 1e-12), 1.0 / order), 0.5), 2);
    if (iterations >= c->hard) return 0.5;
    return iterations > c->easy ? fmin(growth, 1) : growth;
}

/* What to do with a step whose end is `off` the predictor, from the number of known points and, of the increments to the
   end and to the predictor, their inner product, the latter's square, and the square of their difference. */
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
    c->accepted = 1;
}

/* Whether to give up. */
int reject_step(step_control *c, double taken)
{
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

/* The derivative of x by the load factor at the state, whose unknowns are x; see `Problem.load_derivative`. */
static int slope(const sweep *s, const double *x, double *out)
{
    problem *p = s->newton->problem;
    double *ahead = s->work + 4 * s->numbers, *behind = ahead + s->numbers;
    const double load_factor = *s->load_factor, change = s->change * fmax(1, fabs(load_factor));
    *s->load_factor = load_factor + change;
    int failed = residual(p, x, ahead);
    *s->load_factor = load_factor - change;
    failed |= residual(p, x, behind);
    *s->load_factor = load_factor;
    for (int i = 0; i < p->size; i++) ahead[i] = (behind[i] - ahead[i]) * 0.5 / change;
    return failed || residual(p, x, behind) || tangent(p) || solve(p, ahead, out) || p->singular;
}

/* Whether a step is longer than twice the mean slope of its two ends allows, see `Continuation._jumped`. */
static int jumped(const sweep *s, const double *here, const double *found, double goal)
{
    const newton *n = s->newton;
    double *at_end = s->work + 2 * s->numbers, *at_start = at_end + s->numbers, slopes = 0, moves = 0;
    const double load_factor = s->known_load_factors[s->known - 1];
    if (slope(s, found, at_end) || put(s, here, load_factor) || slope(s, here, at_start) || put(s, found, goal))
        return UNSURE;
    for (int i = 0; i < n->nodes; i++)
        for (int j = i * n->block; j < i * n->block + n->motion; j++) {
            const double both = at_end[j] + at_start[j], move = found[j] - here[j];
            slopes += both * both, moves += move * move;
        }
    const double change = goal - load_factor;
    return slopes * change * change >= moves ? ACCEPTED : REJECTED; /* also what is not a number */
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

/* Newton's method at a load factor from a start; where it is ACCEPTED, it has converged, to `found`. */
static int reach(sweep *s, const double *start, double load_factor, double *found)
{
    newton *n = s->newton;
    n->loads = fabs(load_factor) * s->loads;
    if (put(s, start, load_factor) || equilibrate(n, s->x)) return UNSURE;
    s->iterations += n->iterations;
    if (n->verdict != CONVERGED) return REJECTED;
    take(s, found);
    return ACCEPTED;
}

/* The same; whether it does not end within `near` of the start, with as many negative modes as expected. */
static int strays(sweep *s, const double *start, double load_factor, int expected, double near)
{
    int sideways;
    return reach(s, start, load_factor, s->work) != ACCEPTED || !(largest(s, s->work, start) <= near)
           || negative_modes(s->stability, &sideways) != expected;
}

/* A step to a load factor. */
static int attempt(sweep *s, double goal)
{
    double *guess = s->work, *found = s->work + s->numbers, *factors = s->known_load_factors;
    const double *here = s->points + (size_t)(s->known - 1) * s->numbers;
    const double taken = fabs(goal - factors[s->known - 1]);
    int sideways;
    s->control->shrink = 0.5;
    if (!predict(s, goal, guess)) return UNSURE;
    int judged = reach(s, guess, goal, found);
    if (judged != ACCEPTED) return judged;
    const double off = largest(s, found, guess);
    if (!isfinite(off)) return REJECTED;
    judged = judge(s, here, guess, found, off);
    if (judged == UNSURE) judged = jumped(s, here, found, goal);
    if (judged != ACCEPTED) return judged;
    if (negative_modes(s->stability, &sideways) != s->negative) return UNSURE;
    const int order = s->known < 2 ? 1 : 2;
    if (s->known == 3) {
        memmove(s->points, s->points + s->numbers, 2 * (size_t)s->numbers * sizeof *found);
        memmove(factors, factors + 1, 2 * sizeof *factors);
    } else {
        s->known++;
    }
    memcpy(s->points + (size_t)(s->known - 1) * s->numbers, found, s->numbers * sizeof *found);
    factors[s->known - 1] = goal;
    s->steps++;
    accept_step(s->control, taken, step_growth(s->control, off, order, s->newton->iterations));
    return ACCEPTED;
}

/* Advance to the load factors in turn. Returns why it stopped. */
int run(sweep *s)
{
    const double began = now();
    while (s->next < s->count) {
        const double here = s->known_load_factors[s->known - 1], wanted = s->load_factors[s->next];
        if (here == wanted) {
            s->next++, s->control->rejections = s->control->accepted = 0;
            if (!s->every && record_here(s)) return FULL;
            continue;
        }
        const double goal = step_goal(s->control, here, wanted);
        const int before = s->iterations, judged = attempt(s, goal);
        if (judged != ACCEPTED) {
            put(s, s->points + (size_t)(s->known - 1) * s->numbers, here);
            if (judged == UNSURE) {
                s->iterations = before; /* Python counts them when it repeats the step */
                return LEFT;
            }
            if (reject_step(s->control, fabs(goal - here))) return LEFT;
            continue;
        }
        if (s->every && record_here(s)) return FULL;
        if (now() - began > s->patience) return LATER;
    }
    return DONE;
}

/* Newton's method at the load factors in turn, each from its start (count, numbers). DONE; LATER or FULL where some are
   left; LEFT where one is not found, farther than `near` from its start, or with another number of negative modes than
   expected (count,). */
int correct(sweep *s, const double *starts, const int *expected, double near)
{
    const double began = now();
    while (s->next < s->count) {
        const int k = s->next;
        if (strays(s, starts + (size_t)k * s->numbers, s->load_factors[k], expected[k], near)) return LEFT;
        s->next++, s->steps++;
        if (record(s, s->work, s->load_factors[k])) return FULL;
        if (now() - began > s->patience) return LATER;
    }
    return DONE;
}
