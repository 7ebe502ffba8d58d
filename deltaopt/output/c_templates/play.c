  for (int i = 0; i < INSTANTS; i++) {
    const double *s = played[i];
    delta_setpoint found;
    delta_play(&delta_plan, s[0], delta_plan_payload, &found);
    compare(found.angle, s + 1);
    compare(found.speed, s + 4);
    compare(found.acceleration, s + 7);
    compare(found.torque, s + 10);
  }
