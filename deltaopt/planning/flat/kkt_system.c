/* The KKT system, block tridiagonal with a border.

     D_i    block of knot i            S     corner of the border, by the durations
     E_i    knot i + 1 by knot i       b_i   columns of the border at knot i

   Inside of phases the unknown at knot i is how far knot i + 1 deviates from where it leads.

   Factorised in place: D_i its Cholesky factor L_i, E_i its product with L_i^-T, b_i that of
   L_i^-1, the corner L D L^T.
*/

/* In place; 0 where the matrix is not positive definite. Only the lower triangle is used. */
static int cholesky(double A[NB][NB]) {
  for (int j = 0; j < NB; j++) {
    double d = A[j][j];
    for (int k = 0; k < j; k++) d -= A[j][k] * A[j][k];
    if (!(d > 1e-14 * fabs(A[j][j]))) return 0;
    A[j][j] = sqrt(d);
    for (int i = j + 1; i < NB; i++) {
      double s = A[i][j];
      for (int k = 0; k < j; k++) s -= A[i][k] * A[j][k];
      A[i][j] = s / A[j][j];
    }
  }
  return 1;
}

static void solve_lower(double L[NB][NB], double *x) {
  for (int i = 0; i < NB; i++) {
    for (int k = 0; k < i; k++) x[i] -= L[i][k] * x[k];
    x[i] /= L[i][i];
  }
}

static void solve_upper(double L[NB][NB], double *x) {
  for (int i = NB - 1; i >= 0; i--) {
    for (int k = i + 1; k < NB; k++) x[i] -= L[k][i] * x[k];
    x[i] /= L[i][i];
  }
}

/* The border's corner: L D L^T in place, D beside; 0 where it is not positive definite. */
static int factorise_corner(Problem *P) {
  const int64_t w = P->phases;
  double *S = P->corner;
  for (int64_t j = 0; j < w; j++) {
    double d = S[w * j + j];
    for (int64_t k = 0; k < j; k++) d -= S[w * j + k] * S[w * j + k] * P->pivot[k];
    if (!(d > 1e-16)) return 0;
    P->pivot[j] = d;
    for (int64_t i = j + 1; i < w; i++) {
      double s = S[w * i + j];
      for (int64_t k = 0; k < j; k++) s -= S[w * i + k] * S[w * j + k] * P->pivot[k];
      S[w * i + j] = s / d;
    }
  }
  return 1;
}

static void solve_corner(const Problem *P, double *x) {
  const int64_t w = P->phases;
  const double *S = P->corner;
  for (int64_t i = 0; i < w; i++)
    for (int64_t k = 0; k < i; k++) x[i] -= S[w * i + k] * x[k];
  for (int64_t i = 0; i < w; i++) x[i] /= P->pivot[i];
  for (int64_t i = w - 1; i >= 0; i--)
    for (int64_t k = i + 1; k < w; k++) x[i] -= S[w * k + i] * x[k];
}

/* The columns of the border that an interval contributes to the knot on this side of it. */
static void add_border(const Problem *P, const Interval *I, int side, double *columns) {
  for (int64_t q = 0; q < P->phases; q++) {
    if (P->given->given[q] || (!I->moving && q != I->phase)) continue;
    for (int r = 0; r < NB; r++) {
      double *column = columns + NB * q + r;
      if (!I->moving)
        *column += I->K[NK][NB * side + r];
      else
        for (int a = 0; a <= NK; a++)
          *column += symmetric(I, NB * side + r, a) * rate_of(P, I, a, q);
    }
  }
}

/* Where a knot is a boundary, what is fixed there becomes an equation dz = 0 of its own. */
static void fix(const Problem *P, int64_t i, Block *B, double *columns) {
  const int64_t here = i < P->n ? P->interval[i].boundary[0] : P->phases;
  const int64_t next = i < P->n ? P->interval[i].boundary[1] : -1;
  for (int r = 0; r < NB; r++) {
    if (here >= 0 && !P->given->is_free[NB * here + r]) {
      for (int s = 0; s < NB; s++) B->D[r][s] = B->D[s][r] = B->E[s][r] = 0;
      B->D[r][r] = 1;
      for (int64_t w = 0; w < P->phases; w++) columns[NB * w + r] = 0;
    }
    if (next >= 0 && !P->given->is_free[NB * next + r])
      for (int s = 0; s < NB; s++) B->E[r][s] = 0;
  }
}

/* Add what an interval contributes by its own variables a and b <= a; bent: what A^2 counts. */
static void add_part(const Interval *I, double bent, int a, int b, double *to) {
  *to += I->K[a][b];
  if (a % NM == b % NM) *to += bent * I->bending[a / NM][b / NM];
}

/* What an interval contributes to the block of the knot on this side of it. */
static void add_block(const Problem *P, const Interval *I, int side, double shift,
                      double D[NB][NB]) {
  const double bent = shift + smoothing(P, I);
  for (int r = 0; r < NB; r++)
    for (int s = 0; s <= r; s++) add_part(I, bent, NB * side + r, NB * side + s, &D[r][s]);
}

static int at_boundary(const Problem *P, int64_t i) {
  if (i == 0 || i == P->n) return 1;
  return P->interval[i].boundary[0] >= 0 || P->interval[i].boundary[1] >= 0;
}

/* From what precedes an interval, by knot i, the lower triangle D and columns of the border, to the
   same by where knot i leads, all of D. */
static void lead_all_on(const Problem *P, const Interval *I, double D[NB][NB], double *columns) {
  for (int r = 0; r < NB; r++)
    for (int s = 0; s < r; s++) D[s][r] = D[r][s];
  for (int s = 0; s < NB; s++) lead_on(I, D[0] + s, NB);
  for (int r = 0; r < NB; r++) lead_on(I, D[r], 1);
  for (int64_t q = 0; q < P->phases; q++) lead_on(I, columns + NB * q, 1);
}

/* Add the interval after knot i to its block, and couple it to the next. If the interval is by the
   deviation d, what precedes it is a form in (knot i + 1) - d: block and columns of the next knot
   begin with it. */
static void add_next(Problem *P, int64_t i, double shift, Block *B, double *columns) {
  const Interval *I = P->interval + i;
  const int64_t w = P->phases * NB;
  const double bent = shift + smoothing(P, I);
  double *next = border(P, i + 1);
  memset(B[1].D, 0, sizeof B[1].D);
  memset(next, 0, w * sizeof(double));
  if (I->by_deviation) {
    lead_all_on(P, I, B->D, columns);
    memcpy(B[1].D, B->D, sizeof B->D);
    memcpy(next, columns, w * sizeof(double));
    for (int64_t k = 0; k < w; k++) columns[k] = -columns[k];
  }
  for (int r = 0; r < NB; r++)
    for (int s = 0; s < NB; s++) {
      B->E[r][s] = -B[1].D[r][s];
      add_part(I, bent, NB + r, s, &B->E[r][s]);
    }
  add_block(P, I, 0, shift, B->D);
  add_border(P, I, 0, columns);
}

/* The border's own part: curvature by the durations. */
static void assemble_corner(const Problem *P, double shift) {
  const int64_t w = P->phases;
  double *S = P->corner;
  memset(S, 0, w * w * sizeof(double));
  for (int64_t q = 0; q < P->phases; q++) S[(w + 1) * q] = shift;
  for (int64_t i = 0; i < P->n; i++) {
    const Interval *I = P->interval + i;
    if (!I->moving) {
      S[(w + 1) * I->phase] += I->K[NK][NK];
      continue;
    }
    for (int64_t q = 0; q < P->phases; q++)
      for (int64_t s = 0; s <= q; s++)
        for (int a = 0; a <= NK; a++)
          for (int b = 0; b <= NK; b++)
            S[w * q + s] +=
                rate_of(P, I, a, q) * symmetric(I, a, b) * rate_of(P, I, b, s);
  }
  for (int64_t q = 0; q < P->phases; q++) {
    if (!P->given->given[q]) continue;
    for (int64_t k = 0; k < w; k++) S[w * q + k] = S[w * k + q] = 0;
    S[(w + 1) * q] = 1;
  }
}

/* What the elimination of the knot before leaves. */
static void eliminate(const Problem *P, const Block *before, const double *columns_before, Block *B,
                      double *columns) {
  for (int64_t w = 0; w < P->phases; w++, columns += NB, columns_before += NB)
    for (int r = 0; r < NB; r++)
      for (int k = 0; k < NB; k++) columns[r] -= before->E[r][k] * columns_before[k];
  for (int r = 0; r < NB; r++)
    for (int k = 0; k < NB; k++)
      for (int s = 0; s <= r; s++) B->D[r][s] -= before->E[r][k] * before->E[s][k];
}

/* What the elimination of a knot leaves of the corner. */
static void eliminate_corner(Problem *P, const double *columns) {
  for (int64_t v = 0; v < P->phases; v++)
    for (int64_t w = 0; w <= v; w++)
      for (int k = 0; k < NB; k++)
        P->corner[P->phases * v + w] -= columns[NB * v + k] * columns[NB * w + k];
}

/* Factorise the curvature plus a shift times A^2; 0 where it is not positive definite. */
static int factorise(Problem *P, double shift) {
  assemble_corner(P, shift);
  memset(P->block[P->first].D, 0, sizeof P->block->D);
  memset(border(P, P->first), 0, P->phases * NB * sizeof(double));
  for (int64_t i = P->first; i <= P->last; i++) {
    Block *B = P->block + i;
    double *columns = border(P, i);
    if (i > 0) {
      add_block(P, P->interval + i - 1, 1, shift, B->D);
      add_border(P, P->interval + i - 1, 1, columns);
    }
    if (i > P->first) eliminate(P, B - 1, border(P, i - 1), B, columns);
    if (i < P->n) add_next(P, i, shift, B, columns);
    if (at_boundary(P, i)) {
      add_spheres(P, i, B);
      fix(P, i, B, columns);
    }
    if (!cholesky(B->D)) return 0;
    for (int64_t w = 0; w < P->phases; w++) solve_lower(B->D, columns + NB * w);
    eliminate_corner(P, columns);
    for (int k = 0; k < NB && i < P->last; k++) solve_lower(B->D, B->E[k]);
  }
  return factorise_corner(P);
}

/* Factorise with the first shift from this one on that gives a direction of descent; 0 if
   none does. */
static int factorise_shifted(Problem *P, double *shift, double first) {
  for (; *shift < 1e6; *shift = greater(8 * *shift, first))
    if (factorise(P, *shift)) return 1;
  return 0;
}

/* Where the sum of all durations is given, the solution of the border that keeps it. */
static void keep_sum(const Problem *P, double *rest) {
  double *x = P->along_sum, sum = 0, by_multiplier = 0;
  for (int64_t k = 0; k < P->phases; k++) x[k] = 1.0;
  solve_corner(P, x);
  for (int64_t k = 0; k < P->phases; k++) {
    sum += rest[k];
    by_multiplier += x[k];
  }
  for (int64_t k = 0; k < P->phases; k++) rest[k] -= sum / by_multiplier * x[k];
}

/* dz from the gradient g. */
static void newton_step(Problem *P) {
  double *dz = P->dz, *rest = P->rest, *dT = durations(P, dz);
  for (int64_t i = 0; i < size(P); i++) dz[i] = -P->g[i];
  for (int64_t q = 0; q < P->phases; q++) rest[q] = dT[q];
  for (int64_t i = P->first; i <= P->last; i++) {
    Block *B = P->block + i;
    double *x = dz + NB * i;
    const double *columns = border(P, i);
    if (i > P->first)
      for (int r = 0; r < NB; r++)
        for (int k = 0; k < NB; k++) x[r] -= B[-1].E[r][k] * x[k - NB];
    if (i < P->n && P->interval[i].by_deviation) {
      lead_on(P->interval + i, x, 1);
      for (int r = 0; r < NB; r++) {
        x[NB + r] += x[r];
        x[r] = -x[r];
      }
    }
    solve_lower(B->D, x);
    for (int64_t w = 0; w < P->phases; w++)
      for (int k = 0; k < NB; k++) rest[w] -= columns[NB * w + k] * x[k];
  }
  solve_corner(P, rest);
  if (P->given->cost[2] != 0) keep_sum(P, rest);
  for (int64_t q = 0; q < P->phases; q++) dT[q] = rest[q];
  for (int64_t i = P->last; i >= P->first; i--) {
    Block *B = P->block + i;
    double *x = dz + NB * i;
    const double *columns = border(P, i);
    for (int64_t w = 0; w < P->phases; w++)
      for (int k = 0; k < NB; k++) x[k] -= columns[NB * w + k] * rest[w];
    for (int k = 0; k < NB && i < P->last; k++)
      for (int r = 0; r < NB; r++) x[k] -= B->E[r][k] * x[NB + r];
    solve_upper(B->D, x);
    if (i == P->n || !P->interval[i].by_deviation) continue;
    for (int r = 0; r < NB; r++) x[r] = x[NB + r] - x[r];
    lead_back(P->interval + i, x);
  }
  move_positions(P, dz);
}
