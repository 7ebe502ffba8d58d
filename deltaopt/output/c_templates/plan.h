/* A plan for ${name}. Written by deltaopt. Compile plan.c beside delta.c, and call
   delta_play(&delta_plan, t, delta_plan_payload, &setpoint) with t from ${begin} s to ${end} s. */

#ifndef DELTA_PLAN_H
#define DELTA_PLAN_H

#include "delta.h"

extern const delta_trajectory delta_plan;

/* What the plan was made for, kg. */
extern const double delta_plan_payload;

#endif
