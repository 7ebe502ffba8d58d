/* The fastest speeds along a path, by reachability, for rows that are affine in b and u.

   b is the squared speed of the path's parameter s, u its acceleration. In a cell of the mesh, of
   length h, u is linear in s, so that b at its end is b at its begin + h (u at begin + u at end).
   At both ends of every cell each row keeps  low <= alpha u + beta b <= high.

   Backwards from the goal: the largest and the least b at every node from which the goal can be
   reached. Forwards from the start: at every node the largest b that can be reached and from which
   the goal can be reached. Both are sums and minima over the rows: nothing is divided by alpha, so
   that rows may lose their u at a point (zero inertia) or on an interval.

   Ends of cells are numbered 2 i (begin of cell i) and 2 i + 1 (its end); rows of an end follow
   each other. */
#include <math.h>
#include <stdint.h>

#define LARGE 1e30     /* stands for an acceleration without bound */
#define VANISHING 1e-13 /* below it a coefficient of normalised rows is rounding */
#define ROUNDING 1e-12
#define STEPS 60
#define LOSING 0.1    /* of a row, between its bounds at +1 and -1: what all of u changes, below
                         which it has hardly any. Less lets pulses grow beside such points. */
#define STEEPEST 50   /* less would slow what changes quickly, as in small roundings; more lets
                         pulses pass on coarse meshes */

typedef struct { double low, high; } Range;

typedef struct {
  int64_t rows, convex;
  const double *alpha, *beta, *low, *high, *h;
  double *change;  /* of u in each cell, at most */
} Problem;

/* The accelerations that the rows at an end allow at b, and their slopes by b. */
static Range accelerations(const Problem *p, int64_t end, double b, Range *slope) {
  Range u = {-LARGE, LARGE};
  slope->low = slope->high = 0;
  for (int64_t j = end * p->rows; j < (end + 1) * p->rows; j++) {
    const double a = p->alpha[j], by = p->beta[j];
    if (fabs(a) < VANISHING) continue;
    double most = (p->high[j] - by * b) / a, least = (p->low[j] - by * b) / a;
    if (a < 0) { const double kept = most; most = least; least = kept; }
    if (most < u.high) { u.high = most; slope->high = -by / a; }
    if (least > u.low) { u.low = least; slope->low = -by / a; }
  }
  return u;
}

/* Narrow a range by  factor b <= bound. */
static inline void at_most(Range *b, double factor, double bound) {
  if (factor > VANISHING) b->high = fmin(b->high, bound / factor);
  else if (factor < -VANISHING) b->low = fmax(b->low, bound / factor);
}

/* A range, the slopes of its ends and what is left of it (negative: nothing) with its slope. */
typedef struct { Range b, slope; double room, rate; } Reach;

/* Narrow it by  factor b <= bound, which changes at this rate. */
static inline void narrow(Reach *reach, double factor, double bound, double rate) {
  if (fabs(factor) <= VANISHING) {
    if (bound < reach->room) { reach->room = bound; reach->rate = rate; }
    return;
  }
  const double at = bound / factor;
  if (factor > 0 && at < reach->b.high) { reach->b.high = at; reach->slope.high = rate / factor; }
  if (factor < 0 && at > reach->b.low) { reach->b.low = at; reach->slope.low = rate / factor; }
}

static inline int is_empty(Range b) {
  return b.low > b.high + ROUNDING * (fabs(b.low) + fabs(b.high));
}

/* Narrow a range to the b at which the rows of an end allow some u. */
static void allowed(const Problem *p, int64_t end, Range *b) {
  for (int64_t j = end * p->rows; j < (end + 1) * p->rows; j++)
    if (fabs(p->alpha[j]) < VANISHING) {
      at_most(b, p->beta[j], p->high[j]);
      at_most(b, -p->beta[j], -p->low[j]);
      if (fabs(p->beta[j]) < VANISHING && (p->high[j] < -ROUNDING || p->low[j] > ROUNDING))
        b->low = LARGE;
    }
  if (is_empty(*b)) return;
  for (int side = 0; side < 2; side++) {  /* Newton's method on a concave function: from outside */
    double *at = side ? &b->low : &b->high;
    for (int i = 0; i < STEPS; i++) {
      Range slope, u = accelerations(p, end, *at, &slope);
      const double room = u.high - u.low, rate = slope.high - slope.low;
      if (room >= -ROUNDING * (fabs(u.high) + fabs(u.low))) break;
      const double step = -room / rate;
      if (!(side ? rate > 0 && step > 0 : rate < 0 && step < 0)) {  /* nowhere */
        b->low = LARGE;
        return;
      }
      *at += step;
    }
  }
  if (b->high < b->low) {  /* rounding of the way from far outside, or nowhere */
    Range slope, u = accelerations(p, end, b->low, &slope);
    if (u.high >= u.low) b->high = b->low;
  }
}

/* By how much u may change in a cell, INFINITY for any change.

   Where a row hardly depends on u, near a point of zero inertia, leaps of u within a cell that other
   rows stop would gain next to nothing, and a motion of largest b has them: pulses of torque. There
   u changes no faster than STEEPEST times all that it can in the length of the path; not so where
   rows are no more than tangents, which may ask for leaps of u, as Coulomb friction does. */
static double steepest(const Problem *p, int64_t cell) {
  if (!p->convex) return INFINITY;
  const int64_t begin = 2 * cell * p->rows, end = begin + p->rows;
  double range = INFINITY;
  for (int64_t j = begin; j < end + p->rows; j++)
    if (fabs(p->alpha[j]) > VANISHING)
      range = fmin(range, (p->high[j] - p->low[j]) / fabs(p->alpha[j]));
  if (isinf(range)) return INFINITY;
  for (int64_t j = begin; j < end; j++) {
    const double one = fabs(p->alpha[j]), other = fabs(p->alpha[j + p->rows]);
    if (fmax(one, other) > VANISHING && fmin(one, other) * range < LOSING)
      return STEEPEST * p->h[cell] * range;
  }
  return INFINITY;
}

/* The b at the end of a cell that can be reached from b at its begin, within a range, with slopes
   by b.

   At an end where no row has a u, since the path stands still there (p' = 0), u could be anything,
   but not beside it: there u is constant in the cell. */
static Reach reachable(const Problem *p, int64_t cell, double b, Range within) {
  Range by, u = accelerations(p, 2 * cell, b, &by);
  Reach found = {within, {0, 0}, INFINITY, 0};
  const double h = p->h[cell], fast = b + h * u.high, slow = b + h * u.low;
  const double faster = 1 + h * by.high, slower = 1 + h * by.low;
  const int still = u.high >= LARGE && u.low <= -LARGE;
  double change = still ? 0 : p->change[cell], largest = 0;
  for (int64_t j = (2 * cell + 1) * p->rows; j < (2 * cell + 2) * p->rows; j++) {
    const double a = p->alpha[j], by_b = p->beta[j], low = p->low[j], high = p->high[j];
    largest = fmax(largest, fabs(a));
    if (!still) {
      const double above = a > 0 ? fast : slow, below = a > 0 ? slow : fast;
      const double up = a > 0 ? faster : slower, down = a > 0 ? slower : faster;
      narrow(&found, a + h * by_b, h * high + a * above, a * up);
      narrow(&found, -a - h * by_b, -h * low - a * below, -a * down);
    }
    if (change < INFINITY) {
      const double more = fabs(a) * h * change;
      narrow(&found, a + 2 * h * by_b, 2 * h * high + a * b + more, a);
      narrow(&found, -a - 2 * h * by_b, -2 * h * low - a * b + more, -a);
    }
  }
  if (largest < VANISHING) change = 0;
  if (!still && change < INFINITY) {
    narrow(&found, 1, b + h * (2 * u.high + change), 1 + 2 * h * by.high);
    narrow(&found, -1, -b - h * (2 * u.low - change), -1 - 2 * h * by.low);
  }
  if (found.b.high - found.b.low < found.room) {
    found.room = found.b.high - found.b.low;
    found.rate = found.slope.high - found.slope.low;
  }
  return found;
}

/* The b at the begin of a cell, within a range, from which the range at its end can be reached.

   The room that is left there is a concave function of b made of straight pieces. Newton's method
   comes to its zeros from outside, in no more steps than there are pieces on the way. */
static Range controllable(const Problem *p, int64_t cell, Range b, Range target) {
  allowed(p, 2 * cell, &b);
  if (cell > 0) allowed(p, 2 * cell - 1, &b);
  if (is_empty(b)) return b;
  for (int side = 0; side < 2; side++) {
    double *at = side ? &b.low : &b.high;
    for (int i = 0;; i++) {
      const Reach next = reachable(p, cell, *at, target);
      if (next.room >= -ROUNDING * (fabs(next.b.low) + fabs(next.b.high) + *at)) break;
      const double root = *at - next.room / next.rate;
      const int towards = side ? next.rate > 0 : next.rate < 0;
      if (towards && fabs(root - *at) <= ROUNDING * *at) break;  /* steep, as friction is at rest */
      if (i == STEPS || !towards || b.high <= b.low) {
        b.low = LARGE;  /* nowhere */
        return b;
      }
      *at = fmax(b.low, fmin(b.high, root));
    }
  }
  return b;
}

/* Returns 0, or 1 + the node at which no speed is possible, or -1 if the start is not among what
   can reach the goal. Convex: whether rows are all that there is, and no tangents to something that
   is not convex. Results: b (cells + 1), u (cells, 2). Memory of 3 (cells + 1) numbers. */
int64_t sweep(int64_t cells, int64_t rows, int64_t convex, const double *h, const double *alpha,
              const double *beta, const double *low, const double *high, double start, double goal,
              double most, double *b, double *u, double *memory) {
  const Problem problem = {rows, convex, alpha, beta, low, high, h, memory}, *p = &problem;
  Range *K = (Range *)(memory + cells + 1);  /* of b at each node, from where the goal is reached */
  K[cells] = (Range){goal, goal};
  allowed(p, 2 * cells - 1, &K[cells]);
  if (is_empty(K[cells])) return 1 + cells;
  for (int64_t i = cells - 1; i >= 0; i--) {
    p->change[i] = steepest(p, i);
    K[i] = controllable(p, i, (Range){0, most}, K[i + 1]);
    if (is_empty(K[i])) return 1 + i;
  }
  const double slack = ROUNDING * (1 + K[0].high);
  if (start > K[0].high + slack || start < K[0].low - slack) return -1;
  b[0] = start;
  for (int64_t i = 0; i < cells; i++) {
    const Range next = reachable(p, i, b[i], K[i + 1]).b;
    b[i + 1] = next.high >= next.low ? next.high : (next.high + next.low) / 2;
    b[i + 1] = fmax(fmin(b[i + 1], K[i + 1].high), K[i + 1].low);
    Range slope, first = accelerations(p, 2 * i, b[i], &slope);
    const Range last = accelerations(p, 2 * i + 1, b[i + 1], &slope);
    const double sum = (b[i + 1] - b[i]) / h[i], change = p->change[i];
    const double least = fmax(fmax(first.low, sum - last.high), (sum - change) / 2);
    const double top = fmin(fmin(first.high, sum - last.low), (sum + change) / 2);
    u[2 * i] = least > top ? (least + top) / 2 : fmax(fmin(sum / 2, top), least);
    u[2 * i + 1] = sum - u[2 * i];
  }
  return 0;
}
