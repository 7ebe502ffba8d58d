"""Past keep-out bodies: which ways are planned, leg by leg, and past which bodies."""
