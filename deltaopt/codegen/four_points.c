/* Four points at once: the type V, and functions of it that CasADi's operations become.

   The C library has sine, cosine, arc functions and the hyperbolic tangent for one number at a time,
   which costs ten times as much. These are the rational approximations of Moshier's Cephes library,
   without branches: intervals are chosen by masks. Results differ from exact ones by at most two
   units in the last place for arguments that mechanisms have (tests/codegen/test_vector_math.py),
   and are NaN where the C library's are. The compiler makes one instruction of EACH(sqrt, ...). */
#include <math.h>
typedef double V __attribute__((vector_size(32)));
static inline V all_lanes(double a) { return (V){a, a, a, a}; }
/* As fmax and fmin of the C library, without a call in the midst of vectors. */
static inline double FMAX(double a, double b) { return a > b || b != b ? a : b; }
static inline double FMIN(double a, double b) { return a < b || b != b ? a : b; }
#define EACH(f, a) ((V){f((a)[0]), f((a)[1]), f((a)[2]), f((a)[3])})
#define EACH2(f, a, b) \
  ((V){f((a)[0], (b)[0]), f((a)[1], (b)[1]), f((a)[2], (b)[2]), f((a)[3], (b)[3])})
#define ALL(a) all_lanes(a)
#ifdef __clang__
#define SHUFFLE(a, b, i, j, k, l) __builtin_shufflevector(a, b, i, j, k, l)
#else
typedef long long LANES __attribute__((vector_size(32)));
#define SHUFFLE(a, b, i, j, k, l) __builtin_shuffle(a, b, (LANES){i, j, k, l})
#endif
typedef long long Bits __attribute__((vector_size(32)));
static inline V either(Bits mask, V a, V b) {
  return (V)((mask & (Bits)a) | (~mask & (Bits)b));
}
static inline Bits sign_bit(void) { return (Bits)ALL(-0.0); }
static inline V magnitude(V a) { return (V)(~sign_bit() & (Bits)a); }
static inline V with_sign_of(V a, V b) {
  return (V)((~sign_bit() & (Bits)a) | (sign_bit() & (Bits)b));
}

/* atan z for |z| <= 0.66. */
static inline V small_arctangent(V z) {
  const V s = z * z;
  const V p = ((((-8.750608600031904122785e-1 * s - 1.615753718733365076637e1) * s
                 - 7.500855792314704667340e1) * s - 1.228866684490136173410e2) * s
               - 6.485021904942025371773e1);
  const V q = (((((s + 2.485846490142306297962e1) * s + 1.650270098316988542046e2) * s
                 + 4.328810604912902668951e2) * s + 4.853903996359136964868e2) * s
               + 1.945506571482613964425e2);
  return z * (s * p / q) + z;
}

/* The quotient is moved to where the approximation holds: z = -x/y, (y - x)/(y + x) or y/x. */
static V arctangent2(V y, V x) {
  const V b = magnitude(y), a = magnitude(x);
  const Bits steep = (Bits)(b > 2.41421356237309504880 * a), middle = ~steep & (Bits)(b > 0.66 * a);
  const V above = either(steep, -a, either(middle, b - a, b));
  V below = either(steep, b, either(middle, b + a, a));
  below = either((Bits)((b == 0) & (a == 0)), ALL(1.0), below);
  const V from = either(steep, ALL(1.57079632679489661923),
                        either(middle, ALL(0.785398163397448309616), ALL(0.0)));
  const V rest = either(steep, ALL(6.123233995736765886130e-17),
                        either(middle, ALL(3.061616997868382943065e-17), ALL(0.0)));
  const V angle = from + (small_arctangent(above / below) + rest);
  const V turned = 3.14159265358979323846 - (angle - 1.2246467991473531772e-16);
  return with_sign_of(either((Bits)x < 0, turned, angle), y);
}

static V arcsine(V a) { return arctangent2(a, EACH(sqrt, (1 - a) * (1 + a))); }

/* sin a, or cos a if ``quarter`` is 1. Large arguments are left to the C library. */
static inline V wave(V a, long long quarter) {
  const V magic = ALL(6755399441055744.0); /* adding it rounds to an integer in the last bits */
  const V shifted = a * 0.636619772367581343076 + magic, n = shifted - magic;
  const Bits k = ((Bits)shifted & 3) + quarter;
  const V r = ((a - n * 1.57079625129699707031) - n * 7.54978941586159635336e-8)
              - n * 5.39030285815811905290e-15;
  const V s = r * r;
  const V odd = r + r * s * (((((1.58962301576546568060e-10 * s - 2.50507477628578072866e-8) * s
      + 2.75573136213857245213e-6) * s - 1.98412698295895385996e-4) * s
      + 8.33333333332211858878e-3) * s - 1.66666666666666307295e-1);
  const V even = 1 - 0.5 * s + s * s * (((((-1.13585365213876817300e-11 * s
      + 2.08757008419747316778e-9) * s - 2.75573141792967388112e-7) * s
      + 2.48015872888517045348e-5) * s - 1.38888888888730564116e-3) * s
      + 4.16666666666665929218e-2);
  const V value = either((Bits)((k & 1) != 0), even, odd);
  return (V)((Bits)value ^ ((k & 2) << 62));
}
static inline int all_below(V a, double bound) {
  const Bits small = (Bits)(magnitude(a) < bound);
  return (small[0] & small[1] & small[2] & small[3]) != 0;
}
static V sine(V a) { return all_below(a, 1e5) ? wave(a, 0) : EACH(sin, a); }
static V cosine(V a) { return all_below(a, 1e5) ? wave(a, 1) : EACH(cos, a); }

/* 1 - 2/(exp(2 |a|) + 1), and a rational function where that would cancel. */
static V hyperbolic_tangent(V a) {
  const V m = magnitude(a), z = a * a;
  const V near = a + a * z * ((-9.64399179425052238628e-1 * z - 9.92877231001918586564e1) * z
      - 1.61468768441708447952e3) / (((z + 1.12811678491632931402e2) * z
      + 2.23548839060100448583e3) * z + 4.84406305325125486048e3);
  const V magic = ALL(6755399441055744.0), twice = either((Bits)(m > 20), ALL(40.0), m + m);
  const V shifted = twice * 1.4426950408889634073599 + magic, n = shifted - magic;
  const V r = (twice - n * 6.93145751953125e-1) - n * 1.42860682030941723212e-6, s = r * r;
  const V p = r * ((1.26177193074810590878e-4 * s + 3.02994407707441961300e-2) * s + 1);
  const V q = ((3.00198505138664455042e-6 * s + 2.52448340349684104192e-3) * s
      + 2.27265548208155028766e-1) * s + 2;
  const V power = (V)(((Bits)shifted + 1023) << 52); /* 2 to the n, from the bits of n */
  const V far = 1 - 2 / ((1 + 2 * (p / (q - p))) * power + 1);
  return either((Bits)(m < 0.625), near, with_sign_of(far, a));
}
#define SIN(a) sine(a)
#define COS(a) cosine(a)
#define ASIN(a) arcsine(a)
#define ATAN2(a, b) arctangent2(a, b)
#define TANH(a) hyperbolic_tangent(a)
/* Truth is 1 or 0 in each lane. */
#define LESS(a, b) either((Bits)((a) < (b)), ALL(1.0), ALL(0.0))
#define NOT(a) either((Bits)((a) == 0), ALL(1.0), ALL(0.0))
#define WHERE(a, b) either((Bits)((a) != 0), b, ALL(0.0))
