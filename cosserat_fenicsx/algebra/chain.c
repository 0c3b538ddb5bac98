/* Elements and elimination along the rods. The formulas of the rod are in FFCx's kernels alone. */
#include "chain.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

/* A pivot is taken if it is not smaller than this times the largest number in its column. The unknown of another one is
   delayed to the next element: the axial force of a straight inextensible element between two points is not determined
   before the points are. */
static const double SMALLEST_PIVOT = 1e-2;
/* Relative to the diagonal before elimination, smaller pivots of a symmetric matrix are zero to rounding. */
static const double ZERO_PIVOT = 2e-15;

#if KERNEL_ARGUMENTS == 6
typedef void tabulator(double *, const double *, const double *, const double *, const int *, const uint8_t *);
#define LAST
#else
typedef void tabulator(double *, const double *, const double *, const double *, const int *, const uint8_t *, void *);
#define LAST , 0
#endif

/* Numbers next to each other in the processor, and where they are in memory. */
typedef double vector __attribute__((vector_size(LANES * sizeof(double))));
typedef double place_of_vector __attribute__((vector_size(LANES * sizeof(double)), aligned(sizeof(double)), may_alias));

static inline vector load(const double *from)
{
    return *(const place_of_vector *)from;
}

static inline void keep(vector a, double *to)
{
    *(place_of_vector *)to = a;
}

/* ---- elements ---------------------------------------------------------------------------------------------------- */

static void take_constants(kernel *k)
{
    for (; k; k = k->next)
        for (int i = 0; i < k->constants; i++) {
            k->c[k->slot[i]] = *k->constant[i];
            for (int lane = 0; k->together && lane < LANES; lane++)
                k->lanes_c[LANES * k->slot[i] + lane] = *k->constant[i];
        }
}

static double *coefficients(kernel *k, int e)
{
    double *w = k->w + (size_t)e * k->width;
    for (const source *s = k->source; s < k->source + k->sources; s++) {
        const int *which = s->which + (size_t)e * s->count;
        for (int i = 0; i < s->count; i++) w[s->column + i] = s->values[which[i]];
    }
    return w;
}

/* Take the current values of what changes, for assembly by others. */
void pack(kernel *k)
{
    take_constants(k);
    for (; k; k = k->next)
        for (int e = 0; e < k->elements; e++) coefficients(k, e);
}

/* The numbers A of an element. */
static const double *element(kernel *k, int e, double *A)
{
    double x[6];
    const int n = k->symmetric;
    for (int i = 0; i < 2; i++) memcpy(x + 3 * i, k->x + 3 * (size_t)k->corners[2 * e + i], 3 * sizeof *x);
    memset(A, 0, k->size * sizeof *A);
    for (; k; k = k->next) ((tabulator *)k->tabulate)(A, coefficients(k, e), k->c, x, 0, 0 LAST);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < i; j++) A[i * n + j] = A[j * n + i] = 0.5 * (A[i * n + j] + A[j * n + i]);
    return A;
}

/* The numbers of `count` elements from e on, at most LANES, next to each other. */
static const double *elements_together(kernel *k, int e, int count)
{
    double *A = k->lanes_A;
    const double *x = k->lanes_x + 6 * (size_t)e;
    memset(A, 0, LANES * k->size * sizeof *A);
    for (; k; k = k->next) {
        double *w = k->lanes_w + (size_t)e * k->width;
        for (const source *s = k->source; s < k->source + k->sources; s++)
            for (int i = 0; i < s->count; i++)
                for (int lane = 0; lane < LANES; lane++) { /* the first element stands in lanes without one */
                    const int *which = s->which + (size_t)(lane < count ? e + lane : e) * s->count;
                    w[LANES * (s->column + i) + lane] = s->values[which[i]];
                }
        ((tabulator *)k->together)(A, w, k->lanes_c, x, 0, 0 LAST);
    }
    return A;
}

/* Add a vector's elements to values (local degrees of freedom); dofs: (elements, size). */
void add_vector(kernel *k, const int *dofs, double *values)
{
    take_constants(k);
    for (int e = 0; k->together && e < k->elements; e += LANES) {
        const int count = k->elements - e < LANES ? k->elements - e : LANES;
        const double *A = elements_together(k, e, count);
        for (int lane = 0; lane < count; lane++, dofs += k->size)
            for (int i = 0; i < k->size; i++) values[dofs[i]] += A[LANES * i + lane];
    }
    for (int e = k->together ? k->elements : 0; e < k->elements; e++, dofs += k->size) {
        const double *A = element(k, e, k->A);
        for (int i = 0; i < k->size; i++) values[dofs[i]] += A[i];
    }
}

/* Put an expression's values at their places. */
void put_values(kernel *k, const int *dofs, double *values)
{
    take_constants(k);
    for (int e = 0; e < k->elements; e++, dofs += k->size) {
        const double *A = element(k, e, k->A);
        for (int i = 0; i < k->size; i++) values[dofs[i]] = A[i];
    }
}

/* All elements' numbers, (elements, size). */
void tabulate_all(kernel *k, double *values)
{
    take_constants(k);
    for (int e = 0; e < k->elements; e++) element(k, e, values + (size_t)e * k->size);
}

/* ---- one front --------------------------------------------------------------------------------------------------- */

static void swap(double *a, double *b, int n, int step)
{
    for (int i = 0; i < n; i++, a += step, b += step) {
        double c = *a;
        *a = *b, *b = c;
    }
}

static void swap_numbers(int *a, int *b)
{
    int c = *a;
    *a = *b, *b = c;
}

static inline void subtract_pivot(double *F, int n, int k)
{
    const double *restrict pivot = F + (size_t)k * n;
    const double inverse = 1 / pivot[k];
    for (int i = k + 1; i < n; i++) {
        double *restrict row = F + (size_t)i * n;
        const double l = row[k] *= inverse;
        if (l != 0)
            for (int j = k + 1; j < n; j++) row[j] -= l * pivot[j];
    }
}

/* whole: (m,) the largest numbers in the columns of F (n, n). */
static void find_largest(const double *restrict F, int n, int m, double *restrict whole)
{
    for (int j = 0; j < m; j++) whole[j] = 0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < m; j++) {
            const double size = fabs(F[(size_t)i * n + j]);
            whole[j] = size > whole[j] ? size : whole[j]; /* fmax is four times slower */
        }
}

/* The same where each row is multiplied by its scale, one over the sum of its numbers; scale: (n,). */
static void find_scales(const double *F, int n, int m, double *scale, double *whole)
{
    for (int j = 0; j < m; j++) whole[j] = 0;
    for (int i = 0; i < n; i++) {
        double sum = 0;
        for (int j = 0; j < n; j++) sum += fabs(F[(size_t)i * n + j]);
        scale[i] = sum > 0 ? 1 / sum : 1;
        for (int j = 0; j < m; j++) whole[j] = fmax(whole[j], scale[i] * fabs(F[(size_t)i * n + j]));
    }
}

/* LU factors of the first m rows and columns of F (n, n) with row exchanges among them, and the rest reduced. Columns
   without an acceptable pivot are tried again after the others; at most `most` may be left over. Returns how many were
   eliminated, -1 if F is singular: pivots are zero that are smaller than `zero` times the largest number in the column
   before elimination, where `scale` is given with all rows scaled by their sums. scale: (n,) work space for these, or
   0; whole: (m,) work space. */
static int reduce(double *restrict F, int n, int m, int most, int *row, int *column, double zero,
                  double *restrict scale, double *restrict whole)
{
    int k = 0, last = m, before = 0; /* the columns from `last` on were refused since `before` were eliminated */
    double share = most ? SMALLEST_PIVOT : 0;
    if (scale)
        find_scales(F, n, m, scale, whole);
    else
        find_largest(F, n, m, whole);
    while (k < m) {
        if (k == last) {
            if (k == before) {
                if (m - k <= most) break;
                if (share == 0) return -1;
                share = 0;
            }
            last = m, before = k;
        }
        int at = k;
        double best = 0, largest = 0;
        for (int i = k; i < m; i++) {
            const double size = fabs(F[(size_t)i * n + k]);
            if (size > best) best = size, at = i;
        }
        for (int i = m; share > 0 && i < n; i++) largest = fmax(largest, fabs(F[(size_t)i * n + k]));
        if (!((scale ? scale[at] : 1) * best > zero * whole[k]) || best < share * largest) {
            last--;
            swap(F + k, F + last, n, n);
            swap(whole + k, whole + last, 1, 1);
            swap_numbers(column + k, column + last);
            continue;
        }
        if (at != k) {
            swap(F + (size_t)k * n, F + (size_t)at * n, n, 1);
            if (scale) swap(scale + k, scale + at, 1, 1);
            swap_numbers(row + k, row + at);
        }
        subtract_pivot(F, n, k++);
    }
    return k;
}

/* Signs of the pivots of the first m rows and columns of a symmetric F (n, n), the largest on the diagonal first;
   whole: their diagonal before, against which zero is judged, whatever the scale of an unknown. Returns the logarithm
   of the product of their absolute values. */
static double signs(double *F, int n, int m, double *whole, int *negative, int *zero)
{
    double product = 1;
    int power = 0, exponent;
    for (int i = 0; i < m; i++) whole[i] = fabs(F[(size_t)i * n + i]);
    for (int k = 0; k < m; k++) {
        int at = k;
        for (int i = k + 1; i < m; i++)
            if (fabs(F[(size_t)i * n + i]) > fabs(F[(size_t)at * n + at])) at = i;
        swap(F + (size_t)k * n, F + (size_t)at * n, n, 1);
        swap(F + k, F + at, n, n);
        swap(whole + k, whole + at, 1, 1);
        const double pivot = F[(size_t)k * n + k];
        if (!(fabs(pivot) > ZERO_PIVOT * whole[k])) {
            ++*zero;
            continue;
        }
        *negative += pivot < 0;
        product = frexp(product * pivot, &exponent), power += exponent;
        subtract_pivot(F, n, k);
    }
    return log(fabs(product)) + power * log(2);
}

static inline double dot(const double *restrict a, const double *restrict b, int n)
{
    double sum = 0;
#pragma omp simd reduction(+ : sum)
    for (int i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

/* ---- along the rods ---------------------------------------------------------------------------------------------- */

enum { BESIDE = LANES }; /* numbers of a front that are taken together */

static inline int round_down(int i)
{
    return i & -BESIDE;
}

static inline int round_up(int i)
{
    return round_down(i + BESIDE - 1);
}

/* Where the i-th of the numbers carried from the element before is in the front; `ahead`: how many are in front of the
   element's own. */
static inline int carried_to(int i, int ahead, const int *shape)
{
    return i < ahead ? i : i + shape[1] + shape[2];
}

/* The front F of the element in turn, with `d` delayed unknowns and what is carried from the front of the one before.
   diagonal: 0, or where to sum the diagonal of the interface. */
static void assemble(chain *s, kernel *k, const double *matrices, double *F, int t, int d, const double *before,
                     int n_before, int k_before, double *diagonal)
{
    const int *shape = s->shape + 4 * t, *place = s->place + (size_t)t * s->width, w = s->width, e = s->order[t];
    const int n = d + shape[0] + shape[1] + shape[2] + shape[3], ahead = d + shape[0];
    memset(F, 0, (size_t)n * n * sizeof *F);
    const double *A = matrices ? matrices + (size_t)e * w * w : element(k, e, k->A);
    for (int i = 0; i < w; i++) {
        if (place[i] < 0) continue;
        double *row = F + (size_t)(place[i] + d) * n + d;
        for (int j = 0; j < w; j++)
            if (place[j] >= 0) row[place[j]] += A[i * w + j];
        const int number = s->rows[(size_t)t * s->room + place[i]];
        if (diagonal && number >= s->size) diagonal[number - s->size] += A[i * w + i];
    }
    for (int i = k_before; before && i < n_before; i++) {
        double *row = F + (size_t)carried_to(i - k_before, ahead, shape) * n;
        for (int j = k_before; j < n_before; j++)
            row[carried_to(j - k_before, ahead, shape)] += before[(size_t)i * n_before + j];
    }
}

/* The matrix of a segment on the interface; `d`: delayed unknowns, in the first of its places. */
static void condense(chain *s, int t, const double *F, int n, int k, int d)
{
    if (s->block[t] < 0) return;
    const int slots = s->ends[t] < 0 ? 0 : s->delays, kept = n - k - d, all = slots + kept;
    double *block = s->condensed + s->block[t];
    memset(block, 0, (size_t)all * all * sizeof *block);
    for (int i = 0; i < d + kept; i++)
        for (int j = 0; j < d + kept; j++)
            block[(size_t)(i < d ? i : i - d + slots) * all + (j < d ? j : j - d + slots)] =
                F[(size_t)(k + i) * n + k + j];
    for (int i = d; i < slots; i++) block[(size_t)i * all + i] = 1;
}

/* The factors of a front F (n, n) with k pivots by columns, for `subtract_column`: those of L from the first on, those
   of U above the pivots from the last on. Each begins and ends where four numbers of the front do, filled up with
   zeros. */
static void keep_factors(chain *s, int t, const double *F, int n, int k)
{
    double *to = s->factor + (size_t)s->start[t] * BESIDE, *inverse = s->inverse + (size_t)t * s->room;
    for (int j = 0; j < k; j++) {
        const int first = round_down(j + 1), end = round_up(n);
        for (int i = first; i <= j; i++) *to++ = 0;
        for (int i = j + 1; i < n; i++) *to++ = F[(size_t)i * n + j];
        for (int i = n; i < end; i++) *to++ = 0;
        inverse[j] = 1 / F[(size_t)j * n + j];
    }
    for (int j = n - 1; j >= 0; j--) {
        const int above = j < k ? j : k;
        for (int i = 0; i < above; i++) *to++ = F[(size_t)i * n + j];
        for (int i = above; i < round_up(above); i++) *to++ = 0;
    }
}

/* Ask for the factors that are needed next, from `from` to `end`: the processor does not foresee the gaps between those
   of elements, and waiting for them takes most of a substitution. */
static inline void fetch(const double *from, const double *end)
{
    for (; from < end; from += 8) __builtin_prefetch(from);
}

/* z -= column * by, of `many` vectors z and numbers by, from `first` to `end`, both multiples of BESIDE; returns the
   column that follows. */
static inline const double *subtract_column(double *restrict z, const double *restrict column, const double *by,
                                            int first, int end, const int many)
{
    double value[AT_ONCE];
    for (int r = 0; r < many; r++) value[r] = by[r];
    for (int i = first; i < end; i += BESIDE, column += BESIDE)
        for (int j = 0; j < BESIDE; j++)
            for (int r = 0; r < many; r++) z[many * (i + j) + r] -= column[j] * value[r];
    return column;
}

/* z without the columns of L times their numbers of z, of which one depends on those before: a vector of them is found
   in the processor and subtracted from the others at once. */
static inline void subtract_below(double *restrict z, const double *l, int n, int k, const int many)
{
    const int end = round_up(n);
    int j = 0;
    for (; many == 1 && j + BESIDE <= k; j += BESIDE) {
        const int apart = end - j;
        vector v = load(z + j), by[BESIDE];
        for (int c = 0; c < BESIDE; c++) {
            by[c] = v[c] - (vector){0};
            if (c + 1 < BESIDE) v -= load(l + c * apart) * by[c];
        }
        keep(v, z + j);
        for (int i = BESIDE; i < apart; i += BESIDE) {
            vector other = load(z + j + i);
            for (int c = 0; c < BESIDE; c++)
                other -= load(l + c * apart + i - (c + 1 < BESIDE ? 0 : BESIDE)) * by[c];
            keep(other, z + j + i);
        }
        l += BESIDE * apart - BESIDE;
    }
    for (; j < k; j++) l = subtract_column(z, l, z + many * j, round_down(j + 1), end, many);
}

/* The first k numbers of z by the columns of U, from the last one on, whose numbers of z from k on are known. */
static inline void subtract_above(double *restrict z, const double *u, const double *restrict inverse, int n, int k,
                                  const int many)
{
    const int known = many > 1 ? 0 : n - k, all = round_up(k);
    int j = n - 1 - known;
    for (int i = 0; known && i < all; i += BESIDE) {
        vector other = load(z + i);
        for (int l = 0; l < known; l++) other -= load(u + l * all + i) * z[n - 1 - l];
        keep(other, z + i);
    }
    u += known * all;
    for (; j >= 0 && (many > 1 || (j + 1) % BESIDE); j--) {
        for (int r = 0; r < many && j < k; r++) z[many * j + r] *= inverse[j];
        u = subtract_column(z, u, z + many * j, 0, round_up(j < k ? j : k), many);
    }
    for (j++; j > 0; j -= BESIDE) {
        const int first = j - BESIDE;
        vector v = load(z + first), by[BESIDE];
        for (int l = 0; l < BESIDE; l++) { /* upwards, or the compiler does not unroll it */
            const int c = BESIDE - 1 - l;
            v[c] *= inverse[first + c], by[l] = v[c] - (vector){0};
            if (c) v -= load(u + l * j + first) * by[l];
        }
        keep(v, z + first);
        for (int i = 0; i < first; i += BESIDE) {
            vector other = load(z + i);
            for (int l = 0; l < BESIDE; l++) other -= load(u + l * j + i) * by[l];
            keep(other, z + i);
        }
        u += (BESIDE - 1) * j + first;
    }
}

/* Factors of the sum of the elements: of the kernel, or matrices that are given. Returns 0, or 1 if it is singular. */
int eliminate(chain *s, kernel *k, const double *matrices)
{
    const double *before = 0;
    int n_before = 0, k_before = 0, d = 0;
    if (k) take_constants(k);
    for (int t = 0; t < s->elements; t++) {
        const int *shape = s->shape + 4 * t, m = d + shape[0] + shape[1], n = m + shape[2] + shape[3];
        int *row = s->row + (size_t)t * s->room, *column = s->column + (size_t)t * s->room;
        const int last = s->ends[t] != -1;
        double *F = s->front + (size_t)(t % 2) * s->room * s->room; /* of earlier ones the factors are kept */
        int eliminated = -1;
        /* A pivot that seems to be zero is judged again with rows scaled: in the column of a rotation the forces
           against shear of a slender rod exceed all moments, and the more the shorter the element. */
        for (int scaled = 0; scaled < 2 && eliminated < 0; scaled++) {
            assemble(s, k, matrices, F, t, d, before, n_before, k_before, 0);
            for (int i = 0; i < n; i++) row[i] = i;
            for (int i = 0; i < d; i++) column[i] = s->column[(size_t)(t - 1) * s->room + k_before + i];
            memcpy(column + d, s->rows + (size_t)t * s->room, (n - d) * sizeof *column);
            eliminated = reduce(F, n, m, last && s->ends[t] < 0 ? 0 : s->delays, row, column, s->zero_pivot,
                                scaled ? s->carry : 0, s->work);
        }
        k_before = eliminated;
        s->done[2 * t] = n, s->done[2 * t + 1] = k_before;
        if (k_before < 0) return 1;
        keep_factors(s, t, F, n, k_before);
        d = m - k_before, before = F, n_before = n;
        if (last) condense(s, t, F, n, k_before, d), before = 0, d = 0;
    }
    return 0;
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
        double *F = s->front + (size_t)(t % 2) * s->room * s->room; /* of earlier ones nothing is needed */
        assemble(s, k, 0, F, t, 0, before, n_before, k_before, s->diagonal);
        s->logarithm += signs(F, n, m, s->work, &s->negative, &s->zero);
        before = F, n_before = n, k_before = m;
        if (s->ends[t] != -1) condense(s, t, F, n, m, 0), before = 0;
    }
}

/* Forward substitution of b (this rank's unknowns, many); what the interface gets is added to it. found: (elements,
   wide, many) for `backward_of`; carry, y: (room, many) work space. */
static inline void forward_of(const chain *s, const double *b, double *interface, double *found, double *carry,
                              double *y, const int many)
{
    int d = 0, carried = 0;
    for (int t = 0; t < s->elements; t++) {
        const size_t at = (size_t)t * s->room;
        const int *shape = s->shape + 4 * t, *rows = s->rows + at, *row = s->row + at, *column = s->column + at;
        const int n = s->done[2 * t], k = s->done[2 * t + 1], m = d + shape[0] + shape[1];
        const int *start = s->start + t;
        const double *l = s->factor + (size_t)*start * BESIDE, *next = l + BESIDE * (start[1] - *start);
        double *z = found + (size_t)t * s->wide * many;
        if (t + 1 < s->elements) fetch(next, next + s->wide * k);
        for (int i = 0; i < n; i++)
            for (int r = 0; r < many; r++) y[many * i + r] = i >= d && i < m ? b[many * rows[i - d] + r] : 0;
        for (int i = 0; i < carried; i++)
            for (int r = 0; r < many; r++) y[many * carried_to(i, d + shape[0], shape) + r] += carry[many * i + r];
        for (int i = 0; i < n; i++)
            for (int r = 0; r < many; r++) z[many * i + r] = y[many * row[i] + r];
        subtract_below(z, l, n, k, many);
        d = m - k, carried = n - k;
        if (s->ends[t] == -1) {
            memcpy(carry, z + many * k, many * carried * sizeof *carry);
            continue;
        }
        for (int i = k; i < n; i++)
            for (int r = 0; r < many; r++)
                interface[many * (i < k + d ? s->ends[t] + i - k : column[i] - s->size) + r] += z[many * i + r];
        d = carried = 0;
    }
}

/* Backward substitution: x from the solution on the interface, after `forward_of`. */
static inline void backward_of(const chain *s, const double *interface, double *x, double *found, const int many)
{
    for (int t = s->elements - 1; t >= 0; t--) {
        const size_t at = (size_t)t * s->room;
        const int *shape = s->shape + 4 * t, *column = s->column + at;
        const int n = s->done[2 * t], k = s->done[2 * t + 1], m = n - shape[2] - shape[3];
        const double *u = s->factor + (size_t)s->start[t] * BESIDE, *inverse = s->inverse + at;
        double *z = found + (size_t)t * s->wide * many;
        for (int j = 0; j < k; j++) u += round_up(n) - round_down(j + 1);
        if (t > 0) {
            const double *next = u - BESIDE * (s->start[t] - s->start[t - 1]);
            fetch(next, next + n * k);
        }
        for (int i = k; i < n; i++)
            for (int r = 0; r < many; r++) {
                if (i < m && s->ends[t] >= 0) x[many * column[i] + r] = interface[many * (s->ends[t] + i - k) + r];
                z[many * i + r] = column[i] < s->size ? x[many * column[i] + r]
                                                      : interface[many * (column[i] - s->size) + r];
            }
        subtract_above(z, u, inverse, n, k, many);
        for (int j = 0; j < k; j++)
            for (int r = 0; r < many; r++) x[many * column[j] + r] = z[many * j + r];
    }
}

void forward(chain *s, const double *b, double *interface)
{
    forward_of(s, b, interface, s->forward, s->carry, s->work, 1);
}

void backward(chain *s, const double *interface, double *x)
{
    backward_of(s, interface, x, s->forward, 1);
}

/* x (unknowns, AT_ONCE) of as many right-hand sides b, without an interface: the factors, whose reading takes most of
   the time, are read once. work: ((elements, wide) and 2 room, AT_ONCE). */
void substitute(const chain *s, const double *b, double *x, double *work)
{
    double *carry = work + (size_t)AT_ONCE * s->elements * s->wide, *y = carry + AT_ONCE * s->room;
    forward_of(s, b, 0, work, carry, y, AT_ONCE);
    backward_of(s, 0, x, work, AT_ONCE);
}

/* ---- a sparse system ------------------------------------------------------------------------------------------ */

/* Rows and columns of the entries of square matrices one after another; sizes: (count,); where: their unknowns. */
void spread(int count, const int *sizes, const int *where, int *rows, int *columns)
{
    for (int k = 0; k < count; where += sizes[k++])
        for (int i = 0; i < sizes[k]; i++)
            for (int j = 0; j < sizes[k]; j++) *rows++ = where[i], *columns++ = where[j];
}

/* Sort numbers by keys below `size`, where these are equal as they are in `from` (or ascending, without it). starts:
   (size + 1,) work space. */
static void sort_by(const int *key, int size, int count, const int *from, int *to, int *starts)
{
    memset(starts, 0, (size + 1) * sizeof *starts);
    for (int i = 0; i < count; i++) starts[key[i]]++;
    for (int i = 0, sum = 0; i <= size; i++) {
        const int own = starts[i];
        starts[i] = sum;
        sum += own;
    }
    for (int i = 0; i < count; i++) {
        const int k = from ? from[i] : i;
        to[starts[key[k]]++] = k;
    }
}

/* Number the distinct entries of a matrix row by row, columns ascending: starts (size + 1,) of the rows, the `distinct`
   columns, and of every entry its number; order: (count,) work space, as is `distinct`, of that size. Returns how many
   there are. */
int number_entries(int size, int count, const int *rows, const int *columns, int *starts, int *distinct, int *entry,
                   int *order)
{
    int found = 0;
    sort_by(columns, size, count, 0, distinct, starts);
    sort_by(rows, size, count, distinct, order, starts);
    memset(starts, 0, (size + 1) * sizeof *starts);
    for (int i = 0; i < count; i++) {
        const int k = order[i], before = i ? order[i - 1] : -1;
        if (before < 0 || rows[k] != rows[before] || columns[k] != columns[before]) {
            distinct[found++] = columns[k];
            starts[rows[k] + 1]++;
        }
        entry[k] = found - 1;
    }
    for (int i = 0; i < size; i++) starts[i + 1] += starts[i];
    return found;
}

/* ---- a small system as a whole ----------------------------------------------------------------------------------- */

/* LU factors of F (n, n), whose rows are scaled first: those of thick and of thin rods and of constraint equations then
   compete as pivots whatever their units. scale: (n,) of the rows, powers of two. Returns 0, or 1 if it is singular. */
int factor_dense(double *F, int n, int *row, int *column, double zero, double *scale, double *work)
{
    for (int i = 0; i < n; i++) {
        double *f = F + (size_t)i * n, largest = 0;
        int power = 0;
        for (int j = 0; j < n; j++) largest = fmax(largest, fabs(f[j]));
        if (largest > 0 && isfinite(largest)) frexp(largest, &power);
        scale[i] = ldexp(1, -power);
        for (int j = 0; j < n; j++) f[j] *= scale[i];
        row[i] = column[i] = i;
    }
    return reduce(F, n, n, 0, row, column, zero, 0, work) < n;
}

/* Replace b by the solution, by the factors. */
void solve_dense(const double *F, int n, const int *row, const int *column, const double *scale, double *b,
                 double *work)
{
    for (int i = 0; i < n; i++) work[i] = scale[row[i]] * b[row[i]];
    for (int i = 1; i < n; i++) work[i] -= dot(F + (size_t)i * n, work, i);
    for (int i = n - 1; i >= 0; i--)
        work[i] = (work[i] - dot(F + (size_t)i * n + i + 1, work + i + 1, n - i - 1)) / F[(size_t)i * n + i];
    for (int i = 0; i < n; i++) b[column[i]] = work[i];
}
