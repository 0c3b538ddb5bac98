/* Many cases of one scene: the numbers of each are written in turn on two meshes; it is swept from rest on the first,
   corrected on the second, and judged by both. A case that is not decided here is left to Python. */
#include "chain.h"

#include <math.h>
#include <string.h>

/* The whole sweep to its load factor, from rest; 0 where all steps were decided and the rest state is stable. */
static int sweep_case(const cases *c, const mesh *m)
{
    sweep *s = m->sweep;
    int sideways;
    s->known = 1, s->known_load_factors[0] = 0;
    memcpy(s->points, m->at_rest, s->numbers * sizeof *s->points);
    s->control->step = c->first, s->control->rejections = s->control->accepted = 0;
    s->next = s->records = s->iterations = s->steps = 0;
    if (put(s, s->points, 0)) return 1;
    s->negative = negative_modes(s->stability, &sideways);
    return s->negative || run(s) != DONE;
}

/* Newton's method at the load factor from a start; 0 where it finds a stable state near it. */
static int correct_case(const cases *c, const mesh *m)
{
    sweep *s = m->sweep;
    double *start = s->points;
    transfer(c->meshes, start);
    s->iterations = 0;
    if (strays(s, start, *s->load_factors, 0, c->near)) return 1;
    memcpy(s->recorded, s->work, s->newton->problem->size * sizeof *start);
    if (s->fields) tabulate_all(s->fields, s->recorded_fields);
    return 0;
}

static int decide(const cases *c, double *values, double *errors)
{
    const comparison *p = c->meshes;
    const mesh *coarse = p->coarse, *fine = p->fine;
    if (sweep_case(c, coarse)) return 1;
    expand(coarse, coarse->sweep->recorded, coarse->sweep->recorded_fields, *coarse->sweep->load_factors);
    if (correct_case(c, fine)) return 1;
    expand(fine, fine->sweep->recorded, fine->sweep->recorded_fields, *fine->sweep->load_factors);
    return answer(p, values, errors);
}

/* The next cases; LATER where some are left after `patience`, so that Python can obey Ctrl-C. */
int run_cases(cases *c)
{
    const double began = now();
    const int queries = c->meshes->queries;
    while (c->next < c->count) {
        const int k = c->next++;
        const double *values = c->values + (size_t)k * c->width;
        for (const written *w = c->written; w < c->written + c->parts; w++)
            for (int j = 0; j < w->count; j++) w->to[w->place[j]] = values[w->which[j]];
        c->undecided[k] = decide(c, c->found + (size_t)k * queries, c->errors + (size_t)k * queries);
        if (now() - began > c->patience) return c->next < c->count ? LATER : DONE;
    }
    return DONE;
}
