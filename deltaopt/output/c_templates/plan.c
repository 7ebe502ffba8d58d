#include "plan.h"

static const double knots[${knots_number}] = {
${knots}
};
static const double coefficients[${number}] = {
${coefficients}
};
const delta_trajectory delta_plan = {${pieces}, ${powers}, knots, coefficients};
const double delta_plan_payload = ${payload};
