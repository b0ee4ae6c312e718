"""From a scenario's `autopilot` to the record its kernel flies by."""

from math import inf, nan, radians

import numpy as np

from beaver_ftc.control.outer.state import CHANNELS
from beaver_ftc.design.coefficients import ENVELOPE_AIRSPEED_MPS, GEOMETRY, MASS, value
from beaver_ftc.scenario.schema import Scenario

GRAVITY_MPS2 = 9.80665
MOST_DEG_S = (12.0, 6.0, 10.0)  # asked of a healthy aircraft: a transport's manoeuvres
MOST_BANK_DEG = 30.0
STEEPEST_ALPHA_DEG = 15.0  # the model is valid to 16
SPARE_MPS = 2.0  # above the validated airspeeds' end
# A fifth of the inner loops' bandwidth for attitudes, a fifth of that for the path.
GAINS = {
    "altitude": 0.25, "altitude_i": 0.02, "attitude": 1.0, "speed": 0.12, "speed_i": 0.006,
    "bank": 1.0, "bank_i": 0.2, "heading": 0.25,
    "sideslip": 0.5,  # the yaw damper's part beside the rate loop
    "alpha_s": 1.0, "airspeed_s": 3.0,  # against noise and gusts
    "jammed_s": 1.0,  # rolling is handed to the rudder within about so long
    "authority_s": 1.0,  # a rate is asked for only if it can be had, and ended, within this time
    "bank_s": 6.0,  # and a bank only if it can be left within this time
    "spare_mps": 4.0, "path_per_mps": 0.02,  # airspeed off before height goes for it, and how much path, rad
    "protection": 2.0,  # 1/s: how fast the angle of attack may close on its limit
}  # fmt: skip
_UNIT = {"altitude_m": 1.0, "airspeed_mps": 1.0, "heading_deg": radians(1.0), "bank_deg": radians(1.0)}


def set_up_autopilot(autopilot: np.void, power: np.void, scenario: Scenario) -> None:
    """Fill the record (dtype AUTOPILOT); power: the engine's record, already assembled."""
    profile = scenario.autopilot
    if profile is None or not profile.channels:
        return
    autopilot["enabled"], autopilot["dt"] = 1, 1.0 / scenario.rate_hz
    for c, name in enumerate(CHANNELS):
        _fill(autopilot, c, getattr(profile, name), _UNIT[name])
    autopilot["changed_at_s"] = -inf
    for name, gain in GAINS.items():
        autopilot["gain"][name] = gain
    autopilot["gravity"] = GRAVITY_MPS2
    per_mass = GEOMETRY.wing_area_m2 / (MASS.mass_kg * scenario.design_model.mass)
    autopilot["thrust"] = per_mass * value("CX_dpt"), per_mass * value("CX_adpt2")
    autopilot["dihedral"] = value("Cl_beta") / value("Cl_p") * 2.0 / GEOMETRY.span_m
    autopilot["slowest_mps"] = ENVELOPE_AIRSPEED_MPS[0] + SPARE_MPS
    autopilot["steepest_alpha"] = radians(STEEPEST_ALPHA_DEG)
    autopilot["most"], autopilot["most_bank"] = np.radians(MOST_DEG_S), radians(MOST_BANK_DEG)
    for ours, theirs in (("trim_inhg", "trim"), ("low_inhg", "low"), ("high_inhg", "high")):
        autopilot[ours] = power[theirs]
    autopilot["step_inhg"] = power["step"]


def _fill(autopilot: np.void, c: int, legs: tuple, unit: float) -> None:
    autopilot["legs"][c] = len(legs)
    for j, leg in enumerate(legs):
        autopilot["at_s"][c, j] = leg.at_s
        autopilot["value"][c, j] = nan if leg.value is None else leg.value * unit
        pace = getattr(leg, "climb_mps", getattr(leg, "change_mps2", inf))
        autopilot["speed"][c, j] = pace
