/* An interior-point method for motions made of cubics between knots.

     minimise T   subject to   -1 <= c(y_j) <= 1   at four points j of every interval,
     y = (X, V, A, T) at a point, linear in the knots' (X, V) and in T

   c are three torques and other rows, such as speeds, over the share of their limits that an
   interval may use. Both ends are at rest and given. With t a copy of c kept strictly inside
   the limits, c(y) - t = 0, and its multipliers and those of the limits eliminated, Newton's
   equations are in the knots alone: 6 x 6 blocks along the diagonal, and T as the last row.
   They are solved with Cholesky's method, which also tells whether the step is one of descent.

   Written for the four points of an interval in the four lanes of a vector V. What comes
   before this text: V, ALL, SHUFFLE, NP parameters, NC rows, and two generated functions:

     values(y, p, F, B, others)      F + B tau = 0 are the equations of motion, B 3 x 3
     second(y and tau, lambda, p,    derivatives of F + B tau and of the other rows,
            dF, dothers, H, H_tau)   H upper triangle by columns, H_tau 10 x 3
*/

#include <float.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

#define SHORT 0.02 /* a step of which share of a direction says little about its rest */
#define FAR 2.0    /* from one limit of a torque to the other */
#define SHIFT 1e-5 /* the first that is tried: the scene's magnitudes are of the order of one */
#define HIGHEST 1e-2 /* to which a shift grows because steps had to be halved */
#define FAR_OFF 1e-3 /* of complementarity over T: nearer to a solution shifts are smaller */
#define RISE 10.0 /* times complementarity: what merit may rise by, see try_direction */
#define USUAL 16.0 /* so that the intervals of a mesh of 16 have weight 1 in the integral of A^2 */

_Static_assert(NC % 3 == 0, "rows come in threes, one for each motor");

enum { SOLVED, TOO_MANY_ITERATIONS, NO_PROGRESS, SINGULAR, NOT_A_NUMBER };

typedef struct {
  double tolerance;   /* of complementarity and of T as fractions of T, and of |c - t| */
  double barrier;     /* complementarity at first, as a fraction of T */
  double closest;     /* how close t may begin to its limits, as a fraction */
  int64_t iterations; /* at most */
} Settings;

typedef struct {
  double complementarity, dual, primal; /* what is compared with the tolerance */
  double evaluating, solving;            /* seconds: rows and derivatives; linear systems */
  int64_t iterations, factorisations, evaluations;
} Report;

typedef struct {
  V weight[3][4];                /* of X_i, V_i, X_i+1, V_i+1 in X, V, A */
  double scale[NC];              /* 1 / share of the limits that may be used */
  V c[NC], t[NC];                /* rows and their copies */
  V next[NC], inverse[9];        /* rows, and the inverse of B, at the last trial: z if taken */
  V over[NC], under[NC];         /* 1 / distance of t to its limits */
  V upper[NC], lower[NC];        /* multipliers of the limits of t */
  V y[NC];                       /* of c = t: upper - lower */
  V dt[NC], dupper[NC], dlower[NC];
  V moved[NC];                   /* t at the last trial */
  V bend_upper[NC], bend_lower[NC]; /* second-order part of slack times multiplier */
  V C[NC][10];                   /* derivatives of the rows by X, V, A, T */
  double K[13][16];              /* curvature by both knots and T, the lower triangle */
  double bending[4][4];          /* its part of the integral of A^2, as a form in the knots */
} Interval;

typedef struct {
  double D[6][6], E[6][6], b[6]; /* of a knot: Cholesky factor, coupling to the next, to T */
} Block;

typedef struct {
  int64_t n;
  Interval *interval;            /* n */
  Block *block;                  /* n, the first unused */
  double *z, *dz, *trial, *g;    /* n + 1 knots of six, then T */
  V p[NP];
  double pivot_T, mu, penalty;
  double left; /* complementarity now */
  int halvings; /* of the last step */
  Report *report;
} Problem;

static double seconds(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double sum(V a) { return (a[0] + a[1]) + (a[2] + a[3]); }
/* The sums of four vectors. */
static V sum_each(const V *a) {
  const V ab = SHUFFLE(a[0], a[1], 0, 4, 2, 6) + SHUFFLE(a[0], a[1], 1, 5, 3, 7);
  const V cd = SHUFFLE(a[2], a[3], 0, 4, 2, 6) + SHUFFLE(a[2], a[3], 1, 5, 3, 7);
  return SHUFFLE(ab, cd, 0, 1, 4, 5) + SHUFFLE(ab, cd, 2, 3, 6, 7);
}

static V absolute(V a) { return EACH(fabs, a); }
static double greater(double a, double b) { return a > b ? a : b; } /* one instruction */
static double lesser(double a, double b) { return a < b ? a : b; }
static V larger(V a, V b) { return EACH2(greater, a, b); }
static V smaller(V a, V b) { return EACH2(lesser, a, b); }
static double largest(V a) { return greater(greater(a[0], a[1]), greater(a[2], a[3])); }
static int64_t size(const Problem *P) { return 6 * (P->n + 1) + 1; }
static double *duration(const Problem *P, double *z) { return z + size(P) - 1; }

/* ---- from knots to points and back ---- */

/* Hermite's cubics and their derivatives at fractions s of an interval of length e. */
static void set_weights(Interval *I, double e, const double *fractions) {
  for (int k = 0; k < 4; k++) {
    const double s = fractions[k], s2 = s * s, s3 = s2 * s;
    const double W[3][4] = {
        {1 - 3 * s2 + 2 * s3, e * (s - 2 * s2 + s3), 3 * s2 - 2 * s3, e * (s3 - s2)},
        {6 * (s2 - s) / e, 1 - 4 * s + 3 * s2, 6 * (s - s2) / e, 3 * s2 - 2 * s},
        {(12 * s - 6) / (e * e), (6 * s - 4) / e, (6 - 12 * s) / (e * e), (6 * s - 2) / e}};
    for (int j = 0; j < 3; j++)
      for (int a = 0; a < 4; a++) I->weight[j][a][k] = W[j][a];
  }
  for (int a = 0; a < 4; a++)
    for (int b = 0; b < 4; b++) I->bending[a][b] = USUAL * e * sum(I->weight[2][a] * I->weight[2][b]);
}

/* y = (X, V, A, T) at the points, from the interval's two knots. */
static void at_points(const Interval *I, const double *knots, double T, V *y) {
  for (int j = 0; j < 3; j++)
    for (int k = 0; k < 3; k++) {
      V value = ALL(0.0);
      for (int a = 0; a < 4; a++) value += I->weight[j][a] * knots[3 * a + k];
      y[3 * j + k] = value;
    }
  y[9] = ALL(T);
}

/* One number per knot variable from one per component of y: the transpose of at_points. */
static V at_knot(const Interval *I, const V *m, int a, int k) {
  return I->weight[0][a] * m[k] + I->weight[1][a] * m[3 + k] + I->weight[2][a] * m[6 + k];
}

/* Add the rows' derivatives, weighted by q, to a gradient by the knots and by T. */
static void pull_back(const Interval *I, const V *q, double *g, double *g_T) {
  V m[10];
  for (int a = 0; a < 10; a++) {
    m[a] = ALL(0.0);
    for (int r = 0; r < NC; r++) m[a] += I->C[r][a] * q[r];
  }
  for (int a = 0; a < 4; a++)
    for (int k = 0; k < 3; k++) g[3 * a + k] += sum(at_knot(I, m, a, k));
  *g_T += sum(m[9]);
}

/* ---- the rows and their derivatives ---- */

static void invert(const V *B, V *inverse) {
  inverse[0] = B[4] * B[8] - B[5] * B[7];
  inverse[1] = B[2] * B[7] - B[1] * B[8];
  inverse[2] = B[1] * B[5] - B[2] * B[4];
  inverse[3] = B[5] * B[6] - B[3] * B[8];
  inverse[4] = B[0] * B[8] - B[2] * B[6];
  inverse[5] = B[2] * B[3] - B[0] * B[5];
  inverse[6] = B[3] * B[7] - B[4] * B[6];
  inverse[7] = B[1] * B[6] - B[0] * B[7];
  inverse[8] = B[0] * B[4] - B[1] * B[3];
  const V one_by = 1.0 / (B[0] * inverse[0] + B[1] * inverse[3] + B[2] * inverse[6]);
  for (int k = 0; k < 9; k++) inverse[k] *= one_by;
}

/* Torques and other rows at the points, as shares of the whole limits; the inverse of B beside. */
static void rows(const Problem *P, const V *y, V *c, V *inverse) {
  V F[3], B[9];
  values(y, P->p, F, B, c + 3);
  invert(B, inverse);
  for (int k = 0; k < 3; k++) {
    const V *row = inverse + 3 * k;
    c[k] = -(row[0] * F[0] + row[1] * F[1] + row[2] * F[2]);
  }
}

/* From shares of the limits to shares of what may be used of them, or prices back. */
static void scale(const Interval *I, V *c) {
  for (int r = 0; r < NC; r++) c[r] *= I->scale[r];
}

/* C, and into M, 10 x 10, the curvature of y . c, torques being functions of y; the rows are
   known from the trial that led here, or from the beginning. */
static void differentiate(const Problem *P, Interval *I, const double *knots, V M[10][10]) {
  V y[13], weight[NC], lambda[NC], dF[30], H[55], H_tau[30];
  const V *inverse = I->inverse;
  at_points(I, knots, *duration(P, P->z), y);
  for (int k = 0; k < 3; k++) y[10 + k] = I->c[k] / I->scale[k];
  memcpy(weight, I->y, sizeof weight);
  scale(I, weight);
  for (int k = 0; k < 3; k++)
    lambda[k] = -(inverse[k] * weight[0] + inverse[3 + k] * weight[1] + inverse[6 + k] * weight[2]);
  for (int k = 3; k < NC; k++) lambda[k] = weight[k];
  second(y, lambda, P->p, dF, &I->C[0][0] + 30, H, H_tau);
  for (int k = 0; k < 3; k++)
    for (int a = 0; a < 10; a++)
      I->C[k][a] = -(inverse[3 * k] * dF[a] + inverse[3 * k + 1] * dF[10 + a] +
                     inverse[3 * k + 2] * dF[20 + a]);
  const V *h = H;
  for (int b = 0; b < 10; b++)
    for (int a = 0; a <= b; a++) {
      M[a][b] = *h++;
      for (int k = 0; k < 3; k++)
        M[a][b] += H_tau[3 * a + k] * I->C[k][b] + H_tau[3 * b + k] * I->C[k][a];
    }
  for (int r = 0; r < NC; r++)
    for (int a = 0; a < 10; a++) I->C[r][a] *= I->scale[r];
}

/* Add the limits pushing back: sum over the rows of stiffness times derivatives squared.
   Openings depend on X alone, speeds on X, V and T. */
static void push_back(const Interval *I, V M[10][10]) {
  V stiffness[NC], pull[NC];
  for (int r = 0; r < NC; r++)
    stiffness[r] = I->upper[r] * I->over[r] + I->lower[r] * I->under[r];
  for (int b = 0; b < 10; b++) {
    for (int r = 0; r < NC; r++) pull[r] = stiffness[r] * I->C[r][b];
    for (int a = 0; a <= b; a++) {
      V sum = M[a][b];
      for (int r = 0; r < 3; r++) sum += pull[r] * I->C[r][a];
      if (b < 3)
        for (int r = 3; r < 6; r++) sum += pull[r] * I->C[r][a];
      if ((b < 6 || b == 9) && (a < 6 || a == 9))
        for (int r = 6; r < NC; r++) sum += pull[r] * I->C[r][a];
      M[a][b] = sum;
    }
  }
}

/* Curvature of the Lagrangian with t eliminated, by both knots and T: the lower triangle. */
static void curvature(const Problem *P, Interval *I, const double *knots) {
  V M[10][10], half[13][10];
  differentiate(P, I, knots, M);
  push_back(I, M);
  for (int b = 0; b < 10; b++)
    for (int a = 0; a < b; a++) M[b][a] = M[a][b];
  for (int b = 0; b < 10; b++) { /* M is symmetric: its rows are its columns */
    for (int a = 0; a < 12; a++) half[a][b] = at_knot(I, M[b], a / 3, a % 3);
    half[12][b] = M[9][b];
  }
  for (int row = 0; row < 13; row++)
    for (int a = 0; a < 12 && a <= row; a += 4) {
      V four[4];
      for (int k = 0; k < 4; k++) four[k] = at_knot(I, half[row], (a + k) / 3, (a + k) % 3);
      const V sums = sum_each(four);
      memcpy(I->K[row] + a, &sums, sizeof sums);
    }
  I->K[12][12] = sum(half[12][9]);
}

/* How far t is from its limits; kept, for a division takes as long as many products. */
static void measure(Interval *I, int r) {
  const V up = 1 - I->t[r], down = 1 + I->t[r], both = 1 / (up * down);
  I->over[r] = down * both;
  I->under[r] = up * both;
}

/* ---- Newton's equations ---- */

/* In place; 0 where the matrix is not positive definite. Only the lower triangle is used. */
static int cholesky(double A[6][6]) {
  for (int j = 0; j < 6; j++) {
    double d = A[j][j];
    for (int k = 0; k < j; k++) d -= A[j][k] * A[j][k];
    if (!(d > 1e-14 * fabs(A[j][j]))) return 0;
    A[j][j] = sqrt(d);
    for (int i = j + 1; i < 6; i++) {
      double s = A[i][j];
      for (int k = 0; k < j; k++) s -= A[i][k] * A[j][k];
      A[i][j] = s / A[j][j];
    }
  }
  return 1;
}

static void solve_lower(double L[6][6], double *x) {
  for (int i = 0; i < 6; i++) {
    for (int k = 0; k < i; k++) x[i] -= L[i][k] * x[k];
    x[i] /= L[i][i];
  }
}

static void solve_upper(double L[6][6], double *x) {
  for (int i = 5; i >= 0; i--) {
    for (int k = i + 1; k < 6; k++) x[i] -= L[k][i] * x[k];
    x[i] /= L[i][i];
  }
}

/* Diagonal block, coupling to the next knot (transposed) and to T, of knot i. */
static void assemble(const Problem *P, int64_t i, double shift, Block *B) {
  const Interval *left = P->interval + i - 1, *right = P->interval + i;
  for (int r = 0; r < 6; r++) {
    B->b[r] = left->K[12][6 + r] + right->K[12][r];
    for (int s = 0; s < 6; s++) { /* what lies above D's diagonal is not used */
      B->D[r][s] = left->K[6 + r][6 + s] + right->K[r][s];
      B->E[r][s] = right->K[6 + r][s];
      if (r % 3 != s % 3) continue;
      B->D[r][s] += shift * (left->bending[2 + r / 3][2 + s / 3] + right->bending[r / 3][s / 3]);
      B->E[r][s] += shift * right->bending[2 + r / 3][s / 3];
    }
  }
}

/* What the elimination of the knot before leaves. */
static void eliminate(const Block *before, Block *B) {
  for (int r = 0; r < 6; r++)
    for (int k = 0; k < 6; k++) {
      B->b[r] -= before->E[r][k] * before->b[k];
      for (int s = 0; s <= r; s++) B->D[r][s] -= before->E[r][k] * before->E[s][k];
    }
}

static int factorise_once(Problem *P, double shift) {
  double pivot = shift;
  for (int64_t i = 0; i < P->n; i++) pivot += P->interval[i].K[12][12];
  for (int64_t i = 1; i < P->n; i++) {
    Block *B = P->block + i;
    assemble(P, i, shift, B);
    if (i > 1) eliminate(B - 1, B);
    if (!cholesky(B->D)) return 0;
    solve_lower(B->D, B->b);
    for (int k = 0; k < 6; k++) pivot -= B->b[k] * B->b[k];
    for (int r = 0; r < 6; r++) solve_lower(B->D, B->E[r]);
  }
  P->pivot_T = pivot;
  return pivot > 1e-16;
}

/* Factorise the curvature plus a shift times A^2; 0 where it is not positive definite. */
static int factorise(Problem *P, double shift) {
  const double begin = seconds();
  const int done = factorise_once(P, shift);
  P->report->solving += seconds() - begin;
  P->report->factorisations++;
  return done;
}

/* Factorise with the first shift from this one on that gives a direction of descent; 0 if
   none does. */
static int factorise_shifted(Problem *P, double *shift, double first) {
  for (; *shift < 1e6; *shift = greater(8 * *shift, first))
    if (factorise(P, *shift)) return 1;
  return 0;
}

/* dz from the gradient g. */
static void newton_step(Problem *P) {
  const double begin = seconds();
  const int64_t n = P->n;
  double *dz = P->dz, *dT = duration(P, dz);
  for (int64_t i = 0; i < size(P); i++) dz[i] = -P->g[i];
  memset(dz, 0, 6 * sizeof(double));
  memset(dz + 6 * n, 0, 6 * sizeof(double));
  for (int64_t i = 1; i < n; i++) {
    Block *B = P->block + i;
    double *x = dz + 6 * i;
    if (i > 1)
      for (int r = 0; r < 6; r++)
        for (int k = 0; k < 6; k++) x[r] -= B[-1].E[r][k] * x[k - 6];
    solve_lower(B->D, x);
    for (int k = 0; k < 6; k++) *dT -= B->b[k] * x[k];
  }
  *dT /= P->pivot_T;
  for (int64_t i = n - 1; i > 0; i--) {
    Block *B = P->block + i;
    double *x = dz + 6 * i;
    for (int k = 0; k < 6; k++) {
      x[k] -= B->b[k] * *dT;
      for (int r = 0; r < 6 && i < n - 1; r++) x[k] -= B->E[r][k] * x[6 + r];
    }
    solve_upper(B->D, x);
  }
  P->report->solving += seconds() - begin;
}

/* ---- the steps of the method ---- */

/* Keep the second-order part that the direction has, times a weight, for the next one. */
static void bend(Problem *P, double weight) {
  for (int64_t i = 0; i < P->n; i++) {
    Interval *I = P->interval + i;
    for (int r = 0; r < NC; r++) {
      I->bend_upper[r] = -weight * I->dt[r] * I->dupper[r];
      I->bend_lower[r] = weight * I->dt[r] * I->dlower[r];
    }
  }
}

/* The direction of all variables for a barrier parameter. */
static void direction(Problem *P, double mu) {
  memset(P->g, 0, size(P) * sizeof(double));
  double *g_T = duration(P, P->g);
  *g_T = 1.0;
  for (int64_t i = 0; i < P->n; i++) {
    const Interval *I = P->interval + i;
    V q[NC];
    for (int r = 0; r < NC; r++) {
      q[r] = (I->upper[r] * I->over[r] + I->lower[r] * I->under[r]) * (I->c[r] - I->t[r]);
      q[r] += (mu - I->bend_upper[r]) * I->over[r] - (mu - I->bend_lower[r]) * I->under[r];
    }
    pull_back(I, q, P->g + 6 * i, g_T);
  }
  newton_step(P);
  for (int64_t i = 0; i < P->n; i++) {
    Interval *I = P->interval + i;
    V dy[10];
    at_points(I, P->dz + 6 * i, *duration(P, P->dz), dy);
    for (int r = 0; r < NC; r++) {
      V dt = I->c[r] - I->t[r];
      for (int a = 0; a < 10; a++) dt += I->C[r][a] * dy[a];
      I->dt[r] = dt;
      I->dupper[r] = (mu - I->bend_upper[r] + I->upper[r] * dt) * I->over[r] - I->upper[r];
      I->dlower[r] = (mu - I->bend_lower[r] - I->lower[r] * dt) * I->under[r] - I->lower[r];
    }
  }
}

/* The longest steps that keep a fraction of the distance to the limits of t, and of 0. */
static void longest_steps(const Problem *P, double fraction, double *primal, double *dual) {
  V by_t = ALL(1e-300), by_multiplier = ALL(1e-300); /* 1 / step */
  for (int64_t i = 0; i < P->n; i++) {
    const Interval *I = P->interval + i;
    for (int r = 0; r < NC; r++) {
      by_t = larger(by_t, I->dt[r] * I->over[r]);
      by_t = larger(by_t, -I->dt[r] * I->under[r]);
      const V both = 1 / (I->upper[r] * I->lower[r]);
      by_multiplier = larger(by_multiplier, -I->dupper[r] * I->lower[r] * both);
      by_multiplier = larger(by_multiplier, -I->dlower[r] * I->upper[r] * both);
    }
  }
  *primal = lesser(1.0, fraction / largest(by_t));
  *dual = lesser(1.0, fraction / largest(by_multiplier));
  const double shrink = -*duration(P, P->dz) / *duration(P, P->z);
  if (shrink > 0) *primal = lesser(*primal, 0.5 / shrink);
}

/* Sum of slack times multiplier after steps of these lengths. */
static double complementarity(const Problem *P, double primal, double dual) {
  V total = ALL(0.0);
  for (int64_t i = 0; i < P->n; i++) {
    const Interval *I = P->interval + i;
    for (int r = 0; r < NC; r++) {
      const V t = I->t[r] + primal * I->dt[r];
      total += (1 - t) * (I->upper[r] + dual * I->dupper[r]);
      total += (1 + t) * (I->lower[r] + dual * I->dlower[r]);
    }
  }
  return sum(total);
}

/* Mehrotra's choice: as far down as dz, Newton's step without barrier, would get, cubed; and
   his correction for what that step neglects, in so far as it can be taken. */
static void choose_barrier(Problem *P, double tolerance) {
  const double products = 8.0 * NC * P->n;
  double primal, dual;
  longest_steps(P, 1.0, &primal, &dual);
  const double share = complementarity(P, primal, dual) / P->left;
  const double centring = lesser(greater(share * share * share, 1e-3), 1.0);
  const double least = 0.05 * tolerance * *duration(P, P->z) / products;
  P->mu = greater(centring * P->left / products, least);
  bend(P, primal*dual);
}

/* Where a step takes t: halfway from t + step dt to c, that is towards where Newton's step
   really leads, but no closer to the limits than a hundredth of the distance now. */
static V moved(V t, V dt, V c, double step) {
  const V lowest = 0.01 * (1 + t) - 1, highest = 1 - 0.01 * (1 - t);
  return 0.5 * (t + step * dt) + 0.5 * smaller(larger(c, lowest), highest);
}

/* The barrier at t after a step, plus the penalty on |c - t|. A logarithm takes as long as many
   products: there is one for three rows. */
static double merit_of_rows(const Problem *P, Interval *I, const V *c, double step) {
  double barrier = 0;
  V infeasibility = ALL(0.0), room = ALL(1.0);
  for (int r = 0; r < NC; r++) {
    I->moved[r] = step > 0 ? moved(I->t[r], I->dt[r], c[r], step) : I->t[r];
    infeasibility += absolute(c[r] - I->moved[r]);
    room *= 1 - I->moved[r] * I->moved[r];
    if (r % 3 < 2) continue;
    barrier -= log(room[0] * room[1] * room[2] * room[3]);
    room = ALL(1.0);
  }
  return P->mu * barrier + P->penalty * sum(infeasibility);
}

static double merit(Problem *P, double step) {
  const double *dz = P->dz;
  for (int64_t i = 0; i < size(P); i++) P->trial[i] = P->z[i] + step * dz[i];
  const double T = *duration(P, P->trial), begin = seconds();
  double total = T;
  for (int64_t i = 0; i < P->n; i++) {
    Interval *I = P->interval + i;
    V y[10];
    at_points(I, P->trial + 6 * i, T, y);
    rows(P, y, I->next, I->inverse);
    scale(I, I->next);
    total += merit_of_rows(P, I, I->next, step);
  }
  P->report->evaluations++;
  P->report->evaluating += seconds() - begin;
  return total;
}

/* Merit now and its slope along the direction, the penalty being large enough for descent. */
static double merit_now(Problem *P, double *slope) {
  double needed = 0, infeasibility = 0;
  V along = ALL(0.0);
  for (int64_t i = 0; i < P->n; i++) {
    const Interval *I = P->interval + i;
    for (int r = 0; r < NC; r++) {
      needed = greater(needed, largest(absolute(I->upper[r] + I->dupper[r] - I->lower[r] - I->dlower[r])));
      infeasibility += sum(absolute(I->c[r] - I->t[r]));
      along += P->mu * (I->over[r] - I->under[r]) * I->dt[r];
    }
  }
  if (needed > P->penalty || needed < P->penalty / 10) P->penalty = 1.5 * needed + 1e-6;
  *slope = *duration(P, P->dz) + sum(along) - P->penalty * infeasibility;
  double total = *duration(P, P->z);
  for (int64_t i = 0; i < P->n; i++)
    total += merit_of_rows(P, P->interval + i, P->interval[i].c, 0.0);
  return total;
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
  const double now = merit_now(P, &slope) + RISE * P->left + 1e-12;
  const double aim = 1e-4 * lesser(slope, 0.0);
  for (int k = 0; k < 12; k++, step /= 2)
    if (merit(P, step) <= now + aim * step) {
      P->halvings = k;
      return 1;
    }
  return 0;
}

/* To the last trial, multipliers by a step of their own. */
static void move(Problem *P, double dual) {
  memcpy(P->z, P->trial, size(P) * sizeof(double));
  for (int64_t i = 0; i < P->n; i++) {
    Interval *I = P->interval + i;
    for (int r = 0; r < NC; r++) {
      I->c[r] = I->next[r];
      I->t[r] = I->moved[r];
      I->upper[r] += dual * I->dupper[r];
      I->lower[r] += dual * I->dlower[r];
      /* never far from mu / slack: stiffness stays meaningful (Ipopt's kappa_sigma) */
      measure(I, r);
      const V up = P->mu * I->over[r], down = P->mu * I->under[r];
      I->upper[r] = smaller(larger(I->upper[r], up * 1e-8), up * 1e8);
      I->lower[r] = smaller(larger(I->lower[r], down * 1e-8), down * 1e8);
      I->y[r] = I->upper[r] - I->lower[r];
    }
  }
}

/* Weights, rows and multipliers at the guess; 0 where the rows are no numbers. */
static int begin(Problem *P, const double *mesh, const double *fractions, const double *share,
                 const Settings *S) {
  double total = 0;
  P->mu = S->barrier * *duration(P, P->z) / (8.0 * NC * P->n);
  P->penalty = 0;
  for (int64_t i = 0; i < P->n; i++) {
    Interval *I = P->interval + i;
    V y[10];
    set_weights(I, mesh[i], fractions);
    at_points(I, P->z + 6 * i, *duration(P, P->z), y);
    rows(P, y, I->c, I->inverse);
    for (int r = 0; r < NC; r++) I->scale[r] = 1 / share[NC * i + r];
    scale(I, I->c);
    for (int r = 0; r < NC; r++) {
      const V most = ALL(1 - S->closest), least = ALL(S->closest - 1);
      I->t[r] = smaller(larger(I->c[r], least), most);
      measure(I, r);
      I->upper[r] = P->mu * I->over[r];
      I->lower[r] = P->mu * I->under[r];
      I->y[r] = I->upper[r] - I->lower[r];
      I->dt[r] = I->dupper[r] = I->dlower[r] = ALL(0.0);
      I->bend_upper[r] = I->bend_lower[r] = ALL(0.0);
      total += sum(absolute(I->c[r]));
    }
  }
  return total < DBL_MAX;
}

/* Whether z is a solution: dz is Newton's step without barrier. */
static int solved(Problem *P, double tolerance) {
  const double T = *duration(P, P->z);
  Report *R = P->report;
  R->primal = 0;
  for (int64_t i = 0; i < P->n; i++)
    for (int r = 0; r < NC; r++) {
      const Interval *I = P->interval + i;
      R->primal = greater(R->primal, largest(absolute(I->c[r] - I->t[r])));
    }
  R->dual = fabs(*duration(P, P->dz)) / T;
  R->complementarity = P->left / T;
  return greater(R->complementarity, greater(R->primal, R->dual)) <= tolerance;
}

static void differentiate_all(Problem *P) {
  const double begin = seconds();
  for (int64_t i = 0; i < P->n; i++) curvature(P, P->interval + i, P->z + 6 * i);
  P->report->evaluating += seconds() - begin;
}

/* The largest change of a row that the direction asks for. */
static double largest_change(const Problem *P) {
  V most = ALL(0.0);
  for (int64_t i = 0; i < P->n; i++)
    for (int r = 0; r < NC; r++) most = larger(most, absolute(P->interval[i].dt[r]));
  return largest(most);
}

/* Newton's direction without barrier, shifted until it is one of descent; 0 if there is none.
   Where curvature almost vanishes it would ask for torques far beyond their limits, and end
   at the first of them; or the rows' own curvature would halve its step again and again: both
   are cured by a shift. */
static int aim(Problem *P, double *shift) {
  const double left = P->left / *duration(P, P->z);
  const double first = SHIFT * lesser(1.0, left / FAR_OFF);
  if (P->halvings > 1) *shift = greater(*shift, lesser(greater(8 * *shift, first), HIGHEST));
  if (P->halvings < 1) *shift = *shift > first ? *shift / 8 : 0.0;
  for (;; *shift = greater(8 * *shift, first)) {
    if (!factorise_shifted(P, shift, first)) return 0;
    direction(P, 0.0);
    double primal, dual;
    longest_steps(P, 1.0, &primal, &dual);
    if (primal > SHORT || largest_change(P) < FAR) return 1;
  }
}

static int iterate(Problem *P, const Settings *S) {
  double shift = 0, dual;
  for (; P->report->iterations < S->iterations; P->report->iterations++) {
    differentiate_all(P);
    P->left = complementarity(P, 0, 0);
    if (!aim(P, &shift)) return SINGULAR;
    if (solved(P, S->tolerance)) return SOLVED;
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

static uintptr_t aligned(uintptr_t address) { return (address + 63) / 64 * 64; }

/* Bytes of memory that ``solve`` needs for n intervals. */
int64_t workspace(int64_t n) {
  return 128 + n * (sizeof(Interval) + sizeof(Block)) + 3 * (6 * (n + 1) + 1) * sizeof(double) + 64;
}

/* share: of the limits that may be used, n x NC. z: in, a guess; out, the solution. prices: out,
   n x 4 x NC multipliers of the rows. */
int solve(int64_t n, const double *mesh, const double *fractions, const double *share,
          const double *p, double *z, double *prices, const Settings *settings, Report *report,
          void *memory) {
  Problem P = {.n = n, .z = z, .report = report};
  P.interval = (Interval *)aligned((uintptr_t)memory);
  P.block = (Block *)aligned((uintptr_t)(P.interval + n));
  P.dz = (double *)(P.block + n);
  P.trial = P.dz + size(&P);
  P.g = P.trial + size(&P);
  for (int k = 0; k < NP; k++) P.p[k] = ALL(p[k]);
  memset(report, 0, sizeof *report);
  const int status = begin(&P, mesh, fractions, share, settings) ? iterate(&P, settings) : NOT_A_NUMBER;
  for (int64_t i = 0; i < n; i++)
    for (int r = 0; r < NC; r++)
      for (int l = 0; l < 4; l++)
        prices[(4 * i + l) * NC + r] = P.interval[i].y[r][l] * P.interval[i].scale[r];
  return status;
}
