/* The steps of the interior-point method, after Mehrotra, and what Python calls. */

/* Keep the second-order part that the direction has, times a weight, for the next one. */
static void bend(Problem *P, double weight) {
  for (int64_t i = 0; i < P->n; i++)
    for (int j = 0; j < NG; j++) {
      Group *G = P->interval[i].group + j;
      for (int r = 0; r < NC; r++) {
        G->bend_upper[r] = -weight * G->dt[r] * G->dupper[r];
        G->bend_lower[r] = weight * G->dt[r] * G->dlower[r];
      }
    }
  for (int64_t k = 0; k < P->spheres; k++) {
    Sphere *G = P->sphere + k;
    G->bend = -weight * G->dt * G->dupper;
  }
}

/* The gradient of the objective and of the barrier, t being eliminated. */
static void gradient(Problem *P, double mu) {
  memset(P->g, 0, size(P) * sizeof(double));
  for (int64_t q = 0; q < P->phases; q++) durations(P, P->g)[q] = NL ? P->given->cost[0] : 1.0;
  for (int64_t i = 0; i < P->n; i++)
    for (int j = 0; j < NG; j++) {
      const Group *G = P->interval[i].group + j;
      V q[NC], m[NY];
      for (int r = 0; r < NC; r++) {
        q[r] = (G->upper[r] * G->over[r] + G->lower[r] * G->under[r]) * (G->c[r] - G->t[r]);
        q[r] += (mu - G->bend_upper[r]) * G->over[r] - (mu - G->bend_lower[r]) * G->under[r];
      }
      across_rows(G->C, q, m);
      add_to_gradient(P, i, G, m, P->g);
    }
  unevenness(P, P->z, P->g);
  reduce_gradient(P, P->g);
  for (int64_t a = 0; NL && a < size(P); a++) P->g[a] += P->given->cost[1] * P->slope[a];
  for (int64_t k = 0; k < P->spheres; k++) {
    const Sphere *G = P->sphere + k;
    const double q = (G->upper * (G->c - G->t) + mu - G->bend) * G->over;
    for (int j = 0; j < NM; j++) P->g[NB * G->knot + j] += q * G->slope[j];
  }
}

/* The direction of all variables for a barrier parameter. */
static void direction(Problem *P, double mu) {
  gradient(P, mu);
  newton_step(P);
  for (int64_t i = 0; i < P->n; i++) {
    Interval *I = P->interval + i;
    double room[NK];
    const double *change = local_change(P, i, room), dT = duration_of(P, I, P->dz);
    for (int j = 0; j < NG; j++) {
      Group *G = I->group + j;
      V dy[NY];
      at_points(G, change, dT, dy);
      for (int r = 0; r < NC; r++) G->dt[r] = G->c[r] - G->t[r];
      along_rows(G->C, dy, G->dt);
      for (int r = 0; r < NC; r++) {
        G->dupper[r] = (mu - G->bend_upper[r] + G->upper[r] * G->dt[r]) * G->over[r] - G->upper[r];
        G->dlower[r] = (mu - G->bend_lower[r] - G->lower[r] * G->dt[r]) * G->under[r] - G->lower[r];
      }
    }
  }
  for (int64_t k = 0; k < P->spheres; k++) {
    Sphere *G = P->sphere + k;
    G->dt = G->c - G->t + along(G, P->dz);
    G->dupper = (mu - G->bend + G->upper * G->dt) * G->over - G->upper;
  }
}

/* The longest steps that keep a fraction of the distance to the limits of t, and of 0. */
static void longest_steps(const Problem *P, double fraction, double *primal, double *dual) {
  V by_t = ALL(1e-300), by_multiplier = ALL(1e-300); /* 1 / step */
  for (int64_t i = 0; i < P->n; i++)
    for (int j = 0; j < NG; j++) {
      const Group *G = P->interval[i].group + j;
      for (int r = 0; r < NC; r++) {
        by_t = larger(by_t, G->dt[r] * G->over[r]);
        by_t = larger(by_t, -G->dt[r] * G->under[r]);
        if (UPPER(r) && LOWER(r)) {
          const V both = 1 / (G->upper[r] * G->lower[r]);
          by_multiplier = larger(by_multiplier, -G->dupper[r] * G->lower[r] * both);
          by_multiplier = larger(by_multiplier, -G->dlower[r] * G->upper[r] * both);
        } else if (UPPER(r)) {
          by_multiplier = larger(by_multiplier, -G->dupper[r] / G->upper[r]);
        } else {
          by_multiplier = larger(by_multiplier, -G->dlower[r] / G->lower[r]);
        }
      }
    }
  double by_primal = largest(by_t), by_dual = largest(by_multiplier);
  for (int64_t k = 0; k < P->spheres; k++) {
    const Sphere *G = P->sphere + k;
    by_primal = greater(by_primal, G->dt * G->over);
    by_dual = greater(by_dual, -G->dupper / G->upper);
  }
  *primal = lesser(1.0, fraction / by_primal);
  *dual = lesser(1.0, fraction / by_dual);
  for (int64_t q = 0; q < P->phases; q++) {
    const double shrink = -durations(P, P->dz)[q] / durations(P, P->z)[q];
    if (shrink > 0) *primal = lesser(*primal, 0.5 / shrink);
  }
}

/* Sum of slack times multiplier after steps of these lengths. */
static double complementarity(const Problem *P, double primal, double dual) {
  V total = ALL(0.0);
  for (int64_t i = 0; i < P->n; i++)
    for (int j = 0; j < NG; j++) {
      const Group *G = P->interval[i].group + j;
      for (int r = 0; r < NC; r++) {
        const V t = G->t[r] + primal * G->dt[r];
        if (UPPER(r)) total += (1 - t) * (G->upper[r] + dual * G->dupper[r]);
        if (LOWER(r)) total += (1 + t) * (G->lower[r] + dual * G->dlower[r]);
      }
    }
  double all = sum(total);
  for (int64_t k = 0; k < P->spheres; k++) {
    const Sphere *G = P->sphere + k;
    all += (1 - G->t - primal * G->dt) * (G->upper + dual * G->dupper);
  }
  return all;
}

/* How many products of a slack and a multiplier there are. */
static double products(const Problem *P) { return 4.0 * NG * SIDES * P->n + P->spheres; }

/* Mehrotra's choice: as far down as dz, Newton's step without barrier, would get, cubed; and
   his correction for what that step neglects, in so far as it can be taken. Where limits block dz
   at once, though it would gain many times what complementarity is left, the barrier has fallen
   ahead of the motion, which creeps along bodies from then on: the barrier rises again. */
static void choose_barrier(Problem *P, double tolerance) {
  double primal, dual;
  longest_steps(P, 1.0, &primal, &dual);
  const double share = complementarity(P, primal, dual) / P->left;
  const double centring = lesser(greater(share * share * share, 1e-3), 1.0);
  const double now = cost(P, P->z, P->run), gain = AHEAD * fabs(cost_along(P, P->dz));
  const double again = ALIKE && primal < BLOCKED ? lesser(gain, MOST_LEFT * now) : 0.0;
  const double aimed = greater(centring * P->left, again);
  P->mu = greater(aimed, 0.05 * tolerance * now) / products(P);
  bend(P, primal*dual);
}

/* Where a step takes t: halfway from t + step dt to c, that is towards where Newton's step
   really leads, but no closer to the limits than a hundredth of the distance now. */
static V moved(int r, V t, V dt, V c, double step) {
  V towards = c;
  if (LOWER(r)) towards = larger(towards, 0.01 * (1 + t) - 1);
  if (UPPER(r)) towards = smaller(towards, 1 - 0.01 * (1 - t));
  return 0.5 * (t + step * dt) + 0.5 * towards;
}

/* The product of the distances of t to its limits. */
static V room_of(int r, V t) {
  if (UPPER(r) && LOWER(r)) return 1 - t * t;
  return UPPER(r) ? 1 - t : 1 + t;
}

/* The barrier at t after a step, plus the penalty on |c - t|. A logarithm takes as long as many
   products: there is one for three rows. */
static double merit_of_rows(const Problem *P, Group *G, const V *c, double step) {
  double barrier = 0;
  V infeasibility = ALL(0.0), room = ALL(1.0);
  for (int r = 0; r < NC; r++) {
    G->moved[r] = step > 0 ? moved(r, G->t[r], G->dt[r], c[r], step) : G->t[r];
    infeasibility += absolute(c[r] - G->moved[r]);
    room *= room_of(r, G->moved[r]);
    if (r % 3 < 2 && r < NC - 1) continue;
    barrier -= log(room[0] * room[1] * room[2] * room[3]);
    room = ALL(1.0);
  }
  return P->mu * barrier + P->penalty * sum(infeasibility);
}

static double merit_of_spheres(Problem *P, double step) {
  double total = 0;
  for (int64_t k = 0; k < P->spheres; k++) {
    Sphere *G = P->sphere + k;
    const double c = step > 0 ? G->next : G->c;
    const double towards = lesser(c, 1 - 0.01 * (1 - G->t));
    G->moved = step > 0 ? 0.5 * (G->t + step * G->dt) + 0.5 * towards : G->t;
    total += P->penalty * fabs(c - G->moved) - P->mu * log(1 - G->moved);
  }
  return total;
}

/* Rows of spheres at z, and the integral of the running cost before any interval adds to it. */
static void begin_spheres(Problem *P, const double *z) {
  P->next_run = 0;
  for (int64_t k = 0; k < P->spheres; k++) P->sphere[k].next = in_sphere(P->sphere + k, z);
}

static double merit(Problem *P, double step) {
  const double *dz = P->dz;
  for (int64_t i = 0; i < size(P); i++) P->trial[i] = P->z[i] + step * dz[i];
  double total = cost(P, P->trial, 0.0) + unevenness(P, P->trial, NULL);
  begin_spheres(P, P->trial);
  for (int64_t i = 0; i < P->n; i++) {
    Interval *I = P->interval + i;
    double room[NK];
    const double *knots = local(P, i, P->trial, room), T = duration_of(P, I, P->trial);
    for (int j = 0; j < NG; j++) {
      rows(P, i, I->group + j, knots, T, I->group[j].next);
      total += merit_of_rows(P, I->group + j, I->group[j].next, step);
    }
  }
  total += merit_of_spheres(P, step);
  if (NL) total += P->given->cost[1] * P->next_run;
  return total;
}

/* Merit now and its slope along the direction, the penalty being large enough for descent. */
static double merit_now(Problem *P, double *slope) {
  double needed = 0, infeasibility = 0;
  V along = ALL(0.0);
  *slope = cost_along(P, P->dz);
  for (int64_t i = 0; i < P->n; i++)
    for (int j = 0; j < NG; j++) {
      const Group *G = P->interval[i].group + j;
      for (int r = 0; r < NC; r++) {
        const V y = G->upper[r] + G->dupper[r] - G->lower[r] - G->dlower[r];
        needed = greater(needed, largest(absolute(y)));
        infeasibility += sum(absolute(G->c[r] - G->t[r]));
        along += P->mu * (G->over[r] - G->under[r]) * G->dt[r];
      }
    }
  for (int64_t k = 0; k < P->spheres; k++) {
    const Sphere *G = P->sphere + k;
    needed = greater(needed, fabs(G->upper + G->dupper));
    infeasibility += fabs(G->c - G->t);
    *slope += P->mu * G->over * G->dt;
  }
  if (needed > P->penalty || needed < P->penalty / 10) P->penalty = 1.5 * needed + 1e-6 * P->unit;
  *slope += sum(along) - P->penalty * infeasibility;
  double *by_z = memset(P->trial, 0, size(P) * sizeof(double));
  double total = cost(P, P->z, P->run) + unevenness(P, P->z, by_z);
  for (int64_t a = 0; P->smooth > 0 && a < size(P); a++) *slope += by_z[a] * P->dz[a];
  for (int64_t i = 0; i < P->n; i++)
    for (int j = 0; j < NG; j++) {
      Group *G = P->interval[i].group + j;
      total += merit_of_rows(P, G, G->c, 0.0);
    }
  return total + merit_of_spheres(P, 0.0);
}

/* Along a new direction halve the step until the merit rises by no more than RISE times what
   complementarity is left; 0 if it does not. That allows nearly all that stays in the workspace
   at first, and hardly any rise near a solution. Rows are curved, and a full step leaves |c - t|
   in proportion to its square, which the next one takes away. Halved for that every time
   (Maratos' effect) steps creep, and on fine meshes seem to have arrived before they have. */
static int try_direction(Problem *P, double *dual) {
  double slope, step;
  direction(P, P->mu);
  longest_steps(P, greater(0.99, 1 - P->mu), &step, dual);
  const double now = merit_now(P, &slope) + RISE * P->left + 1e-12 * P->unit;
  const double aim = 1e-4 * lesser(slope, 0.0);
  for (int k = 0; k < 12; k++, step /= 2)
    if (merit(P, step) <= now + aim * step) {
      P->halvings = k;
      return 1;
    }
  return 0;
}

/* A multiplier after a step, never far from mu / slack: stiffness stays meaningful (Ipopt's
   kappa_sigma). */
static V near_barrier(V multiplier, V mu_by_slack) {
  return smaller(larger(multiplier, mu_by_slack * 1e-8), mu_by_slack * 1e8);
}

/* To the last trial, multipliers by a step of their own. */
static void move(Problem *P, double dual) {
  memcpy(P->z, P->trial, size(P) * sizeof(double));
  P->run = P->next_run;
  for (int64_t i = 0; i < P->n; i++)
    for (int j = 0; j < NG; j++) {
      Group *G = P->interval[i].group + j;
      for (int r = 0; r < NC; r++) {
        G->c[r] = G->next[r];
        G->t[r] = G->moved[r];
        measure(G, r);
        G->upper[r] = near_barrier(G->upper[r] + dual * G->dupper[r], P->mu * G->over[r]);
        G->lower[r] = near_barrier(G->lower[r] + dual * G->dlower[r], P->mu * G->under[r]);
        G->y[r] = G->upper[r] - G->lower[r];
      }
    }
  for (int64_t k = 0; k < P->spheres; k++) {
    Sphere *G = P->sphere + k;
    G->c = G->next;
    G->t = G->moved;
    G->over = 1 / (1 - G->t);
    G->upper = near_barrier(ALL(G->upper + dual * G->dupper), ALL(P->mu * G->over))[0];
  }
}

/* Whether rates at a boundary are not all zero. */
static int has_rates(const Given *given, int64_t b) {
  for (int k = NB * b + NM; k < NB * (b + 1); k++)
    if (given->is_free[k] || given->state[k] != 0) return 1;
  return 0;
}

/* What is known of the intervals before any motion is. */
static void set_intervals(Problem *P) {
  const Given *given = P->given;
  int64_t i = 0;
  for (int64_t phase = 0; phase < P->phases; phase++) {
    V p[NP];
    for (int k = 0; k < NP; k++) p[k] = ALL(given->p[NP * phase + k]);
    prepare(p, P->prepared + NQ * phase);
    for (int64_t j = 0; j < given->intervals[phase]; j++, i++) {
      Interval *I = P->interval + i;
      I->length = given->mesh[i];
      I->own = given->own + NO * i;
      I->phase = phase;
      I->boundary[0] = j == 0 ? phase : -1;
      I->boundary[1] = j == given->intervals[phase] - 1 ? phase + 1 : -1;
      I->moving = 0;
      for (int side = 0; side < 2; side++) {
        const int64_t b = I->boundary[side];
        I->constant[side] = b >= 0 && has_rates(given, b);
        for (int k = 0; b >= 0 && k < NM; k++) I->moving |= given->drift[NM * b + k] != 0;
      }
      I->any_constant = I->constant[0] || I->constant[1];
      I->by_deviation = I->boundary[0] < 0 && I->boundary[1] < 0;
      for (int r = 0; r < NC; r++) I->scale[r] = 1 / given->share[NC * i + r];
      set_weights(P, I);
      set_bending(P, I, durations(P, P->z)[phase]);
    }
  }
  int64_t knot = 0;
  P->spheres = 0;
  for (int64_t b = 0; b <= P->phases; b++) {
    Sphere *B = P->sphere + P->spheres;
    if (given->radius[b] > 0) {
      B->centre = given->state + NB * b;
      B->radius = given->radius[b];
      B->knot = knot;
      P->spheres++;
    }
    if (b < P->phases) knot += given->intervals[b];
  }
  P->first = 1;
  P->last = P->n - 1;
  for (int k = 0; k < NB; k++) {
    if (given->is_free[k]) P->first = 0;
    if (given->is_free[NB * P->phases + k]) P->last = P->n;
  }
}

/* A row's copy and multipliers at the guess; known: those that are given at its points, or NULL; of
   a problem with a running cost as fractions of the cost. */
static void begin_row(const Problem *P, Group *G, int r, double closest, const double *known) {
  G->t[r] = G->c[r];
  if (LOWER(r)) G->t[r] = larger(G->t[r], ALL(closest - 1));
  if (UPPER(r)) G->t[r] = smaller(G->t[r], ALL(1 - closest));
  measure(G, r);
  G->upper[r] = P->mu * G->over[r];
  G->lower[r] = P->mu * G->under[r];
  for (int l = 0; known && l < 4; l++) {
    if (UPPER(r)) G->upper[r][l] = greater(G->upper[r][l], P->unit * known[NC * l + r]);
    if (LOWER(r)) G->lower[r][l] = greater(G->lower[r][l], -P->unit * known[NC * l + r]);
  }
  G->y[r] = G->upper[r] - G->lower[r];
  G->dt[r] = G->dupper[r] = G->dlower[r] = ALL(0.0);
  G->bend_upper[r] = G->bend_lower[r] = ALL(0.0);
}

/* T^d for component k of the state at a boundary, d its derivative. */
static double power(double T, int k) {
  const int derivative = k / NM % NR;
  return derivative == 0 ? 1 : derivative == 1 ? T : T * T;
}

/* The unknowns from the phases' own knots: where two phases meet there is one knot, and at
   boundaries what is given stands instead of the guess. */
static void pack(const Problem *P, const double *knots, const double *T) {
  double *z = P->z, time = 0;
  for (int64_t q = 0; q < P->phases; q++, knots += NB) {
    const int64_t numbers = NB * P->given->intervals[q];
    memcpy(z, knots, (numbers + NB) * sizeof(double));
    z += numbers;
    knots += numbers;
  }
  memcpy(z + NB, T, P->phases * sizeof(double));
  z = P->z;
  for (int64_t b = 0; b <= P->phases; b++) {
    const double *state = P->given->state + NB * b, *drift = P->given->drift + NM * b;
    const int constant = has_rates(P->given, b);
    for (int k = 0; k < NB; k++) {
      if (!P->given->is_free[NB * b + k])
        z[k] = k < NM ? state[k] + drift[k] * time : state[k];
      else if (constant)
        z[k] /= power(T[b < P->phases ? b : b - 1], k);
    }
    if (b == P->phases) return;
    z += NB * P->given->intervals[b];
    time += T[b];
  }
}

/* The phases' own knots and durations from the unknowns. */
static void unpack(const Problem *P, double *knots, double *T) {
  const double *z = P->z;
  memcpy(T, durations(P, P->z), P->phases * sizeof(double));
  for (int64_t q = 0; q < P->phases; q++, knots += NB) {
    const int64_t numbers = NB * P->given->intervals[q];
    memcpy(knots, z, (numbers + NB) * sizeof(double));
    for (int k = 0; k < NB; k++) {
      if (has_rates(P->given, q)) knots[k] *= power(T[q], k);
      if (has_rates(P->given, q + 1)) knots[numbers + k] *= power(T[q], k);
    }
    z += numbers;
    knots += numbers;
  }
}

/* Weights, rows and multipliers at the guess; 0 where the rows are no numbers. known: the
   multipliers of all rows, or NULL. */
static int begin(Problem *P, const Settings *S, const double *known) {
  double total = 0;
  P->smooth = S->smooth;
  set_intervals(P);
  P->penalty = 0;
  begin_spheres(P, P->z);
  for (int64_t i = 0; i < P->n; i++) {
    Interval *I = P->interval + i;
    double room[NK];
    const double *knots = local(P, i, P->z, room), T = duration_of(P, I, P->z);
    for (int j = 0; j < NG; j++) {
      Group *G = I->group + j;
      rows(P, i, G, knots, T, G->c);
      for (int r = 0; r < NC; r++) total += sum(absolute(G->c[r]));
    }
  }
  P->run = P->next_run;
  const double at_guess = cost(P, P->z, P->run);
  P->mu = S->barrier * at_guess / products(P);
  P->unit = NL ? at_guess : 1.0;
  P->smooth *= P->unit;
  for (int64_t i = 0; i < P->n; i++)
    for (int j = 0; j < NG; j++) {
      for (int r = 0; r < NC; r++) begin_row(P, P->interval[i].group + j, r, S->closest, known);
      if (known) known += 4 * NC;
    }
  for (int64_t k = 0; k < P->spheres; k++) {
    Sphere *G = P->sphere + k;
    G->c = G->next;
    G->t = lesser(G->c, 1 - S->closest);
    G->over = 1 / (1 - G->t);
    G->upper = P->mu * G->over;
    G->dt = G->dupper = G->bend = 0;
    total += fabs(G->c);
  }
  return total + fabs(at_guess) < DBL_MAX;
}

/* How far rows are from their copies at most. */
static double infeasibility(const Problem *P) {
  V most = ALL(0.0);
  for (int64_t i = 0; i < P->n; i++)
    for (int j = 0; j < NG; j++) {
      const Group *G = P->interval[i].group + j;
      for (int r = 0; r < NC; r++) most = larger(most, absolute(G->c[r] - G->t[r]));
    }
  return largest(most);
}

/* Whether z is a solution: dz is Newton's step without barrier. A shifted step is the first of
   many along a valley that is nearly flat, and tells a small part of what these gain: as long
   as there are iterations, it must be as much smaller. Where the guess was a solution but for limits
   that were moved, it is enough in the end that these are kept. */
static int solved(Problem *P, const Settings *S, double shift) {
  const double now = cost(P, P->z, P->run), change = fabs(cost_along(P, P->dz)) / now;
  const int is_last = P->report->iterations == S->iterations - 1;
  Report *R = P->report;
  for (int64_t k = 0; k < P->spheres; k++)
    R->primal = greater(R->primal, fabs(P->sphere[k].c - P->sphere[k].t));
  R->dual = (shift > 0 ? VALLEY : 1.0) * change;
  R->cost = now;
  R->complementarity = P->left / now;
  const double asked = !is_last ? R->dual : S->is_warm ? 0.0 : change;
  return greater(R->complementarity, asked) <= S->tolerance && R->primal <= S->rows;
}

/* What is left includes what is lost because a solution is smooth: what Newton's step would gain if
   that counted nothing from now on. */
static void measure_unevenness(Problem *P, const Settings *S, double shift) {
  P->smooth = 0;
  direction(P, 0.0);
  solved(P, S, shift);
}

static void differentiate_all(Problem *P) {
  memset(P->slope, 0, NL * size(P) * sizeof(double));
  for (int64_t i = 0; i < P->n; i++) curvature(P, i);
  for (int64_t k = 0; k < P->spheres; k++) set_slope(P->sphere + k, P->z);
  if (NL) reduce_gradient(P, P->slope);
}

/* The largest change of a row that the direction asks for, towards a limit that it has. */
static double largest_change(const Problem *P) {
  V most = ALL(0.0);
  for (int64_t i = 0; i < P->n; i++)
    for (int j = 0; j < NG; j++)
      for (int r = 0; r < NC; r++) {
        const V dt = P->interval[i].group[j].dt[r];
        if (UPPER(r)) most = larger(most, dt);
        if (LOWER(r)) most = larger(most, -dt);
      }
  return largest(most);
}

/* Newton's direction without barrier, shifted until it is one of descent; 0 if there is none.
   Where curvature almost vanishes it would ask for torques far beyond their limits, and end
   at the first of them; or the rows' own curvature would halve its step again and again: both
   are cured by a shift. Where rows are farther than that from their limits, any direction that
   mends it changes them so much, and a shift would only keep it from that. */
static int aim(Problem *P, double *shift) {
  const double left = P->left / cost(P, P->z, P->run), most = HIGHEST * P->unit;
  const double first = SHIFT * P->unit * lesser(1.0, left / FAR_OFF);
  const int is_far = P->report->primal > FAR;
  if (P->halvings > 1) *shift = greater(*shift, lesser(greater(8 * *shift, first), most));
  if (P->halvings < 1) *shift = *shift > first ? *shift / 8 : 0.0;
  for (;; *shift = greater(8 * *shift, first)) {
    if (!factorise_shifted(P, shift, first)) return 0;
    direction(P, 0.0);
    double primal, dual;
    longest_steps(P, 1.0, &primal, &dual);
    if (is_far || primal > SHORT || largest_change(P) < FAR) return 1;
  }
}

/* Write down where an iteration stands: cost, complementarity as a fraction of it, shift of the
   Hessian, halvings of the last step. */
static void watch(const Problem *P, const Settings *S, double shift) {
  if (!S->trace) return;
  double *line = S->trace + TRACED * P->report->iterations;
  line[0] = cost(P, P->z, P->run);
  line[1] = P->left / line[0];
  line[2] = shift;
  line[3] = P->halvings;
}

static int iterate(Problem *P, const Settings *S) {
  double shift = 0, dual;
  for (; P->report->iterations < S->iterations; P->report->iterations++) {
    differentiate_all(P);
    P->left = complementarity(P, 0, 0);
    P->report->primal = infeasibility(P);
    watch(P, S, shift);
    if (!aim(P, &shift)) return SINGULAR;
    if (solved(P, S, shift)) {
      if (P->smooth > 0) measure_unevenness(P, S, shift);
      return SOLVED;
    }
    choose_barrier(P, S->tolerance);
    if (!try_direction(P, &dual)) {
      bend(P, 0.0);
      if (!try_direction(P, &dual)) return NO_PROGRESS;
    }
    bend(P, 0.0);
    move(P, dual);
  }
  return TOO_MANY_ITERATIONS;
}

/* ---- what Python calls ---- */

/* The next part of the memory, on a cache line of its own. */
static void *part(uintptr_t *address, int64_t bytes) {
  const uintptr_t begin = (*address + 63) / 64 * 64;
  *address = begin + (uintptr_t)bytes;
  return (void *)begin;
}

/* Share out the memory from an address on; the address after it. */
static uintptr_t share_out(Problem *P, uintptr_t address) {
  const int64_t numbers = size(P), real = sizeof(double), w = P->phases;
  P->interval = part(&address, P->n * (int64_t)sizeof(Interval));
  P->block = part(&address, (P->n + 1) * (int64_t)sizeof(Block));
  P->prepared = part(&address, P->phases * NQ * (int64_t)sizeof(V));
  P->border = part(&address, (P->n + 1) * w * NB * real);
  P->corner = part(&address, w * w * real);
  P->pivot = part(&address, w * real);
  P->rest = part(&address, w * real);
  P->along_sum = part(&address, w * real);
  P->z = part(&address, numbers * real);
  P->dz = part(&address, numbers * real);
  P->trial = part(&address, numbers * real);
  P->g = part(&address, numbers * real);
  P->slope = part(&address, NL * numbers * real);
  P->sphere = part(&address, (P->phases + 1) * (int64_t)sizeof(Sphere));
  return address;
}

/* Bytes of memory that ``solve`` needs for n intervals in all. */
int64_t workspace(int64_t n, int64_t phases) {
  Problem P = {.n = n, .phases = phases};
  return (int64_t)share_out(&P, 64);
}

/* What Python hands over, one after the other: see Given. */
static Given given_by(int64_t phases, int64_t n, const int64_t *flags, const double *rule,
                      const double *numbers) {
  Given G = {.phases = phases, .intervals = flags, .given = flags + phases};
  G.is_free = G.given + phases;
  G.fractions = rule;
  G.thirds = rule + 4 * NG;
  G.quadrature = rule + 8 * NG;
  G.mesh = numbers;
  G.own = G.mesh + n;
  G.share = G.own + n * NO;
  G.p = G.share + n * NC;
  G.state = G.p + phases * NP;
  G.drift = G.state + (phases + 1) * NB;
  G.radius = G.drift + (phases + 1) * NM;
  G.cost = G.radius + phases + 1;
  return G;
}

/* flags: intervals, given, is_free. rule: fractions, thirds, quadrature. numbers: mesh, own, share, p, state,
   drift, radius, cost. motion: in, a guess; out, the solution: knots of each phase in units of its duration,
   (n + phases) x NB, and the durations. multipliers: out, n x points x NC of the rows, one
   for each sphere; in, those of the rows, per share of what may be used of the
   limits, if settings say that they are given. memory: for this call alone, its contents of no account. */
int solve(int64_t phases, const int64_t *flags, const double *rule, const double *numbers,
          double *motion, double *multipliers, const Settings *settings, Report *report,
          void *memory) {
  Problem P = {.phases = phases, .report = report};
  for (int64_t q = 0; q < phases; q++) P.n += flags[q];
  const Given given = given_by(phases, P.n, flags, rule, numbers);
  P.given = &given;
  share_out(&P, (uintptr_t)memory);
  memset(report, 0, sizeof *report);
  double *T = motion + (P.n + phases) * NB;
  pack(&P, motion, T);
  const int status = begin(&P, settings, settings->is_warm ? multipliers : NULL) ? iterate(&P, settings) : NOT_A_NUMBER;
  unpack(&P, motion, T);
  for (int64_t i = 0; i < P.n; i++)
    for (int j = 0; j < NG; j++)
      for (int l = 0; l < 4; l++)
        for (int r = 0; r < NC; r++)
          *multipliers++ = P.interval[i].group[j].y[r][l] * P.interval[i].scale[r];
  for (int64_t k = 0; k < P.spheres; k++) *multipliers++ = P.sphere[k].upper;
  return status;
}
