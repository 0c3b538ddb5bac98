/* Many cases of one scene: the numbers of a few are written at a time, each on two meshes of its own; they are swept
   from rest on the first, corrected on the second, and judged by both. Cases not decided here are left to Python.

   Two meshes of a case: the state of the finer one from that of the coarser, the error estimate of both, and queries.
   What is compared is said in results/compared.py, with what margins in results/accuracy.py, contact forces at nodes in
   results/recovery.py, and the states of each model in its file of models/.

   The same of the states of a path, which Python has: sizes, differences of two meshes, contact forces at nodes. */
#include "chain.h"

#include <math.h>
#include <string.h>

/* Differences of positions and of rotations up to this are rounding alone, in units of the scales' length and rad. */
static const double ROUNDING = 1e-14;
/* Sizes, in the scales' units, below which a quantity is taken to vanish; and the least moment over n times the length.
 */
static const double NOTHING = 1e-9, LEAST_MOMENT = 1e-9;
/* Differences of positions and of rotations up to this are rounding alone where displacement or rotation vanish: an
   unloaded rod holds its line to the rounding of many elements, and so does a straight column, whose load amplifies it.
 */
static const double STILL = 1e-11;
/* Least size of positions and of rotations over the largest of the path: unloaded states differ by rounding. */
static const double AT_REST = 1e-6;
/* Moments up to this multiple of their rounding at all points of a path count as zero, as in straight bars. */
static const double VANISHING = 10;
/* Multiple of their rounding up to which differences of n and m on two meshes count as zero. */
static const double NOISE = 2;
/* Exponents by which an error is extrapolated over its indicator, below and above the known range. Safety factor of
   errors interpolated over leading coefficients: exponent of the distance from the nearest sample, and largest factor.
 */
static const double BELOW = 0.7, ABOVE = 1.4, WIDENED = 0.5, WIDEST = 2;
static const double TINY = 1e-300;

static double square(const double *a, int n)
{
    double sum = 0;
    for (int i = 0; i < n; i++) sum += a[i] * a[i];
    return sum;
}

/* The largest contact force and moment at the Gauss points. */
static void largest_contact(const mesh *m, double *force, double *moment)
{
    *force = *moment = 0;
    for (int i = 0; i < m->elements * m->points; i++) {
        *force = fmax(*force, square(m->gauss + 9 * i, 3)), *moment = fmax(*moment, square(m->gauss + 9 * i + 3, 3));
    }
    *force = sqrt(*force), *moment = sqrt(*moment);
}

/* ---- the state in space ------------------------------------------------------------------------------------------ */

/* b = scale * w a for the nodal values a (p + 1, size) of an element. */
static void weigh(const double *w, int n, const double *a, int size, double scale, double *b)
{
    for (int k = 0; k < size; k++) b[k] = 0;
    for (int j = 0; j < n; j++)
        for (int k = 0; k < size; k++) b[k] += w[j] * a[j * size + k];
    for (int k = 0; k < size; k++) b[k] *= scale;
}

/* The force that statics gives at the i-th Gauss point. */
static void force_at(const mesh *m, int i, int n, double load_factor, double *force)
{
    for (int k = 0; k < n; k++)
        force[k] = load_factor * m->known[n * i + k] + (m->lasting ? m->lasting[n * i + k] : 0);
}

/* The change of strain and the moment there by the material force and change of curvature. */
static void apply_law(const mesh *m, int i, const double *force, const double *curvature, double *strain,
                      double *moment)
{
    if (!m->coupled) {
        for (int k = 0; k < 3; k++) strain[k] = force[k] / m->K[3 * i + k], moment[k] = m->J[3 * i + k] * curvature[k];
        return;
    }
    const double *A = m->coupled + 27 * i, *G = A + 9, *S = A + 18;
    for (int k = 0; k < 3; k++) {
        strain[k] = moment[k] = 0;
        for (int l = 0; l < 3; l++) {
            strain[k] += A[3 * k + l] * force[l] - G[3 * k + l] * curvature[l];
            moment[k] += G[3 * l + k] * force[l] + S[3 * k + l] * curvature[l];
        }
    }
}

/* n, m and r' of a determinate planar model at a Gauss point, in the plane: g = (n, m, r') (5,). */
static void plane_point(const mesh *m, int e, int g, const double *theta, double load_factor, double *out)
{
    const int i = e * m->points + g, n = m->p + 1;
    const double *t_R = m->R_R + 2 * i, *v_R = m->v_R + 2 * i;
    double turned, curvature, strain[3], moment[3];
    weigh(m->at_gauss + g * n, n, theta, 1, 1, &turned);
    weigh(m->slopes + g * n, n, theta, 1, 1 / m->sizes[e], &curvature);
    const double c = cos(turned), s = sin(turned);
    const double t[2] = {c * t_R[0] - s * t_R[1], s * t_R[0] + c * t_R[1]}, a[2] = {-t[1], t[0]};
    force_at(m, i, 2, load_factor, out);
    const double force[3] = {a[0] * out[0] + a[1] * out[1], 0, t[0] * out[0] + t[1] * out[1]};
    const double bent[3] = {0, curvature, 0};
    apply_law(m, i, force, bent, strain, moment);
    out[2] = moment[1];
    for (int k = 0; k < 2; k++) out[3 + k] = (v_R[0] + strain[0]) * a[k] + (v_R[1] + strain[2]) * t[k];
}

/* The same in space: out = (n, m, r') (9,), from the quaternions of the element's nodes. */
static void space_point(const mesh *m, int e, int g, const double *nodes, double load_factor, double *out)
{
    const int i = e * m->points + g, n = m->p + 1;
    const double *R_R = m->R_R + 9 * i, *v_R = m->v_R + 3 * i;
    double q[4], s[4], T[3][3], force[3], bent[3], strain[3], moment[3];
    weigh(m->at_gauss + g * n, n, nodes, 4, 1, q);
    weigh(m->slopes + g * n, n, nodes, 4, 1 / m->sizes[e], s);
    const double a = q[0], b = q[1], c = q[2], d = q[3], squared = square(q, 4);
    const double R[3][3] = {{a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)},
                            {2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)},
                            {2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d}};
    const double turn[3] = {a * s[1] - s[0] * b - (c * s[3] - d * s[2]), a * s[2] - s[0] * c - (d * s[1] - b * s[3]),
                            a * s[3] - s[0] * d - (b * s[2] - c * s[1])};
    for (int k = 0; k < 3; k++)
        for (int l = 0; l < 3; l++)
            T[k][l] = (R[k][0] * R_R[l] + R[k][1] * R_R[3 + l] + R[k][2] * R_R[6 + l]) / squared;
    force_at(m, i, 3, load_factor, out);
    for (int l = 0; l < 3; l++) {
        force[l] = T[0][l] * out[0] + T[1][l] * out[1] + T[2][l] * out[2];
        bent[l] = 2 * (R_R[l] * turn[0] + R_R[3 + l] * turn[1] + R_R[6 + l] * turn[2]) / squared;
    }
    apply_law(m, i, force, bent, strain, moment);
    for (int k = 0; k < 3; k++) {
        out[3 + k] = out[6 + k] = 0;
        for (int l = 0; l < 3; l++) out[3 + k] += T[k][l] * moment[l], out[6 + k] += T[k][l] * (v_R[l] + strain[l]);
    }
}

/* (n, m, r') of a plane as those in space. */
static void in_space(const double *axes, const double *in, double *out)
{
    for (int k = 0; k < 3; k++) {
        out[k] = in[0] * axes[k] + in[1] * axes[3 + k], out[3 + k] = in[2] * axes[6 + k];
        out[6 + k] = in[3] * axes[k] + in[4] * axes[3 + k];
    }
}

/* Positions of the nodes of all rods of a tree, in rq, from r' at the Gauss points, from the clamps outwards. */
static void place_nodes(const mesh *m, const double *gauss, double *rq)
{
    const int n = m->p + 1;
    for (const int *order = m->order; order < m->order + 3 * m->rods; order += 3) {
        const int rod = order[0], entry = m->first[rod] + order[1], first = m->p * entry + rod;
        memmove(rq + 7 * first, order[2] < 0 ? m->reference + 3 * first : rq + 7 * order[2], 3 * sizeof *rq);
        for (int k = entry; k < m->first[rod + 1] + entry - m->first[rod]; k++) {
            const int forward = k < m->first[rod + 1], e = forward ? k : m->first[rod + 1] - 1 - k + entry;
            double *at = rq + 7 * (m->p * e + rod), steps[3 * (m->p + 1)];
            for (int j = 1; j < n; j++)
                for (int i = 0; i < 3; i++) {
                    double step = 0;
                    for (int g = 0; g < m->points; g++)
                        step += m->from_slopes[j * m->points + g] * gauss[9 * (e * m->points + g) + 6 + i];
                    steps[3 * j + i] = step * m->sizes[e];
                }
            if (!forward)
                for (int i = 0; i < 3; i++) at[i] = at[7 * m->p + i] - steps[3 * m->p + i];
            for (int j = 1; j < n - !forward; j++)
                for (int i = 0; i < 3; i++) at[7 * j + i] = at[i] + steps[3 * j + i];
        }
    }
}

/* r and q of all nodes, rq (nodes, 7), and n, m and r' at the Gauss points, inertial, at a load factor from the model's
   unknowns of the nodes and its fields, if it has any. */
static void expand(const mesh *m, const double *nodal, const double *fields, double load_factor, double *rq,
                   double *gauss)
{
    const int c = m->components, plane = m->kind == IN_PLANE || m->kind == PLANAR;
    const int known = m->kind == IN_PLANE || m->kind == IN_SPACE, each = plane ? 5 : 9;
    for (int rod = 0; rod < m->rods; rod++)
        for (int e = m->first[rod]; e < m->first[rod + 1]; e++)
            for (int g = 0; g < m->points; g++, gauss += 9) {
                const double *nodes = nodal + c * (m->p * e + rod);
                double values[9];
                if (m->kind == IN_PLANE) plane_point(m, e, g, nodes, load_factor, values);
                else if (m->kind == IN_SPACE) space_point(m, e, g, nodes, load_factor, values);
                else memcpy(values, fields + each * (e * m->points + g), each * sizeof *values);
                if (plane) in_space(m->axes, values, gauss);
                else memcpy(gauss, values, sizeof values);
            }
    for (int i = 0; i < m->nodes; i++) {
        const double *w = nodal + c * i, *rest = m->reference + 3 * i, *normal = m->axes + 6;
        double *at = rq + 7 * i;
        for (int k = 0; k < 3 && m->kind == SPATIAL; k++) at[k] = w[k];
        for (int k = 0; k < 3 && m->kind == PLANAR; k++) {
            const double off = rest[0] * normal[0] + rest[1] * normal[1] + rest[2] * normal[2];
            at[k] = w[0] * m->axes[k] + w[1] * m->axes[3 + k] + off * normal[k];
        }
        if (plane) {
            const double half = w[c - 1] / 2, s = sin(half);
            at[3] = cos(half);
            for (int k = 0; k < 3; k++) at[4 + k] = s * normal[k];
        } else {
            memcpy(at + 3, w + (known ? 0 : 3), 4 * sizeof *w);
        }
    }
    if (known) place_nodes(m, gauss - 9 * m->elements * m->points, rq);
}

/* `expand` of states: (count, nodes, 7), (count, elements, points, 9). */
void expand_all(const mesh *m, int count, const double *load_factors, const double *nodal, const double *fields,
                double *rq, double *gauss)
{
    const int points = m->elements * m->points, each = fields ? m->kind == PLANAR ? 5 : 9 : 0;
    for (int k = 0; k < count; k++, fields += each * points) {
        expand(m, nodal, fields, load_factors[k], rq, gauss);
        nodal += m->nodes * m->components, rq += 7 * m->nodes, gauss += 9 * points;
    }
}

/* n and m at the nodes of all elements, see `element_contact`. */
static void recover(const mesh *m)
{
    const int n = m->p + 1;
    double density[6], *at = m->contact;
    for (int e = 0; e < m->elements; e++, at += 6 * n) {
        memset(at, 0, 6 * n * sizeof *at);
        for (int g = 0; g < m->points; g++) {
            const double *f = m->gauss + 9 * (e * m->points + g), *r_s = f + 6;
            for (int k = 0; k < 6; k++) density[k] = m->density ? m->density[6 * (e * m->points + g) + k] : 0;
            density[3] += r_s[1] * f[2] - r_s[2] * f[1], density[4] += r_s[2] * f[0] - r_s[0] * f[2];
            density[5] += r_s[0] * f[1] - r_s[1] * f[0];
            for (int j = 0; j < n; j++) {
                const double by_field = m->by_fields[j * m->points + g];
                const double by_density = m->by_densities[j * m->points + g] * m->sizes[e];
                for (int k = 0; k < 6; k++) at[6 * j + k] += by_field * f[k] + by_density * density[k];
            }
        }
    }
}

/* ---- two meshes -------------------------------------------------------------------------------------------------- */

/* The numbers of a point on the fine mesh from the state on the coarse one, which is expanded. */
static void transfer(const comparison *p, double *start)
{
    const mesh *m = p->coarse;
    const int nodal = m->nodes * m->components;
    memcpy(start, p->start, p->numbers * sizeof *start);
    for (int i = 0; i < p->moves; i++) {
        const int from = p->move_from[i];
        double value;
        if (from < nodal) {
            value = m->nodal[from] - m->rest[from];
        } else {
            const int at = (from - nodal) / m->forces, axis = (from - nodal) % m->forces;
            value = 0;
            for (int k = 0; k < 3; k++) value += m->axes[3 * axis + k] * m->gauss[9 * at + k];
        }
        start[p->move_to[i]] += p->move_weight[i] * value;
    }
}

/* The mesh with the k-th of several states. */
static mesh with_state(const mesh *m, int k, const double *motion, const double *gauss, const double *contact)
{
    mesh at = *m;
    at.motion = motion ? (double *)motion + 7 * (size_t)k * m->nodes : 0;
    at.gauss = gauss ? (double *)gauss + 9 * (size_t)k * m->elements * m->points : 0;
    at.contact = contact ? (double *)contact + 6 * (size_t)k * m->elements * (m->p + 1) : 0;
    return at;
}

/* Of states their `Sizes`, see `sizes_of`: (4, count), (count,), (2, count); held: (2, count) force and moment that
   actions without stress would need, or 0; largest: of all states contact force, moment, and its mean over an element.
 */
void measure(const mesh *model, int count, const double *motion, const double *gauss, const double *held, double *sizes,
             int *turning, int *still, double *largest)
{
    double most[2] = {0, 0}, vanishing = 1;
    for (int k = 0; k < 3; k++) largest[k] = 0;
    for (int k = 0; k < count; k++) {
        const mesh at = with_state(model, k, motion, gauss, 0), *m = &at;
        double moved = 0, turned = 0, rotation = 0, force, moment;
        for (int rod = 0; rod < m->rods; rod++) {
            double half = 0;
            for (int i = m->p * m->first[rod] + rod; i <= m->p * m->first[rod + 1] + rod; i++) {
                moved = fmax(moved, square(m->motion + 7 * i, 3));
                half = fmax(half, square(m->motion + 7 * i + 4, 3));
            }
            half = sqrt(half);
            rotation = fmax(rotation, 2 * half);
            turned = fmax(turned, sqrt(8) * half * m->gyrations[rod]); /* |R - 1| = sqrt(8) |sin(angle/2)| */
        }
        for (int e = 0; e < m->elements; e++) {
            double mean = 0;
            for (int g = 0; g < m->points; g++)
                mean += m->weights[g] * sqrt(square(m->gauss + 9 * (e * m->points + g) + 3, 3));
            largest[2] = fmax(largest[2], mean);
        }
        largest_contact(m, &force, &moment);
        largest[0] = fmax(largest[0], force), largest[1] = fmax(largest[1], moment);
        moved = fmax(sqrt(moved), NOTHING);
        if (held) force = fmax(force, LEAST_MOMENT * held[k]), moment = fmax(moment, held[count + k]);
        force = fmax(fmax(force, moment / m->length), NOTHING);
        if (moment > VANISHING * m->limits[1]) vanishing = LEAST_MOMENT;
        sizes[k] = fmax(moved, turned), sizes[count + k] = fmax(rotation, moved / m->length);
        sizes[2 * count + k] = force, sizes[3 * count + k] = moment, turning[k] = turned > moved;
        for (int i = 0; i < 2; i++) most[i] = fmax(most[i], sizes[i * count + k]);
    }
    for (int k = 0; k < count; k++) {
        double *moment = sizes + 3 * count + k;
        *moment = fmax(fmax(*moment, vanishing * model->length * sizes[2 * count + k]), NOTHING);
        for (int i = 0; i < 2; i++) {
            const double least = fmax(NOTHING / (i ? model->length : 1), AT_REST * most[i]);
            still[i * count + k] = sizes[i * count + k] <= least;
            sizes[i * count + k] = fmax(sizes[i * count + k], least);
        }
    }
}

/* (2, count, elements) sizes of the leading coefficients of displacements and of q in the elements. */
void find_leading(const mesh *m, int count, const double *motion, double *found)
{
    const size_t half = (size_t)count * m->elements;
    for (int k = 0; k < count; k++, motion += 7 * m->nodes)
        for (int rod = 0; rod < m->rods; rod++)
            for (int e = m->first[rod]; e < m->first[rod + 1]; e++, found++) {
                double leading[7];
                weigh(m->leading, m->p + 1, motion + 7 * (m->p * e + rod), 7, 1, leading);
                found[0] = sqrt(square(leading, 3)), found[half] = sqrt(square(leading + 3, 4));
            }
}

/* `recover` of states: (count, elements, p + 1, 6); density: of each, or 0. */
void recover_all(const mesh *m, int count, const double *gauss, const double *density, double *contact)
{
    for (int k = 0; k < count; k++) {
        mesh at = with_state(m, k, 0, gauss, contact);
        at.density = density ? density + 6 * (size_t)k * m->elements * m->points : 0;
        recover(&at);
    }
}

/* The values of both meshes at a place, of n weights each: displacement, q, n, m. */
static void at_place(const mesh *m, int rod, int e, const double *w, double *out)
{
    weigh(w, m->p + 1, m->motion + 7 * (m->p * e + rod), 7, 1, out);
    weigh(w, m->p + 1, m->contact + 6 * (m->p + 1) * e, 6, 1, out + 7);
}

/* The largest differences of the four quantities at all places, at ends of coarse elements, and shared, see
   `differences`; still: of positions and rotations. */
static void find_differences(const comparison *p, int turning, const int *still, double *everywhere, double *at_ends,
                             double *shared)
{
    const mesh *coarse = p->coarse, *fine = p->fine;
    const int n = fine->p + 1;
    int place = 0;
    for (int k = 0; k < 4; k++) everywhere[k] = at_ends[k] = shared[k] = 0;
    for (int rod = 0; rod < fine->rods; rod++) {
        const double less = 2.0 * (coarse->first[rod + 1] - coarse->first[rod]);
        const double share = fmin(pow(less / (fine->first[rod + 1] - fine->first[rod]), fine->p), 1);
        for (int e = coarse->first[rod]; e < coarse->first[rod + 1]; e++)
            for (int i = 0; i < p->places; i++, place++) {
                double here[13], off[13], apart[4];
                at_place(fine, rod, p->cells[place], p->weights + place * n, here);
                at_place(coarse, rod, e, p->inside + i * n, off);
                double along = 0;
                for (int k = 0; k < 13; k++) off[k] -= here[k];
                /* without the part along q, since interpolated q are no unit quaternions */
                for (int k = 3; k < 7; k++) along += off[k] * here[k];
                apart[0] = sqrt(square(off, 3)), apart[1] = 2 * sqrt(fmax(square(off + 3, 4) - along * along, 0));
                apart[2] = sqrt(square(off + 7, 3)), apart[3] = sqrt(square(off + 10, 3));
                if (turning) apart[0] = fmax(apart[0], fine->gyrations[rod] * apart[1]);
                for (int k = 0; k < 4; k++) {
                    const int at_end = i == 0 || i == p->places - 1;
                    if (!isfinite(apart[k])) apart[k] = INFINITY;
                    everywhere[k] = fmax(everywhere[k], apart[k]);
                    if (at_end) at_ends[k] = fmax(at_ends[k], apart[k]);
                    shared[k] = fmax(shared[k], at_end ? apart[k] : share * apart[k]);
                }
            }
    }
    for (int k = 0; k < 4; k++) {
        const double noise = k < 2 ? still[k] ? STILL : ROUNDING : fmax(ROUNDING, NOISE * fine->limits[k - 2]);
        if (everywhere[k] <= noise) everywhere[k] = shared[k] = 0;
    }
}

/* `find_differences` of states: (3, 4, count). */
void compare_all(const comparison *both, int count, const double *coarse_motion, const double *coarse_contact,
                 const double *motion, const double *contact, const int *turning, const int *still, double *found)
{
    for (int k = 0; k < count; k++) {
        mesh coarse = with_state(both->coarse, k, coarse_motion, 0, coarse_contact);
        mesh fine = with_state(both->fine, k, motion, 0, contact);
        const int at_rest[2] = {still[k], still[count + k]};
        double apart[3][4];
        comparison p = *both;
        p.coarse = &coarse, p.fine = &fine;
        find_differences(&p, turning[k], at_rest, apart[0], apart[1], apart[2]);
        for (int i = 0; i < 12; i++) found[i * count + k] = apart[i / 4][i % 4];
    }
}

/* Errors (count,) of a quantity from those of the samples `which`, see `spread_error`; errors: of these, relative;
   of_mesh: whether the indicator is the difference of two meshes; work: (3, known). */
static void spread_one(int count, int known, const int *which, const double *indicator, const double *sizes,
                       const double *errors, double between, int of_mesh, double *work, double *found)
{
    double *x = work, *y = work + known, *relative = work + 2 * known;
    int n = 0;
    for (int j = 0; j < known; j++) {
        const double here = indicator[which[j]], size = sizes[which[j]];
        if (!(here > 100 * ROUNDING && errors[j] * size > 0)) continue;
        int i = n++;
        for (; i > 0 && x[i - 1] > log(here); i--) x[i] = x[i - 1], y[i] = y[i - 1];
        x[i] = log(here), y[i] = log(errors[j] * size), relative[n - 1] = log(fmax(here / size, TINY));
    }
    for (int i = 1; i < n; i++) y[i] = fmax(y[i], y[i - 1]);
    for (int k = 0; k < count; k++) {
        if (!n || indicator[k] <= ROUNDING) {
            found[k] = n || !of_mesh ? 0 : indicator[k] / sizes[k];
            continue;
        }
        const double at = log(indicator[k]), of_size = log(fmax(indicator[k] / sizes[k], TINY));
        double unlike = INFINITY, beyond = BELOW * fmin(at - x[0], 0) + ABOVE * fmax(at - x[n - 1], 0);
        int i = 0;
        while (i < n - 1 && x[i + 1] <= at) i++;
        double value = y[i];
        if (i < n - 1 && at > x[i] && y[i] < y[i + 1]) value += (y[i + 1] - y[i]) * (at - x[i]) / (x[i + 1] - x[i]);
        for (int j = 0; j < n; j++) unlike = fmin(unlike, fmin(fabs(at - x[j]), fabs(of_size - relative[j])));
        if (!of_mesh) beyond += fmin(WIDENED * unlike, log(WIDEST));
        found[k] = between * exp(value + beyond) / sizes[k];
    }
}

/* The same of several quantities one after another. */
void spread_errors(int quantities, int count, int known, const int *which, const double *indicator,
                   const double *sizes, const double *errors, const double *between, int of_mesh, double *work,
                   double *found)
{
    for (int k = 0; k < quantities; k++)
        spread_one(count, known, which, indicator + k * count, sizes + k * count, errors + k * known, between[k],
                   of_mesh, work, found + k * count);
}

/* The relative differences and the errors by the meshes of the four quantities, see `estimate_error`. */
static void estimate(const comparison *p, const double *sizes, int turning, const int *still, double *relative,
                     double *errors)
{
    double apart[4], at_ends[4], shared[4];
    int ahead[4], far[4], sure = p->equal;
    const double half = pow(2, p->fine->p + 1);
    find_differences(p, turning, still, apart, at_ends, shared);
    for (int k = 0; k < 4; k++) {
        relative[k] = apart[k] / sizes[k];
        ahead[k] = apart[k] > p->ahead * at_ends[k], far[k] = apart[k] > p->far * at_ends[k];
    }
    far[2] |= far[0] && far[1] && apart[2] <= p->of_ends * at_ends[2];
    for (int k = 0; k < 4; k++) sure &= far[k] || relative[k] == 0;
    for (int k = 0; k < 4; k++) {
        const int below = sure && relative[k] < p->asymptotic && !(k == 1 && p->single);
        const double part = 1 / (below ? p->safety_below : p->safety);
        double gain = far[k] ? part * half : ahead[k] ? fmax(1, half / 16) : 1;
        if (relative[k] == 0) gain = half / p->safety_below;
        errors[k] = fmax(relative[k] / gain, p->fine->limits[4]);
    }
}

/* Whether a mesh surely resolves the state, see `surely_resolved`. */
static int resolves(const comparison *p, const mesh *m)
{
    double force, moment;
    largest_contact(m, &force, &moment);
    const double layer = m->longest / p->in_layer;
    return force * layer * layer <= m->limits[3] && moment * m->longest <= p->turned * m->limits[2];
}

/* Values and estimated errors of all queries; 0 where the two meshes suffice. */
static int answer(const comparison *p, double *values, double *errors)
{
    const mesh *fine = p->fine;
    double sizes[4], relative[4], by_mesh[4], largest[3];
    int turning, still[2];
    measure(fine, 1, fine->motion, fine->gauss, p->held, sizes, &turning, still, largest);
    estimate(p, sizes, turning, still, relative, by_mesh);
    int enough = relative[0] <= p->resolved && fine->limits[4] <= p->tol && p->coarse->limits[4] <= p->tol;
    for (int k = 0; k < 4; k++) enough &= by_mesh[k] <= p->tol;
    if (!enough || !resolves(p, p->coarse) || !resolves(p, fine)) return 1;
    for (const query *q = p->query; q < p->query + p->queries; q++) {
        double at[13];
        at_place(fine, q->rod, q->cell, q->weights, at);
        const double own = q->kind == 1 ? 2 * atan2(sqrt(square(at + 4, 3)), at[3]) : at[q->place];
        const double error = fmax(by_mesh[q->kind], q->kind < 2 ? 0 : fine->limits[q->kind - 2] / sizes[q->kind]);
        *values++ = q->offset + q->unit * own, *errors++ = error * sizes[q->kind] * q->unit;
    }
    return 0;
}

/* ---- many cases ----------------------------------------------------------------------------------------------- */

/* The whole sweeps to their load factor, from rest; those leave where a step was not decided or the rest state is not
   stable. */
static void sweep_cases(const cases *c, const group *g, int *in)
{
    int negative[LANES], why[LANES];
    for (int k = 0; k < g->count; k++) {
        sweep *s = g->sweep[k];
        s->known = 1, s->known_load_factors[0] = 0;
        memcpy(s->points, c->meshes[k]->coarse->at_rest, s->numbers * sizeof *s->points);
        s->control->step = c->first, s->control->rejections = s->control->accepted = 0;
        s->next = s->records = s->iterations = s->steps = 0;
        in[k] = !put(s, s->points, 0);
    }
    count_negative(g, in, negative);
    for (int k = 0; k < g->count; k++) {
        why[k] = in[k] && !negative[k] ? GOING : LEFT;
        g->sweep[k]->negative = 0;
    }
    run_all(g, why);
    for (int k = 0; k < g->count; k++) in[k] = why[k] == DONE;
}

/* Newton's method at the load factor from the states of the coarse mesh; those leave where it finds no stable state
   near them. */
static void correct_cases(const cases *c, const group *g, int *in)
{
    double *start[LANES], load_factor[LANES];
    for (int k = 0; k < g->count; k++) {
        sweep *s = g->sweep[k];
        start[k] = s->points, load_factor[k] = *s->load_factors, s->iterations = 0;
        if (in[k]) transfer(c->meshes[k], start[k]);
    }
    stay_near(g, in, start, load_factor, 0, c->near);
    EACH(k, g, in) {
        sweep *s = g->sweep[k];
        memcpy(s->recorded, s->work, s->newton->problem->size * sizeof *s->work);
        if (s->fields) tabulate_all(s->fields, s->recorded_fields);
    }
}

/* The state that was recorded, expanded. */
static void expand_recorded(const mesh *m)
{
    const int fields = m->kind == PLANAR ? 5 : m->kind == SPATIAL ? 9 : 0;
    for (int i = 0; i < m->nodes * m->components; i++)
        m->nodal[i] = m->from[i] < 0 ? m->rest[i] : m->sweep->recorded[m->from[i]];
    for (int i = 0; i < fields * m->elements * m->points; i++)
        m->fields[i] = m->sweep->recorded_fields[m->field_from[i]];
    expand(m, m->nodal, m->fields, *m->sweep->load_factors, m->motion, m->gauss);
    for (int i = 0; i < m->nodes; i++)
        for (int k = 0; k < 3; k++) m->motion[7 * i + k] -= m->reference[3 * i + k];
    recover(m);
}

/* Solve `count` cases from the next one on, each with meshes of its own. */
static void decide(cases *c, int count)
{
    const int queries = c->meshes[0]->queries;
    int in[LANES];
    c->coarse.count = c->fine.count = count;
    for (int k = 0; k < count; k++) {
        const double *values = c->values + (size_t)(c->next + k) * c->width;
        for (const written *w = c->written[k]; w < c->written[k] + c->parts; w++)
            for (int j = 0; j < w->count; j++) w->to[w->place[j]] = values[w->which[j]];
    }
    take_lanes(&c->coarse), take_lanes(&c->fine);
    sweep_cases(c, &c->coarse, in);
    EACH(k, &c->coarse, in) expand_recorded(c->meshes[k]->coarse);
    correct_cases(c, &c->fine, in);
    for (int k = 0; k < count; k++, c->next++) {
        const size_t at = (size_t)c->next * queries;
        if (in[k]) expand_recorded(c->meshes[k]->fine);
        c->undecided[c->next] = !in[k] || answer(c->meshes[k], c->found + at, c->errors + at);
    }
}

/* The next cases; LATER where some are left after `patience`, so that Python can obey Ctrl-C. */
int run_cases(cases *c)
{
    const double began = now();
    while (c->next < c->count) {
        const int left = c->count - c->next;
        decide(c, left < c->lanes ? left : c->lanes);
        if (now() - began > c->patience) return c->next < c->count ? LATER : DONE;
    }
    return DONE;
}
