/* Laws of friction: their values, and the slips that belong to forces; linear controls of the drive. Both models of
   strings stand on them. */
#include "strings.h"

#include <math.h>
#include <string.h>

enum { MOST = 100 };

static double call_law(void *self, double slip, double load, double *slope);

/* The interval of ascending numbers (count + 1,) in which x is, the first or the last one beyond them. */
static int interval_of(const double *ends, int count, double x)
{
    int low = 0, high = count;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (x < ends[middle]) high = middle;
        else low = middle;
    }
    return low;
}

/* Whether a load is above those of a table, by more than rounding. */
static inline int beyond(const curve *law, double load) { return load > law->loads[law->rows - 1] * (1 + 1e-9); }

/* Hermite's shares of value and slope by the load of a row, and of the next one. */
static void shares(const curve *law, int row, double load, double *share)
{
    const double h = law->loads[row + 1] - law->loads[row], t = (load - law->loads[row]) / h;
    share[0] = (1 + 2 * t) * (1 - t) * (1 - t), share[1] = h * t * (1 - t) * (1 - t);
    share[2] = t * t * (3 - 2 * t), share[3] = h * t * t * (t - 1);
}

/* The torque of a motor with a curve at a speed of its rotor, less that at rest, and its slope; straight beyond. */
static double torque_of_motor(const curve *law, double speed, double *slope)
{
    const double at = fmin(fmax(speed, law->knots[0]), law->knots[law->count]);
    const int k = interval_of(law->knots, law->count, at);
    const double *c = law->cubics + 4 * (size_t)k, t = at - law->knots[k];
    *slope = (3 * c[0] * t + 2 * c[1]) * t + c[2];
    return ((c[0] * t + c[1]) * t + c[2]) * t + c[3] + *slope * (speed - at);
}

/* The largest torque at rest of a law of the bit under a load. */
static double rests(const friction *f)
{
    const curve *law = f->other;
    double slope, share[4];
    if (law->rows < 2 || beyond(law, f->load)) return call_law(law->self, 0, f->load, &slope);
    const int row = interval_of(law->loads, law->rows - 1, f->load);
    const double *R = law->still + row, *rise = R + law->rows;
    shares(law, row, f->load, share);
    return fmax(share[0] * R[0] + share[1] * rise[0] + share[2] * R[1] + share[3] * rise[1], 0);
}

/* R of a law that is a function in Python, at a slip s > 0, and its slope; NaN where that function fails. */
static __attribute__((noinline, cold)) double resistance_of_other(const friction *f, double s, double *slope)
{
    const curve *law = f->other;
    double R;
    if (!law->rows || (law->self && beyond(law, f->load)))
        R = call_law(law->self, f->reach * s, f->load, slope);
    else {
        const double x = law->logarithmic ? log(f->reach * s) : f->reach * s, last = law->knots[law->count];
        const double at = fmin(fmax(x, law->first), last);
        const int k = law->logarithmic ? (int)fmin((at - law->first) / law->width, law->count - 1)
                                       : interval_of(law->knots, law->count, at);
        const int row = law->rows > 1 ? interval_of(law->loads, law->rows - 1, f->load) : 0;
        const double t = law->logarithmic ? at - law->first - k * law->width : at - law->knots[k];
        double share[4] = {1, 0, 0, 0};
        if (law->rows > 1) shares(law, row, f->load, share);
        R = *slope = 0;
        for (int i = 0; i < 4; i++) {
            if (share[i] == 0) continue;
            const double *c = (i % 2 ? law->rise : law->cubics) + 4 * ((size_t)(row + i / 2) * law->count + k);
            R += share[i] * (((c[0] * t + c[1]) * t + c[2]) * t + c[3]);
            *slope += share[i] * ((3 * c[0] * t + 2 * c[1]) * t + c[2]);
        }
        if (x < law->first || x > last || R < 0) *slope = 0;
        if (law->logarithmic && *slope != 0) *slope /= f->reach * s;
        R = fmax(R, 0);
    }
    *slope *= f->scale * f->reach;
    return f->scale * R;
}

static inline double resistance(const friction *f, double s)
{
    double slope;
    if (f->other) return resistance_of_other(f, s, &slope);
    return f->slipping + (f->decay > 0 ? (f->still - f->slipping) * exp(-s / f->decay) : 0);
}

/* The steepest fall of R, left out where it drops. */
static inline double fall(const friction *f)
{
    if (f->other) return f->scale * f->reach * f->other->fall;
    return f->decay > 0 ? (f->still - f->slipping) / f->decay : 0;
}

/* Whether several slips may belong to a force rho s + R(s). */
static inline int several(const friction *f, double rho)
{
    return f->other ? f->scale * f->reach * f->other->drop > rho : f->still - f->slipping > rho * f->decay;
}

/* See `slides`: by Newton's method from the right, kept between slips at which the sum is too small and too large. */
static __attribute__((noinline, cold)) double slides_by_other(const friction *f, double rho, double F, double *R,
                                                               double *slope, long long *iterations)
{
    const double enough = 1e-14 * F / rho;
    double low = 0, high = F / rho, s = high;
    for (int i = 0; i < MOST; i++) {
        ++*iterations;
        *R = resistance_of_other(f, s, slope);
        const double sum = rho * s + *R - F, steep = rho + *slope;
        if (isnan(sum)) return NAN;
        if (sum > 0)
            high = s;
        else
            low = s;
        double next = s - sum / steep;
        /* a change below rounding leaves the bounds, too: it is the end, and no reason to halve */
        const int close = steep > 0 && fabs(next - s) <= enough;
        if (!(steep > 0) || ((next <= low || next >= high) && !close)) next = (low + high) / 2;
        const double change = fabs(next - s);
        s = next;
        if (change <= enough) break;
    }
    return s > 1e-12 * F / rho ? s : 0;
}

/* The largest slip s with rho s + R(s) = F where that sum grows, with R and its slope there; 0 where there is none. The
   sum of the exponential law is convex, and Newton's method comes down from the right. */
static inline double slides(const friction *f, double rho, double F, double *R, double *slope, long long *iterations)
{
    if (f->other) return slides_by_other(f, rho, F, R, slope, iterations);
    double s = (F - f->slipping) / rho, falling = 0;
    const double more = f->still - f->slipping, enough = 1e-14 * F / rho;
    *slope = 0;
    *R = f->slipping;
    if (s <= 0) return 0;
    if (more > 0 && f->decay > 0) {
        for (int i = 0; i < MOST; i++) {
            falling = more * exp(-s / f->decay);
            const double steep = rho - falling / f->decay;
            ++*iterations;
            if (steep <= 0) return 0;
            const double change = (rho * s + f->slipping + falling - F) / steep;
            s -= change;
            if (s <= 0) return 0;
            if (fabs(change) <= enough) break;
        }
        *slope = -falling / f->decay;
        *R += falling;
    }
    return s;
}

/* The mean torque that a drive hands down in a step of the length h: given + gain (Om - om) - inertia 2/h (om -
   before); of a speed that acts late, `given` is its mean less the one asked for. */
typedef struct {
    double given, gain, inertia;
} command;

/* The inverse of 1 - h/2 A by Gauss and Jordan, and what follows from it. */
static void prepare(linear *c, double h)
{
    const int n = c->size, width = 2 * n;
    double *a = c->work;
    if (h == c->h) return;
    c->h = h;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            a[i * width + j] = (i == j) - h / 2 * c->A[i * n + j];
            a[i * width + n + j] = i == j;
        }
    for (int k = 0; k < n; k++) {
        int pivot = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(a[i * width + k]) > fabs(a[pivot * width + k])) pivot = i;
        for (int j = 0; j < width; j++) {
            const double kept = a[k * width + j];
            a[k * width + j] = a[pivot * width + j];
            a[pivot * width + j] = kept;
        }
        for (int i = 0; i < n; i++) {
            const double factor = a[i * width + k] / a[k * width + k];
            for (int j = 0; i != k && j < width; j++) a[i * width + j] -= factor * a[k * width + j];
        }
    }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) a[i * width + n + j] /= a[i * width + i];
    for (int k = 0; k < 2; k++) {
        c->answer[k] = c->D[k];
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++) c->answer[k] += h / 2 * c->C[i] * a[i * width + n + j] * c->B[2 * j + k];
    }
}

/* The mean y in a part of a step with the mean u, and the mean x. */
static double reply(linear *c, const double *u)
{
    const int n = c->size;
    double y = c->D[0] * u[0] + c->D[1] * u[1];
    for (int i = 0; i < n; i++) {
        c->mean[i] = 0;
        for (int j = 0; j < n; j++) {
            const double x = c->state[j] + c->h / 2 * (c->B[2 * j] * u[0] + c->B[2 * j + 1] * u[1]);
            c->mean[i] += c->work[2 * n * i + n + j] * x;
        }
        y += c->C[i] * c->mean[i];
    }
    return y;
}

/* The command of a control to a drive of an inertia. */
static command commanded(linear *c, double h, double inertia)
{
    prepare(c, h);
    if (c->late) return (command){c->waiting[1], 0, inertia};
    const double nothing[2] = {0, 0}, y = reply(c, nothing), *r = c->answer;
    if (c->of_speed) return (command){c->level - y / r[1], -(1 + r[0]) / r[1], 0};
    const double share = 1 / (1 - r[1]);
    return (command){share * (y - r[1] * c->level), share * r[0], share * inertia};
}

/* Whether the speed of the drive follows from what a control has seen before, whatever the torque now. */
static inline int imposes(const linear *c) { return c->used && c->of_speed && (c->late || c->D[1] == 0); }

/* Such a speed, less the one asked for: late, at a time (s) after the begin of the present step; else now. */
static double imposed(const linear *c, double time)
{
    const double *y = c->waiting;
    double now = 0;
    if (c->late) return (y[0] + y[1]) / 2 + (y[2] - y[0]) / 2 * time / c->step;
    for (int i = 0; i < c->size; i++) now += c->C[i] * c->state[i];
    return now / (1 + c->D[0]);
}

/* A part of a step is done, with its mean Om - om and M. */
static void observe(linear *c, double error, double moment)
{
    const double u[2] = {error, moment - c->level};
    c->sum += c->h * reply(c, u);
    c->spent += c->h;
    for (int i = 0; i < c->size; i++) c->state[i] = 2 * c->mean[i] - c->state[i];
}

/* A step is done. */
static void wait_on(linear *c)
{
    memmove(c->waiting, c->waiting + 1, c->late * sizeof *c->waiting);
    c->waiting[c->late] = c->sum / c->spent;
    c->sum = c->spent = 0;
}
