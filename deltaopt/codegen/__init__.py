"""CasADi functions as compiled machine code, evaluated at many points at once."""
