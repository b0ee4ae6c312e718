"""The autopilot's record before the flight: what the scenario declares, and what the aircraft's file says."""

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

MOST_DEG_S = (12.0, 6.0, 10.0)  # rates p, q, r asked of a healthy aircraft: a transport's manoeuvres
STEEPEST_ALPHA_DEG = 15.0
SPARE_ALPHA_DEG = 1.0, 2.0  # at least and at most, below the highest at which the model is valid
SPARE_MPS, SPARE_SHARE = 2.0, 0.2  # above the validated airspeeds' end; at most this share of them
POWER_SIDESLIP_RAD = 0.2  # that full power may lead to with a rudder that is lost; 0.6 is a departure
LEAST_DIHEDRAL = 0.01  # of an aircraft that hardly rolls by sideslip: it is then not flown by it


def set_up_autopilot(autopilot: np.void, control: np.void, declared: Declared) -> None:
    """Fill the record (dtype AUTOPILOT); control: the law's, already assembled."""
    profile = declared.autopilot
    if profile is None or not profile.channels:
        return
    set_up_profile(autopilot, declared)
    _set_up_aircraft_values(autopilot, declared)
    less, more = (declared.aircraft.envelope.alpha_deg[1] - spare for spare in SPARE_ALPHA_DEG)
    trim, low, high = (control["power"]["config"][name] for name in ("trim", "low", "high"))
    fill(
        autopilot, enabled=1, dt=1.0 / declared.rate_hz, changed_at_s=-inf, largest_deviation=NOT_JUDGED,
        gain=tuple(_gains(declared.aircraft).values()), gravity=GRAVITY_MPS2,
        steepest_alpha=radians(min(less, max(STEEPEST_ALPHA_DEG, more))),
        max_healthy_rate=np.radians(MOST_DEG_S), max_healthy_bank=radians(MOST_BANK_DEG),
        trim_power=trim, low_power=low, high_power=high, allowed_power=high,
    )  # fmt: skip
    control["reference"]["config"]["steered"] = 1
    set_up_level_flight_table(autopilot["holding"], control["layout"], declared)


def _gains(aircraft: Aircraft) -> dict[str, float]:
    """The gains; those of the airspeed slower by what the engine lags, which its loop has beside its own."""
    thrust = aircraft.engine.thrust
    slower = 1.0 + (thrust.lag_s if thrust and aircraft.airspeed_by == "power" else 0.0) / GAINS["airspeed_s"]
    return GAINS | {"speed": GAINS["speed"] / slower, "speed_i": GAINS["speed_i"] / slower**2}


def _set_up_aircraft_values(autopilot: np.void, declared: Declared) -> None:
    """What the loops take from the aircraft: thrust, roll by sideslip, slowest airspeed."""
    aircraft, terms, mass_kg = declared.aircraft, declared.terms, declared.mass.mass_kg
    per_mass = aircraft.geometry.wing_area_m2 / mass_kg
    if aircraft.airspeed_by == "power" and THRUST_TERM not in terms:
        set_up_engine(autopilot["engine"], aircraft.engine.thrust, mass_kg)
    by_sideslip = terms.get("Cl_beta", 0.0) / (terms.get("Cl_p") or -1.0)
    dpt_cubed, beta = inf, POWER_SIDESLIP_RAD
    if terms.get("Cn_dpt3"):
        held = terms.get("Cn_beta", 0.0) * beta + terms.get("Cn_beta3", 0.0) * beta**3
        dpt_cubed = max(held / abs(terms["Cn_dpt3"]), 0.0)
    slowest, fastest = aircraft.envelope.airspeed_mps
    fill(
        autopilot, pitch_holds_airspeed=aircraft.airspeed_by == "pitch",
        thrust=per_mass * np.array([terms.get(THRUST_TERM, 0.0), terms.get("CX_adpt2", 0.0)]),
        dihedral=max(by_sideslip, LEAST_DIHEDRAL) * 2.0 / aircraft.geometry.span_m,
        dpt_cubed_held_by_sideslip=dpt_cubed,
        slowest_mps=slowest + min(SPARE_MPS, SPARE_SHARE * (fastest - slowest)),
    )  # fmt: skip
