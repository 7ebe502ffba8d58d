/* Constraint rows and the running cost at the points, spheres, and their derivatives by the knots. */

/* From shares of the limits to shares of what may be used of them, or multipliers back. */
static void scale(const Interval *I, V *c) {
  for (int r = 0; r < NC; r++) c[r] *= I->scale[r];
}

/* Whether all that a row of position and velocity depends on is given at a point. */
static int is_given(const Problem *P, const Interval *I, double fraction, int row) {
  const int64_t b = fraction == 0 ? I->boundary[0] : fraction == 1 ? I->boundary[1] : -1;
  for (int k = 0; b >= 0 && k < 2 * NM; k++)
    if (DEPENDS(row, k) && P->given->is_free[NB * b + k]) return 0;
  return b >= 0 && !I->moving;
}

/* No limit of position or speed where it is given: at a limit there, a motion has no inside. */
static void leave_out_given(const Problem *P, const Interval *I, const Group *G, V *c) {
  if (I->boundary[0] < 0 && I->boundary[1] < 0) return;
  const double *fractions = P->given->fractions + 4 * (G - I->group);
  for (int l = 0; l < 4; l++)
    for (int r = 0; r < NC; r++)
      if (STATE(r) && fabs(c[r][l]) > AT_LIMIT && is_given(P, I, fractions[l], r)) c[r][l] = 0;
}

/* The parameters of an interval, and what depends on them. */
static const V *parameters(Problem *P, const Interval *I) {
  V *q = P->prepared + NQ * I->phase;
  for (int k = 0; k < NO; k++) q[OWN + k] = ALL(I->own[k]);
  return q;
}

/* Rows at the points of interval i as shares of what may be used of the limits; to the integral of
   the running cost its part of it. */
static void rows(Problem *P, int64_t i, Group *G, const double *knots, double T, V *c) {
  const Interval *I = P->interval + i;
  V y[NY], g[NL];
  at_points(G, knots, T, y);
  values(y, parameters(P, I), I->scale, c, g, G->e);
  scale(I, c);
  leave_out_given(P, I, G, c);
  if (NL) P->next_run += sum(G->integral * g[0]);
}

/* Curvature of the Lagrangian with t eliminated, by y; the rows are known from the trial that
   led here, or from the beginning. */
static void differentiate(Problem *P, const Interval *I, Group *G, const double *knots,
                          V S[NY][NY]) {
  V y[NY], weight[NC + NL], stiffness[NC], H[NH];
  at_points(G, knots, duration_of(P, I, P->z), y);
  memcpy(weight, G->y, sizeof G->y);
  scale(I, weight);
  for (int k = 0; k < NL; k++) weight[NC + k] = P->given->cost[1] * G->integral;
  second(y, G->e, weight, parameters(P, I), I->scale, G->C, H);
  scale_rows(G->C, I->scale);
  for (int r = 0; r < NC; r++)
    stiffness[r] = G->upper[r] * G->over[r] + G->lower[r] * G->under[r];
  curvature_of_rows(G->C, H, stiffness, S);
}

/* The same by both knots and T, added to the lower triangle of K. */
static void add_curvature(const Group *G, V S[NY][NY], double K[NK + 1][WIDE + 4]) {
  V half[NK + 1][NY];
  for (int b = 0; b < NY; b++) { /* S is symmetric: its rows are its columns */
    for (int a = 0; a < NK; a++) half[a][b] = at_knot(G->form, S[b], a / NM, a % NM);
    half[NK][b] = S[NY - 1][b];
  }
  for (int row = 0; row <= NK; row++)
    for (int a = 0; a < NK && a <= row; a += 4) {
      V four[4], before;
      for (int k = 0; k < 4; k++)
        four[k] = WIDE == NK || a + k < NK ? at_knot(G->form, half[row], (a + k) / NM, (a + k) % NM)
                                           : ALL(0.0);
      memcpy(&before, K[row] + a, sizeof before);
      const V sums = NG == 1 ? sum_each(four) : before + sum_each(four);
      memcpy(K[row] + a, &sums, sizeof sums);
    }
}

/* The gradient of the Lagrangian by the interval's own knots. */
static void local_gradient(const Problem *P, const Interval *I, double *g) {
  memset(g, 0, NK * sizeof(double));
  for (int j = 0; j < NG; j++) {
    const Group *G = I->group + j;
    V m[NY];
    across_rows(G->C, G->y, m);
    for (int k = 0; k < NL; k++)
      for (int a = 0; a < NY; a++) m[a] += P->given->cost[1] * G->integral * G->C[NZ + NY * k + a];
    for (int a = 0; a < NK; a++) g[a] += sum(at_knot(G->weight, m, a / NM, a % NM));
  }
}

static void curvature(Problem *P, int64_t i) {
  Interval *I = P->interval + i;
  double room[NK], by_T = 0;
  const double *knots = local(P, i, P->z, room);
  if (NG > 1) memset(I->K, 0, sizeof I->K);
  for (int j = 0; j < NG; j++) {
    Group *G = I->group + j;
    V S[NY][NY];
    differentiate(P, I, G, knots, S);
    add_curvature(G, S, I->K);
    by_T += sum(S[NY - 1][NY - 1]);
    for (int k = 0; k < NL; k++) {
      V m[NY];
      for (int a = 0; a < NY; a++) m[a] = G->integral * G->C[NZ + NY * k + a];
      add_to_gradient(P, i, G, m, P->slope + k * size(P));
    }
  }
  I->K[NK][NK] = by_T;
  if (!I->any_constant) return;
  double g[NK];
  local_gradient(P, I, g);
  curvature_in_constant_units(P, i, g);
  set_bending(P, I, duration_of(P, I, P->z));
}

/* How far t is from its limits; kept, for a division takes as long as many products. */
static void measure(Group *G, int r) {
  const V up = 1 - G->t[r], down = 1 + G->t[r];
  if (UPPER(r) && LOWER(r)) {
    const V both = 1 / (up * down);
    G->over[r] = down * both;
    G->under[r] = up * both;
  } else {
    G->over[r] = UPPER(r) ? 1 / up : ALL(0.0);
    G->under[r] = LOWER(r) ? 1 / down : ALL(0.0);
  }
}

/* ---- spheres: (distance of a position from a centre / radius)^2 <= 1 ---- */

static double in_sphere(const Sphere *B, const double *z) {
  double square = 0;
  for (int k = 0; k < NM; k++) {
    const double away = (z[NB * B->knot + k] - B->centre[k]) / B->radius;
    square += away * away;
  }
  return square;
}

static void set_slope(Sphere *B, const double *z) {
  for (int k = 0; k < NM; k++)
    B->slope[k] = 2 * (z[NB * B->knot + k] - B->centre[k]) / (B->radius * B->radius);
}

/* The derivative of what is minimised along dz. */
static double cost_along(const Problem *P, double *dz) {
  double run = 0;
  for (int64_t a = 0; NL && a < size(P); a++) run += P->slope[a] * dz[a];
  return cost(P, dz, run);
}

/* The derivative of a sphere's row along dz. */
static double along(const Sphere *B, const double *dz) {
  double total = 0;
  for (int j = 0; j < NM; j++) total += B->slope[j] * dz[NB * B->knot + j];
  return total;
}

/* What the spheres of a knot add to its block: their curvature and their stiffness. */
static void add_spheres(const Problem *P, int64_t knot, Block *block) {
  for (int64_t b = 0; b < P->spheres; b++) {
    const Sphere *B = P->sphere + b;
    if (B->knot != knot) continue;
    for (int r = 0; r < NM; r++) {
      block->D[r][r] += 2 * B->upper / (B->radius * B->radius);
      for (int s = 0; s <= r; s++)
        block->D[r][s] += B->upper * B->over * B->slope[r] * B->slope[s];
    }
  }
}

/* What is added to what is minimised at z for a smooth motion, in place of none of many that take
   equally long; its gradient is added to g, if there is one. */
static double unevenness(const Problem *P, double *z, double *g) {
  double total = 0;
  for (int64_t i = 0; P->smooth > 0 && i < P->n; i++) {
    const Interval *I = P->interval + i;
    const double weight = smoothing(P, I) * bending_weight(P, I);
    double room[NK];
    const double *knots = local(P, i, z, room);
    for (int j = 0; j < NG; j++) {
      V y[NY], m[NY] = {0};
      at_points(I->group + j, knots, 0.0, y); /* the knots' products would cancel */
      for (int k = 2 * NM; k < 3 * NM; k++) {
        m[k] = weight * y[k];
        total += 0.5 * sum(m[k] * y[k]);
      }
      if (g) add_to_gradient(P, i, I->group + j, m, g);
    }
  }
  return total;
}
