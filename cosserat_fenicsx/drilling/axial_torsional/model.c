/* The equations of a step of the implicit midpoint rule for the mean velocities w:
   (2 M/h + C + h/2 K) w = 2 M/h v - K x - friction - bit + drive. */
#include "model.h"

#include <math.h>
#include <string.h>

enum { ITERATIONS = 60, PATIENCE = 15, HALVINGS = 12 };
enum { AXIAL = 1, TURN = 2 }; /* bits of masks; of one unknown alone only the second */

static inline int bit_of(const model *m, int d) { return m->dofs == 1 ? TURN : 1 << d; }

/* Whether a set-valued law acts on the bit along the axis. */
static inline int pushed(const model *m) { return m->bit.rock || m->bit.flat > 0; }

/* Whether the bit stands on a rock that does not give way. */
static inline int on_rigid(const model *m) { return m->bit.rock && m->bit.stiffness == 0; }

/* Largest friction forces at the nodes from the tension now: the normal force of the soft string,
   |T k n + w (e - (e.t) t)|. */
void limits(model *m)
{
    const int n = m->dofs;
    memset(m->limit, 0, 3 * (size_t)m->nodes * sizeof *m->limit);
    for (int p = 0; p < m->pieces; p++) {
        const double *x = m->x + (size_t)m->element[p] * n;
        double T = m->tension[p];
        if (n == 2 && !m->fixed) T += m->spring[2 * m->element[p]] * (x[2] - x[0]);
        const double q = m->curvature[p] * T + m->across[p];
        const double N = m->length[p] * sqrt(q * q + m->aside[p] * m->aside[p]);
        const double part[2] = {(1 - m->share[p]) * N, m->share[p] * N};
        for (int i = 0; i < 2; i++) {
            double *limit = m->limit + 3 * (size_t)(i ? m->second[p] : m->first[p]);
            limit[0] += m->still[p] * part[i];
            limit[1] += m->slipping[p] * part[i];
            limit[2] += m->still[p] * part[i] * m->radius[p];
        }
    }
    for (int i = 0; i < m->nodes; i++) {
        double *limit = m->limit + 3 * (size_t)i;
        if (limit[0] > 0) limit[2] /= limit[0];
    }
}

/* The matrix for steps of the length h, and what a node feels as its own inverse compliance, 1/(A^-1)_ii, which is the
   best factor of proximal steps. 0 where the matrix is not positive. */
int build(model *m, double h)
{
    const int n = m->dofs, last = m->nodes - 1;
    if (h == m->h) return 1;
    m->h = h;
    for (int i = 0; i <= last; i++)
        for (int d = 0; d < n; d++) {
            const int j = i * n + d;
            m->a[j] = 2 / h * m->mass[j] + m->drag[j];
            if (i) m->a[j] += h / 2 * m->spring[j - n];
            if (i < last) {
                m->a[j] += h / 2 * m->spring[j];
                m->o[j] = 2 / h * m->mass_off[j] + m->drag_off[j] - h / 2 * m->spring[j];
            }
        }
    for (int d = 0; d < n; d++) {
        const upper *top = m->top + d;
        if (!top->rigid) m->a[d] += top->proportional + h / 2 * top->integral;
        double above = top->rigid ? INFINITY : m->a[d], below = m->a[last * n + d];
        for (int j = n + d; j <= last * n + d; j += n) {
            above = m->rho[j] = m->a[j] - m->o[j - n] * m->o[j - n] / above;
            if (!(above > 0)) return 0;
        }
        m->rho[d] = m->a[d];
        for (int j = (last - 1) * n + d; j >= 0; j -= n) {
            m->rho[j] -= m->o[j] * m->o[j] / below;
            below = m->a[j] - m->o[j] * m->o[j] / below;
        }
    }
    return 1;
}

/* Whether all laws are single-valued in steps of the length h: with the steepest slopes of all falling laws at once the
   matrices stay positive. Returns the smallest pivot over its diagonal. */
double steepest(model *m, double h)
{
    const int n = m->dofs, last = m->nodes - 1, turn = n - 1;
    double smallest = 1;
    if (!build(m, h)) return -1;
    for (int d = 0; d < n; d++) {
        double pivot = INFINITY;
        for (int i = m->top[d].rigid; i <= last; i++) {
            const int j = i * n + d;
            const double *limit = m->limit + 3 * (size_t)i, r = limit[2];
            const double decay = m->of_rotation ? m->decay * r : m->decay;
            double slope = decay > 0 ? (limit[0] - limit[1]) / decay * (d == turn ? r * r : 1) : 0;
            if (i == last && d == turn && m->bit.law && m->bit.decay > 0)
                slope += (m->bit.still - m->bit.slipping) * (m->bit.weighs ? m->bit.weight : 1) / m->bit.decay;
            pivot = m->a[j] - slope - (i ? m->o[j - n] * m->o[j - n] / pivot : 0);
            smallest = fmin(smallest, pivot / m->a[j]);
            if (!(pivot > 0)) return smallest;
        }
    }
    return smallest;
}

/* b = 2 M/h v - K x + drive, with the mean signals of the step. */
static void loads(model *m, double h, const double *signal)
{
    const int n = m->dofs, last = m->nodes - 1;
    const double *v = m->v, *x = m->x;
    for (int i = 0; i <= last; i++)
        for (int d = 0; d < n; d++) {
            const int j = i * n + d;
            double p = m->mass[j] * v[j], f = 0;
            if (i) p += m->mass_off[j - n] * v[j - n], f -= m->spring[j - n] * (x[j] - x[j - n]);
            if (i < last) p += m->mass_off[j] * v[j + n], f += m->spring[j] * (x[j + n] - x[j]);
            m->b[j] = 2 / h * p + f;
        }
    for (int d = 0; d < n; d++) {
        const upper *top = m->top + d;
        if (!top->rigid)
            m->b[d] += top->constant + top->proportional * signal[d]
                       + top->integral * (top->error + h / 2 * signal[d]);
    }
    for (int d = 0; d < n; d++) m->b[last * n + d] -= m->bit.force[d + 2 - n];
    if (n == 2) m->b[2 * last] += m->bit.hanging; /* a part of what the bit bears is in the tension at rest */
}

/* The force on a node that is missing in its equation without laws: b - A w. */
static double missing(const model *m, int i, int d)
{
    const int n = m->dofs, last = m->nodes - 1, j = i * n + d;
    double r = m->b[j] - m->a[j] * m->w[j];
    if (i) r -= m->o[j - n] * m->w[j - n];
    if (i < last)
        r -= m->o[j] * m->w[j + n];
    else
        for (int k = 0; k < n; k++) r -= m->bit.tangent[2 * (d + 2 - n) + k + 2 - n] * m->w[j - d + k];
    return r;
}
