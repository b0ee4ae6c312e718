"""Engine power: its command, in the units of its setting; and the Beaver's on pitch, the last that acts there
when neither elevator nor flap does.

    pz = pz_trim - k_V (V - Vbar) + k_att att,    T_V Vbar' = V - Vbar,    att' = q - q_ref - att / T_att

Airspeed fed back to power damps the phugoid, as when an airliner was flown on its engines alone
[Burcham1997]. Washed out, so that power does not fight the airspeed to which a jammed elevator trims the
aircraft: it has not the moment for that. att is what the pitch rate has missed of late: nose too high, and
more power lowers it, Cm_dpt being negative.

Power has little moment and a right-half-plane zero from there to the attitude: it can steady the aircraft,
not make it follow a pitch rate.
"""

from math import exp, radians
from typing import Any

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.schema import MAX_LEVERS
from beaver_ftc.compiled import kernel, record
from beaver_ftc.control.allocation import remaining
from beaver_ftc.control.laws import ADAPTING, FAULT_TOLERANT, ORACLE, law_of
from beaver_ftc.design.engine import engine_power_kw, slipstream
from beaver_ftc.design.model import AIRSPEED, DPT, QDYN
from beaver_ftc.diagnosis.state import PITCH, YAW
from beaver_ftc.scenario.schema import Scenario

LEAST_LACK_RAD_S2 = 0.05  # of pitch acceleration: what 2 to 3 inHg give
WHOLE_RANGE_S = 5.0  # in which a lever goes from stop to stop
YAW_SHARE = 0.5  # of the rudder, that engine power may claim: the rest is there to fly with

# Settings, state, and what is reported of it.
POWER = record(
    enabled=int, impatience=float, forgiveness=float,  # shares per frame
    speed_gain=float, attitude_gain=float,  # inHg per m/s, inHg per rad
    smoothing=float, washout=float, leak=float,  # shares per frame
    trim=float, low=float, high=float, step=float,  # in the units of the setting, as is the command
    dpt_factor=float, highest_dpt=float, lost=float, engaged=int, in_use=int, moved=int, speed=float,
    usual_speed=float, attitude=float,
    command=MAX_LEVERS,  # of all engines, then what each that is an effector has beside it (engines.py)
    from_s=float, frames=int, least=float, greatest=float,
)  # fmt: skip


def is_at_hand(scenario: Scenario) -> bool:
    """Whether the built-in law of a scenario may use the engine."""
    law, inner = law_of(scenario.control.law)
    every_type = scenario.fdi.fault_class == "all" and inner != ADAPTING
    wanted = scenario.control.power.enabled and (law == ORACLE or (law == FAULT_TOLERANT and every_type))
    return wanted and _has_piston_engine(scenario.airframe)


def _has_piston_engine(aircraft: Aircraft) -> bool:
    """Whether the power law knows the engine: manifold pressure is what it moves, at a known engine speed."""
    return aircraft.power_setting == "manifold_pressure_inhg" and aircraft.has_engine_instruments


def configure(power: np.void, layout: np.void, scenario: Scenario) -> None:
    """Fill the record (dtype POWER); layout: of the surfaces."""
    config, dt = scenario.control.power, 1.0 / scenario.rate_hz
    initial: Any = scenario.initial  # its engine's keys are the aircraft's
    power["enabled"], power["from_s"] = is_at_hand(scenario), -1.0
    power["impatience"], power["forgiveness"] = dt / config.patience_s, dt / config.release_s
    power["speed_gain"] = config.speed_gain_inhg_per_mps
    power["attitude_gain"] = config.attitude_gain_inhg_per_deg / radians(1.0)
    lags_s = {"smoothing": config.smoothing_s, "washout": config.washout_s, "leak": config.attitude_memory_s}
    for name, lag_s in lags_s.items():
        power[name] = 1.0 - exp(-dt / lag_s)
    named = scenario.airframe.file.power_setting
    if named is None:
        return
    name, setting = named
    trim = getattr(initial, name)
    power["trim"] = power["command"][0] = power["least"] = power["greatest"] = trim
    power["low"], power["high"] = low, high = setting.range
    per_s = (high - low) / WHOLE_RANGE_S
    if _has_piston_engine(scenario.airframe):
        power["low"], power["high"] = min(config.lowest_inhg, trim), max(config.highest_inhg, trim)
        power["dpt_factor"], power["highest_dpt"] = _slipstream_limits(scenario, layout)
        per_s = config.rate_inhg_s
    power["step"] = per_s * dt


def _slipstream_limits(scenario: Scenario, layout: np.void) -> tuple[float, float]:
    """rho V^3 d dpt / d pz of the engine [FDC], kg/(m3) (m/s)^3 per inHg; and the dpt at which holding the
    propeller's yawing moment takes YAW_SHARE of the rudder's travel."""
    initial: Any = scenario.initial
    aircraft, rudder = scenario.airframe, layout["main"][YAW]
    rpm, terms = initial.engine_rpm, aircraft.terms.values()
    rudders = {s for s, axis in zip(aircraft.surfaces, aircraft.dominant_axis, strict=True) if axis == YAW}
    per_rad = sum(t.value for t in terms if t.coefficient == "Cn" and not t.of and t.surface in rudders)
    of_slipstream = sum(t.value for t in terms if t.coefficient == "Cn" and t.of == (("dpt", 3),))
    kw_per_inhg = engine_power_kw(rpm, 1.0, 1.0) - engine_power_kw(rpm, 0.0, 1.0)
    rudder_rad = min(-layout["low"][rudder], layout["high"][rudder])
    dpt3 = YAW_SHARE * per_rad * rudder_rad / of_slipstream if of_slipstream else np.inf
    return slipstream(kw_per_inhg, 1.0, 1.0) - slipstream(0.0, 1.0, 1.0), max(dpt3, 0.0) ** (1.0 / 3.0)


@kernel
def unable(surfaces, saturated, s):
    """Whether surface s is given up or stands at a stop."""
    return surfaces.effectiveness[s] < surfaces.least_effectiveness or saturated[s] == 1


@kernel
def pitch_is_lost(layout, surfaces, saturated, shortfall):
    """Whether elevator and flap are given up, or cannot between them give what pitch demands.

    A flap that can still act is asked for what the elevator lacks, so a lack says that it has nothing left.
    shortfall (3,) rad/s2; saturated (n,).
    """
    elevator, most = layout.main[PITCH], remaining(layout, surfaces.effectiveness, PITCH)
    for s in range(surfaces.effectiveness.size):
        if layout.aside[s]:
            most = max(most, surfaces.effectiveness[s])
    lacking = unable(surfaces, saturated, elevator) and abs(shortfall[PITCH]) > LEAST_LACK_RAD_S2
    return most < surfaces.least_effectiveness or lacking


@kernel
def watch(power, is_lost, t):
    """Take over once pitch has been lost for a while, hand back once it has not been for longer. t s.

    lost counts up while it is and down while it is not, between 0 and 1: swings past zero keep what they add.
    """
    change = power.impatience if is_lost else -power.forgiveness
    power.lost = min(max(power.lost + change, 0.0), 1.0)
    if power.lost == 1.0 and not power.engaged:
        power.engaged, power.attitude = 1, 0.0
        if power.from_s < 0.0:
            power.from_s = t
    elif power.lost == 0.0:
        power.engaged = 0


@kernel
def follow(power, reference, x, y):
    """Bring airspeed, its slow mean and the attitude missed to this frame; x (3,) rad/s, y (5,)."""
    if power.usual_speed == 0.0:
        power.speed = power.usual_speed = y[AIRSPEED]
    power.speed += power.smoothing * (y[AIRSPEED] - power.speed)
    power.usual_speed += power.washout * (power.speed - power.usual_speed)
    error = x[PITCH] - reference.governed_rate[PITCH]
    power.attitude += reference.dt * error - power.leak * power.attitude


@kernel
def ceiling(power, y, highest_dpt):
    """Highest manifold pressure (inHg) whose slipstream leaves the rudder enough to fly with; y (5,).

    The propeller yaws with dpt^3: slow and at full power, more than the rudder can hold. No limit where
    nothing is known of a slipstream.
    """
    if power.dpt_factor == 0.0:
        return np.inf
    per_inhg = power.dpt_factor / (2.0 * y[QDYN] * y[AIRSPEED])
    return power.command[0] + (highest_dpt - y[DPT]) / per_inhg


@kernel
def wanted(power, y):
    """The law: manifold pressure, inHg, within its limits; the trimmed one unless engaged."""
    if not power.engaged:
        return power.trim
    deviation = power.speed - power.usual_speed
    pressure = power.trim - power.speed_gain * deviation + power.attitude_gain * power.attitude
    return max(min(pressure, ceiling(power, y, power.highest_dpt), power.high), power.low)


@kernel
def steer(power, reference, x, y, watched, is_lost, t):
    """Move the manifold pressure by one frame; x (3,) rad/s, y (5,), t s.

    watched: whether it may take over, since there is an alarm; is_lost: `pitch_is_lost` now.
    """
    follow(power, reference, x, y)
    if watched:
        watch(power, is_lost, t)
    before = power.command[0]
    power.command[0] = min(max(wanted(power, y), before - power.step), before + power.step)
    power.in_use = power.engaged or power.moved
    power.moved = power.command[0] != power.trim
    if power.in_use:
        power.frames += power.engaged
        power.least = min(power.least, power.command[0])
        power.greatest = max(power.greatest, power.command[0])
