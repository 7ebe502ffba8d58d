/* From knots to points and back: Hermite's polynomials, and the units of knots at boundaries. */

/* Hermite's polynomials: coefficients of 1, s, s^2, .. for X, V[, A] at both knots of [0, 1]. */
#if NR == 2
static const double HERMITE[4][4] = {{1, 0, -3, 2}, {0, 1, -2, 1}, {0, 0, 3, -2}, {0, 0, -1, 1}};
#else
static const double HERMITE[6][6] = {
    {1, 0, 0, -10, 15, -6}, {0, 1, 0, -6, 8, -3}, {0, 0, 0.5, -1.5, 1.5, -0.5},
    {0, 0, 0, 10, -15, 6},  {0, 0, 0, -4, 7, -3}, {0, 0, 0, 0.5, -1, 0.5}};
#endif

/* Their derivatives of order d at fractions s of an interval of length one. */
static V hermite(int d, int a, V s) {
  V value = ALL(0.0);
  for (int k = 2 * NR - 1; k >= d; k--) {
    double factor = HERMITE[a][k];
    for (int j = 0; j < d; j++) factor *= k - j;
    value = value * s + factor;
  }
  return value;
}

static void set_unit_weights(Problem *P) {
  for (int a = 0; a < 2 * NR; a++)
    for (int b = 0; b < 2 * NR; b++) P->unit_bending[a][b] = 0;
  for (int g = 0; g < NG; g++) {
    V s;
    memcpy(&s, P->given->fractions + 4 * g, sizeof s);
    for (int d = 0; d <= NR; d++)
      for (int a = 0; a < 2 * NR; a++) P->unit[g][d][a] = hermite(d, a, s);
    for (int a = 0; a < 2 * NR; a++)
      for (int b = 0; b < 2 * NR; b++)
        P->unit_bending[a][b] += USUAL / NG * sum(P->unit[g][2][a] * P->unit[g][2][b]);
  }
}

/* The integral of A^2 in units of each knot, whose rates V, A are T, T^2 times those in
   constant units; scale: length^-4 and so on by its derivatives. */
static void set_bending(const Problem *P, Interval *I, double T) {
  double factor[2 * NR];
  for (int a = 0; a < 2 * NR; a++) {
    factor[a] = a % NR == 0 ? 1 / (I->length * I->length) : factor[a - 1] * I->length;
    if (a % NR > 0 && I->constant[a / NR]) factor[a] *= T;
  }
  for (int a = 0; a < 2 * NR; a++)
    for (int b = 0; b < 2 * NR; b++)
      I->bending[a][b] = I->length * factor[a] * factor[b] * P->unit_bending[a][b];
}

static void set_weights(const Problem *P, Interval *I) {
  for (int g = 0; g < NG; g++) {
    V weights;
    memcpy(&weights, P->given->quadrature + 4 * g, sizeof weights);
    I->group[g].integral = I->length * weights;
    double by_order = 1; /* length^-d */
    for (int d = 0; d <= NR; d++, by_order /= I->length) {
      double by_length = by_order;
      for (int a = 0; a < 2 * NR; a++) {
        by_length = a % NR == 0 ? by_order : by_length * I->length;
        I->group[g].weight[d][a] = by_length * P->unit[g][d][a];
      }
    }
  }
}

/* y = (X, V, A[, J], T) at the points, from the interval's two knots. */
static void at_points(const Group *G, const double *knots, double T, V *y) {
  for (int d = 0; d <= NR; d++)
    for (int k = 0; k < NM; k++) {
      V value = ALL(0.0);
      for (int a = 0; a < 2 * NR; a++) value += G->weight[d][a] * knots[NM * a + k];
      y[NM * d + k] = value;
    }
  y[NY - 1] = ALL(T);
}

/* One number per knot variable from one per component of y: the transpose of at_points. */
static V at_knot(const Group *G, const V *m, int a, int k) {
  V value = G->weight[0][a] * m[k];
  for (int d = 1; d <= NR; d++) value += G->weight[d][a] * m[NM * d + k];
  return value;
}

/* ---- boundaries: constant units and positions that move ---- */

/* T^d, the unit of a component of a knot if it is in constant units, d its derivative. */
static double unit_of(const Interval *I, int component, double T) {
  const int derivative = component / NM % NR;
  if (derivative == 0 || !I->constant[component / NB]) return 1;
  return derivative == 1 ? T : T * T;
}

/* By T: what the chain rule adds for (X, T v[, T^2 a]), v and a being unknowns. */
static double unit_slope(const Interval *I, int component, double T) {
  const int derivative = component / NM % NR;
  if (derivative == 0 || !I->constant[component / NB]) return 0;
  return derivative == 1 ? 1 : 2 * T;
}

/* The knots of interval i in units of its phase. */
static const double *local(const Problem *P, int64_t i, double *z, double *room) {
  const Interval *I = P->interval + i;
  if (!I->any_constant) return z + NB * i;
  const double T = duration_of(P, I, z);
  for (int a = 0; a < NK; a++) room[a] = unit_of(I, a, T) * z[NB * i + a];
  return room;
}

/* Their change along dz. */
static const double *local_change(const Problem *P, int64_t i, double *room) {
  const Interval *I = P->interval + i;
  const double *z = P->z + NB * i, *dz = P->dz + NB * i;
  if (!I->any_constant) return dz;
  const double T = duration_of(P, I, P->z), dT = duration_of(P, I, P->dz);
  for (int a = 0; a < NK; a++) room[a] = unit_of(I, a, T) * dz[a] + unit_slope(I, a, T) * z[a] * dT;
  return room;
}

/* Add m, numbers by y at four points, to a gradient by z. */
static void add_to_gradient(const Problem *P, int64_t i, const Group *G, const V *m, double *g) {
  const Interval *I = P->interval + i;
  double *by_knots = g + NB * i, *by_T = durations(P, g) + I->phase;
  *by_T += sum(m[NY - 1]);
  if (!I->any_constant) {
    for (int a = 0; a < NK; a++) by_knots[a] += sum(at_knot(G, m, a / NM, a % NM));
    return;
  }
  const double *z = P->z + NB * i, T = duration_of(P, I, P->z);
  for (int a = 0; a < NK; a++) {
    const double by_local = sum(at_knot(G, m, a / NM, a % NM));
    by_knots[a] += unit_of(I, a, T) * by_local;
    *by_T += unit_slope(I, a, T) * z[a] * by_local;
  }
}

/* A position that moves is no unknown but drift * (sum of the durations before it): its part of a
   gradient belongs to these. What belongs to nothing unknown becomes zero. */
static void reduce_gradient(const Problem *P, double *g) {
  int64_t knot = 0;
  for (int64_t b = 0; b <= P->phases; b++) {
    double *at = g + NB * knot;
    for (int64_t q = 0; q < b; q++)
      for (int k = 0; k < NM; k++) durations(P, g)[q] += P->given->drift[NM * b + k] * at[k];
    for (int k = 0; k < NB; k++)
      if (!P->given->is_free[NB * b + k]) at[k] = 0;
    if (b < P->phases) knot += P->given->intervals[b];
  }
  for (int64_t q = 0; q < P->phases; q++)
    if (P->given->given[q]) durations(P, g)[q] = 0;
}

/* The same the other way: how positions that move change with the durations. */
static void move_positions(const Problem *P, double *dz) {
  int64_t knot = 0;
  double time = 0;
  for (int64_t b = 0; b <= P->phases; b++) {
    for (int k = 0; k < NM; k++) {
      const double drift = P->given->drift[NM * b + k];
      if (drift != 0) dz[NB * knot + k] = drift * time;
    }
    if (b == P->phases) return;
    time += durations(P, dz)[b];
    knot += P->given->intervals[b];
  }
}

/* Derivative by duration q of local variable a: of both knots, last the phase's own duration. */
static double rate_of(const Problem *P, const Interval *I, int a, int64_t q) {
  if (a == NK) return q == I->phase;
  const int64_t b = I->boundary[a / NB];
  return b > q && a % NB < NM ? P->given->drift[NM * b + a % NB] : 0;
}

static double symmetric(const Interval *I, int a, int b) { return a > b ? I->K[a][b] : I->K[b][a]; }

/* From K by (X, V, A) to K by (x, v, a) where knots are in constant units; g: the gradient of
   the Lagrangian by the former, for the curvature of the change of units itself. */
static void curvature_in_constant_units(const Problem *P, int64_t i, const double *g) {
  Interval *I = P->interval + i;
  const double *z = P->z + NB * i, T = duration_of(P, I, P->z);
  double by_T[NK + 1], corner = I->K[NK][NK];
  for (int a = 0; a < NK; a++) {
    by_T[a] = I->K[NK][a];
    for (int b = 0; b < NK; b++) by_T[a] += symmetric(I, a, b) * unit_slope(I, b, T) * z[b];
  }
  for (int a = 0; a < NK; a++) {
    const int second_derivative = unit_slope(I, a, T) != 0 && a / NM % NR == 2;
    corner += unit_slope(I, a, T) * z[a] * (I->K[NK][a] + by_T[a]);
    if (second_derivative) corner += 2 * z[a] * g[a];
  }
  for (int a = 0; a < NK; a++) {
    I->K[NK][a] = unit_of(I, a, T) * by_T[a] + unit_slope(I, a, T) * g[a];
    for (int b = 0; b <= a; b++) I->K[a][b] *= unit_of(I, a, T) * unit_of(I, b, T);
  }
  I->K[NK][NK] = corner;
}
