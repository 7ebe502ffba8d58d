/* The functions of ${name}; see delta.h. Written by deltaopt. */

#include "delta.h"

#include <math.h>

/* Nothing of the C library but sin, cos, sqrt and atan2 is used. */
static inline double scalar_sqrt(double a) { return sqrt(a); }
static inline double scalar_fabs(double a) { return a < 0 ? -a : a; }
static inline double scalar_copysign(double one, double of) { return of < 0 ? -one : one; }
static inline double scalar_FMAX(double a, double b) { return a > b || b != b ? a : b; }
static inline double scalar_FMIN(double a, double b) { return a < b || b != b ? a : b; }
static inline double arc_sine(double a) { return atan2(a, sqrt((1 - a) * (1 + a))); }

/* tanh a, of Coulomb friction, is 2 t / (1 + t^2) with t = tanh (a / 2). Eight such steps lead to
   it from a continued fraction; each makes relative errors smaller rather than larger. */
static inline double hyperbolic_tangent(double a) {
  double t, square;
  if (!(a > -20)) return a == a ? -1 : a;
  if (!(a < 20)) return 1;
  t = a / 256;
  square = t * t;
  t = t / (1 + square / (3 + square / (5 + square / (7 + square / 9))));
  for (int i = 0; i < 8; i++) t = 2 * t / (1 + t * t);
  return t;
}

typedef double V;
#define EACH(f, a) scalar_##f(a)
#define EACH2(f, a, b) scalar_##f(a, b)
#define ALL(a) (a)
#define SIN sin
#define COS cos
#define ASIN arc_sine
#define ATAN2 atan2
#define TANH hyperbolic_tangent
#define LESS(a, b) ((double)((a) < (b)))
#define NOT(a) ((double)((a) == 0))
#define WHERE(a, b) ((a) != 0 ? (b) : 0.0)

/* Of the controller's angles. */
static const double zeros[3] = {${zeros}};
static const double signs[3] = {${signs}};

${functions}
void delta_inverse_kinematics(const double x[3], double theta[3]) {
  inverse_kinematics(x, theta);
}

void delta_forward_kinematics(const double theta[3], double x[3]) {
  forward_kinematics(theta, x);
}

void delta_joint_motion(const double x[3], const double v[3], const double a[3], double theta[3],
                        double dtheta[3], double ddtheta[3]) {
  joint_motion(x, v, a, theta, dtheta, ddtheta);
}

void delta_inverse_dynamics(const double x[3], const double v[3], const double a[3],
                            double payload, double tau[3]) {
  inverse_dynamics(x, v, a, &payload, tau);
}

void delta_forward_dynamics(const double x[3], const double v[3], const double tau[3],
                            double payload, double a[3]) {
  forward_dynamics(x, v, tau, &payload, a);
}

void delta_angles_to_controller(const double theta[3], double angle[3]) {
  for (int k = 0; k < 3; k++) angle[k] = signs[k] * (theta[k] + zeros[k]);
}

void delta_angles_from_controller(const double angle[3], double theta[3]) {
  for (int k = 0; k < 3; k++) theta[k] = signs[k] * angle[k] - zeros[k];
}

void delta_rates_to_controller(const double rate[3], double turned[3]) {
  for (int k = 0; k < 3; k++) turned[k] = signs[k] * rate[k];
}

void delta_trajectory_at(const delta_trajectory *trajectory, double t, double x[3], double v[3],
                         double a[3]) {
  const double *knots = trajectory->knots, *c;
  const int outside = !(t >= knots[0] && t <= knots[trajectory->pieces]);
  int piece = 0, end = trajectory->pieces;
  double since;
  if (!(t >= knots[0])) t = knots[0];
  if (t > knots[end]) t = knots[end];
  while (end - piece > 1) { /* knots[piece] <= t, which is before knots[end] or the end of all */
    const int middle = piece + (end - piece) / 2;
    if (t >= knots[middle])
      piece = middle;
    else
      end = middle;
  }
  since = t - knots[piece];
  c = trajectory->coefficients + 3 * trajectory->powers * piece;
  for (int k = 0; k < 3; k++) x[k] = v[k] = a[k] = 0;
  for (int power = trajectory->powers - 1; power >= 0; power--)
    for (int k = 0; k < 3; k++) { /* Horner, differentiated twice */
      a[k] = a[k] * since + 2 * v[k];
      v[k] = v[k] * since + x[k];
      x[k] = x[k] * since + c[3 * power + k];
    }
  for (int k = 0; outside && k < 3; k++) v[k] = a[k] = 0;
}

void delta_play(const delta_trajectory *trajectory, double t, double payload,
                delta_setpoint *setpoint) {
  double x[3], v[3], a[3], theta[3], dtheta[3], ddtheta[3], tau[3];
  delta_trajectory_at(trajectory, t, x, v, a);
  joint_motion(x, v, a, theta, dtheta, ddtheta);
  inverse_dynamics(x, v, a, &payload, tau);
  delta_angles_to_controller(theta, setpoint->angle);
  delta_rates_to_controller(dtheta, setpoint->speed);
  delta_rates_to_controller(ddtheta, setpoint->acceleration);
  delta_rates_to_controller(tau, setpoint->torque);
}
