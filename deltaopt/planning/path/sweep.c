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
#define HALVINGS 60
#define SEARCHED 128

typedef struct { double low, high; } Range;

typedef struct {
  int64_t rows;
  const double *alpha, *beta, *low, *high, *h;
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
    for (int i = 0; i < HALVINGS; i++) {
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

/* The b at the end of a cell that can be reached from b at its begin, within a range.

   At an end where no row has a u, since the path stands still there (p' = 0), u could be anything,
   but not beside it: there u is constant in the cell. */
static Range reachable(const Problem *p, int64_t cell, double b, Range within) {
  Range slope, u = accelerations(p, 2 * cell, b, &slope);
  const double h = p->h[cell], fast = b + h * u.high, slow = b + h * u.low;
  const int still = u.high >= LARGE && u.low <= -LARGE;
  double largest = 0;
  for (int64_t j = (2 * cell + 1) * p->rows; j < (2 * cell + 2) * p->rows; j++) {
    const double a = p->alpha[j], step = still ? 2 * h : h, factor = a + step * p->beta[j];
    at_most(&within, factor, step * p->high[j] + a * (still ? b : a > 0 ? fast : slow));
    at_most(&within, -factor, -step * p->low[j] - a * (still ? b : a > 0 ? slow : fast));
    largest = fmax(largest, fabs(a));
  }
  if (largest < VANISHING) {
    at_most(&within, 1, b + 2 * h * u.high);
    at_most(&within, -1, -b - 2 * h * u.low);
  }
  return within;
}

/* b + h (least deceleration at the end of a cell): from how much b at its begin one can slow down
   to b. Concave in b. */
static double slowing(const Problem *p, int64_t cell, double b, double *rate) {
  Range slope, u = accelerations(p, 2 * cell + 1, b, &slope);
  *rate = 1 - p->h[cell] * slope.low;
  return b - p->h[cell] * u.low;
}

static double most_slowing(const Problem *p, int64_t cell, Range b) {
  double rate, most = slowing(p, cell, b.high, &rate);
  if (rate >= 0) return most;
  for (int i = 0; i < HALVINGS; i++) {
    const double middle = (b.low + b.high) / 2;
    most = fmax(most, slowing(p, cell, middle, &rate));
    if (rate > 0) b.low = middle; else b.high = middle;
  }
  return most;
}

/* Whether from b at the begin of a cell a range at its end can be reached. */
static int reaches(const Problem *p, int64_t cell, double b, Range within) {
  return !is_empty(reachable(p, cell, b, within));
}

/* The border between b that do and do not reach the range, to rounding. */
static double border(const Problem *p, int64_t cell, double does, double does_not, Range within) {
  for (int i = 0; i < HALVINGS; i++) {
    const double middle = (does + does_not) / 2;
    if (reaches(p, cell, middle, within)) does = middle; else does_not = middle;
  }
  return does;
}

/* The b at the begin of a cell, within a range, from which the range at its end can be reached. */
static Range controllable(const Problem *p, int64_t cell, Range b, Range target) {
  const double h = p->h[cell], most = most_slowing(p, cell, target);
  for (int64_t j = 2 * cell * p->rows; j < (2 * cell + 1) * p->rows; j++) {
    const double a = p->alpha[j], factor = a - h * p->beta[j];
    if (a > 0) at_most(&b, factor, a * most - h * p->low[j]);
    else at_most(&b, -factor, -a * most + h * p->high[j]);
  }
  allowed(p, 2 * cell, &b);
  if (cell > 0) allowed(p, 2 * cell - 1, &b);
  if (is_empty(b)) return b;
  const int top = reaches(p, cell, b.high, target), bottom = reaches(p, cell, b.low, target);
  if (top && bottom) return b;
  double inside = top ? b.high : b.low;
  for (int i = 1; i <= SEARCHED && !top && !bottom; i++) {  /* also where b has hardly a bound */
    inside = b.low + (b.high - b.low) * (i < 64 ? i / 64.0 : exp2(63 - i) / 64);
    if (reaches(p, cell, inside, target)) break;
    if (i == SEARCHED) { b.low = LARGE; return b; }
  }
  if (!top) b.high = border(p, cell, inside, b.high, target);
  if (!bottom) b.low = border(p, cell, inside, b.low, target);
  return b;
}

/* Returns 0, or 1 + the node at which no speed is possible, or -1 if the start is not among what
   can reach the goal. Results: b (cells + 1), u (cells, 2), limits (cells + 1, 2): the range of b
   at each node from which the goal can be reached. */
int64_t sweep(int64_t cells, int64_t rows, const double *h, const double *alpha,
              const double *beta, const double *low, const double *high, double start, double goal,
              double most, double *b, double *u, double *limits) {
  const Problem problem = {rows, alpha, beta, low, high, h}, *p = &problem;
  Range *K = (Range *)limits;
  K[cells] = (Range){goal, goal};
  allowed(p, 2 * cells - 1, &K[cells]);
  if (is_empty(K[cells])) return 1 + cells;
  for (int64_t i = cells - 1; i >= 0; i--) {
    K[i] = controllable(p, i, (Range){0, most}, K[i + 1]);
    if (is_empty(K[i])) return 1 + i;
  }
  const double slack = ROUNDING * (1 + K[0].high);
  if (start > K[0].high + slack || start < K[0].low - slack) return -1;
  b[0] = start;
  for (int64_t i = 0; i < cells; i++) {
    const Range next = reachable(p, i, b[i], K[i + 1]);
    b[i + 1] = next.high >= next.low ? next.high : (next.high + next.low) / 2;
    b[i + 1] = fmax(fmin(b[i + 1], K[i + 1].high), K[i + 1].low);
    Range slope, first = accelerations(p, 2 * i, b[i], &slope);
    const Range last = accelerations(p, 2 * i + 1, b[i + 1], &slope);
    const double sum = (b[i + 1] - b[i]) / h[i];
    const double least = fmax(first.low, sum - last.high), top = fmin(first.high, sum - last.low);
    u[2 * i] = least > top ? (least + top) / 2 : fmax(fmin(sum / 2, top), least);
    u[2 * i + 1] = sum - u[2 * i];
  }
  return 0;
}
