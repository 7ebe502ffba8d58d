/* Instants of the plan, and angles, speeds, accelerations, torques there. */
enum { INSTANTS = ${number} };
static const double played[INSTANTS][13] = {
${rows}
};
