/* Compares with deltaopt's own numbers, and measures the time of an evaluation.
   cc -O2 delta.c ${sources}test_delta.c -lm -o test_delta && ./test_delta */

#include <math.h>
#include <stdio.h>
#include <time.h>

#include "${header}"

/* Position, velocity, acceleration; motor angles, speeds, accelerations; torques; the controller's
   angles. */
enum { STATES = ${number} };
static const double payload = ${payload};
static const double state[STATES][24] = {
${states}
};
${played}
static double worst = 0;

static void compare(const double *found, const double *wanted) {
  double scale = 1;
  for (int k = 0; k < 3; k++) scale = fmax(scale, fabs(wanted[k]));
  for (int k = 0; k < 3; k++) {
    const double error = fabs(found[k] - wanted[k]) / scale;
    if (!(error <= worst)) worst = error;
  }
}

static double nanoseconds(int forward) {
  enum { ROUNDS = 20000 };
  double result[3];
  volatile double sink = 0;
  const clock_t begin = clock();
  for (int round = 0; round < ROUNDS; round++)
    for (int i = 0; i < STATES; i++) {
      const double *s = state[i];
      if (forward)
        delta_forward_dynamics(s, s + 3, s + 18, payload, result);
      else
        delta_inverse_dynamics(s, s + 3, s + 6, payload, result);
      sink += result[0];
    }
  return 1e9 * (double)(clock() - begin) / CLOCKS_PER_SEC / ROUNDS / STATES;
}

int main(void) {
  for (int i = 0; i < STATES; i++) {
    const double *s = state[i];
    double result[3], speed[3], acceleration[3];
    delta_inverse_kinematics(s, result);
    compare(result, s + 9);
    delta_forward_kinematics(s + 9, result);
    compare(result, s);
    delta_joint_motion(s, s + 3, s + 6, result, speed, acceleration);
    compare(result, s + 9);
    compare(speed, s + 12);
    compare(acceleration, s + 15);
    delta_inverse_dynamics(s, s + 3, s + 6, payload, result);
    compare(result, s + 18);
    delta_forward_dynamics(s, s + 3, s + 18, payload, result);
    compare(result, s + 6);
    delta_angles_to_controller(s + 9, result);
    compare(result, s + 21);
    delta_angles_from_controller(s + 21, result);
    compare(result, s + 9);
  }
${play}  printf("largest relative error: %.1e\n", worst);
  printf("inverse dynamics: %.0f ns, forward dynamics: %.0f ns\n", nanoseconds(0), nanoseconds(1));
  return worst < 1e-9 ? 0 : 1;
}
