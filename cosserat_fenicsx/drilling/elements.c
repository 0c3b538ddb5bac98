/* The equations of a step of the implicit midpoint rule for the mean velocities w:
   (2 M/h + C + h/2 K) w = 2 M/h v - K x - friction - bit + drive. */
enum { ITERATIONS = 60, PATIENCE = 15, HALVINGS = 12 };
/* Slip (rad/s, m/s) at which friction between both sides of a joint is the largest: it creeps up to there. */
#define CREEP 1e-6
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
            limit[0] += m->factor[p] * part[i];
            limit[2] += m->factor[p] * part[i] * m->radius[p];
        }
    }
    for (int i = 0; i < m->nodes; i++) {
        double *limit = m->limit + 3 * (size_t)i;
        if (limit[0] > 0) limit[2] /= limit[0];
        limit[1] = m->wall.slipping * limit[0];
        limit[0] *= m->wall.still;
    }
}

/* The law of friction at a node on the wall, against its slip (m/s). */
static inline friction law_on_wall(const model *m, int i)
{
    const double *limit = m->limit + 3 * (size_t)i, r = m->of_rotation ? limit[2] : 1;
    friction f = {limit[0], limit[1], r * m->wall.decay, m->wall.other, 1, 1 / r, 0};
    if (f.other) f.scale = limit[0] / m->wall.still;
    return f;
}

/* Output of a linear control of the drive in a step of the length h, with the mean speed asked for. The factor on the
   speed follows from h alone. */
static void command_drive(model *m, double h, double asked)
{
    upper *top = m->top + m->dofs - 1;
    if (!m->control.used || top->rigid) return;
    const command f = commanded(&m->control, h, top->inertia);
    const double more = 2 / h * (top->inertia - f.inertia); /* the node's mass has all of the inertia */
    top->proportional = f.gain - more;
    top->given = f.given + more * (asked - m->v[m->dofs - 1]);
}

/* The matrix for steps of the length h, and the inverse compliances of the nodes, 1/(A^-1)_ii, the best factors of
   proximal steps. 0 where the matrix is not positive. */
int build(model *m, double h)
{
    const int n = m->dofs, last = m->nodes - 1;
    if (h == m->h) return 1;
    m->h = h;
    memset(m->stands, 0, sizeof m->stands);
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
    command_drive(m, h, 0);
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
    for (int p = 0; p < m->pairs; p++) {
        const int j = m->pair[p] * n + m->pair_dof[p];
        m->parted[p][0] = m->a[j], m->parted[p][1] = m->a[j + n], m->parted[p][2] = m->o[j];
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
            const friction wall = law_on_wall(m, i);
            const double r = m->limit[3 * (size_t)i + 2];
            double slope = wall.still > 0 ? fall(&wall) * (d == turn ? r * r : 1) : 0;
            if (i == last && d == turn && m->bit.law)
                slope += fall(&m->bit.given) * (m->bit.weighs && !m->bit.given.other ? m->bit.weight : 1);
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
            m->b[d] += top->given + top->proportional * signal[d]
                       + top->integral * (top->error + h / 2 * signal[d]);
    }
    for (int p = 0; p < m->pairs; p++) {
        const int j = m->pair[p] * n + m->pair_dof[p];
        const double creep = m->pair_lost[p] / CREEP * (m->w[j + n] - m->w[j]);
        m->b[j] -= signal[n + p], m->b[j + n] += signal[n + p];
        m->rubbed[p] = fmax(fmin(creep, m->pair_lost[p]), -m->pair_lost[p]);
        m->rubs[p] = m->bends[p] = m->softens[p] = 0;
    }
    for (int d = 0; d < n; d++) m->b[last * n + d] -= m->bit.force[d + 2 - n];
    if (n == 2) m->b[2 * last] += m->bit.hanging; /* the tension at rest contains a part of the weight on bit */
}

/* Residual force of the equation of a node without laws: b - A w. */
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
/* Set-valued laws: friction at the wall, a vector against the slip (V, r om), and the torque of the bit.

   Newton's method on the law's proximal map. With the force F and the slip s of an iteration, tau = F + rho s. Where
   tau is within the limit the node is held. Elsewhere the slip s* that belongs to tau, F(s*) + rho s* = tau, is found
   first, and the law is linearised there: F = F* + D (s - s*). */

static inline double length(double x, double y) { return sqrt(x * x + y * y); }

/* Where the law of friction drops at once, a node is held by the static limit only while it has not slipped. */
static double threshold(const model *m, int i, int mask, const friction *f)
{
    if (f->decay > 0 || f->still == f->slipping) return f->still;
    return (m->held[i] & mask) == mask && !m->broken[i] ? f->still : f->slipping;
}

/* Linearise the law of friction of a node against its slip: r times its rotation, and with it its axial velocity along
   the wall (`mask` of both unknowns). Returns the difference to the slip that belongs to tau. */
static double friction_at(model *m, int i, const friction *law, double r, int mask)
{
    const int n = m->dofs, along = mask & AXIAL, j = i * n + n - 1;
    const double s[2] = {along ? m->w[2 * i] : 0, r * m->w[j]};
    double rho = m->rho[j] / (r * r), *d = m->d + 3 * (size_t)i;
    if (along) rho = fmin(rho, m->rho[2 * i]);
    rho = fmax(m->ease * rho, 2 * fall(law));
    const double tau[2] = {along ? m->force[2 * i] + rho * s[0] : 0, m->force[j] + rho * s[1]};
    const double size = length(tau[0], tau[1]);
    if (size <= threshold(m, i, mask, law)) {
        m->mask[i] |= mask;
        return length(s[0], s[1]);
    }
    m->broken[i] = 1;
    double R, falling;
    const double sigma = slides(law, rho, size, &R, &falling, &m->inner);
    const double turning = along ? R / fmax(sigma, 1e-300) : 0, e[2] = {tau[0] / size, tau[1] / size};
    d[2] = along ? turning + (falling - turning) * e[1] * e[1] : falling;
    if (along) {
        d[0] = turning + (falling - turning) * e[0] * e[0];
        d[1] = (falling - turning) * e[0] * e[1];
        m->c[2 * i] = e[0] * R - sigma * (d[0] * e[0] + d[1] * e[1]);
    }
    m->c[j] = e[1] * R - sigma * ((along ? d[1] * e[0] : 0) + d[2] * e[1]);
    if (along) d[1] *= r;
    d[2] *= r * r; /* from here on against w */
    return length(s[0] - sigma * e[0], s[1] - sigma * e[1]);
}

/* The weight on bit on a rock, which pushes but does not pull: on a rigid one, or on a spring that the
   static weight compresses at rest. */
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

/* The entries of the matrix beside a pair, with a damper more than without friction and curve. */
static void damp_pair(model *m, int p, double more)
{
    const int j = m->pair[p] * m->dofs + m->pair_dof[p];
    double *const entry[3] = {m->a + j, m->a + j + m->dofs, m->o + j};
    for (int k = 0; k < 3; k++) *entry[k] = m->parted[p][k] + (k < 2 ? more : -more);
}

/* The tangent of a motor's curve at its speed, as what it adds to the torque and takes from the damper of the matrix,
   which has its steepest slope. Returns whether the last one was not true there. */
static int bend(model *m, int p)
{
    const int n = m->dofs, j = m->pair[p] * n + m->pair_dof[p];
    const double rate = m->w[j + n] - m->w[j], c = m->pair_slope[p];
    double slope;
    const double more = torque_of_motor(m->drives + p, rate, &slope) + c * rate;
    if (fabs(more - m->bends[p] - m->softens[p] * rate) <= 1e-12 * c * (fabs(rate) + 1)) return 0;
    m->softens[p] = m->ease * (slope + c);
    const double bends = more - m->softens[p] * rate;
    m->b[j] -= bends - m->bends[p], m->b[j + n] += bends - m->bends[p];
    m->bends[p] = bends;
    return 1;
}

/* Friction between both sides of joints, as that of a motor's rotor in its housing: where it holds them they creep, by
   a damper; elsewhere it is a given force. And the curves of motors. Returns whether one begins to stand or to slip, or
   another tangent of the curve is taken. */
static int rub_joints(model *m)
{
    const int n = m->dofs;
    int changed = 0;
    for (int p = 0; p < m->pairs; p++) {
        const double lost = m->pair_lost[p];
        const int bends = m->drives[p].count > 0;
        if (bends) changed |= bend(m, p);
        if (lost == 0) {
            if (bends) damp_pair(m, p, -m->softens[p]);
            continue;
        }
        const int j = m->pair[p] * n + m->pair_dof[p];
        /* at most the inverse compliance between both sides */
        const double rho = m->ease * fmin(m->rho[j], m->rho[j + n]) / 4;
        const double tau = m->rubbed[p] + rho * (m->w[j + n] - m->w[j]);
        const int stands = fabs(tau) <= lost;
        const double force = stands ? 0 : copysign(lost, tau), more = force - m->rubs[p];
        changed |= more != 0 || stands != m->stands[p];
        m->b[j] += more, m->b[j + n] -= more;
        m->rubs[p] = force;
        if (bends || stands != m->stands[p]) damp_pair(m, p, (stands ? lost / CREEP : 0) - (bends ? m->softens[p] : 0));
        m->stands[p] = stands;
    }
    return changed;
}

/* The prediction of all laws from the state of the iteration, as masks of held unknowns and as linear laws c + d w.
   Returns the largest difference to its slips, m/s or rad/s; the largest slip into *scale. */
static double predict(model *m, double h, double *scale)
{
    const int n = m->dofs, last = m->nodes - 1, both = n == 2 ? AXIAL | TURN : TURN;
    double error = 0, largest = 0;
    for (int i = 0; i <= last; i++) {
        const double *limit = m->limit + 3 * (size_t)i;
        m->mask[i] = 0;
        memset(m->d + 3 * (size_t)i, 0, 3 * sizeof *m->d);
        memset(m->c + (size_t)i * n, 0, n * sizeof *m->c);
        if (limit[0] > 0) {
            const friction law = law_on_wall(m, i);
            error = fmax(error, friction_at(m, i, &law, limit[2], both));
            const double s = limit[2] * m->w[i * n + n - 1];
            largest = fmax(largest, fabs(s));
            if (n == 2) largest = fmax(largest, fabs(m->w[2 * i]));
        }
    }
    if (m->bit.law) {
        error = fmax(error, friction_at(m, last, &m->bit.rubs, 1, TURN)); /* the wall has no friction there */
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
    for (int p = 0; p < m->pairs; p++) {
        const int k = m->pair[p] * n + m->pair_dof[p];
        m->rubbed[p] = m->stands[p] ? m->pair_lost[p] / CREEP * (m->w[k + n] - m->w[k]) : m->rubs[p];
    }
    const int j = last * n + n - 1, mask = m->mask[last];
    if (m->bit.law) m->force[j] = mask & TURN ? missing(m, last, n - 1) : m->c[j] + m->d[3 * last + 2] * m->w[j];
    if (pushed(m))
        m->force[2 * last] = mask & AXIAL ? missing(m, last, 0) : m->c[2 * last] + m->d[3 * last] * m->w[2 * last];
}
