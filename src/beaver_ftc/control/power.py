"""Engine power as the last means on pitch.

The Beaver's power acts on pitch when neither elevator nor flap does. It takes over once pitch has been lost
for a while (`pitch_is_lost`, `engage`), and then moves the manifold pressure:

    P = base - K_V (V - V_bar) + K_theta theta_m                                     `wanted`
    tau_V V_bar' = V - V_bar,    theta_m' = q - q_ref - theta_m / tau_theta          `follow`

    P, base            inHg        manifold pressure; that of the trim, or of the autopilot
    V, V_bar           m/s         airspeed through a lag, and its slow mean: `speed`, `usual_speed`
    theta_m            rad         recent error of the pitch attitude: `attitude`
    q, q_ref           rad/s       pitch rate, and its reference
    K_V, K_theta                   `speed_gain`, inHg per m/s, and `attitude_gain`, inHg per rad
    tau_V, tau_theta   s           given as the shares of a frame `washout` and `leak`

Airspeed fed back to power damps the phugoid, as when an airliner was flown on its engines alone
[Burcham1997]. The airspeed is washed out (less its slow mean), so that power does not fight the airspeed to
which a jammed elevator trims the aircraft: the moment of power is too small for that. theta_m is the recent
integral of the pitch-rate error. If the nose is too high, more power lowers it, because Cm_dpt is negative.
Power has little moment, and a right-half-plane zero lies between power and attitude. So power can steady the
aircraft, but cannot make it follow a pitch rate.

    setting     power of an engine in its own unit: manifold pressure, inHg, of the Beaver
    engaged     this law sets the power
    y           measured signals (design/table.py)
"""

from math import exp, radians

import numpy as np

from beaver_ftc.aircraft import PITCH, Aircraft
from beaver_ftc.aircraft.schema import MAX_LEVERS
from beaver_ftc.compiled import fill, kernel, record
from beaver_ftc.control import row_of
from beaver_ftc.control.authority import remaining
from beaver_ftc.control.slipstream_limit import ceiling, slipstream_limits
from beaver_ftc.design.table import AIRSPEED
from beaver_ftc.scenario.declared import Declared

LEAST_LACK_RAD_S2 = 0.05  # smallest shortfall in pitch that counts: 2 to 3 inHg give so much
WHOLE_RANGE_S = 5.0  # time in which a lever goes from stop to stop; manifold pressure has `rate_inhg_s`

# enabled                      whether the law may use the engine (`is_at_hand`)
# impatience, forgiveness      changes of `lost` in a frame (`engage`)
# speed_gain, attitude_gain    K_V, K_theta
# smoothing, washout, leak     1 - exp(-dt / tau) of the lag of V, of V_bar and of theta_m
# trim, low, high, step        setting in trim, its range, and its largest change in a frame
# dpt_factor, highest_dpt      see slipstream_limit.py; 0 if there is no slipstream to account for
POWER_CONFIG = record(
    enabled=int, impatience=float, forgiveness=float, speed_gain=float, attitude_gain=float,
    smoothing=float, washout=float, leak=float, trim=float, low=float, high=float, step=float,
    dpt_factor=float, highest_dpt=float,
)  # fmt: skip
# base: the setting while not engaged: that of the trim, or of the autopilot.
SETPOINT = record(base=float)
# lost: see `engage`, 0 to 1; engaged: whether this law sets the power; moved: whether the power differs from
# `base`. speed, usual_speed, attitude: V, V_bar, theta_m.
POWER_MEMORY = record(lost=float, engaged=int, moved=int, speed=float, usual_speed=float, attitude=float)
# command            setting of the common lever, then of each engine that is an effector, less that of the
#                    common lever (engines.py)
# in_use             whether the levers are commanded
# from_s, frames     for the report: when the law was first engaged, s (-1: never); number of frames
# least, greatest    for the report: the lowest and highest setting
POWER_OUTPUT = record(command=MAX_LEVERS, in_use=int, from_s=float, frames=int, least=float, greatest=float)
POWER = record(config=POWER_CONFIG, setpoint=SETPOINT, memory=POWER_MEMORY, output=POWER_OUTPUT)


def is_at_hand(declared: Declared) -> bool:
    """Whether the declared built-in law may use the engine: the scenario allows it, the engine is known, and
    the law is informed, or it reallocates, may pitch by power, and receives the diagnosis of all types."""
    law = row_of(declared.control.law)
    may_pitch = law.reallocates and law.pitch_by_power and declared.fdi.fault_class == "all"
    may_use = declared.control.power.enabled and (law.informed or may_pitch)
    return may_use and _has_piston_engine(declared.aircraft)


def _has_piston_engine(aircraft: Aircraft) -> bool:
    """Whether the power law knows the engine: manifold pressure is what it moves, at a known engine speed."""
    return aircraft.power_setting == "manifold_pressure_inhg" and aircraft.has_engine_instruments


def configure_power(power: np.void, layout: np.void, declared: Declared) -> None:
    """Fill the record (dtype POWER); layout: of the surfaces."""
    settings = declared.control.power
    dt = 1.0 / declared.rate_hz
    config = power["config"]
    lags_s = settings.smoothing_s, settings.washout_s, settings.attitude_memory_s
    smoothing, washout, leak = (1.0 - exp(-dt / lag_s) for lag_s in lags_s)
    fill(
        config, enabled=is_at_hand(declared), impatience=dt / settings.patience_s,
        forgiveness=dt / settings.release_s, speed_gain=settings.speed_gain_inhg_per_mps,
        attitude_gain=settings.attitude_gain_inhg_per_deg / radians(1.0), smoothing=smoothing,
        washout=washout, leak=leak,
    )  # fmt: skip
    power["output"]["from_s"] = -1.0
    name_and_setting = declared.aircraft.file.power_setting
    if name_and_setting is None:
        return
    name, setting = name_and_setting
    trim = getattr(declared.initial, name)
    power["setpoint"]["base"] = power["output"]["command"][0] = trim
    fill(power["output"], least=trim, greatest=trim)
    low, high = setting.range
    per_s = (high - low) / WHOLE_RANGE_S
    if _has_piston_engine(declared.aircraft):
        low, high = min(settings.lowest_inhg, trim), max(settings.highest_inhg, trim)
        config["dpt_factor"], config["highest_dpt"] = slipstream_limits(declared, layout)
        per_s = settings.rate_inhg_s
    fill(config, trim=trim, low=low, high=high, step=per_s * dt)


@kernel
def pitch_is_lost(layout, surfaces, saturated, shortfall):
    """Whether pitch is lost. Either condition suffices:

    - All surfaces of pitch are given up: the most that remains of elevators and of each backup is below
      `least`.
    - The elevator is given up or at its stop, and the shortfall in pitch exceeds LEAST_LACK_RAD_S2. The flap
      is then asked for the rest of the demand, so a shortfall means that the flap has nothing to spare.

    shortfall (3,) rad/s2; saturated (n,).
    """
    effectiveness = surfaces.output.effectiveness
    elevator = layout.main[PITCH]
    least = surfaces.config.least_effectiveness
    remains = remaining(layout, effectiveness, PITCH)
    for s in range(effectiveness.size):
        if layout.is_backup[s]:
            remains = max(remains, effectiveness[s])
    unable = effectiveness[elevator] < least or saturated[elevator] == 1
    return remains < least or (unable and abs(shortfall[PITCH]) > LEAST_LACK_RAD_S2)


@kernel
def engage(power, is_lost, t):
    """Take over at t s once pitch has been lost for a while; hand back once it has not been lost for longer:

        lost <- lost + impatience in a frame in which pitch is lost, else lost - forgiveness; within 0 to 1
        engaged from lost = 1 on, until lost = 0

    impatience: dt / patience_s; forgiveness: dt / release_s. theta_m begins at 0.
    """
    config = power.config
    memory = power.memory
    output = power.output
    change = config.impatience if is_lost else -config.forgiveness
    memory.lost = min(max(memory.lost + change, 0.0), 1.0)
    if memory.lost == 1.0 and not memory.engaged:
        memory.engaged = 1
        memory.attitude = 0.0
        if output.from_s < 0.0:
            output.from_s = t
    elif memory.lost == 0.0:
        memory.engaged = 0


@kernel
def follow(config, memory, reference, x, y):
    """Bring V, V_bar and theta_m to this frame of dt s; x (3,) rad/s, y (n_y,): measured.

    V <- V + smoothing (airspeed - V),    V_bar <- V_bar + washout (V - V_bar)
    theta_m <- theta_m + dt (q - q_ref) - leak theta_m
    """
    if memory.usual_speed == 0.0:
        memory.speed = memory.usual_speed = y[AIRSPEED]
    memory.speed += config.smoothing * (y[AIRSPEED] - memory.speed)
    memory.usual_speed += config.washout * (memory.speed - memory.usual_speed)
    error = x[PITCH] - reference.output.governed_rate[PITCH]
    memory.attitude += reference.config.dt * error - config.leak * memory.attitude


@kernel
def wanted(power, y):
    """The setting that the law wants, inHg: P = base - K_V (V - V_bar) + K_theta theta_m, within `ceiling`
    and its range, while it is engaged; else `base`."""
    config = power.config
    memory = power.memory
    P = power.setpoint.base
    if not memory.engaged:
        return P
    P -= config.speed_gain * (memory.speed - memory.usual_speed)
    P += config.attitude_gain * memory.attitude
    return max(min(P, ceiling(power, y, config.highest_dpt), config.high), config.low)


@kernel
def steer_by_power(power, reference, x, y, may_engage, is_lost, t):
    """Move the manifold pressure by one frame; x (3,) rad/s, t s.

    may_engage: whether power may take over (after an alarm); is_lost: `pitch_is_lost` now. `moved` of the
    memory keeps the levers in use after the law has handed back, until they are at `base` again.
    """
    memory = power.memory
    output = power.output
    follow(power.config, memory, reference, x, y)
    if may_engage:
        engage(power, is_lost, t)
    P = moved(output.command[0], wanted(power, y), power.config.step)
    output.command[0] = P
    output.in_use = memory.engaged or memory.moved
    memory.moved = power.setpoint.base != P
    if output.in_use:
        output.frames += memory.engaged
        output.least = min(output.least, P)
        output.greatest = max(output.greatest, P)


@kernel
def moved(before, wanted, step):
    """The setting `wanted`, as far as one `step` of a frame reaches from `before`."""
    return min(max(wanted, before - step), before + step)


@kernel
def follow_autopilot(power, setting, airspeed):
    """Take the autopilot's setting as `base`, and its airspeed, m/s, as V_bar while this law is engaged: the
    law has an airspeed loop of its own. If the law may not use the engine, move the lever to the setting."""
    power.output.in_use = 1
    power.setpoint.base = setting
    if power.memory.engaged:
        power.memory.usual_speed = airspeed
    if not power.config.enabled:
        power.output.command[0] = moved(power.output.command[0], setting, power.config.step)


@kernel
def move_differences(power, difference, n, step):
    """Move the command of each of n engines, which is added to the common lever's, towards `difference` (n,),
    by at most a `step`, in units of the setting."""
    output = power.output
    for k in range(n):
        output.command[1 + k] = moved(output.command[1 + k], difference[k], step)
        output.in_use = output.in_use or output.command[1 + k] != 0.0
