"""Exact units of JSBSim and of the standards it follows, in SI; standard gravity; the Earth."""

from math import pi

M_PER_FT = 0.3048
KG_PER_LB = 0.45359237
GRAVITY_MPS2 = 9.80665
N_PER_LBF = KG_PER_LB * GRAVITY_MPS2
KG_PER_SLUG = N_PER_LBF / M_PER_FT
EARTH_RATE_RAD_S = 2.0 * pi / 86164.0905  # one turn per sidereal day [WGS84]
EARTH_RADIUS_M = 6_371_000.0  # mean radius: for a local plane and gravity with height, not for navigation
