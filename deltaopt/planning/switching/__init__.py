"""Switch resolution: which limit is active when, solved to many digits."""
