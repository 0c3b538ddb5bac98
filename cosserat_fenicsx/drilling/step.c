/* A step, its books and its record. */

/* w from (A + D) w = b - c by elimination along the string; held unknowns have given velocities. Returns a sum that is
   finite if all numbers are. */
static inline double eliminate(model *m, const double *given_top, double given_bit, const int n)
{
    const int last = m->nodes - 1;
    for (int i = 0; i <= last; i++) {
        const double *d = m->d + 3 * (size_t)i, *o = i ? m->o + (size_t)(i - 1) * n : 0;
        double *q = m->q + 4 * (size_t)i, *y = m->y + (size_t)i * n;
        int mask = m->mask[i];
        double p[2][2] = {{0}}, r[2] = {0}, given[2] = {0};
        for (int k = 0; k < n; k++) {
            p[k][k] = m->a[i * n + k] + d[2 * (k + 2 - n)];
            r[k] = m->b[i * n + k] - m->c[i * n + k] * (k == n - 1 && m->limit[3 * i] > 0 ? m->limit[3 * i + 2] : 1);
        }
        if (n == 2) p[0][1] = p[1][0] = d[1];
        if (i) {
            const double *before = q - 4;
            for (int k = 0; k < n; k++) {
                for (int l = 0; l < n; l++) p[k][l] -= o[k] * before[2 * k + l] * o[l];
                r[k] -= o[k] * y[k - n];
            }
        } else
            for (int k = 0; k < n; k++)
                if (m->top[k].rigid) mask |= bit_of(m, k), given[k] = given_top[k];
        if (i == last) {
            if (mask & AXIAL && on_rigid(m)) given[0] = given_bit;
            for (int k = 0; k < n; k++)
                for (int l = 0; l < n; l++) p[k][l] += m->bit.tangent[2 * (k + 2 - n) + l + 2 - n];
        }
        q[0] = q[1] = q[2] = q[3] = 0;
        if (n == 1) {
            q[0] = mask ? 0 : 1 / p[0][0];
            y[0] = mask ? given[0] : r[0] * q[0];
        } else if (mask == 0) {
            const double det = 1 / (p[0][0] * p[1][1] - p[0][1] * p[1][0]);
            q[0] = p[1][1] * det, q[1] = -p[0][1] * det, q[2] = -p[1][0] * det, q[3] = p[0][0] * det;
            y[0] = q[0] * r[0] + q[1] * r[1], y[1] = q[2] * r[0] + q[3] * r[1];
        } else {
            for (int k = 0; k < 2; k++)
                if (mask & 1 << k)
                    y[k] = given[k];
                else {
                    q[3 * k] = 1 / p[k][k];
                    y[k] = q[3 * k] * (r[k] - (mask & 1 << (1 - k) ? p[k][1 - k] * given[1 - k] : 0));
                }
        }
    }
    double sum = 0;
    for (int k = 0; k < n; k++) sum += m->w[last * n + k] = m->y[last * n + k];
    for (int i = last - 1; i >= 0; i--) {
        const double *o = m->o + (size_t)i * n, *q = m->q + 4 * (size_t)i, *y = m->y + (size_t)i * n;
        double *w = m->w + (size_t)i * n, s[2];
        for (int k = 0; k < n; k++) s[k] = o[k] * w[n + k];
        for (int k = 0; k < n; k++) {
            w[k] = y[k];
            for (int l = 0; l < n; l++) w[k] -= q[2 * k + l] * s[l];
            sum += w[k];
        }
    }
    return sum;
}

/* The mean velocities w and the forces of the laws in a step; 0 where Newton's method does not converge. */
static int solve(model *m, double h, const double *signal)
{
    const double gap = on_rigid(m) ? (m->bit.face - m->x[2 * m->nodes - 2]) / h : 0;
    memset(m->broken, 0, m->nodes * sizeof *m->broken);
    loads(m, h, signal);
    m->ease = 1;
    for (int i = 0;; i++) {
        double scale;
        if (i && i % PATIENCE == 0) m->ease *= 0.5; /* nodes that flip to and fro settle with smaller factors */
        const double error = predict(m, h, &scale);
        if (!rub_joints(m) && i && error <= 1e-10 * scale + 1e-11) {
            m->iterations += i;
            if (i > m->most) m->most = i;
            return 1;
        }
        const double sum = m->dofs == 1 ? eliminate(m, signal, gap, 1) : eliminate(m, signal, gap, 2);
        if (i == ITERATIONS || !isfinite(sum)) {
            m->iterations += i;
            return 0;
        }
        take_forces(m);
    }
}

/* v of an unknown changes at once: the kinetic energy that this adds. */
static double set_velocity(model *m, int i, int d, double v)
{
    const int n = m->dofs, j = i * n + d;
    double p = m->mass[j] * (m->v[j] + v) / 2;
    if (i) p += m->mass_off[j - n] * m->v[j - n];
    if (i < m->nodes - 1) p += m->mass_off[j] * m->v[j + n];
    const double added = p * (v - m->v[j]);
    m->v[j] = v;
    return added;
}

/* Set the velocities of held nodes in one of the unknowns to 0, and that of a bit on a rock to the rock's, by impulses
   on these nodes alone. Other nodes keep their momentum, which dissipates energy and never adds any. Returns the
   impulse on the last node. */
static double settle(model *m, int d)
{
    const int n = m->dofs, last = m->nodes - 1, rigid = m->top[d].rigid, mask = bit_of(m, d);
    double *v = m->v + d, *change = m->y + d, *pivot = m->q + d;
    const double *mass = m->mass + d, *off = m->mass_off + d;
    int moves = 0;
    for (int i = 0; i <= last; i++) {
        const double sinking = i == last && d < n - 1 && on_rigid(m) ? m->bit.sinking : 0;
        change[i * n] = m->held[i] & mask ? sinking - v[i * n] : 0;
        pivot[i * n] = (i == 0 && rigid) || m->held[i] & mask ? 0 : mass[i * n]; /* 0 where a node is held */
        moves |= change[i * n] != 0;
    }
    if (!moves) return 0;
    for (int i = 1; i <= last; i++) {
        if (!pivot[i * n]) continue;
        const double before = pivot[(i - 1) * n], o = off[(i - 1) * n];
        if (before) pivot[i * n] -= o * o / before;
        change[i * n] -= before ? o / before * change[(i - 1) * n] : o * change[(i - 1) * n];
    }
    double on_last = 0;
    for (int i = last; i >= 0; i--)
        if (pivot[i * n])
            change[i * n] = (change[i * n] - (i < last ? off[i * n] * change[(i + 1) * n] : 0)) / pivot[i * n];
    for (int i = 0; i <= last; i++)
        if (!pivot[i * n]) {
            double impulse = mass[i * n] * change[i * n];
            if (i) impulse += off[(i - 1) * n] * change[(i - 1) * n];
            if (i < last) impulse += off[i * n] * change[(i + 1) * n];
            const double work = impulse * (v[i * n] + change[i * n] / 2);
            if (i == last) on_last = impulse;
            if (i == 0)
                *(d == n - 1 ? &m->sums.drive : &m->sums.hook) += work;
            else
                *(i == last && (m->bit.law || pushed(m)) ? &m->sums.bit : &m->sums.wall) -= work;
        }
    for (int i = 0; i <= last; i++) v[i * n] += change[i * n];
    return on_last;
}

/* The weight on bit of a step from the momentum (N s) that a rigid rock gave the bit in it. A bit that comes down on
   the rock takes its velocity at once: the impulse of the bit's mass has no duration, and is recorded as such, not as a
   force that would be the larger the shorter the step. The half element beside it, which the mesh stops at once, too,
   is stopped by a wave with the force Z (change of velocity), for as long as that takes. */
static void weigh(model *m, double h, double momentum, int stood, double before)
{
    lower *bit = &m->bit;
    const int last = m->nodes - 1;
    const double change = before - bit->sinking, whole = m->mass[2 * last];
    const double impulse = stood || !(m->held[last] & AXIAL) ? 0 : fmax(fmin(whole * change, momentum), 0);
    if (impulse > 0) {
        const double half = whole + m->mass_off[2 * last - 2] - bit->mass;
        bit->impulse += impulse * bit->mass / whole;
        bit->slowed += impulse * (1 - bit->mass / whole);
        bit->slowing = sqrt(2 * half * m->spring[2 * last - 2]) * change;
    }
    /* a step in which the bit leaves the rock may end with a little too much momentum: it is taken off later */
    const double wave = fmin(bit->slowed, h * bit->slowing), sum = momentum - impulse + wave;
    bit->slowed -= wave + fmax(-sum, 0);
    bit->weight = momentum / h;
    bit->recorded[0] = fmax(sum, 0) / h;
    bit->share = momentum > 0 ? bit->recorded[0] / bit->weight : 1;
}

/* Take a step that has converged. */
static void commit(model *m, double h, const double *signal)
{
    const int n = m->dofs, last = m->nodes - 1, turn = n - 1;
    books *sums = &m->sums;
    for (int d = 0; d < n; d++) {
        upper *top = m->top + d;
        const double w = m->w[d], stretched = top->error + h / 2 * (signal[d] - w);
        if (top->rigid)
            top->force = -missing(m, 0, d);
        else {
            top->force = top->given + top->proportional * (signal[d] - w) + top->integral * stretched;
            top->error += h * (signal[d] - w);
        }
        /* the work on a hook includes its spring; on a drive it is the work of the torque */
        if (d == turn)
            sums->drive += h * top->force * w;
        else
            sums->hook += h * (top->force - m->hanging_top) * signal[d];
        top->force -= top->inertia * 2 * (w - m->v[d]) / h;
    }
    if (m->control.used) {
        linear *c = &m->control;
        prepare(c, h);
        const double late = m->top[turn].rigid ? imposed(c, c->spent + h / 2) : 0;
        observe(c, signal[turn] - late - m->w[turn], m->top[turn].force);
    }
    for (int i = 0; i <= last; i++) {
        const double *F = m->force + (size_t)i * n, *w = m->w + (size_t)i * n;
        const double *limit = m->limit + 3 * (size_t)i;
        if (limit[0] > 0) sums->wall += h * (F[turn] * limit[2] * w[turn] + (n == 2 ? F[0] * w[0] : 0));
        for (int d = 0; d < n; d++) {
            const int j = i * n + d;
            double lost = m->drag[j] * w[d];
            if (i) lost += m->drag_off[j - n] * w[d - n];
            if (i < last) lost += m->drag_off[j] * w[d + n];
            sums->mud += h * lost * w[d];
        }
    }
    for (int p = 0; p < m->pairs; p++) {
        const int j = m->pair[p] * n + m->pair_dof[p];
        const double rate = m->w[j + n] - m->w[j], lost = h * m->pair_slope[p] * rate * rate;
        m->applied[p] = signal[n + p] - m->rubbed[p] + m->bends[p] + m->softens[p] * rate;
        sums->tools += h * m->applied[p] * rate - lost;
        sums->mud -= lost;
    }
    const double *w = m->w + (size_t)last * n;
    const double before = n == 2 ? m->v[2 * last] : 0;
    const int stood = m->held[last] & AXIAL, slips = !(m->mask[last] & TURN);
    double force[2];
    for (int d = 2 - n; d < 2; d++) {
        force[d] = m->bit.force[d];
        for (int k = 0; k < n; k++) force[d] += m->bit.tangent[2 * d + k + 2 - n] * w[k];
        if (d ? m->bit.law : pushed(m)) force[d] += m->force[last * n + d + n - 2];
        sums->bit += h * force[d] * w[d + n - 2];
    }
    if (n == 2) m->bit.weight = m->bit.recorded[0] = force[0];
    /* a torque by the weight of the step before contains the impulse of that weight */
    m->bit.torque = m->bit.recorded[1] = force[1];
    if (m->bit.weighs && m->bit.share < 1) {
        const double most = m->bit.share * m->bit.rubs.still;
        m->bit.recorded[1] = slips ? m->bit.share * force[1] : fmax(fmin(force[1], most), -most);
    }
    for (int j = 0; j < m->nodes * n; j++) {
        m->x[j] += h * m->w[j];
        m->v[j] = 2 * m->w[j] - m->v[j];
    }
    for (int i = 0; i <= last; i++) m->held[i] = m->mask[i];
    /* held unknowns end the step at rest, or with the rock */
    double given = 0;
    for (int d = 0; d < n; d++) {
        const double impulse = settle(m, d);
        if (d < turn) given = -impulse;
    }
    if (n == 2 && on_rigid(m)) weigh(m, h, h * force[0] + given, stood, before);
}

/* The law of friction of a bit in the next step, by the weight on bit of the last one. */
static void rub_by_weight(lower *bit)
{
    const double load = fmax(bit->weight, 0), stands = !bit->rock || bit->weight > 0;
    friction f = bit->given;
    if (f.other) {
        double slope;
        f.load = bit->weighs ? load : bit->hanging;
        f.scale = bit->weighs ? load > 0 : stands;
        if (bit->weighs) f.still = f.scale > 0 ? rests(&f) : 0;
        else f.still *= f.scale;
        f.slipping = f.scale > 0 ? resistance_of_other(&f, 1e-6, &slope) : 0;
    } else {
        const double factor = bit->weighs ? load : stands;
        f.still *= factor;
        f.slipping *= factor;
    }
    bit->rubs = f;
}

static int step(model *m, double h, const double *from, const double *to)
{
    double signal[2 + MOST_PAIRS];
    const size_t size = (size_t)m->nodes * m->dofs * sizeof(double);
    for (int d = 0; d < m->dofs + m->pairs; d++) signal[d] = (from[d] + to[d]) / 2;
    if (!build(m, h)) return 0;
    command_drive(m, h, signal[m->dofs - 1]);
    if (!m->fixed) limits(m);
    rub_by_weight(&m->bit);
    /* a step that fails leaves the guess as it was */
    memcpy(m->guess, m->w, size);
    memcpy(m->guess + (size_t)m->nodes * m->dofs, m->force, size);
    if (solve(m, h, signal)) {
        commit(m, h, signal);
        return 1;
    }
    memcpy(m->w, m->guess, size);
    memcpy(m->force, m->guess + (size_t)m->nodes * m->dofs, size);
    return 0;
}

static void write_record(const model *m, double *row)
{
    const int n = m->dofs, last = m->nodes - 1, turn = n - 1;
    const double *x = m->x, *v = m->v, *w = m->at_end ? v : m->w;
    double kinetic = 0, strain = 0, weight = 0;
    for (int i = 0; i <= last; i++)
        for (int d = 0; d < n; d++) {
            const int j = i * n + d;
            kinetic += m->mass[j] * v[j] * v[j] / 2;
            if (i < last) {
                const double stretch = x[j + n] - x[j];
                kinetic += m->mass_off[j] * v[j] * v[j + n];
                strain += m->spring[j] * stretch * stretch / 2;
                if (d < turn) strain += m->hanging[i] * stretch;
            }
            const double above = i ? m->hanging[i - 1] : m->hanging_top;
            if (d < turn) weight += (above - (i < last ? m->hanging[i] : -m->bit.hanging)) * x[j];
        }
    if (n == 2 && !m->top[0].rigid) {
        const double error = m->top[0].error;
        strain += m->top[0].integral * error * error / 2 - m->hanging_top * error;
    }
    double motors = 0;
    for (int p = 0, k = 0; p < m->pairs; p++) {
        const double *parted = m->w + (size_t)m->pair[p] * n + turn;
        if (m->pair_dof[p] != turn) continue;
        const double speed = m->stands[p] ? 0 : parted[n] - parted[0];
        motors += speed;
        if (m->shown) row[ROW - 1 + k++] = speed;
    }
    const double drive = m->top[turn].force, hook = n == 2 ? m->hanging_top - m->top[0].force : NAN;
    const double weight_on_bit = n == 2 ? m->bit.recorded[0] : m->bit.over_time ? m->bit.weight : NAN;
    const double series[] = {w[turn], x[turn], drive, w[last * n + turn], x[last * n + turn], m->bit.recorded[1], hook,
                             n == 2 ? w[2 * last] : NAN, n == 2 ? x[2 * last] : NAN, weight_on_bit,
                             n == 2 ? m->bit.impulse : NAN, motors, kinetic, strain,
                             m->sums.drive, m->sums.hook, weight, m->sums.tools, m->sums.bit, m->sums.wall,
                             m->sums.mud};
    memcpy(row, series, sizeof series);
}

/* Do intervals, rows (h, velocities asked for at the begin, at the end, whether a record is written). Returns how many
   were done; of one that fails nothing, or its first parts, have been done, which nobody may use. */
int advance_elements(model *m, int intervals, const double *interval, const double *weights, double *rows)
{
    const int n = m->dofs, all = n + m->pairs;
    for (int i = 0; i < intervals; i++, interval += 2 + 2 * all) {
        const double h = interval[0];
        if (weights) m->bit.weight = *weights;
        for (int p = 0; p < m->pairs; p++)
            if (m->over[p]) m->drives[p] = m->over[p][i];
        double from[2 + MOST_PAIRS], to[2 + MOST_PAIRS];
        memcpy(from, interval + 1, all * sizeof *from);
        memcpy(to, interval + 1 + all, all * sizeof *to);
        for (int d = 0; d < n; d++) {
            const linear *c = &m->control;
            const int rigid = m->top[d].rigid, own = d == n - 1 && imposes(c);
            double speed = from[d];
            if (own) speed += imposed(c, c->spent);
            if (own && rigid) from[d] = speed, to[d] += imposed(c, c->spent + h);
            if ((own || rigid) && m->v[d] != speed) {
                double *work = d == n - 1 ? &m->sums.drive : &m->sums.hook;
                *work += set_velocity(m, 0, d, speed);
            }
        }
        const double face = m->bit.face, sinks = m->bit.floor - face;
        double done = 0, size = 1;
        while (done < 1) {
            double begin[2 + MOST_PAIRS], end[2 + MOST_PAIRS];
            for (int d = 0; d < all; d++) {
                begin[d] = from[d] + done * (to[d] - from[d]);
                end[d] = from[d] + (done + size) * (to[d] - from[d]);
            }
            m->bit.face = face + (done + size) * sinks;
            m->bit.middle = face + (done + size / 2) * sinks;
            if (step(m, size * h, begin, end)) {
                done += size;
                /* parts begin at multiples of their length */
                if (size < 1 && fmod(done, 2 * size) == 0) size *= 2;
            } else {
                m->halved++;
                size /= 2;
                if (size < 1.0 / (1 << HALVINGS)) return i;
            }
        }
        if (interval[1 + 2 * all] != 0) {
            if (m->control.used) wait_on(&m->control);
            if (weights) weights++;
            write_record(m, rows + 1); /* after the time */
            rows += ROW + m->shown;
        }
    }
    return intervals;
}
