/* Up to LANES problems of one kind on equal meshes, in lock step: elements and elimination of all of them at once, one
   in each lane of a vector of the processor. A lane that needs what only chain.c does (other pivots than the first
   lane, or delayed ones) goes there alone. The digits differ at most by the order of pivots. */
#include "chain.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#if KERNEL_ARGUMENTS == 6
typedef void lane_tabulator(vector *, const vector *, const vector *, const vector *, const int *, const uint8_t *);
#else
typedef void lane_tabulator(vector *, const vector *, const vector *, const vector *, const int *, const uint8_t *,
                            void *);
#endif

/* Share of the largest number in a column that a pivot must have which is the largest in the first lane; share of the
   diagonal before elimination that the pivots of a positive matrix must have. */
static const double ACCEPTABLE_PIVOT = 0.1, POSITIVE_PIVOT = 1e-10;

static vector magnitude(vector a)
{
    for (int k = 0; k < LANES; k++) a[k] = fabs(a[k]);
    return a;
}

static vector larger(vector a, vector b)
{
    for (int k = 0; k < LANES; k++) a[k] = a[k] > b[k] ? a[k] : b[k];
    return a;
}

/* The first lane that takes part; whether others do. */
static int first_of(const group *g, const int *in, int *several)
{
    int first = -1;
    *several = 0;
    for (int k = 0; k < g->count; k++)
        if (in[k] && first < 0) first = k;
        else if (in[k]) *several = 1;
    return first;
}

static problem *problem_of(const group *g, int k)
{
    return g->sweep[k]->newton->problem;
}

/* ---- elements ---------------------------------------------------------------------------------------------------- */

/* Take all coefficients and constants of a lane. */
static void take_lane(const lane_kernel *to, const kernel *from, int lane)
{
    for (; to; to = to->next, from = from->next) {
        const size_t count = (size_t)from->elements * from->width;
        for (size_t i = 0; i < count; i++) to->w[LANES * i + lane] = from->w[i];
        for (int i = 0; i < to->constants; i++) to->c[LANES * i + lane] = from->c[i];
    }
}

/* Take the numbers of the cases that the problems are to solve. */
void take_lanes(const group *g)
{
    for (int k = 0; g->together && k < g->count; k++) {
        const second_variation *v = g->sweep[k]->stability;
        take_lane(g->together->residual, problem_of(g, k)->residual, k);
        take_lane(g->together->tangent, problem_of(g, k)->tangent, k);
        for (int i = 0; i < v->parts; i++) take_lane(g->together->second[i], v->form[i], k);
    }
}

/* Take the constants that change, of a kernel of the lanes in turn. */
static void take_lane_constants(const lane_kernel *to, kernel *const *of, const int *in, int count)
{
    for (int k = 0; k < count; k++) {
        const kernel *from = of[k];
        for (const lane_kernel *v = to; in[k] && v; v = v->next, from = from->next)
            for (int i = 0; i < from->constants; i++) v->c[LANES * from->slot[i] + k] = *from->constant[i];
    }
}

/* The numbers A of an element in all lanes. */
static void tabulate_lanes(const lane_kernel *v, kernel *const *of, const int *in, int count, int first, int e,
                           vector *A)
{
    const kernel *parts[LANES], *k = of[first];
    const int n = k->symmetric;
    vector x[6], zero = {0};
    for (int i = 0; i < 6; i++) x[i] = zero + k->x[3 * (size_t)k->corners[2 * e + i / 3] + i % 3];
    memset(A, 0, k->size * sizeof *A);
    for (int i = 0; i < count; i++) parts[i] = of[i];
    for (; v; v = v->next) {
        double *w = v->w + (size_t)LANES * e * parts[first]->width;
        for (int i = 0; i < count; i++) {
            if (!in[i]) continue;
            for (const source *s = parts[i]->source; s < parts[i]->source + parts[i]->sources; s++) {
                const int *which = s->which + (size_t)e * s->count;
                for (int j = 0; j < s->count; j++) w[LANES * (s->column + j) + i] = s->values[which[j]];
            }
            parts[i] = parts[i]->next;
        }
        ((lane_tabulator *)v->tabulate)(A, (const vector *)w, (const vector *)v->c, x, 0, 0 LAST);
    }
    TAKE_SYMMETRIC_PART(A, n);
}

/* ---- fronts ------------------------------------------------------------------------------------------------------ */

/* The front F of the element in turn with the matrix A of its element and what is carried from the one before: n rows
   of `wide` numbers each. */
static void assemble_lanes(const chain *s, int t, const vector *A, vector *restrict F, int n, int wide,
                           const vector *before, int n_before, int k_before)
{
    const int *shape = s->shape + 4 * t, *place = s->place + (size_t)t * s->width, w = s->width, ahead = shape[0];
    memset(F, 0, (size_t)n * wide * sizeof *F);
    for (int i = 0; i < w; i++) {
        if (place[i] < 0) continue;
        vector *row = F + (size_t)place[i] * wide;
        for (int j = 0; j < w; j++)
            if (place[j] >= 0) row[place[j]] += A[i * w + j];
    }
    for (int i = k_before; before && i < n_before; i++) {
        vector *row = F + (size_t)carried_to(i - k_before, ahead, shape) * wide;
        const vector *from = before + (size_t)i * (n_before + wide - n);
        for (int j = k_before; j < n_before; j++) row[carried_to(j - k_before, ahead, shape)] += from[j];
        if (wide > n) row[n] += from[n_before];
    }
}

/* Eliminate the first m unknowns of F (n, n + 1), the last column of which is the right side; inverse pivots take the
   place of these. `bad` marks lanes whose pivots are not acceptable. */
static void reduce_lanes(vector *restrict F, int n, int m, const chain *s, int share, int first, int *bad)
{
    vector whole[m], zero = {0};
    const int wide = n + 1;
    for (int j = 0; j < m; j++) whole[j] = zero;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < m; j++) whole[j] = larger(whole[j], magnitude(F[i * wide + j]));
    for (int k = 0; k < m; k++) {
        vector best = zero, below = zero;
        int at = k;
        for (int i = k; i < m; i++) {
            const vector size = magnitude(F[i * wide + k]);
            if (size[first] > best[first]) at = i;
            best = larger(best, size);
        }
        for (int i = m; share && i < n; i++) below = larger(below, magnitude(F[i * wide + k]));
        const vector pivot = F[at * wide + k], size = magnitude(pivot), inverse = 1.0 / pivot;
        for (int i = 0; i < LANES; i++)
            bad[i] |= !(size[i] > s->zero_pivot * whole[k][i] && size[i] >= ACCEPTABLE_PIVOT * best[i]
                        && size[i] >= SMALLEST_PIVOT * below[i]);
        for (int j = k; at != k && j < wide; j++) {
            const vector kept = F[k * wide + j];
            F[k * wide + j] = F[at * wide + j], F[at * wide + j] = kept;
        }
        const vector *restrict row = F + k * wide;
        int i = k + 1;
        for (; i + 1 < n; i += 2) { /* two rows read the pivot's once */
            vector *restrict other = F + i * wide, *restrict next = other + wide;
            const vector l = other[k] * inverse, l_next = next[k] * inverse;
            for (int j = k + 1; j < wide; j++) other[j] -= l * row[j], next[j] -= l_next * row[j];
        }
        for (; i < n; i++) {
            vector *restrict other = F + i * wide;
            const vector l = other[k] * inverse;
            for (int j = k + 1; j < wide; j++) other[j] -= l * row[j];
        }
        F[k * wide + k] = inverse;
    }
}

/* The same of a symmetric F (n, n), of which the upper half is read, without row exchanges; bad: where it is not surely
   positive. */
static void reduce_positive(vector *restrict F, int n, int m, int *bad)
{
    vector whole[m];
    for (int j = 0; j < m; j++) whole[j] = magnitude(F[j * n + j]);
    for (int k = 0; k < m; k++) {
        const vector *restrict row = F + k * n, pivot = row[k], inverse = 1.0 / pivot;
        for (int i = 0; i < LANES; i++) bad[i] |= !(pivot[i] > POSITIVE_PIVOT * whole[k][i]);
        for (int i = k + 1; i < n; i++) {
            vector *restrict other = F + i * n;
            const vector l = row[i] * inverse;
            for (int j = i; j < n; j++) other[j] -= l * row[j];
        }
    }
}

/* ---- what a group asks for --------------------------------------------------------------------------------------- */

/* The residuals b at x; who fails leaves. */
void residuals(const group *g, int *in, double *const *x, double *const *b)
{
    const lock_step *l = g->together;
    kernel *of[LANES];
    int several;
    first_of(g, in, &several);
    for (int k = 0; k < g->count; k++) {
        if (!in[k]) continue;
        if (!l || !several) in[k] = !residual(problem_of(g, k), x[k], b[k]);
        else in[k] = !begin_residual(problem_of(g, k), x[k]);
    }
    if (!l || !several) return;
    const int first = first_of(g, in, &several);
    if (first < 0) return;
    for (int k = 0; k < g->count; k++) of[k] = problem_of(g, k)->residual;
    const int *dofs = problem_of(g, first)->dofs, size = of[first]->size;
    vector *A = (vector *)l->A;
    take_lane_constants(l->residual, of, in, g->count);
    for (int e = 0; e < of[first]->elements; e++, dofs += size) {
        tabulate_lanes(l->residual, of, in, g->count, first, e, A);
        for (int k = 0; k < g->count; k++) {
            double *local = problem_of(g, k)->local;
            for (int i = 0; in[k] && i < size; i++) local[dofs[i]] += A[i][k];
        }
    }
    for (int k = 0; k < g->count; k++)
        if (in[k]) in[k] = !end_residual(problem_of(g, k), x[k], b[k]);
}

/* Solutions x of tangent * x = b in all lanes; bad: those that are to be found alone. */
static void solve_lanes(const group *g, const int *in, int first, double *const *b, double *const *x, int *bad)
{
    const lock_step *l = g->together;
    const chain *s = problem_of(g, first)->chain;
    kernel *of[LANES];
    vector *A = (vector *)l->A, *X = (vector *)l->x, *before = 0;
    int n_before = 0, k_before = 0;
    for (int k = 0; k < g->count; k++) of[k] = problem_of(g, k)->tangent;
    take_lane_constants(l->tangent, of, in, g->count);
    for (int t = 0; t < s->elements; t++) {
        const int *shape = s->shape + 4 * t, m = shape[0] + shape[1], n = m + shape[2] + shape[3];
        const int *rows = s->rows + (size_t)t * s->room, last = s->ends[t] != -1;
        vector *F = (vector *)l->front + (size_t)t * s->room * (s->room + 1);
        tabulate_lanes(l->tangent, of, in, g->count, first, s->order[t], A);
        assemble_lanes(s, t, A, F, n, n + 1, before, n_before, k_before);
        for (int i = 0; i < m; i++)
            for (int k = 0; k < g->count; k++)
                if (in[k]) F[i * (n + 1) + n][k] += b[k][rows[i]];
        reduce_lanes(F, n, m, s, s->delays && !(last && s->ends[t] < 0), first, bad);
        before = last ? 0 : F, n_before = n, k_before = m;
    }
    for (int t = s->elements - 1; t >= 0; t--) {
        const int *shape = s->shape + 4 * t, m = shape[0] + shape[1], n = m + shape[2] + shape[3];
        const int *rows = s->rows + (size_t)t * s->room;
        const vector *F = (vector *)l->front + (size_t)t * s->room * (s->room + 1);
        vector z[n];
        for (int i = m; i < n; i++) z[i] = X[rows[i]];
        for (int i = m - 1; i >= 0; i--) {
            const vector *row = F + i * (n + 1);
            vector sum = row[n];
            for (int j = i + 1; j < n; j++) sum -= row[j] * z[j];
            X[rows[i]] = z[i] = sum * row[i];
        }
    }
    for (int k = 0; k < g->count; k++)
        for (int i = 0; in[k] && !bad[k] && i < s->size; i++) x[k][i] = X[i][k];
}

/* Newton's directions: x with tangent * x = b at the states, or by the tangent before; who fails leaves. */
void directions(const group *g, int *in, double *const *b, double *const *x)
{
    int several, bad[LANES] = {0}, first = first_of(g, in, &several);
    const int alone = !g->together || !several;
    if (!alone) solve_lanes(g, in, first, b, x, bad);
    for (int k = 0; k < g->count; k++) {
        problem *p = problem_of(g, k);
        if (!in[k]) continue;
        p->singular = 0;
        if (alone || bad[k]) in[k] = (g->sweep[k]->newton->keeps || !tangent(p)) && !solve(p, b[k], x[k]);
    }
}

/* The numbers of negative modes at the states, see `negative_modes`. */
void count_negative(const group *g, const int *in, int *negative)
{
    int several, sideways, bad[LANES] = {0}, first = first_of(g, in, &several);
    const int alone = !g->together || !several;
    const lock_step *l = g->together;
    for (int part = 0; !alone && part < g->sweep[first]->stability->parts; part++) {
        const chain *s = g->sweep[first]->stability->chain[part];
        kernel *of[LANES];
        vector *A = (vector *)l->A, *before = 0;
        int n_before = 0, k_before = 0;
        for (int k = 0; k < g->count; k++) of[k] = g->sweep[k]->stability->form[part];
        take_lane_constants(l->second[part], of, in, g->count);
        for (int t = 0; t < s->elements; t++) {
            const int *shape = s->shape + 4 * t, m = shape[0] + shape[1], n = m + shape[2] + shape[3];
            vector *F = (vector *)l->front + (size_t)(t % 2) * s->room * s->room;
            tabulate_lanes(l->second[part], of, in, g->count, first, s->order[t], A);
            assemble_lanes(s, t, A, F, n, n, before, n_before, k_before);
            reduce_positive(F, n, m, bad);
            before = s->ends[t] == -1 ? F : 0, n_before = n, k_before = m;
        }
    }
    for (int k = 0; k < g->count; k++)
        if (in[k]) negative[k] = alone || bad[k] ? negative_modes(g->sweep[k]->stability, &sideways) : 0;
}
