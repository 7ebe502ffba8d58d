#include <math.h>
#include <stdint.h>

typedef double V __attribute__((vector_size(32), aligned(8)));

/* Gauss's elimination with pivots from the column, in place. rows: n of ``width`` numbers, a
   multiple of 4, the right-hand side in column n, where the solution is left; 0 if singular. */
int gauss(int64_t n, int64_t width, double *rows) {
  for (int64_t k = 0; k < n; k++) {
    int64_t pivot = k;
    for (int64_t i = k + 1; i < n; i++)
      if (fabs(rows[i * width + k]) > fabs(rows[pivot * width + k])) pivot = i;
    double *top = rows + k * width, *other = rows + pivot * width;
    if (!(fabs(other[k]) > 0)) return 0;
    const int64_t first = k / 4 * 4;
    for (int64_t j = first; j < width && pivot != k; j++) {
      const double kept = top[j];
      top[j] = other[j];
      other[j] = kept;
    }
    for (int64_t i = k + 1; i < n; i++) {
      double *row = rows + i * width;
      const double factor = row[k] / top[k];
      if (factor == 0) continue;
      for (int64_t j = first; j < width; j += 4) *(V *)(row + j) -= factor * *(V *)(top + j);
    }
  }
  for (int64_t k = n - 1; k >= 0; k--) {
    double *row = rows + k * width;
    for (int64_t j = k + 1; j < n; j++) row[n] -= row[j] * rows[j * width + n];
    row[n] /= row[k];
  }
  return 1;
}
