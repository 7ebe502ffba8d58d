/* A program that computes recorded calls again, and prints by how much they differ. It stands
   behind the C that it calls; METHOD, GAUSS or MESH is defined where that is not rows (sanitize.py
   writes compute then). */
#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *block(int64_t bytes) { return malloc((size_t)(bytes > 0 ? bytes : 1)); }
static void *copied(const void *from, int64_t bytes) {
  return memcpy(block(bytes), from, (size_t)bytes);
}
static void *numbers(FILE *file, int64_t *count) {
  if (fread(count, 8, 1, file) != 1) exit(3);
  void *all = block(8 * *count);
  if (fread(all, 8, (size_t)*count, file) != (size_t)*count) exit(3);
  return all;
}
typedef struct { int64_t arrays; int64_t count[24]; double *array[24]; } Call;
static int64_t calls;
static Call *call;
static void compute(const Call *c, double *worst);

static void compare(const double *found, const double *wanted, int64_t n, double *worst) {
  double size = 0, off = 0;
  for (int64_t i = 0; i < n; i++) size = fmax(size, fabs(wanted[i]));
  for (int64_t i = 0; i < n; i++) {
    if (isnan(found[i]) && isnan(wanted[i])) continue;
    const double d = fabs(found[i] - wanted[i]) / size;
    if (found[i] != wanted[i] && !(d <= off)) off = d;
  }
  if (!(off <= *worst)) *worst = off;
}

typedef struct { int64_t first; double worst; } Work;

static void *all_calls(void *given) {
  Work *work = given;
  for (int64_t i = 0; i < calls; i++) compute(call + (i + work->first) % calls, &work->worst);
  return NULL;
}

int main(int argc, char **argv) {
  FILE *file = fopen(argv[1], "rb");
  const int threads = atoi(argv[2]);
  if (argc < 3 || !file || fread(&calls, 8, 1, file) != 1) return 3;
  call = block(calls * (int64_t)sizeof(Call));
  for (int64_t i = 0; i < calls; i++) {
    if (fread(&call[i].arrays, 8, 1, file) != 1) return 3;
    for (int64_t a = 0; a < call[i].arrays; a++)
      call[i].array[a] = numbers(file, call[i].count + a);
  }
  pthread_t thread[64];
  Work work[64];
  for (int k = 0; k < threads; k++) {
    work[k] = (Work){calls * k / threads, 0};
    if (pthread_create(thread + k, NULL, all_calls, work + k)) return 3;
  }
  double worst = 0;
  for (int k = 0; k < threads; k++) {
    pthread_join(thread[k], NULL);
    if (!(work[k].worst <= worst)) worst = work[k].worst;
  }
  printf("%.1e\n", worst);
  return 0;
}

#if defined METHOD

/* phases, iterations, whether multipliers are given; flags; rule; numbers; guess; tolerance, rows,
   barrier, closest; multipliers given; status; motion; multipliers */
static void compute(const Call *c, double *worst) {
  const int64_t *whole = (const int64_t *)c->array[0], *flags = (const int64_t *)c->array[1];
  int64_t n = 0;
  for (int64_t q = 0; q < whole[0]; q++) n += flags[q];
  double *motion = copied(c->array[4], 8 * c->count[4]);
  double *multipliers = copied(c->array[6], 8 * c->count[6]);
  const Settings settings = {.tolerance = c->array[5][0], .rows = c->array[5][1],
                             .barrier = c->array[5][2], .closest = c->array[5][3],
                             .iterations = whole[1], .is_warm = whole[2]};
  Report report;
  void *memory = block(workspace(n, whole[0]));
  const double status = solve(whole[0], flags, c->array[2], c->array[3], motion, multipliers,
                              &settings, &report, memory);
  compare(&status, c->array[7], 1, worst);
  if (status == 0) compare(motion, c->array[8], c->count[8], worst);
  for (int64_t i = 0; status == 0 && i < c->count[9]; i++)
    if (!isfinite(multipliers[i])) *worst = NAN;
  free(memory);
  free(multipliers);
  free(motion);
}

#elif defined GAUSS

/* n and width; rows; status; solution */
static void compute(const Call *c, double *worst) {
  const int64_t n = ((const int64_t *)c->array[0])[0], width = ((const int64_t *)c->array[0])[1];
  double *rows = copied(c->array[1], 8 * c->count[1]);
  const double done = gauss(n, width, rows);
  compare(&done, c->array[2], 1, worst);
  for (int64_t i = 0; done && i < n; i++)
    compare(rows + width * i + n, c->array[3] + i, 1, worst);
  free(rows);
}

#elif defined MESH

/* sizes; numbers; then arrays as in Mesh, empty if absent; status; results */
static void compute(const Call *c, double *worst) {
  const int64_t *size = (const int64_t *)c->array[0];
  const double *number = c->array[1], *array[11];
  for (int i = 0; i < 11; i++) array[i] = c->count[2 + i] ? c->array[2 + i] : NULL;
  double *results = block(8 * c->count[14]);
  Mesh mesh = {size[0], size[1], size[2], size[3], size[4], size[5],
               number[0], number[1], number[2], number[3], number[4], number[5], number[6],
               array[0], array[1], array[2], array[3], array[4], array[5], array[6], array[7],
               array[8], array[9], array[10], rows, results};
  const double status = (double)on_mesh(&mesh);
  compare(&status, c->array[13], 1, worst);
  if (status == 0) compare(results, c->array[14], c->count[14], worst);
  free(results);
}

#endif
