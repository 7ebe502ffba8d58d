/* An interior-point method for motions made of polynomials between knots.

     minimise    sum of T_q                              the durations of the phases q
                 or  w sum of T_q + v sum over q of integral l dt     with a running cost l
     subject to  lower_r <= c_r(y_j) <= upper_r          constraint rows, at every point j of every
                                                         interval; +1, -1, or no limit on that side
                 |x - centre|^2 <= radius^2                 spheres, each at one boundary
     y = (X, V, A[, J], T_q) at a point, linear in the knots of its interval

   A motion has phases, each with its own duration T_q, mesh and parameters p_q. Time inside a
   phase is counted in units of its duration: V = T v, A = T^2 a, J = T^3 j. Every coordinate is
   a cubic between knots of (X, V) (NR = 2: acceleration may jump at knots), or three cubics of equal
   length between knots of (X, V, A) (NR = 3: acceleration is continuous, jerk is constant in each). Rows may depend on quantities that
   equations determine, such as motor torques; these are eliminated in the generated functions
   below, so that here rows are functions of y alone.

   Boundaries: the start, the joints of phases, and the goal. There each component of the state
   is free, fixed, or a position that moves, at + drift * (time since the start); a position that
   is free may have to be in a sphere. Where rates are
   not all zero, the knot at a boundary is in constant units (x, v[, a]), since it belongs to two
   phases, or has a velocity given in m/s; the chain rule takes it to (X, T v[, T^2 a]) of the
   phase beside it. So joints need no rows.

   With t a copy of c kept strictly inside the limits, c(y) - t = 0, and its multipliers and those
   of the limits eliminated, Newton's equations are in the knots and the durations; a running cost
   adds to curvature and gradient. This KKT system is block tridiagonal, a block for each knot, with
   a border: a dense column for each duration; a sphere adds to the block of its knot alone. Blocks
   are factorised with Cholesky's method, the border with L D L^T. Where it is not positive definite
   the step would not be one of descent.

   Jerk is 1 / length^3 times differences of positions, and K the square of that: elimination of
   positions from knot to knot would leave the difference of two numbers that are larger than it by
   the sixth power of how many times one interval is longer than another, and no digits where one is
   short. So inside of phases K is by knot i + 1 and by how far that deviates from where knot i leads with constant A
   (NR = 2: constant V): what is left then are the sums of what the motion itself costs.

   Where nothing but the speed of one motor decides how long a motion takes, many motions are as
   fast, and on a mesh almost as fast: steps would drift along that valley, and each mesh would have
   to resolve another motion. So of motions that are equally fast as far as the tolerance goes the
   smoothest is sought.

   The text is in five files, compiled as one: this one, with what is stored; knots_and_points.c;
   rows.c; kkt_system.c; and interior_point.c, the steps of the method. Nothing in it is kept from
   call to call: all memory is the caller's.

   Written for four points of an interval in the four lanes of a vector V. What comes before this
   text: V, ALL, EACH, EACH2, SHUFFLE; sizes; and generated functions. C is the sparse matrix of
   derivatives of the rows by y, stored as its NZ nonzeros, row by row, and then the dense NL x NY
   derivatives of T l.

     NM, NR         coordinates, and unknowns for each at a knot
     NY, NC         numbers in y, constraint rows
     NL             running costs, 0 or 1
     NP, NQ         parameters, and numbers that depend on them alone
     NO, OWN        parameters of each interval's own, and where in p they begin
     NE             numbers that values keeps for second, the torques among them
     NZ, NH         nonzeros of C's constraint rows and of H's upper triangle
     NG             groups of four points in an interval
     ALIKE          rows that are alike, distances from bodies
     SIDES          limits of all rows together; UPPER(r), LOWER(r): whether row r has that one
     DEPENDS(r, a)  whether row r depends on component a of position and velocity
     STATE(r)       whether row r depends on the position and velocity alone

     prepare(p, q)                        what depends on parameters alone
     values(y, q, s, c, g, e)             rows, the integrand T l, and e for second; of rows
                                          that are alike those alone whose s, as below, is not 0
     second(y, e, weights of c and g, q, s, C, H)  derivatives; H of the weighted sum
     scale_rows(C, s)                     multiply each row of C
     along_rows(C, dy, dc)                dc += C dy
     across_rows(C, q, m)                 m = C^T q
     curvature_of_rows(C, H, s, S)        S = H + C^T diag(s) C, all of it
*/

#include <float.h>
#include <stdint.h>
#include <string.h>

#define SHORT 0.02 /* a step of which share of a direction says little about its rest */
#define AT_LIMIT 0.9999999 /* of a limit: a given state is as good as at it */
#define FAR 2.0    /* from one limit of a row to the other */
#define SHIFT 1e-5 /* the first that is tried: the scene's magnitudes are of the order of one */
#define HIGHEST 1e-2 /* to which a shift grows because steps had to be halved */
#define FAR_OFF 1e-3 /* of complementarity over the cost: nearer to a solution shifts are smaller */
#define BLOCKED 0.3 /* a step of which share of a direction is blocked, see choose_barrier */
#define AHEAD 5.0 /* times what the direction gains: what complementarity is to be where it is blocked */
#define MOST_LEFT 0.3 /* of the cost: where more is to be gained the direction is far off */
#define RISE 10.0 /* times complementarity: what merit may rise by, see try_direction */
#define VALLEY 100.0 /* times what a shifted step gains: what is left, see solved */
#define USUAL 16.0 /* so that the intervals of a mesh of 16 have weight 1 in the integral of A^2 */

enum {
  NB = NM * NR,           /* unknowns at a knot */
  NK = 2 * NB,            /* at both knots of an interval */
  WIDE = (NK + 3) / 4 * 4 /* NK, rounded up to whole vectors */
};

enum { SOLVED, TOO_MANY_ITERATIONS, NO_PROGRESS, SINGULAR, NOT_A_NUMBER };

typedef struct {
  double tolerance;   /* of complementarity and of the cost as fractions of it */
  double rows;        /* of |c - t| */
  double barrier;     /* complementarity at first, as a fraction of the cost */
  double closest;     /* how close t may begin to its limits, as a fraction */
  int64_t iterations; /* at most */
  double *trace;      /* for those who watch, TRACED numbers of each iteration; or NULL */
  int64_t is_warm;    /* whether multipliers are given with the guess */
  double smooth;      /* what unevenness counts beside the cost, see unevenness */
} Settings;

enum { TRACED = 4 };

typedef struct {
  double cost, complementarity, dual, primal; /* what is compared with the tolerance */
  int64_t iterations;
} Report;

/* The problem. n is the number of intervals of all phases together. */
typedef struct {
  int64_t phases;
  const int64_t *intervals;  /* of each phase */
  const int64_t *given;      /* whether a phase's duration is given */
  const double *mesh;        /* n: intervals as fractions of their phase's duration */
  const double *own;         /* n x NO: parameters of each interval's own, in place of those in p */
  const double *share;       /* n x NC: of the limits that may be used; infinite: no limit there */
  const double *p;           /* phases x NP */
  const double *state;       /* (phases + 1) x NB: at each boundary, in constant units */
  const int64_t *is_free;    /* (phases + 1) x NB: which of its components are not given */
  const double *drift;       /* (phases + 1) x NM: velocity of a position that moves */
  const double *radius;      /* phases + 1: of the sphere about the position in state; 0: none */
  const double *cost;        /* 3: weights of the duration and of the running cost; whether the sum of
                                all durations is given */
  const double *fractions;   /* NG x 4: the points of an interval */
  const double *thirds;      /* NG x 4: in which third of the interval each of them is, if NR = 3:
                                at the end of one that is the beginning of the next, jerk jumps */
  const double *quadrature;  /* NG x 4: their weights in integrals */
} Given;

typedef struct {
  V weight[NR + 1][2 * NR];      /* of X_i, V_i[, A_i], X_i+1, .. in X, V, A[, J] */
  V form[NR + 1][2 * NR];        /* the same for K: of what the interval is a form in */
  V integral;                    /* weight of a point in integrals over the phase */
  V c[NC], t[NC];                /* rows and their copies */
  V next[NC], e[NE];             /* rows, and what values keeps, at the last trial: z if taken */
  V over[NC], under[NC];         /* 1 / distance of t to its limits; 0 where there is none */
  V upper[NC], lower[NC];        /* multipliers of the limits of t; 0 where there is none */
  V y[NC];                       /* of c = t: upper - lower */
  V dt[NC], dupper[NC], dlower[NC];
  V moved[NC];                   /* t at the last trial */
  V bend_upper[NC], bend_lower[NC]; /* second-order part of slack times multiplier */
  V C[NZ + NL * NY];             /* derivatives of rows and running cost by y */
} Group;                         /* of four points */

typedef struct {
  Group group[NG];
  double scale[NC];              /* 1 / share of the limits that may be used */
  double K[NK + 1][WIDE + 4];    /* curvature by both knots and T, the lower triangle */
  double bending[2 * NR][2 * NR]; /* its part of the integral of A^2, as a form in the knots */
  int by_deviation;              /* K and bending are by the deviation in place of knot i */
  double length, back[NR];       /* back[k]: (-length)^k / k!, of what was a length earlier */
  const double *own;             /* NO: its own parameters */
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
  double slope[NM];            /* by the position */
  const double *centre;
  double radius;
  int64_t knot;                /* that is in it */
} Sphere;

typedef struct {
  const Given *given;
  int64_t n, phases;             /* intervals; phases, each with a column of the border */
  int64_t first, last;           /* the first and last knot that is not wholly fixed */
  Interval *interval;            /* n */
  Block *block;                  /* n + 1 */
  V *prepared;                   /* phases x NQ */
  double *border;                /* (n + 1) x phases x NB */
  double *corner, *pivot;        /* phases x phases, lower triangle: L; phases: D */
  double *z, *dz, *trial, *g;    /* n + 1 knots, then the durations */
  double *slope;                 /* NL x size of z: derivatives of the running cost's integral by z */
  double *rest, *along_sum;      /* phases: the border's part of a right-hand side, of a solution; by a
                                    multiplier of the sum of all durations */
  int64_t spheres;
  Sphere *sphere;
  double mu, penalty;
  double smooth;                 /* what unevenness counts, in the unit of the cost */
  double run, next_run;          /* the integral of the running cost at z, at the trial */
  double unit;                   /* of what shifts are counted in: 1, or a running cost at first */
  double left; /* complementarity now */
  int halvings; /* of the last step */
  Report *report;
} Problem;

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
/* What is minimised, at z; run: the integral of the running cost there. */
static double cost(const Problem *P, double *z, double run) {
  return NL ? P->given->cost[0] * total_duration(P, z) + P->given->cost[1] * run
            : total_duration(P, z);
}
static double duration_of(const Problem *P, const Interval *I, double *z) {
  return durations(P, z)[I->phase];
}
static double *border(const Problem *P, int64_t knot) { return P->border + knot * P->phases * NB; }
