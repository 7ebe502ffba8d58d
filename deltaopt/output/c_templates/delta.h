/* ${name}: kinematics and dynamics. Written by deltaopt.

   SI units. x down, y and z horizontal, from the base's centre to the tool's point (the platform's
   centre without a tool); motor angles theta from the horizontal, up positive; every elbow outside.
   payload: kg at the platform. Every term that the robot's file names is modelled.
   Results are not numbers where the platform cannot be. No function keeps state or allocates
   memory; of the C library sin, cos, sqrt and atan2 are used.${joints} */

#ifndef DELTA_H
#define DELTA_H

/* Motor angles, rad, of a position, m. */
void delta_inverse_kinematics(const double x[3], double theta[3]);

/* Position, m, of motor angles, rad: the lower of two. */
void delta_forward_kinematics(const double theta[3], double x[3]);

/* Motor angles, speeds and accelerations, rad, rad/s, rad/s^2, of a motion: m, m/s, m/s^2. */
void delta_joint_motion(const double x[3], const double v[3], const double a[3], double theta[3],
                        double dtheta[3], double ddtheta[3]);

/* Torques, N m, of a motion: m, m/s, m/s^2. */
void delta_inverse_dynamics(const double x[3], const double v[3], const double a[3],
                            double payload, double tau[3]);

/* Acceleration, m/s^2, under torques, N m. */
void delta_forward_dynamics(const double x[3], const double v[3], const double tau[3],
                            double payload, double a[3]);

/* The controller's angles of motor angles theta, and back, rad. */
void delta_angles_to_controller(const double theta[3], double angle[3]);
void delta_angles_from_controller(const double angle[3], double theta[3]);

/* The controller's speeds, accelerations or torques of the motors', and back: the same. */
void delta_rates_to_controller(const double rate[3], double turned[3]);

/* A motion of polynomials of the time since each of them began. */
typedef struct {
  int pieces;
  int powers;                 /* of each polynomial: its degree + 1 */
  const double *knots;        /* where they begin, and the last ends: pieces + 1 instants, s */
  const double *coefficients; /* of ascending powers: pieces * powers * 3, m/s^power */
} delta_trajectory;

/* Position, velocity, acceleration at time t, s: at a knot just after it, at the end just before;
   at rest before the beginning and after the end. */
void delta_trajectory_at(const delta_trajectory *trajectory, double t, double x[3], double v[3],
                         double a[3]);

/* What a controller is to do at an instant, in its own angles: rad, rad/s, rad/s^2, and N m to
   feed forward. */
typedef struct {
  double angle[3], speed[3], acceleration[3], torque[3];
} delta_setpoint;

/* Of the motion at time t, s, with a payload, kg. */
void delta_play(const delta_trajectory *trajectory, double t, double payload,
                delta_setpoint *setpoint);

#endif
