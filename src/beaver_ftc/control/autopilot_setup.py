"""The autopilot's record, and how it is filled before the flight, from the declaration of the scenario and
the aircraft's file.

The loops are in autopilot.py, whose module docstring has the letters.
"""

from math import inf, radians

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.aircraft import GRAVITY_MPS2, THRUST_TERM
from beaver_ftc.compiled import fill, record
from beaver_ftc.control.envelope_protection import HOLDING, MOST_BANK_DEG, set_up_level_flight_table
from beaver_ftc.control.profile import MAX_LEGS, N_CHANNELS, NOT_JUDGED, set_up_profile
from beaver_ftc.control.thrust import ENGINE, set_up_engine
from beaver_ftc.scenario.declared import Declared

# Gains of the loops: K, 1/s, and K_i, 1/s2, whose name ends with `_i`; times, s; and bounds of the demands.
# The loop of the pitch attitude is a fifth as fast as the inner loop, and the path loop a quarter as fast as
# this one; the loop of the bank is slower.
# Gusts set the gains, not comfort.
GAINS = {
    "altitude": 0.8, "altitude_i": 0.04, "attitude": 3.0, "speed": 0.3, "speed_i": 0.015,
    "bank": 1.0, "bank_i": 0.2, "heading": 0.25, "heading_i": 0.004,
    "sideslip": 0.5,  # 1/s, of the yaw damper: yaw rate per sideslip
    "alpha_s": 2.0, "airspeed_s": 3.0,  # s, smoothing against noise and gusts
    "jammed_s": 1.0,  # s, time constant with which rolling is handed to the rudder
    "authority_s": 1.0,  # s: a rate is demanded only if it can be reached, and ended, within this time
    "bank_s": 6.0,  # s: a bank is demanded only if it can be left within this time
    "spare_mps": 2.0,  # m/s: with more error of the airspeed, the path gives way
    "path_per_mps": 0.02,  # rad per m/s: how much it gives way
    "loose": 0.4,  # factor on the heading loop when nothing acts in yaw: the turn then follows slowly
    "protection": 2.0,  # 1/s: how fast the angle of attack may close on its limit
}  # fmt: skip
GAIN = record(**dict.fromkeys(GAINS, float))

AUTOPILOT = record(
    enabled=int,  # whether the scenario has a profile
    flying=int,  # whether the autopilot has taken over
    dt=float,  # s, length of a frame
    gain=GAIN,
    # Profile (profile.py), in SI and rad, by channel: its legs. A leg whose value is NaN keeps the command.
    n_legs=(int, N_CHANNELS), next_leg_index=(int, N_CHANNELS),
    leg_starts_at_s=(N_CHANNELS, MAX_LEGS), leg_value=(N_CHANNELS, MAX_LEGS),
    leg_max_rate=(N_CHANNELS, MAX_LEGS),
    is_commanded=(int, N_CHANNELS),  # whether a leg has begun, so that the channel is flown
    # the value to which the leg takes the command; the command now; its largest rate, per second
    goal=N_CHANNELS, command=N_CHANNELS, max_command_rate=N_CHANNELS,
    command_rate=N_CHANNELS,  # rate of the command now, per second
    changed_at_s=N_CHANNELS,  # when a leg last changed the goal
    # Aircraft and engine
    gravity=float,  # m/s2
    thrust=2,  # acceleration by dpt, and by dpt^2 per rad of alpha, over qdyn, m/s2 per Pa
    engine=ENGINE,  # table of thrust, where the slipstream does not give it
    pitch_holds_airspeed=int,  # whether pitch, and not power, holds the airspeed
    trim_power=float, low_power=float, high_power=float,  # setting in trim, and its range
    climb_in_trim=float,  # gamma_trim, rad, with the engine as trimmed
    dihedral=float,  # 1/m: minus roll rate per rad of sideslip and m/s of airspeed
    full_power=float, allowed_power=float,  # the highest setting now; the highest that the rudder allows
    sideslip_dpt_cubed=float,  # dpt^3 whose yawing moment the largest accepted sideslip holds
    slowest_mps=float, steepest_alpha=float,  # least airspeed, m/s, and largest angle of attack, rad, to fly
    max_healthy_rate=3, rate_limit=3,  # largest p, q, r to demand, rad/s: with all surfaces healthy, and now
    max_healthy_bank=float, bank_limit=float,  # largest bank to demand, rad: the same
    # Memory
    alpha=float, airspeed=float,  # smoothed, rad and m/s
    recent_airspeed_mps=float,  # averaged over RECENT_AIRSPEED_S
    # integrals M: rad/s of turn rate, rad of path angle, m/s2 along the path, rad/s of bank rate
    missing_turn_rate=float, missing_path_angle=float, missing_acceleration=float, missing_roll_rate=float,
    roll_loss_share=float,  # share of roll that rudder and dihedral carry, 0 to 1
    yaw_loss_share=float,  # 1: no surface acts in yaw; moves smoothly between 0 and 1
    engine_yaw_share=float,  # share of the last BY_POWER_S in which engines alone act in yaw
    # Output
    rates=3,  # p, q, r to fly, rad/s
    sets_power=int, power_setting=float,  # whether the autopilot sets the engine now, and to what
    power_airspeed=float,  # m/s, to hold while power stands in for a lost pitch
    airspeed_to_fly=float, to_fly_rate=float,  # m/s; its rate of change, m/s2
    holding=HOLDING,
    # Deviations: averaged over MEAN_S, and the largest so far; from the command and, for the airspeed, also
    # from the airspeed to fly. `largest_deviation` is NOT_JUDGED until the channel counts (profile.py).
    mean_deviation=N_CHANNELS, mean_limited_deviation=float,
    largest_limited_deviation=float, largest_deviation=N_CHANNELS,
    largest_instant_deviation=float,  # m/s, of the airspeed from what is commanded, at one instant
)  # fmt: skip

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
    """GAINS, with an airspeed loop that is slower if power holds the airspeed and the engine lags by tau s:

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
    aircraft = declared.aircraft
    terms = declared.terms
    mass_kg = declared.mass.mass_kg
    S_per_m = aircraft.geometry.wing_area_m2 / mass_kg
    if aircraft.airspeed_by == "power" and THRUST_TERM not in terms:
        set_up_engine(autopilot["engine"], aircraft.engine.thrust, mass_kg)
    roll_ratio = terms.get("Cl_beta", 0.0) / (terms.get("Cl_p") or -1.0)
    dpt3 = inf
    beta = POWER_SIDESLIP_RAD
    if terms.get("Cn_dpt3"):
        Cn_held = terms.get("Cn_beta", 0.0) * beta + terms.get("Cn_beta3", 0.0) * beta**3
        dpt3 = max(Cn_held / abs(terms["Cn_dpt3"]), 0.0)
    slowest, fastest = aircraft.envelope.airspeed_mps
    fill(
        autopilot, pitch_holds_airspeed=aircraft.airspeed_by == "pitch",
        thrust=S_per_m * np.array([terms.get(THRUST_TERM, 0.0), terms.get("CX_adpt2", 0.0)]),
        dihedral=max(roll_ratio, LEAST_DIHEDRAL) * 2.0 / aircraft.geometry.span_m,
        sideslip_dpt_cubed=dpt3,
        slowest_mps=slowest + min(SPARE_MPS, SPARE_SHARE * (fastest - slowest)),
    )  # fmt: skip
