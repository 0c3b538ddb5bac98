/* Set-valued laws: friction at the wall, a vector against the slip (V, r om), and the torque of the bit.

   Newton's method on the law's proximal map. With the force F and the slip s of an iteration, tau = F + rho s. Where
   tau is within the limit the node is held. Elsewhere the slip s* that belongs to tau, F(s*) + rho s* = tau, is found
   first, and the law is linearised there: F = F* + D (s - s*). */

static inline double length(double x, double y) { return sqrt(x * x + y * y); }

/* The slip of a law R(s) = slipping + (still - slipping) exp(-s/decay) with R(s) + rho s = tau > still, R and its slope
   there. The function is convex, and Newton's method descends to its root. */
static double foretold(double tau, double still, double slipping, double decay, double rho, double *R, double *slope)
{
    double s = (tau - slipping) / rho, falling = 0;
    if (still > slipping && decay > 0) {
        for (int i = 0; i < 50; i++) {
            falling = (still - slipping) * exp(-s / decay);
            const double step = (slipping + falling + rho * s - tau) / (rho - falling / decay);
            s = fmax(s - step, 0);
            if (fabs(step) <= 1e-14 * s) break;
        }
        *slope = -falling / decay;
    } else
        *slope = 0;
    *R = slipping + falling;
    return s;
}

/* Where the law of friction drops at once, a node is held by the static limit only while it has not slipped. */
static double threshold(const model *m, int i, int mask, double still, double slipping, double decay)
{
    if (decay > 0 || still == slipping) return still;
    return (m->held[i] & mask) == mask && !m->broken[i] ? still : slipping;
}

static double wall(model *m, int i)
{
    const int n = m->dofs;
    const double *limit = m->limit + 3 * (size_t)i, r = limit[2];
    const double decay = m->of_rotation ? m->decay * r : m->decay;
    const double s[2] = {n == 2 ? m->w[2 * i] : 0, r * m->w[i * n + n - 1]};
    const double *F = m->force + (size_t)i * n;
    double rho = m->rho[i * n + n - 1] / (r * r), *d = m->d + 3 * (size_t)i, *c = m->c + (size_t)i * n;
    if (n == 2) rho = fmin(rho, m->rho[2 * i]);
    rho *= m->ease;
    if (decay > 0) rho = fmax(rho, 2 * (limit[0] - limit[1]) / decay);
    const double tau[2] = {n == 2 ? F[0] + rho * s[0] : 0, F[n - 1] + rho * s[1]};
    const double size = length(tau[0], tau[1]);
    const int both = n == 2 ? AXIAL | TURN : TURN;
    if (size <= threshold(m, i, both, limit[0], limit[1], decay)) {
        m->mask[i] |= both;
        return length(s[0], s[1]);
    }
    m->broken[i] = 1;
    double R, falling;
    const double sigma = foretold(size, limit[0], limit[1], decay, rho, &R, &falling);
    const double turning = n == 2 ? R / fmax(sigma, 1e-300) : 0, e[2] = {tau[0] / size, tau[1] / size};
    d[0] = turning + (falling - turning) * e[0] * e[0];
    d[1] = (falling - turning) * e[0] * e[1];
    d[2] = turning + (falling - turning) * e[1] * e[1];
    if (n == 1) d[2] = falling;
    if (n == 2) c[0] = e[0] * R - sigma * (d[0] * e[0] + d[1] * e[1]);
    c[n - 1] = e[1] * R - sigma * (d[1] * e[0] + d[2] * e[1]);
    d[1] *= r, d[2] *= r * r; /* from here on against w */
    return length(s[0] - sigma * e[0], s[1] - sigma * e[1]);
}

/* The torque of the bit, at the last node, where the wall has no friction. */
static double cut(model *m)
{
    const int n = m->dofs, i = m->nodes - 1, j = i * n + n - 1;
    const double still = m->bit.factor * m->bit.still, slipping = m->bit.factor * m->bit.slipping;
    const double decay = m->bit.decay, s = m->w[j];
    double rho = m->ease * m->rho[j];
    if (decay > 0) rho = fmax(rho, 2 * (still - slipping) / decay);
    const double tau = m->force[j] + rho * s;
    if (fabs(tau) <= threshold(m, i, TURN, still, slipping, decay)) {
        m->mask[i] |= TURN;
        return fabs(s);
    }
    m->broken[i] = 1;
    double R, falling;
    const double sigma = foretold(fabs(tau), still, slipping, decay, rho, &R, &falling);
    m->d[3 * i + 2] = falling;
    m->c[j] = copysign(R - falling * sigma, tau);
    return fabs(s - copysign(sigma, tau));
}

/* The weight on bit on a rock, which pushes but does not pull: on a rigid one, or on a spring that is as long at rest
   as the static weight compresses it. */
static double rest(model *m, double h)
{
    const int i = m->nodes - 1;
    if (m->bit.stiffness > 0) {
        const double k = m->bit.stiffness, still = k * (m->x[2 * i] - m->bit.middle) + m->bit.hanging;
        const double pressed = still + k * h / 2 * m->w[2 * i];
        if (pressed > 0) m->c[2 * i] = still, m->d[3 * i] = k * h / 2;
        return fabs(m->force[2 * i] - fmax(pressed, 0)) / (m->rho[2 * i] + k * h / 2);
    }
    const double gap = (m->bit.face - m->x[2 * i]) / h, s = m->w[2 * i] - gap;
    if (m->force[2 * i] + m->rho[2 * i] * s > 0) {
        m->mask[i] |= AXIAL;
        return fabs(s);
    }
    return fabs(m->force[2 * i] / m->rho[2 * i]);
}

/* The flats of a worn bit, which bear between nothing and twice their mean force: all where the bit moves down, nothing
   where it moves up. The mean is a part of the given force. */
static double rub(model *m)
{
    const int i = m->nodes - 1;
    const double tau = m->force[2 * i] + m->rho[2 * i] * m->w[2 * i];
    if (fabs(tau) <= m->bit.flat) {
        m->mask[i] |= AXIAL;
        return fabs(m->w[2 * i]);
    }
    m->c[2 * i] = copysign(m->bit.flat, tau);
    return fabs(m->force[2 * i] - m->c[2 * i]) / m->rho[2 * i];
}

/* What all laws foretell from the state of the iteration, as masks of held unknowns and as linear laws c + d w.
   Returns the largest difference to its slips, m/s or rad/s; the largest slip into *scale. */
static double foretell(model *m, double h, double *scale)
{
    const int n = m->dofs, last = m->nodes - 1;
    double error = 0, largest = 0;
    for (int i = 0; i <= last; i++) {
        const double *limit = m->limit + 3 * (size_t)i;
        m->mask[i] = 0;
        memset(m->d + 3 * (size_t)i, 0, 3 * sizeof *m->d);
        memset(m->c + (size_t)i * n, 0, n * sizeof *m->c);
        if (limit[0] > 0) {
            error = fmax(error, wall(m, i));
            const double s = limit[2] * m->w[i * n + n - 1];
            largest = fmax(largest, fabs(s));
            if (n == 2) largest = fmax(largest, fabs(m->w[2 * i]));
        }
    }
    if (m->bit.law) {
        error = fmax(error, cut(m));
        largest = fmax(largest, fabs(m->w[last * n + n - 1]));
    }
    if (m->bit.rock) error = fmax(error, rest(m, h));
    if (m->bit.flat > 0) {
        error = fmax(error, rub(m));
        largest = fmax(largest, fabs(m->w[2 * last]));
    }
    *scale = largest;
    return error;
}

/* Forces of the laws that belong to the new w: of slipping nodes from the linear law, of held ones from balance. */
static void take_forces(model *m)
{
    const int n = m->dofs, last = m->nodes - 1;
    for (int i = 0; i <= last; i++) {
        const double *limit = m->limit + 3 * (size_t)i, *d = m->d + 3 * (size_t)i;
        double *F = m->force + (size_t)i * n;
        const double *c = m->c + (size_t)i * n, *w = m->w + (size_t)i * n;
        if (limit[0] > 0) {
            const double r = limit[2];
            if (m->mask[i]) {
                if (n == 2) F[0] = missing(m, i, 0);
                F[n - 1] = missing(m, i, n - 1) / r;
            } else {
                if (n == 2) F[0] = c[0] + d[0] * w[0] + d[1] * w[1];
                F[n - 1] = c[n - 1] + (n == 2 ? d[1] / r * w[0] : 0) + d[2] / r * w[n - 1];
            }
        }
    }
    const int j = last * n + n - 1, mask = m->mask[last];
    if (m->bit.law) m->force[j] = mask & TURN ? missing(m, last, n - 1) : m->c[j] + m->d[3 * last + 2] * m->w[j];
    if (pushed(m))
        m->force[2 * last] = mask & AXIAL ? missing(m, last, 0) : m->c[2 * last] + m->d[3 * last] * m->w[2 * last];
}
