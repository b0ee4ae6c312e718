"""Fill the autopilot's record before the flight, from what the scenario declares and what the aircraft's file
says."""

from math import inf, radians

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.aircraft import GRAVITY_MPS2, THRUST_TERM
from beaver_ftc.compiled import fill
from beaver_ftc.control.autopilot import GAINS
from beaver_ftc.control.envelope_protection import MOST_BANK_DEG, set_up_level_flight_table
from beaver_ftc.control.profile import NOT_JUDGED, set_up_profile
from beaver_ftc.control.thrust import set_up_engine
from beaver_ftc.scenario.declared import Declared

MOST_DEG_S = (12.0, 6.0, 10.0)  # largest rates p, q, r of a healthy aircraft: a transport's manoeuvres
STEEPEST_ALPHA_DEG = 15.0  # angle of attack that no demand exceeds, within the limits of SPARE_ALPHA_DEG
SPARE_ALPHA_DEG = 2.0, 1.0  # The limit on alpha is at most and at least so far below alpha_max of the model.
# The slowest airspeed to fly is so far above the slowest validated one, at most by this share of the range.
SPARE_MPS, SPARE_SHARE = 2.0, 0.2
POWER_SIDESLIP_RAD = 0.2  # sideslip that full power may cause if the rudder is lost; 0.6 is a departure
LEAST_DIHEDRAL = 0.01  # least Cl_beta / Cl_p: an aircraft that hardly rolls by sideslip is not flown by it


def set_up_autopilot(autopilot: np.void, control: np.void, declared: Declared) -> None:
    """Fill the record (dtype AUTOPILOT), its table of level flight (`holding`), and `steered` of the law's
    reference. control: the records of the law, already assembled.

    steepest_alpha = clip(STEEPEST_ALPHA_DEG, alpha_max - 2 deg, alpha_max - 1 deg)
    """
    profile = declared.autopilot
    if profile is None or not profile.channels:
        return
    set_up_profile(autopilot, declared)
    _set_up_aircraft_values(autopilot, declared)
    alpha_lo, alpha_hi = (declared.aircraft.envelope.alpha_deg[1] - spare for spare in SPARE_ALPHA_DEG)
    trim, low, high = (control["power"]["config"][name] for name in ("trim", "low", "high"))
    fill(
        autopilot, enabled=1, dt=1.0 / declared.rate_hz, changed_at_s=-inf, largest_deviation=NOT_JUDGED,
        gain=tuple(_gains(declared.aircraft).values()), gravity=GRAVITY_MPS2,
        steepest_alpha=radians(min(max(STEEPEST_ALPHA_DEG, alpha_lo), alpha_hi)),
        max_healthy_rate=np.radians(MOST_DEG_S), max_healthy_bank=radians(MOST_BANK_DEG),
        trim_power=trim, low_power=low, high_power=high, allowed_power=high,
    )  # fmt: skip
    control["reference"]["config"]["steered"] = 1
    set_up_level_flight_table(autopilot["holding"], control["layout"], declared)


def _gains(aircraft: Aircraft) -> dict[str, float]:
    """GAINS, with an airspeed loop that is slower if the engine lags by tau s:

        speed / slower,    speed_i / slower^2,    slower = 1 + tau / airspeed_s

    The loop then has the lag of the engine in addition to airspeed_s, the smoothing of the airspeed.
    """
    thrust = aircraft.engine.thrust
    tau = thrust.lag_s if thrust and aircraft.airspeed_by == "power" else 0.0
    slower = 1.0 + tau / GAINS["airspeed_s"]
    return GAINS | {"speed": GAINS["speed"] / slower, "speed_i": GAINS["speed_i"] / slower**2}


def _set_up_aircraft_values(autopilot: np.void, declared: Declared) -> None:
    """Fill the values of the aircraft that the loops need (terms: derivatives of the design model):

        thrust = S / m (CX_dpt, CX_adpt2)                           m/s2 per Pa, by dpt and by dpt^2 alpha
        dihedral = max(Cl_beta / Cl_p, LEAST_DIHEDRAL) 2 / b        1/m: steady roll rate is -dihedral V beta
        dpt3 = (Cn_beta beta + Cn_beta3 beta^3) / |Cn_dpt3|         slipstream whose yawing moment the
                                                                    sideslip beta = POWER_SIDESLIP_RAD holds

    S m2: wing area; m kg: mass; b m: span. A model without Cl_p has -1 for it. dpt3 is at least 0, and
    infinite without Cn_dpt3.
    """
    aircraft, terms, mass_kg = declared.aircraft, declared.terms, declared.mass.mass_kg
    S_per_m = aircraft.geometry.wing_area_m2 / mass_kg
    if aircraft.airspeed_by == "power" and THRUST_TERM not in terms:
        set_up_engine(autopilot["engine"], aircraft.engine.thrust, mass_kg)
    roll_ratio = terms.get("Cl_beta", 0.0) / (terms.get("Cl_p") or -1.0)
    dpt3, beta = inf, POWER_SIDESLIP_RAD
    if terms.get("Cn_dpt3"):
        Cn_held = terms.get("Cn_beta", 0.0) * beta + terms.get("Cn_beta3", 0.0) * beta**3
        dpt3 = max(Cn_held / abs(terms["Cn_dpt3"]), 0.0)
    slowest, fastest = aircraft.envelope.airspeed_mps
    fill(
        autopilot, pitch_holds_airspeed=aircraft.airspeed_by == "pitch",
        thrust=S_per_m * np.array([terms.get(THRUST_TERM, 0.0), terms.get("CX_adpt2", 0.0)]),
        dihedral=max(roll_ratio, LEAST_DIHEDRAL) * 2.0 / aircraft.geometry.span_m,
        dpt_cubed_held_by_sideslip=dpt3,
        slowest_mps=slowest + min(SPARE_MPS, SPARE_SHARE * (fastest - slowest)),
    )  # fmt: skip
