"""CasADi functions as compiled C, evaluated at many points at once."""
