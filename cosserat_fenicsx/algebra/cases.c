/* Many cases of one problem: the numbers of each are written in turn, then it is swept from rest, or corrected from a
   start. A case that is not decided here is left to Python. */
#include "chain.h"

#include <math.h>
#include <string.h>

/* The whole sweep to its load factors, from rest; 0 where all steps were decided and the rest state is stable. */
static int sweep_case(cases *c, int k)
{
    sweep *s = c->sweep;
    int sideways;
    s->known = 1, s->known_load_factors[0] = 0;
    memcpy(s->points, c->starts, s->numbers * sizeof *s->points);
    s->control->step = c->first, s->control->rejections = s->control->accepted = 0;
    s->next = s->records = s->iterations = s->steps = 0;
    s->recorded = c->found + (size_t)k * s->newton->problem->size;
    if (s->fields) s->recorded_fields = c->found_fields + (size_t)k * s->fields->elements * s->fields->size;
    if (put(s, s->points, 0)) return 1;
    s->negative = negative_modes(s->stability, &sideways);
    return s->negative || run(s) != DONE;
}

/* Newton's method at the load factor from the start of the case; 0 where it finds a stable state near it. */
static int correct_case(cases *c, int k)
{
    sweep *s = c->sweep;
    newton *n = s->newton;
    const double *start = c->starts + (size_t)k * s->numbers;
    double *found = s->work;
    int sideways;
    if (put(s, start, *s->load_factors)) return 1;
    n->loads = fabs(*s->load_factors) * s->loads;
    if (equilibrate(n, s->x) || n->verdict != CONVERGED) return 1;
    take(s, found);
    if (!(largest(s, found, start) <= c->near) || negative_modes(s->stability, &sideways)) return 1;
    memcpy(c->found + (size_t)k * n->problem->size, found, n->problem->size * sizeof *found);
    if (s->fields) tabulate_all(s->fields, c->found_fields + (size_t)k * s->fields->elements * s->fields->size);
    return 0;
}

/* The next cases; LATER where some are left after `patience`, so that Python can obey Ctrl-C. */
int run_cases(cases *c)
{
    const double began = now();
    while (c->next < c->count) {
        const int k = c->next++;
        for (int i = 0; i < c->parts; i++) {
            const written *w = c->written + i;
            const double *values = w->values + (size_t)k * w->width;
            for (int j = 0; j < w->count; j++) w->to[w->place[j]] = values[w->which[j]];
        }
        c->undecided[k] = c->corrects ? correct_case(c, k) : sweep_case(c, k);
        if (now() - began > c->patience) return c->next < c->count ? LATER : DONE;
    }
    return DONE;
}
