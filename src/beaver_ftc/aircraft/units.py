"""Exact units of JSBSim and of the standards it follows, in SI; and standard gravity."""

M_PER_FT = 0.3048
KG_PER_LB = 0.45359237
GRAVITY_MPS2 = 9.80665
N_PER_LBF = KG_PER_LB * GRAVITY_MPS2
KG_PER_SLUG = N_PER_LBF / M_PER_FT
