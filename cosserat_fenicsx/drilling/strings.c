/* Laws of friction: their values, and the slips that belong to forces. Both models of strings stand on them. */
#include "strings.h"

#include <math.h>
#include <string.h>

enum { MOST = 100 };

static double call_law(void *self, double slip, double load, double *slope);

/* R of a law that is a function in Python, at a slip s > 0, and its slope; NaN where that function fails. */
static __attribute__((noinline, cold)) double resistance_of_other(const friction *f, double s, double *slope)
{
    const curve *law = f->other;
    double R;
    if (law->self)
        R = call_law(law->self, f->reach * s, f->load, slope);
    else {
        const double x = (log(f->reach * s) - law->first) / law->width;
        const int k = (int)fmin(fmax(x, 0), law->count - 1);
        const double t = law->width * (fmin(fmax(x, 0), law->count) - k), *c = law->cubics + 4 * k;
        R = ((c[0] * t + c[1]) * t + c[2]) * t + c[3];
        *slope = x < 0 || x > law->count ? 0 : ((3 * c[0] * t + 2 * c[1]) * t + c[2]) / (f->reach * s);
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
static __attribute__((noinline, cold)) double slides_by_other(const friction *f, double rho, double F, double *R, double *slope, long long *iterations)
{
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
        if (!(steep > 0) || next <= low || next >= high) next = (low + high) / 2;
        const double change = fabs(next - s);
        s = next;
        if (change <= 1e-14 * F / rho) break;
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
