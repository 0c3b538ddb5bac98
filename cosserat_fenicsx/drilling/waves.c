/* Torsional waves of a string, step by step; see torsion.py for the method. */

/* The law of friction at a node. */
static inline friction law_at(const waves *w, int node)
{
    friction f = {w->hold[node], w->slide[node], w->decay[node], NULL, 1, 1, 0};
    if (w->wall.self || w->wall.count || w->rock.self || w->rock.count) {
        const int bit = w->bit && node == w->cells;
        const curve *other = bit ? &w->rock : &w->wall;
        if (other->self || other->count) {
            f.other = other;
            f.scale = bit ? 1 : w->grip[node];
            f.reach = bit ? 1 : w->reach[node];
            f.load = w->load;
        }
    }
    return f;
}

/* The speed om with S om + T(om) = F, T the law of friction. Where several speeds fulfil that, it continues to slide as
   before, with the sign of `before`. */
static inline double slip(const friction *f, double F, double S, double before, long long *iterations)
{
    double size = fabs(F), sign = F < 0 ? -1.0 : 1.0, R, slope;
    if (size <= f->still && !(several(f, S) && before * sign > 0)) return 0.0;
    double om = slides(f, S, size, &R, &slope, iterations);
    return om > 0 || isnan(om) ? sign * om : 0.0;
}

/* The mean speed of a node with an inertia over a step. A node that would turn round stops. `speed`: at the start of
   the step, then at its end. */
static double turned(waves *w, int node, double F, double S, double inertia, double *speed)
{
    double before = *speed, rate = 2 * inertia / w->dt;
    const friction law = law_at(w, node);
    double om = slip(&law, F + rate * before, S + rate, before, &w->iterations);
    double after = inertia > 0 ? 2 * om - before : om;
    if (inertia > 0 && law.still > 0 && after * before < 0) {
        double torque = F + rate * before - (S + rate) * before / 2;
        if (torque * before >= 0) {
            om = before / 2;
            after = 0.0;
        }
    }
    w->torque[node] = F + rate * before - (S + rate) * om;
    *speed = after;
    return om;
}

/* Add the losses at a node to the energy ledger, and update its angle. */
static void book(waves *w, int node, double om, double moment)
{
    double dt = w->dt;
    w->last_speed[node] = w->speed[node];
    w->last_moment[node] = w->moment[node];
    w->speed[node] = om;
    w->moment[node] = moment;
    w->angle[node] += dt * om;
    w->in_mud += dt * w->drag[node] * om * om;
    *(node == w->cells && w->bit ? &w->at_bit : &w->at_wall) += dt * w->torque[node] * om;
}

/* The drive, at the mean speed asked for. */
static void drive(waves *w, double asked)
{
    double Q = w->up[0], Z = w->below[0], S = Z + w->drag[0], dt = w->dt, om, torque;
    double I = w->drive_inertia, before = w->drive_speed;
    linear *control = &w->control;
    const command f = control->used
        ? commanded(control, dt, I)
        : (command){w->given + w->Ki * w->integral, w->Kp + w->Ki * dt / 2, I};
    if (w->stiff) {
        const friction law = law_at(w, 0);
        w->drive_speed = om = asked + (control->used ? f.given : 0);
        if (om == 0) w->torque[0] = fmax(-law.still, fmin(law.still, -Q));
        else w->torque[0] = law.still > 0 ? copysign(resistance(&law, fabs(om)), om) : 0.0;
    } else {
        om = turned(w, 0, f.given + f.gain * asked - Q, S + f.gain, f.inertia, &w->drive_speed);
        w->integral += dt * (asked - om);
    }
    torque = Q + S * om + w->torque[0];
    w->work += dt * torque * om + I * (w->drive_speed * w->drive_speed - before * before) / 2;
    if (control->used) {
        observe(control, asked - om, torque);
        wait_on(control);
    }
    book(w, 0, om, torque);
}

/* Inlined into the loop over steps it would be a third slower. */
static __attribute__((noinline)) void energies(const waves *w, double *kinetic, double *strain)
{
    double moving = 0.0, held = 0.0;
    for (int c = 0; c < w->cells; c++) {
        double P = w->down[c], Q = w->up[c], share = w->share[c];
        moving += share * (P - Q) * (P - Q);
        held += share * (P + Q) * (P + Q);
    }
    for (int f = 0; f < w->filters; f++) {
        double P = w->down_kept[f], Q = w->up_kept[f], share = w->share[w->filtered[f]];
        moving += share * (P - Q) * (P - Q);
        held += share * (P + Q) * (P + Q);
    }
    *kinetic = (moving + w->drive_inertia * w->drive_speed * w->drive_speed
                + w->bit_inertia * w->bit_speed * w->bit_speed) / 2;
    *strain = held / 2;
}

/* The bit below a motor, whose torque is R - c (om_bit - om) less the friction of its rotor: the housing om bears it,
   P - A om = T. So the bit meets the wave (c P + A R)/(A + c) on the impedance c A/(A + c), or P on A while friction
   holds the rotor. It turns forwards, backwards or not at all: one of them is true to its sense. Returns om; T into
   *torque. */
static double against_motor(waves *w, double P, double R, double c, double *torque)
{
    const int n = w->cells;
    const double A = w->above[n] + w->drag[n], before = w->bit_speed;
    double om;
    for (int sense = 1;; sense = sense > 0 ? -1 : 0) {
        const double S = sense ? c * A / (A + c) : A;
        const double F = sense ? (c * P + A * (R - sense * w->lost)) / (A + c) : P;
        w->bit_speed = before;
        const double bit = turned(w, n, F, S + w->dragged, w->bit_inertia, &w->bit_speed);
        *torque = F - S * bit;
        om = sense ? (P - *torque) / A : bit;
        w->turned = bit - om;
        if (!sense || w->lost == 0 || sense * w->turned > 0) return om;
    }
}

/* The same of a motor with a curve, whose tangents Newton's method takes. The speed on a tangent is above the one it
   touches at just where the answer is, so both ends of an interval close in on it. */
static double below_motor(waves *w, double P, double R)
{
    const int n = w->cells;
    const double dt = w->dt, before = w->bit_speed;
    double T, om, low = -INFINITY, high = INFINITY;
    w->last_turned = w->turned;
    if (!w->motor.count) om = against_motor(w, P, R, w->slope, &T);
    else
        for (int i = 0;; i++) {
            double slope, at = w->turned;
            const double more = torque_of_motor(&w->motor, at, &slope);
            w->bit_speed = before;
            om = against_motor(w, P, R + more - slope * at, -slope, &T);
            ++w->iterations;
            const double change = w->turned - at, enough = 1e-12 * (1 + fabs(at));
            if (fabs(change) <= enough || high - low <= enough) break;
            if (i == MOST) return NAN;
            *(change > 0 ? &low : &high) = at;
            if (w->turned <= low || w->turned >= high) w->turned = (low + high) / 2;
        }
    const double bit = om + w->turned;
    w->bit_angle += dt * bit;
    w->tools += dt * T * w->turned;
    w->in_mud += dt * w->dragged * bit * bit;
    w->at_bit += dt * w->torque[n] * w->turned; /* beyond what is booked at the speed of the housing */
    return om;
}

/* The bit, or the free end; R: torque that the flow gives a motor at rest. */
static void end(waves *w, double P, double R)
{
    int n = w->cells;
    w->last_on_bit = w->torque[n];
    if (w->slope > 0) {
        const double om = below_motor(w, P, R);
        book(w, n, om, P - w->above[n] * om);
        w->up[n - 1] = P - 2 * w->above[n] * om;
        return;
    }
    double om = turned(w, n, P, w->above[n] + w->drag[n], w->bit_inertia, &w->bit_speed);
    book(w, n, om, P - w->above[n] * om);
    w->up[n - 1] = P - 2 * w->above[n] * om;
}

/* All nodes between drive and end; returns the wave that reaches the end. */
static double between(waves *w, double P)
{
    double *down = w->down, *up = w->up, *speed = w->speed, dt = w->dt, lost = 0.0, braked = 0.0;
    for (int j = 1; j < w->cells; j++) {
        double Q = up[j], above = w->above[j], below = w->below[j], drag = w->drag[j], F = P - Q;
        double S = above + below + drag, om;
        if (w->hold[j] > 0) {
            const friction law = law_at(w, j);
            om = slip(&law, F, S, speed[j], &w->iterations);
            double torque = F - S * om;
            w->torque[j] = torque;
            lost += torque * om;
        } else om = F / S;
        braked += drag * om * om;
        w->last_speed[j] = speed[j];
        w->last_moment[j] = w->moment[j];
        speed[j] = om;
        w->angle[j] += dt * om;
        w->moment[j] = P - above * om;
        up[j - 1] = P - 2 * above * om;
        P = down[j];
        down[j] = Q + 2 * below * om;
    }
    w->at_wall += dt * lost;
    w->in_mud += dt * braked;
    return P;
}

static void pass(double turn, double root, double *wave, double *kept)
{
    double x = *wave, s = *kept;
    *wave = turn * x + root * s;
    *kept = root * x - turn * s;
}

/* The law of the bit under another weight. */
static void press(waves *w, double load)
{
    const int n = w->cells;
    w->load = load;
    const friction law = law_at(w, n);
    w->hold[n] = law.other ? load > 0 ? rests(&law) : 0 : w->per_weight[0] * load;
    w->slide[n] = law.other ? w->hold[n] : w->per_weight[1] * load;
}

/* Do `steps` steps, of given mean speeds and, where these change, weights on bit; each writes a row, its first number
   left to the time. Returns how many were done: fewer where a number is not finite. */
int advance_waves(waves *w, int steps, const double *speeds, const double *weights, double *rows)
{
    const int n = w->cells;
    for (int k = 0; k < steps; k++) {
        double P = w->down[0], kinetic, strain;
        if (weights) press(w, weights[k]);
        if (w->motors) w->motor = w->motors[k];
        drive(w, speeds[k]);
        w->down[0] = w->up[0] + 2 * w->below[0] * w->speed[0];
        end(w, between(w, P), w->slope > 0 ? w->driven[k] : 0);
        for (int f = 0; f < w->filters; f++) {
            int c = w->filtered[f];
            double turn = w->turn[f], root = sqrt((1 - turn) * (1 + turn));
            pass(turn, root, w->down + c, w->down_kept + f);
            pass(turn, root, w->up + c, w->up_kept + f);
        }
        energies(w, &kinetic, &strain);
        const double series[] = {
            w->stiff || (w->drive_inertia > 0 && !w->control.of_speed) ? w->drive_speed
                                                                       : (w->last_speed[0] + w->speed[0]) / 2,
            w->angle[0],
            (w->last_moment[0] + w->moment[0]) / 2,
            w->bit_inertia > 0 ? w->bit_speed : (w->last_speed[n] + w->speed[n]) / 2,
            w->slope > 0 ? w->bit_angle : w->angle[n],
            w->bit ? (w->last_on_bit + w->torque[n]) / 2 : 0, NAN, NAN, NAN, weights ? weights[k] : NAN, NAN,
            (w->last_turned + w->turned) / 2, kinetic, strain, w->work, 0, 0, w->tools, w->at_bit,
            w->at_wall, w->in_mud};
        memcpy(rows + ROW * (size_t)k + 1, series, sizeof series);
        if (!isfinite(kinetic + strain)) return k;
    }
    return steps;
}
