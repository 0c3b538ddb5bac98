/* The soft string of softstring.py, see there: piece by piece from the lower end up, on pieces and on their halves. On
   each the friction P, P' = drag N(P), follows from collocation at Gauss's points, P = drag (integral of N), solved by
   iteration; each step divides the error by more than 1/(drag curvature length), and Lipschitz's constant of N in P is
   the curvature whatever turns round. SI units. Arrays belong to numpy. */

#include <float.h>
#include <math.h>

enum { POINTS = 8, PLACES = 10, STEPS = 60, TERMS = 10, SUMS = 6, ROW = 12 };

/* Of a string on n pieces: rows (9, n) length, weight, curvature, t, n, b, drag, turn, climb; see `Chain`. tables: see
   `_TABLES` in softstring.py. tension, torque: at the lower end. Returns 0, or 1 where the iteration does not converge;

   pieces: (n, 12) error of the force that friction adds to hook load (N) and torque (N m), and the load V (N/m) at the
   lower end, at the points, and at the upper end;
   halves: NULL, or of the 2n halves length, t, n, force of the wall (N), and then at the 10 places of each tension,
   torque and force of the wall per length;
   sums: both errors, the sizes that they are compared with, hook load and surface torque. */
extern int soft_string(int n, const double *chain, const double *tables, double tension, double torque, double *pieces,
                       double *halves, double *sums);

/* The sums of many strings on the same pieces, which differ in weight (cases, n), friction (cases, n), tension and
   torque (cases): found (cases, 6), NaN where the iteration does not converge. slip: (3, n) of `Pieces`, from the lower
   end up: axial, around, contact radius; coulomb: 0 without the root of Coulomb's law. work: (21, n). */
extern void soft_strings(int cases, int n, const double *chain, const double *tables, const double *slip, int coulomb,
                         const double *weight, const double *friction, const double *tension, const double *torque,
                         double *work, double *found);

typedef struct {
    const double *at, *up_to, *weights, *halves, *last; /* see `_TABLES` */
} rule;

typedef struct {
    double length, weight, curvature, t, n, b, drag, turn, climb;
} piece;

typedef struct {                                  /* at the places of a piece */
    double across[PLACES], height[PLACES];        /* weight along the normal (N/m); weight of what is below (N) */
    double V[PLACES], N[PLACES], P[PLACES];
    double force;                                 /* integral of N */
} solution;

static inline double larger(double a, double b) { return a < b ? b : a; } /* fmax is a call */

/* sin(a)/a and (1 - cos a)/a^2 by their series in a^2, where a is at most 1. */
static const double SINE[TERMS] = {1.0, -1.0 / 6, 1.0 / 120, -1.0 / 5040, 1.0 / 362880, -1.0 / 39916800,
    1.0 / 6227020800.0, -1.0 / 1307674368000.0, 1.0 / 355687428096000.0, -1.0 / 121645100408832000.0};
static const double COSINE[TERMS] = {1.0 / 2, -1.0 / 24, 1.0 / 720, -1.0 / 40320, 1.0 / 3628800, -1.0 / 479001600.0,
    1.0 / 87178291200.0, -1.0 / 20922789888000.0, 1.0 / 6402373705728000.0, -1.0 / 2432902008176640000.0};

static void geometry(const rule *rule, const piece *p, solution *s)
{
    double first[PLACES], second[PLACES], angle = p->curvature * p->length;
    if (fabs(angle) <= 1.0) {
        double z[PLACES];
        #pragma omp simd
        for (int i = 0; i < PLACES; i++) {
            z[i] = angle * rule->at[i] * (angle * rule->at[i]);
            first[i] = SINE[TERMS - 1];
            second[i] = COSINE[TERMS - 1];
        }
        for (int k = TERMS - 2; k >= 0; k--) {
            #pragma omp simd
            for (int i = 0; i < PLACES; i++) {
                first[i] = first[i] * z[i] + SINE[k];
                second[i] = second[i] * z[i] + COSINE[k];
            }
        }
    } else {
        for (int i = 0; i < PLACES; i++) {
            double a = angle * rule->at[i], half = a != 0.0 ? sin(a / 2) / (a / 2) : 1.0;
            first[i] = a != 0.0 ? sin(a) / a : 1.0;
            second[i] = half * half / 2;
        }
    }
    #pragma omp simd
    for (int i = 0; i < PLACES; i++) {
        double u = p->length * rule->at[i], a = angle * rule->at[i];
        s->across[i] = p->weight * (p->n * (1.0 - a * a * second[i]) + p->t * a * first[i]);
        s->height[i] = p->weight * u * (p->t * first[i] - p->n * a * second[i]);
    }
}

/* V and N at the places from `from` to before `to`, with the tension T at the lower end. */
static inline void loads(const piece *p, double T, solution *s, int from, int to)
{
    double along = p->weight * p->b, square = along * along;
    #pragma omp simd
    for (int i = from; i < to; i++) {
        s->V[i] = p->curvature * (T + s->height[i] + s->P[i]) + s->across[i];
        s->N[i] = sqrt(s->V[i] * s->V[i] + square);
    }
}

/* out (count,) = the columns of a table (8, count) times values at the points. */
static inline void times(const double *table, const double *values, int count, double *out)
{
    #pragma omp simd
    for (int i = 0; i < count; i++)
        out[i] = 0.0;
    for (int j = 0; j < POINTS; j++) {
        #pragma omp simd
        for (int i = 0; i < count; i++)
            out[i] += table[j * count + i] * values[j];
    }
}

/* P at the places of a piece, from a guess at the points, and its force. Returns 1 where it does not converge. */
static int solve(const rule *rule, const piece *p, double T, solution *s)
{
    double before = HUGE_VAL, reach = fabs(p->drag) * p->curvature * p->length;
    for (int step = 0; step < STEPS; step++) {
        double new[POINTS], change = 0.0, size = fabs(T);
        loads(p, T, s, 1, POINTS + 1);
        times(rule->up_to, s->N + 1, POINTS, new);
        for (int i = 0; i < POINTS; i++) {
            new[i] *= p->drag * p->length;
            change = larger(change, fabs(new[i] - s->P[i + 1]));
            size = larger(size, fabs(new[i]));
            s->P[i + 1] = new[i];
        }
        size += fabs(s->height[PLACES - 1]);
        /* N belongs to P before this step; the force that it lacks is at most reach times the change */
        if (change * (reach < 1.0 ? reach : 1.0) <= DBL_EPSILON * size ||
            (change <= 1e-10 * size && change >= before / 4)) {
            double sum = 0.0;
            for (int i = 0; i < POINTS; i++)
                sum += rule->weights[i] * s->N[i + 1];
            s->force = sum * p->length;
            s->P[0] = 0.0;
            s->P[PLACES - 1] = p->drag * s->force;
            return !isfinite(s->force);
        }
        before = change;
    }
    return 1;
}

/* Errors of a force by the decay of Legendre's coefficients of the load, squared by Gauss's rule; and by sharp turns of
   the load between two points, which comparisons may miss. */
static double doubts(const rule *rule, const piece *p, const solution *s)
{
    double along = fabs(p->weight * p->b), found = 0.0, most = DBL_MIN, steps[PLACES - 1];
    for (int k = 0; k < 2; k++) {
        double sum = 0.0;
        for (int i = 0; i < POINTS; i++)
            sum += rule->last[k * POINTS + i] * s->N[i + 1];
        found += sum * sum;
    }
    for (int i = 1; i <= POINTS; i++)
        most = larger(most, s->N[i]);
    found = found / most * p->length;
    int sharp = 0;
    for (int i = 0; i < PLACES - 1; i++) {
        steps[i] = fabs(s->V[i + 1] - s->V[i]);
        sharp |= along < steps[i];
    }
    if (!sharp)
        return found;
    /* inside: a part of the triangle over the step; beside an end: the triangle that has the wrong sign, twice, and
       the contribution of the load along the binormal */
    for (int i = 0; i < PLACES - 1; i++) {
        double width = (rule->at[i + 1] - rule->at[i]) * p->length, end = s->V[i ? PLACES - 1 : 0];
        double beside = s->V[i ? POINTS : 1];
        if (!(along < steps[i]))
            continue;
        if ((i == 0 || i == PLACES - 2) && fabs(end) < steps[i])
            found += 2 * ((end * beside < 0 ? end * end : 0.0) + along * along) * width / steps[i];
        else if ((i && i < PLACES - 2) && s->V[i + 1] * s->V[i] < 0)
            found += steps[i] * width / 4;
    }
    return found;
}

/* What is kept of a half: see `halves` of soft_string. */
static void keep(const rule *rule, const piece *p, const solution *s, double T, double torque, long i, long m,
                 double *to)
{
    double turned[POINTS];
    times(rule->up_to, s->N + 1, POINTS, turned);
    to[i] = p->length;
    to[m + i] = p->t;
    to[2 * m + i] = p->n;
    to[3 * m + i] = s->force / p->climb;
    double *tension = to + 4 * m + PLACES * i, *moment = tension + PLACES * m, *side = moment + PLACES * m;
    for (int j = 0; j < PLACES; j++) {
        double integral = j == 0 ? 0.0 : j == PLACES - 1 ? s->force : turned[j - 1] * p->length;
        tension[j] = T + s->height[j] + s->P[j];
        moment[j] = torque + p->turn * integral;
        side[j] = s->N[j] / p->climb;
    }
}

int soft_string(int n, const double *chain, const double *tables, double tension, double torque, double *pieces,
                double *halves, double *sums)
{
    rule rule = {tables, tables + 10, tables + 74, tables + 82, tables + 210};
    double coarse = tension, fine = tension, high = 0.0, scale = fabs(tension), largest = fabs(torque), grown = 0.0;
    for (int i = 0; i < n; i++) {
        const double *c = chain + i;
        piece p = {c[0], c[n], c[2L * n], c[3L * n], c[4L * n], c[5L * n], c[6L * n], c[7L * n], c[8L * n]};
        solution s, half;
        double *row = pieces + (long)ROW * i, guess[2 * POINTS];
        geometry(&rule, &p, &s);
        double load = hypot(p.curvature * coarse + s.across[0], p.weight * p.b);
        for (int j = 1; j <= POINTS; j++)
            s.P[j] = p.drag * load * p.length * rule.at[j];
        if (solve(&rule, &p, coarse, &s))
            return 1;
        loads(&p, coarse, &s, 0, PLACES);
        for (int j = 0; j < PLACES; j++)
            row[2 + j] = s.V[j];
        times(rule.halves, s.P + 1, 2 * POINTS, guess);
        double force = 0.0, doubt = 0.0;
        for (int side = 0; side < 2; side++) {
            piece part = p;
            part.length = p.length / 2;
            if (side) {
                double angle = p.curvature * part.length, sine = sin(angle), cosine = cos(angle);
                part.t = p.t * cosine - p.n * sine;
                part.n = p.n * cosine + p.t * sine;
            }
            geometry(&rule, &part, &half);
            for (int j = 0; j < POINTS; j++)
                half.P[j + 1] = guess[side * POINTS + j] - p.drag * force;
            if (solve(&rule, &part, fine, &half))
                return 1;
            loads(&part, fine, &half, 0, PLACES);
            if (halves)
                keep(&rule, &part, &half, fine, torque, 2L * i + side, 2L * n, halves);
            force += half.force;
            doubt += doubts(&rule, &part, &half);
            high += fabs(half.height[PLACES - 1]);
            fine += half.height[PLACES - 1] + half.P[PLACES - 1];
            torque += p.turn * half.force;
            scale = larger(scale, fabs(fine));
            largest = larger(largest, fabs(torque));
        }
        row[1] = 2 * (fabs(s.force - force) + doubt);
        coarse += s.height[PLACES - 1] + s.P[PLACES - 1];
    }
    sums[0] = sums[1] = 0.0;
    for (int i = n - 1; i >= 0; i--) { /* friction above multiplies a change from below, at most by exp(grown) */
        double *row = pieces + (long)ROW * i, drag = fabs(chain[6L * n + i]);
        grown += drag * chain[2L * n + i] * chain[i];
        row[0] = drag * row[1] * exp(grown);
        row[1] *= chain[7L * n + i];
        sums[0] += row[0];
        sums[1] += row[1];
    }
    sums[2] = scale + high * 1e-3;
    sums[3] = largest;
    sums[4] = fine;
    sums[5] = torque;
    return 0;
}

void soft_strings(int cases, int n, const double *chain, const double *tables, const double *slip, int coulomb,
                  const double *weight, const double *friction, const double *tension, const double *torque,
                  double *work, double *found)
{
    for (long i = 0; i < 9L * n; i++)
        work[i] = chain[i];
    double *drag = work + 6L * n, *turn = work + 7L * n, *climb = work + 8L * n;
    for (long k = 0; k < cases; k++) {
        for (long i = 0; i < n; i++) {
            double mu = friction[k * n + i], around = slip[n + i] * mu;
            climb[i] = coulomb ? sqrt(1 + around * around) : 1.0;
            work[n + i] = weight[k * n + i];
            drag[i] = slip[i] * mu / climb[i];
            turn[i] = around * slip[2L * n + i] / climb[i];
        }
        if (soft_string(n, work, tables, tension[k], torque[k], work + 9L * n, 0, found + SUMS * k))
            for (int i = 0; i < SUMS; i++)
                found[SUMS * k + i] = NAN;
    }
}
