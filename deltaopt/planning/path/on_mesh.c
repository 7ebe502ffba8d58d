/* The fastest motion on a mesh of a path, and what it does between nodes: places, rows, sweep,
   durations and losses of all cells, as ``on_mesh.py`` does array by array.

   The rows are a compiled function of x, p', p'', (speed, u) at many places (``vectorised.py``). */
#include <stdlib.h>
#include <string.h>

enum { INSIDE = 7 };

typedef int64_t (*Rows)(const int64_t *call);

typedef struct {
  int64_t cells, rows, others, powers, pieces, convex;
  double start, goal, most;
  double series, stopping, longest;
  double slowest;            /* speed below which slopes by b are taken at it */
  const double *knots;       /* of the path, (pieces + 1) */
  const double *curve;       /* coefficients of p, p', p'', (pieces, powers, 9) */
  const double *nodes;       /* (cells + 1) */
  const double *b, *u;       /* where tangents are taken, at both ends of cells (2 cells) */
  const double *more;        /* alpha, beta, low, high of other rows there, (4, 2 cells, others) */
  const double *tighter;     /* by how much bounds of all rows are moved inwards, (cells, all) */
  const double *sides;       /* bounds of the rows, (2, rows) */
  const double *inside;      /* fractions of the time in cells when rows are looked at (INSIDE) */
  const double *weights;     /* of these instants (INSIDE) */
  const double *parameters;
  Rows evaluate;
  double *results;           /* b (cells + 1), u (cells, 2), then of cells durations, losses,
                                stops; then excess of rows (cells, INSIDE, rows) */
} Mesh;

/* Arrays of the evaluation at n places. */
typedef struct { double *x, *dx, *ddx, *states, *values, *slopes, *alpha; } Places;

static double *taken(double **memory, int64_t numbers) {
  double *found = *memory;
  *memory += numbers;
  return found;
}

static Places places_in(double **memory, int64_t n, int64_t rows) {
  Places p;
  p.x = taken(memory, 3 * n), p.dx = taken(memory, 3 * n), p.ddx = taken(memory, 3 * n);
  p.states = taken(memory, 2 * n), p.values = taken(memory, n * rows);
  p.slopes = taken(memory, n * rows), p.alpha = taken(memory, n * rows);
  return p;
}

static void put_place(const Mesh *m, Places *at, int64_t k, int64_t piece, double since) {
  const double *c = m->curve + piece * m->powers * 9;
  double p[9] = {0};
  for (int64_t power = m->powers - 1; power >= 0; power--)
    for (int i = 0; i < 9; i++) p[i] = p[i] * since + c[9 * power + i];
  memcpy(at->x + 3 * k, p, 24), memcpy(at->dx + 3 * k, p + 3, 24);
  memcpy(at->ddx + 3 * k, p + 6, 24);
}

static inline void put_state(Places *at, int64_t k, double speed, double u) {
  at->states[2 * k] = speed, at->states[2 * k + 1] = u;
}

/* Evaluates all rows at places, and puts their slopes by the speed into ``slopes``. Whether all
   rows are numbers. */
static int evaluated(const Mesh *m, const Places *at, int64_t n, double *slopes) {
  const int64_t call[] = {n, 3, 3, 3, 2, (int64_t)at->x, (int64_t)at->dx, (int64_t)at->ddx,
                          (int64_t)at->states, (int64_t)m->parameters, (int64_t)at->values,
                          (int64_t)slopes, (int64_t)at->alpha, 0};
  m->evaluate(call);
  double sum = 0;
  for (int64_t i = 0; i < n * m->rows; i++) sum += at->values[i] - at->values[i];
  return sum == 0;
}

/* All rows at both ends of cells, in units of the path's length and of the largest alpha. */
typedef struct { double *alpha, *beta, *low, *high, length, largest; } Tangents;

static void take_tangents(const Mesh *m, const Places *ends, Tangents *t) {
  const int64_t n = 2 * m->cells, all = m->rows + m->others;
  t->largest = 0;
  for (int64_t k = 0; k < n; k++)
    for (int64_t j = 0; j < all; j++) {
      const int64_t to = k * all + j, from = k * m->rows + j;
      double alpha, beta, low, high;
      if (j < m->rows) {
        const double speed = ends->states[2 * k], faster = fmax(speed, m->slowest);
        alpha = ends->alpha[from], beta = ends->slopes[from] / (2 * faster);
        const double rest = ends->values[from] - alpha * m->u[k] - beta * (speed * speed);
        low = m->sides[j] - rest, high = m->sides[m->rows + j] - rest;
      } else {
        const double *other = m->more + k * m->others + j - m->rows;
        const int64_t each = n * m->others;
        alpha = other[0], beta = other[each], low = other[2 * each], high = other[3 * each];
      }
      const double by = m->tighter ? m->tighter[k / 2 * all + j] : 0;
      t->alpha[to] = alpha, t->beta[to] = beta, t->low[to] = low + by, t->high[to] = high - by;
      t->largest = fmax(t->largest, fabs(alpha));
    }
  if (!(t->largest > 0)) t->largest = 1;
  for (int64_t i = 0; i < n * all; i++)
    t->alpha[i] /= t->largest, t->beta[i] *= t->length / t->largest;
}

/* Durations of all cells and whether the motion stops in them; see ``MeshMotion``. */
static void put_durations(const Mesh *m, const double *b, const double *u, double *durations,
                          double *stops) {
  double most = 0;
  for (int64_t i = 0; i <= m->cells; i++) most = fmax(most, b[i]);
  const double rate = sqrt(most), least = rate / (m->longest * m->longest);
  const double longest = m->longest * (m->nodes[m->cells] - m->nodes[0]) / rate;
  for (int64_t i = 0; i < m->cells; i++) {
    const double h = m->nodes[i + 1] - m->nodes[i];
    const double share = h / fmax(sqrt(b[i]) + sqrt(b[i + 1]), least);
    double z = (u[2 * i + 1] - u[2 * i]) / h * share * share;
    stops[i] = !(z < m->stopping && share < longest);
    if (stops[i]) z = 0;
    const double root = sqrt(fmax(fabs(z), m->series));
    durations[i] = 2 * share * (
        fabs(z) < m->series ? 1 + z * (1.0 / 3 + z * (1.0 / 5 + z / 7))
        : z > 0             ? atanh(fmin(root, m->stopping)) / root
                            : atan(root) / root);
  }
}

/* The part of the way that is made in a part of the time, from one speed to another. */
static double share_of_way(double part, double first, double last) {
  const double sum = first + last;
  return sum > 0 ? part * (2 * first + (last - first) * part) / sum : part;
}

/* By how much rows are exceeded inside of cells, and what that costs of the duration. */
static int put_losses(const Mesh *m, Places *at, const double *b, const double *u,
                      const double *durations, const double *stops, double *losses,
                      double *beyond) {
  double total = 0;
  int64_t piece = 0;
  for (int64_t i = 0; i < m->cells; i++) {
    const double h = m->nodes[i + 1] - m->nodes[i], change = u[2 * i + 1] - u[2 * i];
    while (piece < m->pieces - 1 && m->nodes[i] + h / 2 >= m->knots[piece + 1]) piece++;
    const double first = sqrt(fmax(b[i], 0)), last = sqrt(fmax(b[i + 1], 0));
    for (int64_t k = 0; k < INSIDE; k++) {
      const double z = share_of_way(m->inside[k], first, last);
      const double since = m->nodes[i] - m->knots[piece] + h * z;
      const double there = b[i] + h * z * (2 * u[2 * i] + change * z);
      put_place(m, at, INSIDE * i + k, piece, since);
      put_state(at, INSIDE * i + k, sqrt(fmax(there, 0)), u[2 * i] + change * z);
    }
    total += durations[i];
  }
  if (!evaluated(m, at, INSIDE * m->cells, at->slopes)) return 0;
  for (int64_t i = 0; i < m->cells; i++) {
    double missed = 0;
    for (int64_t k = INSIDE * i; k < INSIDE * (i + 1); k++) {
      double most = -INFINITY;
      for (int64_t j = 0; j < m->rows; j++) {
        const double value = at->values[k * m->rows + j];
        const double above = isinf(m->sides[m->rows + j]) ? -INFINITY : value;
        const double below = isinf(m->sides[j]) ? -INFINITY : -value;
        beyond[k * m->rows + j] = fmax(above, below) - 1;
        most = fmax(most, beyond[k * m->rows + j]);
      }
      missed += m->weights[k - INSIDE * i] * fabs(most);
    }
    losses[i] = stops[i] ? INFINITY : missed * durations[i] / total;
  }
  return 1;
}

enum { FOUND = 0, NO_NUMBERS = -2, NO_MEMORY = -3 };

static int64_t swept_on(Mesh *m, double *memory) {
  const int64_t n = m->cells, all = m->rows + m->others;
  Places ends = places_in(&memory, 2 * n, m->rows), inner = places_in(&memory, INSIDE * n, m->rows);
  Tangents t = {0};
  t.alpha = taken(&memory, 2 * n * all), t.beta = taken(&memory, 2 * n * all);
  t.low = taken(&memory, 2 * n * all), t.high = taken(&memory, 2 * n * all);
  t.length = m->nodes[n] - m->nodes[0];
  double *h = taken(&memory, n), *of_sweep = taken(&memory, 3 * (n + 1));
  double *b = m->results, *u = b + n + 1, *durations = u + 2 * n, *losses = durations + n;
  double *stops = losses + n, *beyond = stops + n;
  int64_t piece = 0;
  for (int64_t i = 0; i < n; i++) {
    const double length = m->nodes[i + 1] - m->nodes[i];
    h[i] = length / t.length;
    while (piece < m->pieces - 1 && m->nodes[i] + length / 2 >= m->knots[piece + 1]) piece++;
    for (int64_t k = 2 * i; k < 2 * i + 2; k++) {
      const double since = m->nodes[i] - m->knots[piece] + (k % 2) * length;
      put_place(m, &ends, k, piece, since);
    }
  }
  /* First the slopes, at no less than the slowest speed; then values and alpha, at the motion
     itself, whose own slopes nobody needs. */
  for (int own = 0; own < 2; own++) {
    for (int64_t k = 0; k < 2 * n; k++) {
      const double speed = sqrt(fmax(m->b[k], 0));
      put_state(&ends, k, own ? speed : fmax(speed, m->slowest), m->u[k]);
    }
    if (!evaluated(m, &ends, 2 * n, own ? t.beta : ends.slopes)) return NO_NUMBERS;
  }
  take_tangents(m, &ends, &t);
  const double unit = t.length / t.largest;
  const int64_t status = sweep(n, all, m->convex, h, t.alpha, t.beta, t.low, t.high, m->start / unit,
                               m->goal / unit, m->most, b, u, of_sweep);
  if (status) return status;
  for (int64_t i = 0; i <= n; i++) b[i] *= unit;
  for (int64_t i = 0; i < 2 * n; i++) u[i] /= t.largest;
  put_durations(m, b, u, durations, stops);
  return put_losses(m, &inner, b, u, durations, stops, losses, beyond) ? FOUND : NO_NUMBERS;
}

/* What ``sweep`` returns, or one of the numbers above. */
int64_t on_mesh(Mesh *m) {
  const int64_t n = m->cells, of_places = 11 + 3 * m->rows, all = m->rows + m->others;
  const int64_t numbers = (2 + INSIDE) * n * of_places + 8 * n * all + 4 * n + 3;
  double *memory = malloc((size_t)numbers * sizeof(double));
  if (!memory) return NO_MEMORY;
  const int64_t status = swept_on(m, memory);
  free(memory);
  return status;
}
