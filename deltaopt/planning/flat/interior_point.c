/* An interior-point method for motions made of polynomials between knots.

     minimise    sum of T_q                              the durations of the phases q
     subject to  lower_r <= c_r(y_j) <= upper_r          constraint rows, at every point j of every
                                                         interval; +1, -1, or no limit on that side
                 sum over q of integral g_k dt <= sum of T_q                      integral rows
     y = (X, V, A[, J], T_q) at a point, linear in the knots of its interval

   A motion has phases, each with its own duration T_q, mesh and parameters p_q. Time inside a
   phase is counted in units of its duration: V = T v, A = T^2 a, J = T^3 j. Every coordinate is
   a cubic between knots of (X, V) (NR = 2: acceleration may jump at knots), or a quintic between
   knots of (X, V, A) (NR = 3: acceleration is continuous). Rows may depend on quantities that
   equations determine, such as motor torques; these are eliminated in the generated functions
   below, so that here rows are functions of y alone.

   Boundaries: the start, the joints of phases, and the goal. There each component of the state
   is free, fixed, or a position that moves, at + drift * (time since the start). Where rates are
   not all zero, the knot at a boundary is in constant units (x, v[, a]), since it belongs to two
   phases, or has a velocity given in m/s; the chain rule takes it to (X, T v[, T^2 a]) of the
   phase beside it. So joints need no rows.

   With t a copy of c kept strictly inside the limits, c(y) - t = 0, and its multipliers and those
   of the limits eliminated, Newton's equations are in the knots, the durations, and one multiplier
   for each integral row. This KKT system is block tridiagonal, a block for each knot, with a
   border: a dense column for each integral row, then one for each duration. Blocks are factorised
   with Cholesky's method, the border with L D L^T, its signs being known: negative for integral
   rows, positive for durations. Other signs tell that the step would not be one of descent.

   Written for four points of an interval in the four lanes of a vector V. What comes before this
   text: V, ALL, EACH, EACH2, SHUFFLE; sizes; and generated functions. C is the sparse matrix of
   derivatives of the rows by y, stored as its NZ nonzeros, row by row, and then the dense NI x NY
   derivatives of the integrands T (g - 1).

     NM coordinates, NR unknowns for each at a knot, NY numbers in y, NC constraint rows, NI integral rows, NP
     parameters, NQ numbers that depend on them alone, NZ, NH nonzeros of H's upper triangle, NE numbers handed from values to second,
     NG groups of four points in an interval, SIDES limits there are of all rows together
     UPPER(r), LOWER(r)                   whether row r has that limit
     prepare(p, q)                        what depends on parameters alone
     values(y, q, c, g, e)                rows, integrands T (g - 1), and e for second
     second(y, e, weights of c and g, q, C, H)     derivatives; H of the weighted sum
     scale_rows(C, s)                     multiply each row of C
     along_rows(C, dy, dc)                dc += C dy
     across_rows(C, q, m)                 m = C^T q
     curvature_of_rows(C, H, s, S)        S = H + C^T diag(s) C, all of it
*/

#include <float.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

#define SHORT 0.02 /* a step of which share of a direction says little about its rest */
#define FAR 2.0    /* from one limit of a row to the other */
#define SHIFT 1e-5 /* the first that is tried: the scene's magnitudes are of the order of one */
#define HIGHEST 1e-2 /* to which a shift grows because steps had to be halved */
#define FAR_OFF 1e-3 /* of complementarity over T: nearer to a solution shifts are smaller */
#define RISE 10.0 /* times complementarity: what merit may rise by, see try_direction */
#define USUAL 16.0 /* so that the intervals of a mesh of 16 have weight 1 in the integral of A^2 */

enum {
  NB = NM * NR,           /* unknowns at a knot */
  NK = 2 * NB,            /* at both knots of an interval */
  WIDE = (NK + 3) / 4 * 4 /* NK, rounded up to whole vectors */
};

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

/* The problem. n is the number of intervals of all phases together. */
typedef struct {
  int64_t phases;
  const int64_t *intervals;  /* of each phase */
  const int64_t *given;      /* whether a phase's duration is given */
  const double *mesh;        /* n: intervals as fractions of their phase's duration */
  const double *share;       /* n x NC: of the limits that may be used; infinite: no limit there */
  const double *p;           /* phases x NP */
  const double *state;       /* (phases + 1) x NB: at each boundary, in constant units */
  const int64_t *is_free;    /* (phases + 1) x NB: which of its components are not given */
  const double *drift;       /* (phases + 1) x NM: velocity of a position that moves */
  const double *fractions;   /* NG x 4: the points of an interval */
  const double *quadrature;  /* NG x 4: their weights in integrals */
} Given;

typedef struct {
  V weight[NR + 1][2 * NR];      /* of X_i, V_i[, A_i], X_i+1, .. in X, V, A[, J] */
  V integral;                    /* weight of a point in integrals over the phase */
  V c[NC], t[NC];                /* rows and their copies */
  V next[NC], e[NE];             /* rows, and what values keeps, at the last trial: z if taken */
  V over[NC], under[NC];         /* 1 / distance of t to its limits; 0 where there is none */
  V upper[NC], lower[NC];        /* multipliers of the limits of t; 0 where there is none */
  V y[NC];                       /* of c = t: upper - lower */
  V dt[NC], dupper[NC], dlower[NC];
  V moved[NC];                   /* t at the last trial */
  V bend_upper[NC], bend_lower[NC]; /* second-order part of slack times multiplier */
  V C[NZ + NI * NY];             /* derivatives of rows and integrands by y */
} Group;                         /* of four points */

typedef struct {
  Group group[NG];
  double scale[NC];              /* 1 / share of the limits that may be used */
  double K[NK + 1][WIDE + 4];    /* curvature by both knots and T, the lower triangle */
  double bending[2 * NR][2 * NR]; /* its part of the integral of A^2, as a form in the knots */
  double length;
  int64_t phase;
  int64_t boundary[2];           /* where its knots are boundaries, else -1 */
  int constant[2], any_constant; /* whether its knots are in constant units */
  int moving;                    /* whether one of its knots is at a position that moves */
} Interval;

typedef struct {
  double D[NB][NB], E[NB][NB];   /* of a knot: Cholesky factor, coupling to the next */
} Block;

typedef struct {
  double c, t, next, moved, over, upper, dt, dupper, bend; /* as for a row with an upper limit */
} Integral;

typedef struct {
  const Given *given;
  int64_t n, phases, width;      /* intervals, phases, columns of the border */
  int64_t first, last;           /* the first and last knot that is not wholly fixed */
  Interval *interval;            /* n */
  Block *block;                  /* n + 1 */
  V *q;                          /* phases x NQ */
  double *border;                /* (n + 1) x width x NB */
  double *corner, *pivot;        /* width x width, lower triangle: L; width: D */
  double *z, *dz, *trial, *g;    /* n + 1 knots, then the durations */
  double *slope;                 /* NI x size of z: derivatives of the integral rows by z */
  double *rest;                  /* width: the border's part of a right-hand side, of a solution */
  Integral integral[NI];
  V unit[NG][NR + 1][2 * NR];    /* weights in an interval of length one */
  double unit_bending[2 * NR][2 * NR];
  double mu, penalty;
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
static int64_t size(const Problem *P) { return NB * (P->n + 1) + P->phases; }
static double *durations(const Problem *P, double *z) { return z + NB * (P->n + 1); }
static double total_duration(const Problem *P, double *z) {
  double total = 0;
  for (int64_t q = 0; q < P->phases; q++) total += durations(P, z)[q];
  return total;
}
static double duration_of(const Problem *P, const Interval *I, double *z) {
  return durations(P, z)[I->phase];
}
static double *border(const Problem *P, int64_t knot) { return P->border + knot * P->width * NB; }

/* ---- from knots to points and back ---- */

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

/* ---- the rows and their derivatives ---- */

/* From shares of the limits to shares of what may be used of them, or multipliers back. */
static void scale(const Interval *I, V *c) {
  for (int r = 0; r < NC; r++) c[r] *= I->scale[r];
}

/* Rows at the points of interval i as shares of what may be used of the limits; to the integral
   rows its part of them. */
static void rows(Problem *P, int64_t i, Group *G, const double *knots, double T, V *c) {
  const Interval *I = P->interval + i;
  V y[NY], g[NI];
  at_points(G, knots, T, y);
  values(y, P->q + NQ * I->phase, c, g, G->e);
  scale(I, c);
  for (int k = 0; k < NI; k++) P->integral[k].next += sum(G->integral * g[k]);
}

/* Curvature of the Lagrangian with t eliminated, by y; the rows are known from the trial that
   led here, or from the beginning. */
static void differentiate(const Problem *P, const Interval *I, Group *G, const double *knots,
                          V S[NY][NY]) {
  V y[NY], weight[NC + NI], stiffness[NC], H[NH];
  at_points(G, knots, duration_of(P, I, P->z), y);
  memcpy(weight, G->y, sizeof G->y);
  scale(I, weight);
  for (int k = 0; k < NI; k++) weight[NC + k] = P->integral[k].upper * G->integral;
  second(y, G->e, weight, P->q + NQ * I->phase, G->C, H);
  scale_rows(G->C, I->scale);
  for (int r = 0; r < NC; r++)
    stiffness[r] = G->upper[r] * G->over[r] + G->lower[r] * G->under[r];
  curvature_of_rows(G->C, H, stiffness, S);
}

/* The same by both knots and T, added to the lower triangle of K. */
static void add_curvature(const Group *G, V S[NY][NY], double K[NK + 1][WIDE + 4]) {
  V half[NK + 1][NY];
  for (int b = 0; b < NY; b++) { /* S is symmetric: its rows are its columns */
    for (int a = 0; a < NK; a++) half[a][b] = at_knot(G, S[b], a / NM, a % NM);
    half[NK][b] = S[NY - 1][b];
  }
  for (int row = 0; row <= NK; row++)
    for (int a = 0; a < NK && a <= row; a += 4) {
      V four[4], before;
      for (int k = 0; k < 4; k++)
        four[k] = WIDE == NK || a + k < NK ? at_knot(G, half[row], (a + k) / NM, (a + k) % NM)
                                           : ALL(0.0);
      memcpy(&before, K[row] + a, sizeof before);
      const V sums = NG == 1 ? sum_each(four) : before + sum_each(four);
      memcpy(K[row] + a, &sums, sizeof sums);
    }
}

/* The gradient of the Lagrangian's rows by the interval's own knots. */
static void local_gradient(const Problem *P, const Interval *I, double *g) {
  memset(g, 0, NK * sizeof(double));
  for (int j = 0; j < NG; j++) {
    const Group *G = I->group + j;
    V m[NY];
    across_rows(G->C, G->y, m);
    for (int k = 0; k < NI; k++)
      for (int a = 0; a < NY; a++)
        m[a] += P->integral[k].upper * G->integral * G->C[NZ + NY * k + a];
    for (int a = 0; a < NK; a++) g[a] += sum(at_knot(G, m, a / NM, a % NM));
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
    for (int k = 0; k < NI; k++) {
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

/* ---- Newton's equations ---- */

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

/* The border's corner: L D L^T in place, D beside; 0 where signs are not as they should be. */
static int factorise_corner(Problem *P) {
  const int64_t w = P->width;
  double *S = P->corner;
  for (int64_t j = 0; j < w; j++) {
    double d = S[w * j + j];
    for (int64_t k = 0; k < j; k++) d -= S[w * j + k] * S[w * j + k] * P->pivot[k];
    if (!(j < NI ? d < -1e-300 : d > 1e-16)) return 0;
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
  const int64_t w = P->width;
  const double *S = P->corner;
  for (int64_t i = 0; i < w; i++)
    for (int64_t k = 0; k < i; k++) x[i] -= S[w * i + k] * x[k];
  for (int64_t i = 0; i < w; i++) x[i] /= P->pivot[i];
  for (int64_t i = w - 1; i >= 0; i--)
    for (int64_t k = i + 1; k < w; k++) x[i] -= S[w * k + i] * x[k];
}

/* The columns of the border that an interval contributes to the knot on this side of it. */
static void add_border(const Problem *P, const Interval *I, int side, double *columns) {
  columns += NI * NB;
  if (!I->moving) {
    for (int r = 0; r < NB; r++) columns[NB * I->phase + r] += I->K[NK][NB * side + r];
    return;
  }
  for (int64_t q = 0; q < P->phases; q++)
    for (int r = 0; r < NB; r++)
      for (int a = 0; a <= NK; a++)
        columns[NB * q + r] += symmetric(I, NB * side + r, a) * rate_of(P, I, a, q);
}

/* Where a knot is a boundary, what is fixed there becomes an equation dz = 0 of its own. */
static void fix(const Problem *P, int64_t i, Block *B, double *columns) {
  const int64_t here = i < P->n ? P->interval[i].boundary[0] : P->phases;
  const int64_t next = i < P->n ? P->interval[i].boundary[1] : -1;
  for (int r = 0; r < NB; r++) {
    if (here >= 0 && !P->given->is_free[NB * here + r]) {
      for (int s = 0; s < NB; s++) B->D[r][s] = B->D[s][r] = B->E[s][r] = 0;
      B->D[r][r] = 1;
      for (int64_t w = 0; w < P->width; w++) columns[NB * w + r] = 0;
    }
    if (next >= 0 && !P->given->is_free[NB * next + r])
      for (int s = 0; s < NB; s++) B->E[r][s] = 0;
  }
}

/* Diagonal block and coupling to the next knot (transposed) of knot i. */
static void assemble_block(const Problem *P, int64_t i, double shift, Block *B) {
  const Interval *left = P->interval + i - 1, *right = P->interval + i;
  if (i > 0 && i < P->n) {
    for (int r = 0; r < NB; r++)
      for (int s = 0; s < NB; s++) { /* what lies above D's diagonal is not used */
        B->D[r][s] = left->K[NB + r][NB + s] + right->K[r][s];
        B->E[r][s] = right->K[NB + r][s];
        if (r % NM != s % NM) continue;
        B->D[r][s] +=
            shift * (left->bending[NR + r / NM][NR + s / NM] + right->bending[r / NM][s / NM]);
        B->E[r][s] += shift * right->bending[NR + r / NM][s / NM];
      }
    return;
  }
  for (int r = 0; r < NB; r++)
    for (int s = 0; s < NB; s++) {
      const int same = r % NM == s % NM;
      if (i > 0) {
        B->D[r][s] = left->K[NB + r][NB + s];
        if (same) B->D[r][s] += shift * left->bending[NR + r / NM][NR + s / NM];
        B->E[r][s] = 0;
      } else {
        B->D[r][s] = right->K[r][s];
        B->E[r][s] = right->K[NB + r][s];
        if (same) {
          B->D[r][s] += shift * right->bending[r / NM][s / NM];
          B->E[r][s] += shift * right->bending[NR + r / NM][s / NM];
        }
      }
    }
}

static int at_boundary(const Problem *P, int64_t i) {
  if (i == 0 || i == P->n) return 1;
  return P->interval[i].boundary[0] >= 0 || P->interval[i].boundary[1] >= 0;
}

static void assemble(const Problem *P, int64_t i, double shift, Block *B, double *columns) {
  assemble_block(P, i, shift, B);
  memset(columns + NI * NB, 0, P->phases * NB * sizeof(double));
  for (int k = 0; k < NI; k++)
    memcpy(columns + NB * k, P->slope + k * size(P) + NB * i, NB * sizeof(double));
  if (i > 0) add_border(P, P->interval + i - 1, 1, columns);
  if (i < P->n) add_border(P, P->interval + i, 0, columns);
  for (int64_t q = 0; q < P->phases; q++)
    if (P->given->given[q]) memset(columns + NB * (NI + q), 0, NB * sizeof(double));
  if (at_boundary(P, i)) fix(P, i, B, columns);
}

/* The border's own part: curvature by the durations, and the integral rows. */
static void assemble_corner(const Problem *P, double shift) {
  const int64_t w = P->width;
  double *S = P->corner;
  memset(S, 0, w * w * sizeof(double));
  for (int k = 0; k < NI; k++) {
    const Integral *G = P->integral + k;
    S[(w + 1) * k] = -1 / (G->upper * G->over);
    for (int64_t q = 0; q < P->phases; q++)
      S[w * (NI + q) + k] = durations(P, P->slope + k * size(P))[q];
  }
  for (int64_t q = 0; q < P->phases; q++) S[(w + 1) * (NI + q)] = shift;
  for (int64_t i = 0; i < P->n; i++) {
    const Interval *I = P->interval + i;
    if (!I->moving) {
      S[(w + 1) * (NI + I->phase)] += I->K[NK][NK];
      continue;
    }
    for (int64_t q = 0; q < P->phases; q++)
      for (int64_t s = 0; s <= q; s++)
        for (int a = 0; a <= NK; a++)
          for (int b = 0; b <= NK; b++)
            S[w * (NI + q) + NI + s] += rate_of(P, I, a, q) * symmetric(I, a, b) * rate_of(P, I, b, s);
  }
  for (int64_t q = 0; q < P->phases; q++) {
    if (!P->given->given[q]) continue;
    for (int64_t k = 0; k < w; k++) S[w * (NI + q) + k] = S[w * k + NI + q] = 0;
    S[(w + 1) * (NI + q)] = 1;
  }
}

/* What the elimination of the knot before leaves. */
static void eliminate(const Problem *P, const Block *before, const double *columns_before, Block *B,
                      double *columns) {
  for (int64_t w = 0; w < P->width; w++, columns += NB, columns_before += NB)
    for (int r = 0; r < NB; r++)
      for (int k = 0; k < NB; k++) columns[r] -= before->E[r][k] * columns_before[k];
  for (int r = 0; r < NB; r++)
    for (int k = 0; k < NB; k++)
      for (int s = 0; s <= r; s++) B->D[r][s] -= before->E[r][k] * before->E[s][k];
}

/* What the elimination of a knot leaves of the corner. */
static void eliminate_corner(Problem *P, const double *columns) {
  for (int64_t v = 0; v < P->width; v++)
    for (int64_t w = 0; w <= v; w++)
      for (int k = 0; k < NB; k++)
        P->corner[P->width * v + w] -= columns[NB * v + k] * columns[NB * w + k];
}

static int factorise_once(Problem *P, double shift) {
  assemble_corner(P, shift);
  for (int64_t i = P->first; i <= P->last; i++) {
    Block *B = P->block + i;
    double *columns = border(P, i);
    assemble(P, i, shift, B, columns);
    if (i > P->first) eliminate(P, B - 1, border(P, i - 1), B, columns);
    if (!cholesky(B->D)) return 0;
    for (int64_t w = 0; w < P->width; w++) solve_lower(B->D, columns + NB * w);
    eliminate_corner(P, columns);
    for (int k = 0; k < NB && i < P->last; k++) solve_lower(B->D, B->E[k]);
  }
  return factorise_corner(P);
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
  double *dz = P->dz, *rest = P->rest, *dT = durations(P, dz);
  for (int64_t i = 0; i < size(P); i++) dz[i] = -P->g[i];
  for (int k = 0; k < NI; k++) rest[k] = 0;
  for (int64_t q = 0; q < P->phases; q++) rest[NI + q] = dT[q];
  for (int64_t i = P->first; i <= P->last; i++) {
    Block *B = P->block + i;
    double *x = dz + NB * i;
    const double *columns = border(P, i);
    if (i > P->first)
      for (int r = 0; r < NB; r++)
        for (int k = 0; k < NB; k++) x[r] -= B[-1].E[r][k] * x[k - NB];
    solve_lower(B->D, x);
    for (int64_t w = 0; w < P->width; w++)
      for (int k = 0; k < NB; k++) rest[w] -= columns[NB * w + k] * x[k];
  }
  solve_corner(P, rest);
  for (int64_t q = 0; q < P->phases; q++) dT[q] = rest[NI + q];
  for (int64_t i = P->last; i >= P->first; i--) {
    Block *B = P->block + i;
    double *x = dz + NB * i;
    const double *columns = border(P, i);
    for (int64_t w = 0; w < P->width; w++)
      for (int k = 0; k < NB; k++) x[k] -= columns[NB * w + k] * rest[w];
    for (int k = 0; k < NB && i < P->last; k++)
      for (int r = 0; r < NB; r++) x[k] -= B->E[r][k] * x[NB + r];
    solve_upper(B->D, x);
  }
  move_positions(P, dz);
  P->report->solving += seconds() - begin;
}

/* ---- the steps of the method ---- */

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
  for (int k = 0; k < NI; k++) P->integral[k].bend = -weight * P->integral[k].dt * P->integral[k].dupper;
}

/* The gradient of the objective and of the barrier, t being eliminated. */
static void gradient(Problem *P, double mu) {
  memset(P->g, 0, size(P) * sizeof(double));
  for (int64_t q = 0; q < P->phases; q++) durations(P, P->g)[q] = 1.0;
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
  reduce_gradient(P, P->g);
  for (int k = 0; k < NI; k++) {
    const Integral *G = P->integral + k;
    const double q = (G->upper * (G->c - G->t) + mu - G->bend) * G->over;
    for (int64_t a = 0; a < size(P); a++) P->g[a] += q * P->slope[k * size(P) + a];
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
  for (int k = 0; k < NI; k++) {
    Integral *G = P->integral + k;
    G->dt = G->c - G->t;
    for (int64_t a = 0; a < size(P); a++) G->dt += P->slope[k * size(P) + a] * P->dz[a];
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
  for (int k = 0; k < NI; k++) {
    const Integral *G = P->integral + k;
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
  for (int k = 0; k < NI; k++) {
    const Integral *G = P->integral + k;
    all += (1 - G->t - primal * G->dt) * (G->upper + dual * G->dupper);
  }
  return all;
}

/* How many products of a slack and a multiplier there are. */
static double products(const Problem *P) { return 4.0 * NG * SIDES * P->n + NI; }

/* Mehrotra's choice: as far down as dz, Newton's step without barrier, would get, cubed; and
   his correction for what that step neglects, in so far as it can be taken. */
static void choose_barrier(Problem *P, double tolerance) {
  double primal, dual;
  longest_steps(P, 1.0, &primal, &dual);
  const double share = complementarity(P, primal, dual) / P->left;
  const double centring = lesser(greater(share * share * share, 1e-3), 1.0);
  const double least = 0.05 * tolerance * total_duration(P, P->z) / products(P);
  P->mu = greater(centring * P->left / products(P), least);
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

static double merit_of_integrals(Problem *P, double step) {
  double total = 0;
  for (int k = 0; k < NI; k++) {
    Integral *G = P->integral + k;
    const double c = step > 0 ? G->next : G->c;
    const double towards = lesser(c, 1 - 0.01 * (1 - G->t));
    G->moved = step > 0 ? 0.5 * (G->t + step * G->dt) + 0.5 * towards : G->t;
    total += P->penalty * fabs(c - G->moved) - P->mu * log(1 - G->moved);
  }
  return total;
}

static double merit(Problem *P, double step) {
  const double *dz = P->dz, begin = seconds();
  for (int64_t i = 0; i < size(P); i++) P->trial[i] = P->z[i] + step * dz[i];
  double total = total_duration(P, P->trial);
  for (int k = 0; k < NI; k++) P->integral[k].next = 1;
  for (int64_t i = 0; i < P->n; i++) {
    Interval *I = P->interval + i;
    double room[NK];
    const double *knots = local(P, i, P->trial, room), T = duration_of(P, I, P->trial);
    for (int j = 0; j < NG; j++) {
      rows(P, i, I->group + j, knots, T, I->group[j].next);
      total += merit_of_rows(P, I->group + j, I->group[j].next, step);
    }
  }
  total += merit_of_integrals(P, step);
  P->report->evaluations++;
  P->report->evaluating += seconds() - begin;
  return total;
}

/* Merit now and its slope along the direction, the penalty being large enough for descent. */
static double merit_now(Problem *P, double *slope) {
  double needed = 0, infeasibility = 0;
  V along = ALL(0.0);
  *slope = total_duration(P, P->dz);
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
  for (int k = 0; k < NI; k++) {
    const Integral *G = P->integral + k;
    needed = greater(needed, fabs(G->upper + G->dupper));
    infeasibility += fabs(G->c - G->t);
    *slope += P->mu * G->over * G->dt;
  }
  if (needed > P->penalty || needed < P->penalty / 10) P->penalty = 1.5 * needed + 1e-6;
  *slope += sum(along) - P->penalty * infeasibility;
  double total = total_duration(P, P->z);
  for (int64_t i = 0; i < P->n; i++)
    for (int j = 0; j < NG; j++) {
      Group *G = P->interval[i].group + j;
      total += merit_of_rows(P, G, G->c, 0.0);
    }
  return total + merit_of_integrals(P, 0.0);
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

/* A multiplier after a step, never far from mu / slack: stiffness stays meaningful (Ipopt's
   kappa_sigma). */
static V near_barrier(V multiplier, V mu_by_slack) {
  return smaller(larger(multiplier, mu_by_slack * 1e-8), mu_by_slack * 1e8);
}

/* To the last trial, multipliers by a step of their own. */
static void move(Problem *P, double dual) {
  memcpy(P->z, P->trial, size(P) * sizeof(double));
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
  for (int k = 0; k < NI; k++) {
    Integral *G = P->integral + k;
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
  set_unit_weights(P);
  for (int64_t q = 0; q < P->phases; q++) {
    V p[NP];
    for (int k = 0; k < NP; k++) p[k] = ALL(given->p[NP * q + k]);
    prepare(p, P->q + NQ * q);
    for (int64_t j = 0; j < given->intervals[q]; j++, i++) {
      Interval *I = P->interval + i;
      I->length = given->mesh[i];
      I->phase = q;
      I->boundary[0] = j == 0 ? q : -1;
      I->boundary[1] = j == given->intervals[q] - 1 ? q + 1 : -1;
      I->moving = 0;
      for (int side = 0; side < 2; side++) {
        const int64_t b = I->boundary[side];
        I->constant[side] = b >= 0 && has_rates(given, b);
        for (int k = 0; b >= 0 && k < NM; k++) I->moving |= given->drift[NM * b + k] != 0;
      }
      I->any_constant = I->constant[0] || I->constant[1];
      for (int r = 0; r < NC; r++) I->scale[r] = 1 / given->share[NC * i + r];
      set_weights(P, I);
      set_bending(P, I, durations(P, P->z)[q]);
    }
  }
  P->first = 1;
  P->last = P->n - 1;
  for (int k = 0; k < NB; k++) {
    if (given->is_free[k]) P->first = 0;
    if (given->is_free[NB * P->phases + k]) P->last = P->n;
  }
}

/* A row's copy and multipliers at the guess. */
static void begin_row(const Problem *P, Group *G, int r, double closest) {
  G->t[r] = G->c[r];
  if (LOWER(r)) G->t[r] = larger(G->t[r], ALL(closest - 1));
  if (UPPER(r)) G->t[r] = smaller(G->t[r], ALL(1 - closest));
  measure(G, r);
  G->upper[r] = P->mu * G->over[r];
  G->lower[r] = P->mu * G->under[r];
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

/* Weights, rows and multipliers at the guess; 0 where the rows are no numbers. */
static int begin(Problem *P, const Settings *S) {
  double total = 0;
  set_intervals(P);
  P->mu = S->barrier * total_duration(P, P->z) / products(P);
  P->penalty = 0;
  for (int k = 0; k < NI; k++) P->integral[k].next = 1;
  for (int64_t i = 0; i < P->n; i++) {
    Interval *I = P->interval + i;
    double room[NK];
    const double *knots = local(P, i, P->z, room), T = duration_of(P, I, P->z);
    for (int j = 0; j < NG; j++) {
      Group *G = I->group + j;
      rows(P, i, G, knots, T, G->c);
      for (int r = 0; r < NC; r++) {
        total += sum(absolute(G->c[r]));
        begin_row(P, G, r, S->closest);
      }
    }
  }
  for (int k = 0; k < NI; k++) {
    Integral *G = P->integral + k;
    G->c = G->next;
    G->t = lesser(G->c, 1 - S->closest);
    G->over = 1 / (1 - G->t);
    G->upper = P->mu * G->over;
    G->dt = G->dupper = G->bend = 0;
    total += fabs(G->c);
  }
  return total < DBL_MAX;
}

/* Whether z is a solution: dz is Newton's step without barrier. */
static int solved(Problem *P, double tolerance) {
  const double T = total_duration(P, P->z);
  Report *R = P->report;
  R->primal = 0;
  for (int64_t i = 0; i < P->n; i++)
    for (int j = 0; j < NG; j++) {
      const Group *G = P->interval[i].group + j;
      for (int r = 0; r < NC; r++)
        R->primal = greater(R->primal, largest(absolute(G->c[r] - G->t[r])));
    }
  for (int k = 0; k < NI; k++)
    R->primal = greater(R->primal, fabs(P->integral[k].c - P->integral[k].t));
  R->dual = fabs(total_duration(P, P->dz)) / T;
  R->complementarity = P->left / T;
  return greater(R->complementarity, greater(R->primal, R->dual)) <= tolerance;
}

static void differentiate_all(Problem *P) {
  const double begin = seconds();
  memset(P->slope, 0, NI * size(P) * sizeof(double));
  for (int64_t i = 0; i < P->n; i++) curvature(P, i);
  for (int k = 0; k < NI; k++) reduce_gradient(P, P->slope + k * size(P));
  P->report->evaluating += seconds() - begin;
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
   are cured by a shift. */
static int aim(Problem *P, double *shift) {
  const double left = P->left / total_duration(P, P->z);
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

/* The next part of the memory, on a cache line of its own. */
static void *part(uintptr_t *address, int64_t bytes) {
  const uintptr_t begin = (*address + 63) / 64 * 64;
  *address = begin + (uintptr_t)bytes;
  return (void *)begin;
}

/* Share out the memory from an address on; the address after it. */
static uintptr_t share_out(Problem *P, uintptr_t address) {
  const int64_t numbers = size(P), real = sizeof(double), w = P->width;
  P->interval = part(&address, P->n * (int64_t)sizeof(Interval));
  P->block = part(&address, (P->n + 1) * (int64_t)sizeof(Block));
  P->q = part(&address, P->phases * NQ * (int64_t)sizeof(V));
  P->border = part(&address, (P->n + 1) * w * NB * real);
  P->corner = part(&address, w * w * real);
  P->pivot = part(&address, w * real);
  P->rest = part(&address, w * real);
  P->z = part(&address, numbers * real);
  P->dz = part(&address, numbers * real);
  P->trial = part(&address, numbers * real);
  P->g = part(&address, numbers * real);
  P->slope = part(&address, NI * numbers * real);
  return address;
}

/* Bytes of memory that ``solve`` needs for n intervals in all. */
int64_t workspace(int64_t n, int64_t phases) {
  Problem P = {.n = n, .phases = phases, .width = NI + phases};
  return (int64_t)share_out(&P, 64);
}

/* What Python hands over, one after the other: see Given. */
static Given given_by(int64_t phases, int64_t n, const int64_t *flags, const double *rule,
                      const double *numbers) {
  Given G = {.phases = phases, .intervals = flags, .given = flags + phases};
  G.is_free = G.given + phases;
  G.fractions = rule;
  G.quadrature = rule + 4 * NG;
  G.mesh = numbers;
  G.share = G.mesh + n;
  G.p = G.share + n * NC;
  G.state = G.p + phases * NP;
  G.drift = G.state + (phases + 1) * NB;
  return G;
}

/* flags: intervals, given, is_free. rule: fractions, quadrature. numbers: mesh, share, p, state,
   drift. motion: in, a guess; out, the solution: knots of each phase in units of its duration,
   (n + phases) x NB, and the durations. multipliers: out, n x points x NC of the rows, NI of the
   integral rows. memory: for this call alone, its contents of no account. */
int solve(int64_t phases, const int64_t *flags, const double *rule, const double *numbers,
          double *motion, double *multipliers, const Settings *settings, Report *report,
          void *memory) {
  Problem P = {.phases = phases, .width = NI + phases, .report = report};
  for (int64_t q = 0; q < phases; q++) P.n += flags[q];
  const Given given = given_by(phases, P.n, flags, rule, numbers);
  P.given = &given;
  share_out(&P, (uintptr_t)memory);
  memset(report, 0, sizeof *report);
  double *T = motion + (P.n + phases) * NB;
  pack(&P, motion, T);
  const int status = begin(&P, settings) ? iterate(&P, settings) : NOT_A_NUMBER;
  unpack(&P, motion, T);
  for (int64_t i = 0; i < P.n; i++)
    for (int j = 0; j < NG; j++)
      for (int l = 0; l < 4; l++)
        for (int r = 0; r < NC; r++)
          *multipliers++ = P.interval[i].group[j].y[r][l] * P.interval[i].scale[r];
  for (int k = 0; k < NI; k++) *multipliers++ = P.integral[k].upper;
  return status;
}
