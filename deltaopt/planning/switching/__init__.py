"""Switch resolution: the instants at which limits become active or inactive, to many digits.

Read in this order: structure, detection, arc_mesh, unknowns, conditions,
kkt_system (and kkt_terms), newton, residuals, active_set, resolution.
"""
