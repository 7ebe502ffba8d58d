/* From knots to points and back, and the units of knots at boundaries. */

/* What X, V, A[, J] are on [0, 1] by X, V[, A] at both knots: Hermite's polynomials and their
   derivatives by s, or three cubics, ``thirds`` saying in which of them a point is. */
#if NR == 2
static void hermite(V s, V thirds, V W[3][4]) {
  (void)thirds;
  const V s2 = s * s, s3 = s2 * s;
  const V all[3][4] = {{1 - 3 * s2 + 2 * s3, s - 2 * s2 + s3, 3 * s2 - 2 * s3, s3 - s2},
                       {6 * (s2 - s), 1 - 4 * s + 3 * s2, 6 * (s - s2), 3 * s2 - 2 * s},
                       {12 * s - 6, 6 * s - 4, 6 - 12 * s, 6 * s - 2}};
  memcpy(W, all, sizeof all);
}
#else
/* The acceleration at both ends of the thirds of an interval, by X, V, A at both knots: with it
   linear in each third, the cubics there lead from knot to knot with continuous acceleration. */
static const double AT_THIRDS[4][6] = {{0, 0, 1, 0, 0, 0},
                                       {-9, -6, -5.0 / 6, 9, -3, 1.0 / 3},
                                       {9, 3, 1.0 / 3, -9, 6, -5.0 / 6},
                                       {0, 0, 0, 0, 0, 1}};

/* At s in a third of [0, 1]: X, V, A, J by X, V, A at both knots. */
static void cubics(int third, double s, double W[4][6]) {
  const double L = 1.0 / 3, t = s - third * L;
  for (int a = 0; a < 6; a++) {
    double x = a == 0, v = a == 1;
    for (int k = 0; k < third; k++) {
      x += L * v + L * L * (2 * AT_THIRDS[k][a] + AT_THIRDS[k + 1][a]) / 6;
      v += L * (AT_THIRDS[k][a] + AT_THIRDS[k + 1][a]) / 2;
    }
    const double begin = AT_THIRDS[third][a], jerk = (AT_THIRDS[third + 1][a] - begin) / L;
    W[0][a] = x + t * (v + t * (begin / 2 + t * jerk / 6));
    W[1][a] = v + t * (begin + t * jerk / 2);
    W[2][a] = begin + t * jerk;
    W[3][a] = jerk;
  }
}

static void hermite(V s, V thirds, V W[4][6]) {
  for (int l = 0; l < 4; l++) {
    double at[4][6];
    cubics((int)thirds[l], s[l], at);
    for (int d = 0; d < 4; d++)
      for (int a = 0; a < 6; a++) W[d][a][l] = at[d][a];
  }
}
#endif

/* t^k / k!: of derivative d + k in derivative d a time t later. */
static V taylor(V t, int k) {
  return k < 0 ? ALL(0.0) : k == 0 ? ALL(1.0) : k == 1 ? t : 0.5 * t * t;
}

/* From W, by both knots of [0, 1], to the same by knot i + 1 and its deviation d from where knot i
   leads: X_i = where (knot i + 1 - d) was 1 earlier. */
static void by_deviation(V s, V W[NR + 1][2 * NR], V form[NR + 1][2 * NR]) {
  for (int d = 0; d <= NR; d++)
    for (int a = 0; a < NR; a++) {
      form[d][a] = ALL(0.0);
      for (int b = 0; b <= a; b++) form[d][a] -= W[d][b] * taylor(ALL(-1.0), a - b);
      form[d][NR + a] = taylor(s - 1, a - d);
    }
}

/* From [0, 1] to an interval of length e: each derivative by time divides by it. */
static void lengthen(double e, V W[NR + 1][2 * NR]) {
  const double power[] = {1, e, e * e, e * e * e};
  for (int d = 0; d <= NR; d++)
    for (int a = 0; a < 2 * NR; a++) {
      if (a % NR > d) W[d][a] *= power[a % NR - d];
      if (a % NR < d) W[d][a] /= power[d - a % NR];
    }
}

/* The weights at the points of an interval. */
static void set_weights(const Problem *P, Interval *I) {
  for (int k = 0; k < NR; k++) I->back[k] = taylor(ALL(-I->length), k)[0];
  for (int g = 0; g < NG; g++) {
    Group *G = I->group + g;
    V s, thirds, weights;
    memcpy(&s, P->given->fractions + 4 * g, sizeof s);
    memcpy(&thirds, P->given->thirds + 4 * g, sizeof thirds);
    memcpy(&weights, P->given->quadrature + 4 * g, sizeof weights);
    G->integral = I->length * weights;
    hermite(s, thirds, G->weight);
    memcpy(G->form, G->weight, sizeof G->form);
    if (I->by_deviation) by_deviation(s, G->weight, G->form);
    lengthen(I->length, G->weight);
    lengthen(I->length, G->form);
  }
}

/* From a gradient by knot i, numbers a stride apart, to one by where knot i leads. */
static void lead_on(const Interval *I, double *g, int stride) {
  for (int k = 0; k < NM; k++)
    for (int a = NR - 1; a > 0; a--)
      for (int b = 0; b < a; b++)
        g[stride * (NM * a + k)] += I->back[a - b] * g[stride * (NM * b + k)];
}

/* From where knot i leads to knot i. */
static void lead_back(const Interval *I, double *x) {
  for (int k = 0; k < NM; k++)
    for (int b = 0; b < NR; b++)
      for (int a = b + 1; a < NR; a++) x[NM * b + k] += I->back[a - b] * x[NM * a + k];
}

/* What A^2 weighs at each point of an interval. Where smooth motions are sought it weighs less in
   short intervals, in which motors reach their speed at once: A has to be large there. */
static double bending_weight(const Problem *P, const Interval *I) {
  return USUAL * I->length / NG * (P->smooth > 0 ? USUAL * I->length : 1.0);
}

/* What A^2, so weighted, counts in what is minimised. */
static double smoothing(const Problem *P, const Interval *I) { return P->smooth * I->length; }

/* What A^2 at the points adds up to as a form in the knots, each in its unit. */
static void set_bending(const Problem *P, Interval *I, double T) {
  const double rates[] = {1, T, T * T};
  for (int a = 0; a < 2 * NR; a++)
    for (int b = 0; b < 2 * NR; b++) {
      double total = 0;
      for (int g = 0; g < NG; g++)
        total += sum(I->group[g].form[2][a] * I->group[g].form[2][b]);
      I->bending[a][b] = bending_weight(P, I) * total;
      if (I->constant[a / NR]) I->bending[a][b] *= rates[a % NR];
      if (I->constant[b / NR]) I->bending[a][b] *= rates[b % NR];
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
static V at_knot(const V (*W)[2 * NR], const V *m, int a, int k) {
  V value = W[0][a] * m[k];
  for (int d = 1; d <= NR; d++) value += W[d][a] * m[NM * d + k];
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
    for (int a = 0; a < NK; a++) by_knots[a] += sum(at_knot(G->weight, m, a / NM, a % NM));
    return;
  }
  const double *z = P->z + NB * i, T = duration_of(P, I, P->z);
  for (int a = 0; a < NK; a++) {
    const double by_local = sum(at_knot(G->weight, m, a / NM, a % NM));
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
