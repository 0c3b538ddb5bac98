/* Constraint equations of supports and joints: reactions, their tangent and their second variation, in blocks of the
   nodes that they tie, and the small dense system of the interface to which they belong. The equations (forms/ties.py)
   are in FFCx's kernels. */
#include "chain.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

enum { MAPS = 1024, RQ = 7, FOUND = 13, SMALL = 6 }; /* numbers of: r and q; c and its gradient; a node's motions */

static int python_hook(void *self, int what, double *a, double *b);

/* Copy the tied nodes' unknowns and the multipliers from x. */
void see_ties(ties *t, const double *x)
{
    for (int i = 0; i < t->nodes * t->block; i++) t->nodal[i] = t->rows[i] < 0 ? t->at_rest[i] : x[t->rows[i]];
    for (int k = 0; k < t->added; k++) t->multipliers[t->equation[k]] = x[t->multiplier[k]];
    t->known = t->known_change = 0;
}

/* ---- equations --------------------------------------------------------------------------------------------------- */

/* Put (r, q) of the nodes into the rows of numbers that the kernels take. */
static void put_motion(const ties *t, const double *nodal, double load_factor)
{
    static const double ground[RQ] = {0, 0, 0, 1, 0, 0, 0};
    double rq[RQ];
    for (int i = 0; i < 2 * t->count; i++) {
        const int node = t->ends[i];
        const double *values = nodal + node * t->block, *e = t->axes;
        double *to = t->numbers + i / 2 * t->width + i % 2 * RQ;
        if (node >= 0 && t->plane) {
            const double c = cos(values[2] / 2), s = sin(values[2] / 2);
            for (int k = 0; k < 3; k++) {
                rq[k] = values[0] * e[k] + values[1] * e[3 + k] + t->offset[3 * node + k];
                rq[4 + k] = s * e[6 + k];
            }
            rq[3] = c, values = rq;
        }
        memcpy(to, node < 0 ? ground : values, RQ * sizeof *to);
    }
    for (int i = 0; i < t->count; i++) t->numbers[i * t->width + t->at_load_factor] = load_factor;
}

static void tabulate_row(void *kernel, const ties *t, int i, double *found, int size)
{
    memset(found, 0, size * sizeof *found);
    ((tabulator *)kernel)(found, 0, t->numbers + i * t->width, 0, 0, 0 LAST);
}

static void evaluate(ties *t, const double *nodal, double load_factor, double *found)
{
    put_motion(t, nodal, load_factor);
    for (int i = 0; i < t->count; i++) tabulate_row(t->value, t, i, found + FOUND * i, FOUND);
}

/* Values and gradients of all equations at the state, and gradients where reactions act, see MovingTies. */
void find_ties(ties *t, double load_factor)
{
    if (t->known && t->known_at == load_factor) return;
    evaluate(t, t->nodal, load_factor, t->found);
    for (int i = 0; i < t->nodes * t->block; i++)
        t->acting[i] = t->share == 1 ? t->nodal[i] : t->share * t->nodal[i] + (1 - t->share) * t->start[i];
    if (t->share == 1) memcpy(t->amid, t->found, FOUND * t->count * sizeof *t->amid);
    else evaluate(t, t->acting, load_factor, t->amid);
    t->known = 1, t->known_change = 0, t->known_at = load_factor;
}

static const double *gradient(const double *found, int tie, int end)
{
    return found + FOUND * tie + 1 + SMALL * end;
}

/* Forces and moments on the nodes, (nodes, 6), of reactions with these multipliers. */
void react(ties *t, double load_factor, const double *multipliers, double *forces)
{
    find_ties(t, load_factor);
    memset(forces, 0, SMALL * t->nodes * sizeof *forces);
    for (int i = 0; i < 2 * t->count; i++)
        for (int k = 0; t->ends[i] >= 0 && k < SMALL; k++)
            forces[SMALL * t->ends[i] + k] += multipliers[i / 2] * gradient(t->amid, i / 2, i % 2)[k];
}

/* Where the rows of forces turn with the nodes, Python knows them: see `RodModel.tie_maps`. */
static int take_maps(ties *t, const double *nodal)
{
    return t->self ? python_hook(t->self, MAPS, (double *)nodal, t->forces) : 0;
}

/* Add reactions and constraint equations to the rows of nodes and multipliers, see `TieRows`. */
int add_ties(ties *t, double load_factor, double *b)
{
    react(t, load_factor, t->multipliers, t->forces);
    if (take_maps(t, t->nodal)) return 1;
    for (int i = 0; i < t->nodes * t->block; i++) {
        double sum = 0;
        for (int k = 0; k < SMALL; k++) sum += t->test[SMALL * i + k] * t->forces[SMALL * (i / t->block) + k];
        if (t->rows[i] >= 0) b[t->rows[i]] += sum;
    }
    for (int k = 0; k < t->added; k++)
        if (t->multiplier[k] >= 0)
            b[t->multiplier[k]] += t->found[FOUND * t->equation[k]] - t->shift[t->equation[k]];
    return 0;
}

/* ---- derivatives ------------------------------------------------------------------------------------------------- */

/* The change of the reactions with small motions of the nodes where they act, (pairs, 6, 6). */
static void find_change(ties *t, double load_factor)
{
    double found[4 * SMALL * SMALL];
    if (t->known_change && t->known_at == load_factor) return;
    find_ties(t, load_factor);
    put_motion(t, t->acting, load_factor);
    memset(t->change, 0, SMALL * SMALL * t->pairs * sizeof *t->change);
    for (int j = 0; j < t->turning; j++) {
        const int i = t->turns[j];
        t->numbers[i * t->width + t->at_multiplier] = t->multipliers[i];
        tabulate_row(t->changes, t, i, found, 4 * SMALL * SMALL);
        for (int block = 0; block < 4; block++) {
            const int pair = t->pair[4 * i + block];
            for (int k = 0; pair >= 0 && k < SMALL; k++)
                for (int l = 0; l < SMALL; l++)
                    t->change[SMALL * (SMALL * pair + k) + l] +=
                        found[2 * SMALL * (block / 2 * SMALL + k) + block % 2 * SMALL + l];
        }
    }
    t->known_change = 1;
}

/* A node's (6, block) displacement and rotation by its unknowns. */
static void move_by_unknowns(const ties *t, const double *nodal, int node, double *map)
{
    memset(map, 0, SMALL * t->block * sizeof *map);
    if (t->plane) {
        for (int k = 0; k < SMALL; k++)
            for (int j = 0; j < t->block; j++)
                map[k * t->block + j] = t->test[SMALL * (node * t->block + j) + k];
        return;
    }
    const double *q = nodal + node * t->block + 3;
    const double scale = 2 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const double a = scale * q[0], b = scale * q[1], c = scale * q[2], d = scale * q[3];
    const double turned[3][4] = {{-b, a, -d, c}, {-c, d, a, -b}, {-d, -c, b, a}};
    for (int k = 0; k < 3; k++) {
        map[k * t->block + k] = 1;
        memcpy(map + (3 + k) * t->block + 3, turned[k], sizeof turned[k]);
    }
}

/* c = factor a b for a (n, m), b (m, p). */
static void times(const double *a, const double *b, int n, int m, int p, double factor, double *c)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j < p; j++) {
            double sum = 0;
            for (int k = 0; k < m; k++) sum += a[i * m + k] * b[k * p + j];
            c[i * p + j] = factor * sum;
        }
}

/* Derivatives of what `add_ties` adds, into t->derivatives, see `TieRows.tangent_blocks`. */
int differentiate_ties(ties *t, double load_factor)
{
    const int n = t->block, by_end = 2 * n * t->added;
    double map[SMALL * SMALL * 2], product[SMALL * SMALL * 2];
    double *of_nodes = t->derivatives, *reactions = of_nodes + n * n * t->pairs, *equations = reactions + by_end;
    react(t, load_factor, t->multipliers, t->forces);
    find_change(t, load_factor);
    if (take_maps(t, t->acting)) return 1;
    for (int p = 0; p < t->pairs; p++) {
        move_by_unknowns(t, t->acting, t->second[p], map);
        times(t->test + SMALL * n * t->first[p], t->change + SMALL * SMALL * p, n, SMALL, SMALL, 1, product);
        times(product, map, n, SMALL, n, t->share, of_nodes + n * n * p);
    }
    for (int i = 0; t->turned && i < t->nodes; i++)
        for (int k = 0; k < n * n; k++) of_nodes[n * n * t->own[i] + k] += t->share * t->turned[n * n * i + k];
    memset(reactions, 0, 2 * by_end * sizeof *reactions);
    for (int j = 0; j < 2 * t->added; j++) {
        const int tie = t->equation[j / 2], node = t->ends[2 * tie + j % 2];
        if (node < 0) continue;
        move_by_unknowns(t, t->nodal, node, map);
        times(t->test + SMALL * n * node, gradient(t->amid, tie, j % 2), n, SMALL, 1, 1, reactions + n * j);
        times(gradient(t->found, tie, j % 2), map, 1, SMALL, n, 1, equations + n * j);
    }
    return 0;
}

/* out: (pairs, n, n) of the second variation, see `TieRows.second_variation`; axes: (n, 6). */
void vary_ties(ties *t, double load_factor, const double *axes, int n, double *out)
{
    double symmetric[SMALL * SMALL], across[SMALL * SMALL], product[SMALL * SMALL];
    find_change(t, load_factor);
    for (int k = 0; k < SMALL; k++)
        for (int j = 0; j < n; j++) across[k * n + j] = axes[SMALL * j + k];
    for (int p = 0; p < t->pairs; p++) {
        const double *here = t->change + SMALL * SMALL * p, *there = t->change + SMALL * SMALL * t->mirrored[p];
        for (int k = 0; k < SMALL; k++)
            for (int l = 0; l < SMALL; l++)
                symmetric[SMALL * k + l] = 0.5 * (here[SMALL * k + l] + there[SMALL * l + k]);
        times(axes, symmetric, n, SMALL, SMALL, 1, product);
        times(product, across, n, SMALL, n, 1, out + n * n * p);
    }
}

/* Stiffnesses (ties,) of springs in place of all equations, see `TieRows.springs`, which are added to out (pairs, n, n)
   unless that is 0. */
void spring_ties(ties *t, double load_factor, const double *axes, int n, const double *resistance, double *stiffness,
                 double *out)
{
    double along[2 * SMALL];
    find_ties(t, load_factor);
    for (int i = 0; i < t->count; i++) {
        double largest = 0;
        for (int end = 0; end < 2; end++)
            for (int j = 0; j < n; j++) {
                const int node = t->ends[2 * i + end];
                double sum = 0;
                for (int k = 0; k < SMALL; k++) sum += gradient(t->found, i, end)[k] * axes[SMALL * j + k];
                along[n * end + j] = sum;
                if (node >= 0) largest = fmax(largest, sum * sum * resistance[n * node + j]);
            }
        stiffness[i] = t->held * largest;
        for (int block = 0; out && block < 4; block++) {
            const int pair = t->pair[4 * i + block];
            for (int k = 0; pair >= 0 && k < n; k++)
                for (int l = 0; l < n; l++)
                    out[n * (n * pair + k) + l] +=
                        stiffness[i] * along[n * (block / 2) + k] * along[n * (block % 2) + l];
        }
    }
}

/* The part of supports and joints in the second variation, (pairs, n, n), with springs whose scales `resistance`
   (nodes, n) follow from the elements' diagonal on the interface. */
void hold_variation(const tied_variation *v, double load_factor, const double *diagonal)
{
    ties *t = v->ties;
    const int n = v->size;
    vary_ties(t, load_factor, v->axes, n, v->blocks);
    for (int i = 0; i < t->nodes * n; i++) {
        const double own = v->blocks[n * n * t->own[i / n] + i % n * (n + 1)];
        v->resistance[i] = fabs((v->places[i] < 0 ? 0 : diagonal[v->places[i]]) + own);
    }
    spring_ties(t, load_factor, v->axes, n, v->resistance, v->stiffness, v->blocks);
}

/* ---- the interface ----------------------------------------------------------------------------------------------- */

/* The matrix: the sum of the segments' condensed matrices and of what constraint equations add (or 0). */
void assemble_dense(dense *d, const double *condensed, const double *others)
{
    memset(d->matrix, 0, (size_t)d->size * d->size * sizeof *d->matrix);
    for (int i = 0; i < d->entries; i++) {
        if (i >= d->condensed && !others) break;
        if (d->entry[i] >= 0) d->matrix[d->entry[i]] += i < d->condensed ? condensed[i] : others[i - d->condensed];
    }
}

static inline double dot(const double *restrict a, const double *restrict b, int n)
{
    double sum = 0;
#pragma omp simd reduction(+ : sum)
    for (int i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

/* LU factors of F, whose rows are scaled first: those of thick and of thin rods and of constraint equations then
   compete as pivots whatever their units. scale: (n,) of the rows, powers of two; work: (2 n + BESIDE,).
   Returns 0, or 1 if it is singular. */
static int factor_dense(double *F, int n, int wide, int *row, int *column, double zero, double *scale,
                        double *work)
{
    for (int i = 0; i < n; i++) {
        double *f = F + (size_t)i * wide, largest = 0;
        int power = 0;
        for (int j = 0; j < n; j++) largest = fmax(largest, fabs(f[j]));
        if (largest > 0 && isfinite(largest)) frexp(largest, &power);
        scale[i] = ldexp(1, -power);
        for (int j = 0; j < n; j++) f[j] *= scale[i];
        row[i] = column[i] = i;
    }
    return reduce(F, n, wide, n, 0, row, column, zero, 0, work, work + n) < n;
}

/* Replace b by the solution, by the factors. */
static void solve_dense(const double *F, int n, int wide, const int *row, const int *column, const double *scale,
                        double *b, double *work)
{
    for (int i = 0; i < n; i++) work[i] = scale[row[i]] * b[row[i]];
    for (int i = 1; i < n; i++) work[i] -= dot(F + (size_t)i * wide, work, i);
    for (int i = n - 1; i >= 0; i--) {
        const double *f = F + (size_t)i * wide;
        work[i] = (work[i] - dot(f + i + 1, work + i + 1, n - i - 1)) / f[i];
    }
    for (int i = 0; i < n; i++) b[column[i]] = work[i];
}

/* Factors of the matrix, which stays. Returns 0, or 1 if it is singular. */
int factor_matrix(dense *d, double zero)
{
    const int n = d->size, wide = round_up(n);
    for (int i = 0; i < n; i++) {
        double *row = d->factors + (size_t)i * wide;
        memcpy(row, d->matrix + (size_t)i * n, n * sizeof *row);
        memset(row + n, 0, (wide - n) * sizeof *row);
    }
    return factor_dense(d->factors, n, wide, d->row, d->column, zero, d->scale, d->work);
}

void solve_matrix(const dense *d, double *b)
{
    solve_dense(d->factors, d->size, round_up(d->size), d->row, d->column, d->scale, b, d->work);
}

/* Whether the symmetric matrix is positive definite, by Cholesky's factors of it scaled to a diagonal of ones, which is
   more accurate than eigenvalues in the signs of small ones; then the logarithm of its determinant. */
int is_positive(dense *d, double *logarithm)
{
    const int n = d->size;
    double *F = d->factors;
    *logarithm = 0;
    for (int i = 0; i < n; i++) {
        const double size = sqrt(fabs(d->matrix[(size_t)i * n + i]));
        d->scale[i] = 1 / (size > 0 ? size : 1);
        *logarithm -= 2 * log(d->scale[i]);
    }
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            double sum = d->scale[i] * d->matrix[(size_t)i * n + j] * d->scale[j];
            for (int k = 0; k < j; k++) sum -= F[(size_t)i * n + k] * F[(size_t)j * n + k];
            if (j < i) F[(size_t)i * n + j] = sum / F[(size_t)j * n + j];
            else if (!(sum > 0)) return 0;
            else F[(size_t)i * n + i] = sqrt(sum), *logarithm += log(sum);
        }
    return 1;
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
