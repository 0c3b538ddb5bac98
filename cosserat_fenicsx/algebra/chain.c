/* Elements and elimination along the rods. The formulas of the rod are in FFCx's kernels alone. */
#include "chain.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

/* A pivot is taken if it is not smaller than this times the largest number in its column. The unknown of another one is
   delayed to the next element: the axial force of a straight inextensible element between two points is not determined
   before the points are. */
static const double SMALLEST_PIVOT = 1e-2;

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

/* The symmetric part of a matrix A (n, n), of numbers or of vectors, takes its place. */
#define TAKE_SYMMETRIC_PART(A, n) \
    for (int i = 0; i < (n); i++) \
        for (int j = 0; j < i; j++) (A)[i * (n) + j] = (A)[j * (n) + i] = 0.5 * ((A)[i * (n) + j] + (A)[j * (n) + i])

enum { BESIDE = LANES }; /* numbers of a front that are taken together */

static inline int round_down(int i)
{
    return i & -BESIDE;
}

static inline int round_up(int i)
{
    return round_down(i + BESIDE - 1);
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
    TAKE_SYMMETRIC_PART(A, n);
    return A;
}

/* The numbers of `count` elements from e on, at most LANES, next to each other. */
static const double *elements_together(kernel *k, int e, int count)
{
    double *A = k->lanes_A;
    const double *x = k->lanes_x + 6 * (size_t)e;
    const int n = k->symmetric;
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
    TAKE_SYMMETRIC_PART((place_of_vector *)A, n);
    return A;
}

/* The numbers of an element in turn, `step` apart from each other: those computed together with the first of LANES
   elements, which comes before the others. */
static const double *element_in_turn(kernel *k, int e, int *step)
{
    *step = k->together ? LANES : 1;
    if (!k->together) return element(k, e, k->A);
    if (e % LANES == 0) elements_together(k, e, k->elements - e < LANES ? k->elements - e : LANES);
    return k->lanes_A + e % LANES;
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

/* Matrices F of n rows and columns have rows of `wide` numbers, a multiple of BESIDE; those from n on are zeros. */

static void swap(double *a, double *b, int n, int step)
{
    for (int i = 0; i < n; i++, a += step, b += step) {
        double c = *a;
        *a = *b, *b = c;
    }
}

static void swap_rows(double *restrict a, double *restrict b, int n)
{
    for (int i = 0; i < n; i += BESIDE) {
        const vector c = load(a + i);
        keep(load(b + i), a + i), keep(c, b + i);
    }
}

static void swap_numbers(int *a, int *b)
{
    int c = *a;
    *a = *b, *b = c;
}

static inline void subtract_pivot(double *F, int n, int wide, int k)
{
    const double *restrict pivot = F + (size_t)k * wide;
    const double inverse = 1 / pivot[k];
    for (int i = k + 1; i < n; i++) {
        double *restrict row = F + (size_t)i * wide;
        const double l = row[k] *= inverse;
        if (l != 0)
            for (int j = k + 1; j < n; j++) row[j] -= l * pivot[j];
    }
}

/* whole: (m,) the largest numbers in the columns of F. */
static void find_largest(const double *restrict F, int n, int wide, int m, double *restrict whole)
{
    for (int j = 0; j < m; j++) whole[j] = 0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < m; j++) {
            const double size = fabs(F[(size_t)i * wide + j]);
            whole[j] = size > whole[j] ? size : whole[j]; /* fmax is four times slower */
        }
}

/* The same where each row is multiplied by its scale, one over the sum of its numbers; scale: (n,). */
static void find_scales(const double *F, int n, int wide, int m, double *scale, double *whole)
{
    for (int j = 0; j < m; j++) whole[j] = 0;
    for (int i = 0; i < n; i++) {
        double sum = 0;
        for (int j = 0; j < n; j++) sum += fabs(F[(size_t)i * wide + j]);
        scale[i] = sum > 0 ? 1 / sum : 1;
        for (int j = 0; j < m; j++) whole[j] = fmax(whole[j], scale[i] * fabs(F[(size_t)i * wide + j]));
    }
}

/* Subtract pivot k, at `c` among the BESIDE columns that are taken together, in these columns alone. */
static inline void subtract_beside(double *F, int n, int wide, int k, const int c)
{
    double *row = F + (size_t)k * wide + k - c;
    vector pivot = load(row), scale = (vector){0} + 1;
    scale[c] = 1 / pivot[c];
    for (int j = 0; j <= c; j++) pivot[j] = 0;
    for (int i = k + 1; i < n; i++) {
        const vector v = load(row += wide) * scale;
        keep(v - pivot * ((vector){0} + v[c]), row);
    }
}

/* Subtract `count` pivots from k on, which are in their columns, in `rows` rows, the first of them `row`, and in the
   columns from `first` on, a multiple of BESIDE. */
static inline __attribute__((always_inline)) void subtract_from(double *row, const int rows, const double *F, int n,
                                                                int wide, int k, int first, const int count)
{
    vector l[2][BESIDE], v[2];
    for (int i = 0; i < rows; i++)
        for (int p = 0; p < count; p++) l[i][p] = (vector){0} + row[i * wide + k + p];
    for (int j = first; j < n; j += BESIDE) {
        for (int i = 0; i < rows; i++) v[i] = load(row + i * wide + j);
        for (int p = 0; p < count; p++)
            for (int i = 0; i < rows; i++) v[i] -= load(F + (size_t)(k + p) * wide + j) * l[i][p];
        for (int i = 0; i < rows; i++) keep(v[i], row + i * wide + j);
    }
}

/* The same in all rows below the first pivot's. */
static void subtract_pivots(double *F, int n, int wide, int k, int first, int count)
{
    int i = k + 1;
    for (; first < n && i < k + count; i++) subtract_from(F + (size_t)i * wide, 1, F, n, wide, k, first, i - k);
    for (; first < n && count == BESIDE && i + 1 < n; i += 2)
        subtract_from(F + (size_t)i * wide, 2, F, n, wide, k, first, BESIDE);
    for (; first < n && count > 0 && i < n; i++) subtract_from(F + (size_t)i * wide, 1, F, n, wide, k, first, count);
}

/* The largest of the absolute values of column k of F from row k to m, and `at` which it is the first time; `below`: of
   those from row m on; size: (n + BESIDE,) work space. Without branches, which the processor would not foresee. */
static inline double largest_in_column(const double *F, int n, int wide, int k, int m, double *restrict size, int *at,
                                       double *below)
{
    double best[BESIDE] = {0}, place[BESIDE], most = 0, first = m;
    const int end = k + round_up(m - k);
    *below = 0;
    for (int i = m; i < n; i++) size[0] = fabs(F[(size_t)i * wide + k]), *below = size[0] > *below ? size[0] : *below;
    for (int i = k; i < m; i++) size[i] = fabs(F[(size_t)i * wide + k]);
    for (int i = m; i < end; i++) size[i] = 0;
    for (int i = k; i < end; i += BESIDE)
        for (int j = 0; j < BESIDE; j++) best[j] = size[i + j] > best[j] ? size[i + j] : best[j];
    for (int j = 0; j < BESIDE; j++) most = best[j] > most ? best[j] : most, place[j] = m;
    for (int i = end - BESIDE; i >= k; i -= BESIDE)
        for (int j = 0; j < BESIDE; j++) place[j] = size[i + j] == most ? i + j : place[j];
    for (int j = 0; j < BESIDE; j++) first = place[j] < first ? place[j] : first;
    *at = first < m ? first : k;
    return most;
}

/* LU factors of the first m rows and columns of F with row exchanges among them, and the rest reduced. Columns
   without an acceptable pivot are tried again after the others; at most `most` may be left over. Returns how many were
   eliminated, -1 if F is singular: pivots are zero that are smaller than `zero` times the largest number in the column
   before elimination, where `scale` is given with all rows scaled by their sums. scale: (n,) work space for these, or
   0; whole: (m,), size: (n,) work space.

   A pivot is subtracted at once in the columns beside it alone, and with the others of these in all columns that
   follow. */
static int reduce(double *F, int n, int wide, int m, int most, int *row, int *column, double zero,
                  double *restrict scale, double *restrict whole, double *restrict size)
{
    int k = 0, last = m, before = 0; /* the columns from `last` on were refused since `before` were eliminated */
    int from = 0, end = 0; /* the pivots from `from` on are subtracted in the columns up to `end` alone */
    double share = most ? SMALLEST_PIVOT : 0;
    if (scale)
        find_scales(F, n, wide, m, scale, whole);
    else
        find_largest(F, n, wide, m, whole);
    while (k < m) {
        int at;
        double largest;
        if (k == last) {
            if (k == before) {
                if (m - k <= most) break;
                if (share == 0) return -1;
                share = 0;
            }
            last = m, before = k;
        }
        if (k >= end) {
            subtract_pivots(F, n, wide, from, end, k - from);
            from = k, end = round_down(k) + BESIDE;
        }
        const double best = largest_in_column(F, n, wide, k, m, size, &at, &largest);
        if (!((scale ? scale[at] : 1) * best > zero * whole[k]) || best < share * largest) {
            subtract_pivots(F, n, wide, from, end, k - from);
            from = k, last--;
            swap(F + k, F + last, n, wide);
            swap(whole + k, whole + last, 1, 1);
            swap_numbers(column + k, column + last);
            continue;
        }
        if (at != k) {
            swap_rows(F + (size_t)k * wide, F + (size_t)at * wide, n);
            if (scale) swap(scale + k, scale + at, 1, 1);
            swap_numbers(row + k, row + at);
        }
        switch (k % BESIDE) {
        case 0: subtract_beside(F, n, wide, k, 0); break;
        case 1: subtract_beside(F, n, wide, k, 1); break;
        case 2: subtract_beside(F, n, wide, k, 2); break;
        default: subtract_beside(F, n, wide, k, 3);
        }
        k++;
    }
    subtract_pivots(F, n, wide, from, end, k - from);
    return k;
}

/* ---- along the rods ---------------------------------------------------------------------------------------------- */

/* Where the i-th of the numbers carried from the element before is in the front; `ahead`: how many are in front of the
   element's own. */
static inline int carried_to(int i, int ahead, const int *shape)
{
    return i < ahead ? i : i + shape[1] + shape[2];
}

/* How many of the numbers from j on, of w, follow each other in the front, too. */
static inline int in_a_row(const int *place, int j, int w)
{
    int end = j + 1;
    while (end < w && place[end] == place[end - 1] + 1) end++;
    return end - j;
}

/* The front F of the element in turn, with `d` delayed unknowns and what is carried from the front of the one before.
   diagonal: 0, or where to sum the diagonal of the interface. */
static void assemble(chain *s, kernel *k, const double *matrices, double *F, int t, int d, const double *before,
                     int n_before, int k_before, double *diagonal)
{
    const int *shape = s->shape + 4 * t, *place = s->place + (size_t)t * s->width, w = s->width, e = s->order[t];
    const int n = d + shape[0] + shape[1] + shape[2] + shape[3], ahead = d + shape[0], wide = s->wide;
    int runs = 0, length[w], begin[w], step = 1;
    for (int j = 0; j < w; j += place[j] < 0 ? 1 : length[runs++])
        if (place[j] >= 0) begin[runs] = j, length[runs] = in_a_row(place, j, w);
    memset(F, 0, (size_t)round_up(n) * wide * sizeof *F);
    const double *A = matrices ? matrices + (size_t)e * w * w : element_in_turn(k, e, &step);
    for (int i = 0; i < w; i++) {
        if (place[i] < 0) continue;
        double *row = F + (size_t)(place[i] + d) * wide + d;
        for (int r = 0; r < runs; r++) {
            double *restrict to = row + place[begin[r]];
            const double *restrict a = A + step * (i * w + begin[r]);
            for (int j = 0; step == 1 && j < length[r]; j++) to[j] += a[j];
            for (int j = 0; step == LANES && j < length[r]; j++) to[j] += a[LANES * j];
        }
        const int number = s->rows[(size_t)t * s->room + place[i]];
        if (diagonal && number >= s->size) diagonal[number - s->size] += A[step * i * (w + 1)];
    }
    for (int i = k_before; before && i < n_before; i++) {
        double *row = F + (size_t)carried_to(i - k_before, ahead, shape) * wide;
        for (int j = k_before; j < n_before; j++)
            row[carried_to(j - k_before, ahead, shape)] += before[(size_t)i * wide + j];
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
                F[(size_t)(k + i) * s->wide + k + j];
    for (int i = d; i < slots; i++) block[(size_t)i * all + i] = 1;
}

/* Rows `first` to `end` of `count` columns of F from j on, both multiples of BESIDE, to one place for each column. */
static inline void turn_columns(const double *restrict F, int wide, int first, int end, int j, const int count,
                                double *const *to)
{
    for (int i = first; i < end; i += BESIDE)
        for (int c = 0; c < count; c++)
            for (int r = 0; r < BESIDE; r++) to[c][i - first + r] = F[(size_t)(i + r) * wide + j + c];
}

/* The factors of a front F (n, n) with k pivots by columns, for `subtract_column`: those of L from the first on, those
   of U above the pivots from the last on. Each begins and ends where four numbers of the front do, filled up with
   zeros. */
static void keep_factors(chain *s, int t, const double *F, int n, int k)
{
    double *to = s->factor + (size_t)s->start[t] * BESIDE, *inverse = s->inverse + (size_t)t * s->room;
    double *at[BESIDE];
    const int wide = s->wide, end = round_up(n);
    for (int j = 0; j < k; j += BESIDE) {
        const int count = k - j < BESIDE ? k - j : BESIDE, below = j + BESIDE;
        for (int c = 0; c < count; c++) {
            for (int r = 0; r < BESIDE && c + 1 < BESIDE; r++) *to++ = r > c ? F[(size_t)(j + r) * wide + j + c] : 0;
            at[c] = to, to += end - below;
            inverse[j + c] = 1 / F[(size_t)(j + c) * (wide + 1)];
        }
        if (count == BESIDE) turn_columns(F, wide, below, end, j, BESIDE, at);
        else turn_columns(F, wide, below, end, j, count, at);
    }
    for (int j = round_down(n - 1); j >= 0; j -= BESIDE) {
        const int count = n - j < BESIDE ? n - j : BESIDE, full = round_down(j < k ? j : k);
        for (int c = count - 1; c >= 0; c--) {
            const int above = j + c < k ? j + c : k;
            at[c] = to, to += full;
            for (int i = full; i < round_up(above); i++) *to++ = i < above ? F[(size_t)i * wide + j + c] : 0;
        }
        if (count == BESIDE) turn_columns(F, wide, 0, full, j, BESIDE, at);
        else turn_columns(F, wide, 0, full, j, count, at);
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
        double *F = s->front + (size_t)(t % 2) * s->wide * s->wide; /* of earlier ones the factors are kept */
        int eliminated = -1;
        /* A pivot that seems to be zero is judged again with rows scaled: in the column of a rotation the forces
           against shear of a slender rod exceed all moments, and the more the shorter the element. */
        for (int scaled = 0; scaled < 2 && eliminated < 0; scaled++) {
            assemble(s, k, matrices, F, t, d, before, n_before, k_before, 0);
            for (int i = 0; i < n; i++) row[i] = i;
            for (int i = 0; i < d; i++) column[i] = s->column[(size_t)(t - 1) * s->room + k_before + i];
            memcpy(column + d, s->rows + (size_t)t * s->room, (n - d) * sizeof *column);
            eliminated = reduce(F, n, s->wide, m, last && s->ends[t] < 0 ? 0 : s->delays, row, column, s->zero_pivot,
                                scaled ? s->carry : 0, s->work, s->work + s->room);
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
