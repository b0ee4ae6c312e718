"""Outer loops: altitude, airspeed, heading and bank by body rates and engine power.

The autopilot computes where each channel of the commanded profile should be now, from the legs of the
scenario, and body-rate references and an engine setting for that.

    climb    gamma_c = (h' + k (hc - h)) / V + what was found missing
             theta_c = gamma_c + alpha cos(bank) (smoothed)
             theta' = k (theta_c - theta)
    speed    a = V' + k (Vc - V) + what was found missing + g (gamma_c - gamma in trim), by engine power
    gliding  gamma_c = gamma in trim - (V' + k (Vc - V) + what was found missing) / g: airspeed by pitch
    heading  phi_c = V / g k (psi_c - psi),   phi' = k (phi_c - phi)
    turn     psi' = g tan phi / V: coordinated [Etkin1996, sec. 7.6]; and the body rates of these angles'
             rates, with sideslip washed out by the rudder

Every demand is limited, and what a limit cut off is not integrated. The limits on rates and bank shrink with
what the surfaces that are left can give; climb and descent are bounded by the power there is, so that the
airspeed is kept. Where the ailerons no longer act, the roll is flown by sideslip: rudder and dihedral.

Envelope protection computes what can still be held with the remaining authority of the surfaces. Level flight
of the design model takes an elevator that depends on dynamic pressure and flap:

    qdyn S CX = m g sin alpha,   qdyn S CZ + m g cos alpha = 0,   Cm = 0

in angle of attack, slipstream and elevator: wings level, no rates, no sideslip, the engine free. What acts
like the elevator now is estimated from the balance of the pitch moments,

    acting = offset + left u + d / G,    d: what the law's observer finds unexplained

so a jam is known where it stands before its type is. The speeds at which the flap, less a reserve to fly
with, makes up for the rest are those that can be held; the commanded airspeed is brought among them. A speed
for which the elevator, or what is left of it, does not suffice cannot be held by any law.

The autopilot's record keeps the profile to fly, its limits, its memory, and how far it was off;
`set_up_autopilot` fills it from the declared `autopilot`.
"""

from functools import lru_cache
from math import inf, nan, radians

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.aircraft import GRAVITY_MPS2, THRUST_TERM
from beaver_ftc.compiled import kernel, record, row_of
from beaver_ftc.control.allocation import attainable, remaining
from beaver_ftc.control.power import ceiling
from beaver_ftc.control.thrust import (
    ENGINE,
    between,
    gained,
    look_up,
    power_for,
    set_up_engine,
    thrust_per_inhg,
)
from beaver_ftc.design.engine import SEA_LEVEL_DENSITY_KG_M3
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA, QDYN
from beaver_ftc.diagnosis.state import PITCH, ROLL, YAW
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.signals import MEAN_S, TIME_TOLERANCE_S

ALTITUDE, SPEED, HEADING, BANK = range(4)
N_CHANNELS = 4
MAX_LEGS = 100
CHANNELS = ("altitude_m", "airspeed_mps", "heading_deg", "bank_deg")
NOT_JUDGED = -1.0  # a deviation that no frame has counted for
AT_ONE_INSTANT = "airspeed_at_one_instant_mps"  # the largest deviation, where `airspeed_mps` is of the mean
LIMITED = "airspeed_limited_mps"  # the commanded one, as far as it can be held
COLUMNS = (
    "altitude_command_m", "airspeed_command_mps", "heading_command_rad", "bank_command_rad", LIMITED,
)  # fmt: skip

# Of each loop, 1/s and of what it finds missing 1/s2; smoothing, s; and what bounds the demands. Attitudes a
# fifth as fast as the inner loops, the path a quarter of that: gusts set the gains, not comfort.
GAINS = {
    "altitude": 0.8, "altitude_i": 0.04, "attitude": 3.0, "speed": 0.3, "speed_i": 0.015,
    "bank": 1.0, "bank_i": 0.2, "heading": 0.25, "heading_i": 0.004,
    "sideslip": 0.5,  # the yaw damper's part beside the rate loop
    "alpha_s": 2.0, "airspeed_s": 3.0,  # against noise and gusts
    "jammed_s": 1.0,  # rolling is handed to the rudder within about so long
    "authority_s": 1.0,  # a rate is asked for only if it can be had, and ended, within this time
    "bank_s": 6.0,  # and a bank only if it can be left within this time
    "spare_mps": 2.0, "path_per_mps": 0.02,  # airspeed off before height goes for it, and how much path, rad
    "loose": 0.4,  # share of the heading loop left when nothing acts in yaw: the turn is then slow to follow
    "protection": 2.0,  # 1/s: how fast the angle of attack may close on its limit
}  # fmt: skip
GAIN = record(**dict.fromkeys(GAINS, float))

# What can be held: the elevator that level flight takes, over dynamic pressure and flap (rad);
# what acts like the elevator and what of it is commanded, smoothed (rad); the airspeeds between which level
# flight can be held (m/s); and of each limit since when it has bitten (s), and its value at last (SI).
FASTEST, SLOWEST, BANK_LIMIT = range(3)
N_QDYN, N_FLAP = 12, 5
HOLDING = record(
    has_table=int, limits_airspeed=int, n_averaged_frames=int, flap_reserve=float,
    max_airspeed_rate_mps2=float,
    qdyn=N_QDYN, flap=N_FLAP, elevator=(N_QDYN, N_FLAP),
    mean_acting_elevator=float, mean_commanded_elevator=float,
    fastest=float, slowest=float, bank=float,
    in_force=(int, 3), from_s=3, value=3,
)  # fmt: skip

# A leg: from when on, to which value (not a number: hold what is), how fast. SI and rad.
AUTOPILOT = record(
    enabled=int, flying=int, dt=float,
    n_legs=(int, N_CHANNELS), next_leg_index=(int, N_CHANNELS),  # how many, and which is next
    leg_starts_at_s=(N_CHANNELS, MAX_LEGS), leg_value=(N_CHANNELS, MAX_LEGS),
    leg_max_command_rate=(N_CHANNELS, MAX_LEGS),
    is_commanded=(int, N_CHANNELS),  # whether the channel is flown by now
    goal=N_CHANNELS, command=N_CHANNELS, max_command_rate=N_CHANNELS,
    command_rate=N_CHANNELS,  # per second, of the command at this instant
    changed_at_s=N_CHANNELS,
    # what is known of the aircraft
    gravity=float, thrust=2,  # m/s2 per dpt and Pa: at no alpha, and per alpha
    engine=ENGINE, pitch_holds_airspeed=int,  # what else is known of it; whether pitch holds the airspeed
    trim_power=float, low_power=float, high_power=float,  # in the units of its setting
    climb_in_trim=float,  # rad, with the engine as trimmed
    dihedral=float,  # roll rate per sideslip and airspeed, 1/m
    full_power=float, allowed_power=float,  # the highest there is now, and that the rudder allows
    dpt_cubed_held_by_sideslip=float,  # dpt^3 whose yawing moment the largest accepted sideslip holds
    slowest_mps=float, steepest_alpha=float,
    max_healthy_rate=3,  # rad/s, of the rates asked for with all surfaces healthy
    rate_limit=3, max_healthy_bank=float, bank_limit=float,
    # memory
    alpha=float, airspeed=float,  # smoothed, rad and m/s
    recent_airspeed_mps=float,  # averaged over RECENT_AIRSPEED_S
    missing_turn_rate=float,  # rad/s of turning found missing
    missing_path_angle=float,  # rad of path angle found missing
    missing_acceleration=float, missing_roll_rate=float,  # m/s2, rad/s: found missing
    roll_loss_share=float,  # share of roll that rudder and dihedral carry
    yaw_loss_share=float,  # 1: nothing acts in yaw
    engines_alone_yaw_share=float,  # share of the time of late in which engines alone act there
    rates=3, gain=GAIN,
    sets_power=int, power_setting=float,  # whether the engine is set by now, and to what
    power_airspeed=float,  # m/s, to hold while power stands in for a lost pitch
    airspeed_to_fly=float, airspeed_to_fly_rate=float,  # m/s, and its change, m/s2
    holding=HOLDING,
    # how far off, at most; and the mean deviation of late, from what is commanded and, airspeed, held
    # `largest_deviation` is NOT_JUDGED until a channel is: of angles that takes SETTLED_S
    mean_deviation=N_CHANNELS, mean_deviation_from_airspeed_to_fly=float,
    largest_deviation_from_airspeed_to_fly=float, largest_deviation=N_CHANNELS,
    largest_instant_airspeed_deviation=float,  # m/s, of the airspeed from what is commanded, at one instant
)  # fmt: skip


ACTING_S = 4.0  # over which the balance is averaged: gusts pitch within a second
HOLD_SETTLED_S = 0.5  # and before which nothing is concluded from it
NOTED_MPS, NOTED_RAD = 0.5, 0.02  # a limit that bites by so much is announced


@kernel
def limit_airspeed_to_fly(autopilot, layout, surfaces, u, unexplained, y, t):
    """Set autopilot.airspeed_to_fly of this frame: the commanded airspeed where it can be held.

    u (n,) rad: where the surfaces are. unexplained rad: the elevator that would give what the law's observer
    finds in pitch.
    """
    hold, e, f = autopilot.holding, layout.main[PITCH], layout.stand_in
    hold.fastest, hold.slowest = np.inf, 0.0
    effectiveness, offset = surfaces.output.effectiveness, surfaces.output.offset
    left = effectiveness[e]
    whole = left >= 1.0 and (f < 0 or effectiveness[f] >= 1.0)
    if whole or not hold.has_table:
        hold.n_averaged_frames = 0
    else:
        average_acting_elevator(hold, autopilot.dt, offset[e], left * u[e], unexplained)
        if hold.n_averaged_frames * autopilot.dt > HOLD_SETTLED_S:
            find_airspeeds_that_can_be_held(hold, layout, surfaces, y)
    approach_airspeed_to_fly(autopilot)
    record_limits_in_force(autopilot, layout.main, effectiveness, t)


@kernel
def average_acting_elevator(hold, dt, offset, commanded, unexplained):
    """Average the elevator that would account for the pitch moments there are, rad: `offset` is how
    far it is off, `commanded` what its remaining effectiveness gives."""
    acting = offset + commanded + unexplained
    hold.n_averaged_frames += 1
    weight = max(dt / ACTING_S, 1.0 / hold.n_averaged_frames)
    hold.mean_acting_elevator += weight * (acting - hold.mean_acting_elevator)
    hold.mean_commanded_elevator += weight * (commanded - hold.mean_commanded_elevator)


@kernel
def find_airspeeds_that_can_be_held(hold, layout, surfaces, y):
    """The fastest and the slowest airspeed that can be held, m/s."""
    e, f = layout.main[PITCH], layout.stand_in
    left, effectiveness = surfaces.output.effectiveness[e], surfaces.output.effectiveness[f]
    least = hold.mean_acting_elevator - hold.mean_commanded_elevator + left * layout.low[e]
    greatest = hold.mean_acting_elevator - hold.mean_commanded_elevator + left * layout.high[e]
    up, down = layout.low[f] + hold.flap_reserve, layout.high[f] - hold.flap_reserve
    if effectiveness < surfaces.config.least_effectiveness:
        up = down = min(max(surfaces.output.offset[f], layout.low[f]), layout.high[f])
    per_pa = 2.0 * y[QDYN] / y[AIRSPEED] ** 2
    hold.fastest = np.sqrt(2.0 * dynamic_pressure_limit(hold, up, greatest, True) / per_pa)
    hold.slowest = np.sqrt(2.0 * dynamic_pressure_limit(hold, down, least, False) / per_pa)


@kernel
def dynamic_pressure_limit(hold, flap, elevator, highest):
    """The highest (or lowest) dynamic pressure, Pa, of level flight with flap and elevator (rad): where the
    elevator it takes is the one there is. Infinite (or zero) where the table does not bound it."""
    before = between(flap, N_FLAP, hold.flap, row_of(hold.elevator, 0))
    if before > elevator:
        return hold.qdyn[0] if highest else 0.0
    for j in range(1, N_QDYN):
        after = between(flap, N_FLAP, hold.flap, row_of(hold.elevator, j))
        if after > elevator:
            part = (elevator - before) / (after - before)
            return hold.qdyn[j - 1] + part * (hold.qdyn[j] - hold.qdyn[j - 1])
        before = after
    return np.inf if highest else hold.qdyn[N_QDYN - 1]


@kernel
def approach_airspeed_to_fly(autopilot):
    """Bring the airspeed to fly towards the nearest to the commanded one that can be held, without a bump."""
    hold, command = autopilot.holding, autopilot.command[SPEED]
    wanted = min(max(command, hold.slowest), hold.fastest)
    if wanted == command and not hold.limits_airspeed:
        autopilot.airspeed_to_fly, autopilot.airspeed_to_fly_rate = command, autopilot.command_rate[SPEED]
        return
    most = hold.max_airspeed_rate_mps2 * autopilot.dt
    step = min(max(wanted - autopilot.airspeed_to_fly, -most), most)
    autopilot.airspeed_to_fly += step
    autopilot.airspeed_to_fly_rate = step / autopilot.dt
    hold.limits_airspeed = autopilot.airspeed_to_fly != command


@kernel
def record_limits_in_force(autopilot, main, effectiveness, t):
    """Note since when a limit has bitten, and what it is at last; main (3,): who leads each axis."""
    hold, command = autopilot.holding, autopilot.command[SPEED]
    if autopilot.is_commanded[SPEED]:
        record_limit(hold, FASTEST, hold.fastest, hold.fastest < command - NOTED_MPS, t)
        record_limit(hold, SLOWEST, hold.slowest, hold.slowest > command + NOTED_MPS, t)
    if effectiveness[main[ROLL]] < 1.0 or effectiveness[main[YAW]] < 1.0:
        hold.bank += autopilot.dt / ACTING_S * (autopilot.bank_limit - hold.bank)
        record_limit(hold, BANK_LIMIT, hold.bank, hold.bank < autopilot.max_healthy_bank - NOTED_RAD, t)


@kernel
def record_limit(hold, kind, value, bites, t):
    """Keep a limit that bites now."""
    hold.in_force[kind] = bites
    if bites:
        if hold.from_s[kind] < 0.0:
            hold.from_s[kind] = t
        hold.value[kind] = value


MOST_PATH_RAD = 0.15
MOST_SIDESLIP_RAD = 0.14
MOST_MISSING = 0.1  # rad of path angle, and times gravity of acceleration
MOST_DRIFT_RAD_S = 0.1  # of turning that a bank without a turn stands for
RECENT_AIRSPEED_S = 20.0  # over which the recent airspeed is averaged
MAX_FROM_RECENT_MPS = 3.0  # power alone can hold an airspeed within so much of the recent one
CUT_INHG_S, RAISE_INHG_S = 8.0, 1.0  # about as fast as the engine follows; and slower than a gust lasts
KEPT_ASIDE = 0.15  # of the power's range at either end, for engines that alone yaw the aircraft
LOOP_GAIN_SHARE_BY_POWER = 0.25  # of the loops of bank and heading where engines alone yaw the aircraft
BY_POWER_S = 5.0  # since when that counts
SETTLED_S = 30.0  # after a change of heading


@kernel
def clamp(value, most):
    """value within -most and most."""
    return min(max(value, -most), most)


@kernel
def wrap_to_half_turn(angle):
    """The same direction within half a turn, rad."""
    return angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))


@kernel
def begin_leg(autopilot, c, now, t):
    """Take up the next leg of channel c, which is at `now` as measured."""
    j = autopilot.next_leg_index[c]
    autopilot.next_leg_index[c] = j + 1
    if not autopilot.is_commanded[c]:
        autopilot.is_commanded[c] = 1
        autopilot.command[c] = now
    value = autopilot.leg_value[c, j]
    autopilot.goal[c] = autopilot.command[c]
    if not np.isnan(value):
        away = value - autopilot.command[c]
        autopilot.goal[c] += wrap_to_half_turn(away) if c == HEADING else away
        autopilot.changed_at_s[c] = t
    autopilot.max_command_rate[c] = autopilot.leg_max_command_rate[c, j]


@kernel
def advance_commands(autopilot, measured, t):
    """Bring every channel's command to t s; measured (N_CHANNELS,): where they are."""
    for c in range(N_CHANNELS):
        while (
            autopilot.next_leg_index[c] < autopilot.n_legs[c]
            and t >= autopilot.leg_starts_at_s[c, autopilot.next_leg_index[c]] - TIME_TOLERANCE_S
        ):
            begin_leg(autopilot, c, measured[c], t)
        if autopilot.is_commanded[c]:
            away = autopilot.goal[c] - autopilot.command[c]
            most = autopilot.max_command_rate[c] * autopilot.dt
            step = min(max(away, -most), most)
            autopilot.command[c] += step
            autopilot.command_rate[c] = step / autopilot.dt if most < np.inf else 0.0


@kernel
def steer(autopilot, control, u, measured, unexplained, t):
    """One frame, at t s: fill autopilot.rates (3,) rad/s, and the engine setting where an airspeed is
    commanded. control: the records of the law (control/state.py). u, unexplained: see
    `limit_airspeed_to_fly`.
    """
    layout, surfaces, saturated = control.layout, control.surfaces, control.allocation.output.saturated
    axes, power, by_engines = control.axes, control.power, control.engines.output.authority
    y, attitude = measured.y, measured.attitude
    if not autopilot.flying:
        take_over(autopilot, y, attitude)
    advance_commands(autopilot, (measured.altitude, y[AIRSPEED], attitude[YAW], attitude[ROLL]), t)
    smooth_signals_and_losses(autopilot, layout, surfaces, saturated, by_engines[1, YAW] > 0.0, y)
    limit_rates_and_bank(autopilot, layout, axes.G, axes.hold, by_engines)
    limit_airspeed_to_fly(autopilot, layout, surfaces, u, unexplained, y, t)
    push = acceleration_per_power(autopilot, power, y)
    rudder = layout.main[YAW]
    left, at_stop = surfaces.output.effectiveness[rudder], saturated[rudder]
    autopilot.full_power = highest_power(autopilot, power, left, at_stop, y)
    path = path_angle_to_fly(autopilot, measured, push)
    set_body_rates(
        autopilot,
        y,
        attitude,
        bank_angle_rate(autopilot, attitude),
        pitch_attitude_rate(autopilot, y, attitude, path),
    )
    autopilot.sets_power = autopilot.is_commanded[SPEED] and not autopilot.pitch_holds_airspeed
    if autopilot.sets_power:
        set_power(autopilot, power, y, path, push)


@kernel
def take_over(autopilot, y, attitude):
    """In trim: smoothed signals and the engine as they are."""
    autopilot.flying = 1
    autopilot.alpha, autopilot.airspeed = y[ALPHA], y[AIRSPEED]
    autopilot.recent_airspeed_mps = y[AIRSPEED]
    autopilot.climb_in_trim = attitude[PITCH] - y[ALPHA]


@kernel
def smooth_signals_and_losses(autopilot, layout, surfaces, saturated, engines_yaw, y):
    """Smooth what is noisy, and note whether the ailerons or the rudder are gone; ailerons at their stop give
    no more roll, whatever their estimated effectiveness. engines_yaw: whether engines can yaw the
    aircraft."""
    dt = autopilot.dt
    least = surfaces.config.least_effectiveness
    effectiveness = surfaces.output.effectiveness
    autopilot.alpha += dt / autopilot.gain.alpha_s * (y[ALPHA] - autopilot.alpha)
    autopilot.airspeed += dt / autopilot.gain.airspeed_s * (y[AIRSPEED] - autopilot.airspeed)
    at_stop = saturated[layout.main[ROLL]] == 1
    gone = remaining(layout, effectiveness, ROLL) < least or at_stop
    autopilot.roll_loss_share += dt / autopilot.gain.jammed_s * (gone - autopilot.roll_loss_share)
    free = remaining(layout, effectiveness, YAW) < least
    autopilot.yaw_loss_share += dt / autopilot.gain.jammed_s * (free - autopilot.yaw_loss_share)
    if engines_yaw:
        by_power = free or saturated[layout.main[YAW]] == 1
        autopilot.engines_alone_yaw_share += dt / BY_POWER_S * (by_power - autopilot.engines_alone_yaw_share)


@kernel
def limit_rates_and_bank(autopilot, layout, G, hold, engine_authority):
    """Rates and bank that the surfaces left can give: their spare acceleration for a while. G (3, n): with
    the effectiveness of each in it; hold (3,) rad/s2; engine_authority: as in `allocation.attainable`."""
    for i in range(3):
        least, greatest = attainable(G, layout, engine_authority, i)
        spare = max(min(greatest - hold[i], hold[i] - least), 0.0)
        autopilot.rate_limit[i] = min(autopilot.max_healthy_rate[i], spare * autopilot.gain.authority_s)
    by_sideslip = autopilot.roll_loss_share * autopilot.dihedral * autopilot.airspeed * MOST_SIDESLIP_RAD
    autopilot.rate_limit[ROLL] = max(autopilot.rate_limit[ROLL], by_sideslip)
    steepest = autopilot.max_healthy_bank * (
        1.0 - max(0.5 * autopilot.roll_loss_share, 0.2 * autopilot.yaw_loss_share)
    )
    autopilot.bank_limit = min(steepest, autopilot.rate_limit[ROLL] * autopilot.gain.bank_s)


@kernel
def acceleration_per_power(autopilot, power, y):
    """Acceleration along the path per unit of power, m/s2, where no table has it; the table's are brought to
    this airspeed."""
    if autopilot.engine.settings:
        look_up(autopilot.engine, autopilot.airspeed)
        return 0.0
    return thrust_per_inhg(autopilot.thrust, autopilot.alpha, autopilot.airspeed, power, y)


@kernel
def highest_power(autopilot, power, left, at_stop, y):
    """The highest power with what is left of the rudder: the Beaver's propeller yaws with dpt^3.

    What the rudder lacks, sideslip makes up for. The slower, the less: a climb beyond it ends in slow flight.
    A rudder at its stop holds no more, whatever is believed of it: power then goes back until it comes off.
    left: effectiveness of the rudder.
    """
    high = autopilot.high_power
    if at_stop:
        lowest = ceiling(power, y, autopilot.dpt_cubed_held_by_sideslip ** (1.0 / 3.0))
        cut = min(autopilot.allowed_power, power.output.command[0]) - CUT_INHG_S * autopilot.dt
        autopilot.allowed_power = min(max(cut, lowest), high)
    else:
        autopilot.allowed_power = min(autopilot.allowed_power + RAISE_INHG_S * autopilot.dt, high)
    if left >= 1.0:
        return autopilot.allowed_power
    held = max(left, 0.0) * power.config.highest_dpt**3 + (1.0 - left) * autopilot.dpt_cubed_held_by_sideslip
    return min(autopilot.allowed_power, ceiling(power, y, held ** (1.0 / 3.0)))


@kernel
def path_angle_to_fly(autopilot, measured, push):
    """Path angle to fly, rad; the one that is flown where no altitude is commanded."""
    if autopilot.pitch_holds_airspeed and autopilot.is_commanded[SPEED]:
        return glide_path_angle(autopilot)
    if not autopilot.is_commanded[ALTITUDE]:
        return measured.attitude[PITCH] - autopilot.alpha
    V = autopilot.airspeed
    error = autopilot.command[ALTITUDE] - measured.altitude
    wanted = (
        autopilot.command_rate[ALTITUDE] + autopilot.gain.altitude * error
    ) / V + autopilot.missing_path_angle
    low, high = path_angle_limits(autopilot, push)
    path = min(max(wanted, low), high)
    if path == wanted:
        lift = autopilot.missing_path_angle + autopilot.dt * autopilot.gain.altitude_i * error / V
        autopilot.missing_path_angle = clamp(lift, MOST_MISSING)
    return path


@kernel
def glide_path_angle(autopilot):
    """Path angle at which gravity brings the airspeed to where it is commanded, rad."""
    error = autopilot.airspeed_to_fly - autopilot.airspeed
    along = autopilot.airspeed_to_fly_rate + autopilot.missing_acceleration + autopilot.gain.speed * error
    steeper = along / autopilot.gravity
    limited = clamp(steeper, MOST_PATH_RAD)
    if limited == steeper:
        integrate_missing_acceleration(autopilot, error)
    return autopilot.climb_in_trim - limited


@kernel
def integrate_missing_acceleration(autopilot, error):
    """Integrate the acceleration that an airspeed takes in addition to the computed one; error m/s."""
    found = autopilot.missing_acceleration + autopilot.dt * autopilot.gain.speed_i * error
    autopilot.missing_acceleration = clamp(found, MOST_MISSING * autopilot.gravity)


@kernel
def path_angle_limits(autopilot, push):
    """The steepest descent and climb, rad: what the engine sustains, and what airspeed there is to spare."""
    slow = autopilot.slowest_mps
    fast, idle, full = np.inf, autopilot.trim_power, autopilot.trim_power
    if autopilot.is_commanded[SPEED]:
        slow = max(slow, autopilot.airspeed_to_fly - autopilot.gain.spare_mps)
        fast = autopilot.airspeed_to_fly + autopilot.gain.spare_mps
        idle, full = autopilot.low_power, max(autopilot.full_power, autopilot.low_power)
    trim, engine = autopilot.trim_power, autopilot.engine
    at_idle = autopilot.climb_in_trim + gained(engine, push, trim, idle) / autopilot.gravity
    at_full = autopilot.climb_in_trim + gained(engine, push, trim, full) / autopilot.gravity
    low = at_idle - autopilot.gain.path_per_mps * (fast - autopilot.airspeed)
    high = at_full + autopilot.gain.path_per_mps * (autopilot.airspeed - slow)
    return max(low, -MOST_PATH_RAD), min(max(high, -MOST_PATH_RAD), MOST_PATH_RAD)


@kernel
def pitch_attitude_rate(autopilot, y, attitude, path):
    """The rate of the pitch attitude, rad/s."""
    if not (
        autopilot.is_commanded[ALTITUDE] or (autopilot.pitch_holds_airspeed and autopilot.is_commanded[SPEED])
    ):
        return 0.0
    wanted = path + autopilot.alpha * np.cos(attitude[ROLL]) - attitude[PITCH]
    rate = clamp(autopilot.gain.attitude * wanted, autopilot.rate_limit[PITCH])
    return min(rate, autopilot.gain.protection * (autopilot.steepest_alpha - y[ALPHA]))


@kernel
def bank_angle_rate(autopilot, attitude):
    """The rate of the bank angle, rad/s; slower where engines alone yaw and roll."""
    loop_gain_share = 1.0 - autopilot.roll_loss_share * autopilot.engines_alone_yaw_share * (
        1.0 - LOOP_GAIN_SHARE_BY_POWER
    )
    if autopilot.is_commanded[HEADING]:
        error = wrap_to_half_turn(autopilot.command[HEADING] - attitude[YAW])
        left = 1.0 - autopilot.yaw_loss_share * (1.0 - autopilot.gain.loose)
        found = (
            autopilot.missing_turn_rate
            + autopilot.dt * autopilot.yaw_loss_share * autopilot.gain.heading_i * error
        )
        autopilot.missing_turn_rate = autopilot.yaw_loss_share * clamp(found, MOST_DRIFT_RAD_S)
        turning = (
            loop_gain_share * left * autopilot.gain.heading * error
            + autopilot.command_rate[HEADING]
            + autopilot.missing_turn_rate
        )
        bank = autopilot.airspeed / autopilot.gravity * turning
    elif autopilot.is_commanded[BANK]:
        bank = autopilot.command[BANK]
    else:
        return 0.0
    away = clamp(bank, autopilot.bank_limit) - attitude[ROLL]
    wanted = (
        loop_gain_share * autopilot.gain.bank * away + autopilot.roll_loss_share * autopilot.missing_roll_rate
    )
    rate = clamp(wanted, autopilot.rate_limit[ROLL])
    if rate == wanted:
        autopilot.missing_roll_rate += (
            autopilot.roll_loss_share * autopilot.dt * loop_gain_share * autopilot.gain.bank_i * away
        )
    return rate


@kernel
def set_body_rates(autopilot, y, attitude, rolling, pitching):
    """Body rates of the attitude's rates (rad/s) in a coordinated turn; the rudder keeps the sideslip."""
    rates = autopilot.rates
    sin_roll, cos_roll = np.sin(attitude[ROLL]), np.cos(attitude[ROLL])
    sin_pitch, cos_pitch = np.sin(attitude[PITCH]), np.cos(attitude[PITCH])
    lateral = autopilot.is_commanded[HEADING] or autopilot.is_commanded[BANK]
    turning = 0.0
    if lateral:
        turning = autopilot.gravity / autopilot.airspeed * sin_roll / max(cos_roll, 0.1)
    rates[ROLL] = rolling - turning * sin_pitch
    rates[PITCH] = pitching * cos_roll + turning * cos_pitch * sin_roll
    rates[YAW] = 0.0
    if lateral:
        sideslip = -rolling / (autopilot.dihedral * autopilot.airspeed)
        wanted = autopilot.roll_loss_share * clamp(sideslip, MOST_SIDESLIP_RAD)
        keeping = autopilot.gain.sideslip * (y[BETA] - wanted)
        rates[YAW] = turning * cos_pitch * cos_roll - pitching * sin_roll + keeping
    rates[YAW] = clamp(rates[YAW], autopilot.rate_limit[YAW])


@kernel
def set_power(autopilot, power, y, path, push):
    """Set the power; while power stands in for a lost pitch, also the airspeed for its law and the
    acceleration that the path takes: that law has an airspeed loop of its own."""
    error = autopilot.airspeed_to_fly - autopilot.airspeed
    autopilot.recent_airspeed_mps += (
        autopilot.dt / RECENT_AIRSPEED_S * (autopilot.airspeed - autopilot.recent_airspeed_mps)
    )
    along = autopilot.airspeed_to_fly_rate + autopilot.missing_acceleration
    if power.memory.engaged:
        autopilot.power_airspeed = autopilot.recent_airspeed_mps + clamp(
            autopilot.airspeed_to_fly - autopilot.recent_airspeed_mps, MAX_FROM_RECENT_MPS
        )
        error = autopilot.power_airspeed - autopilot.airspeed
    else:
        along += autopilot.gain.speed * error
    climbing = autopilot.gravity * (path - autopilot.climb_in_trim)
    wanted = power_for(autopilot.engine, push, autopilot.trim_power, along + climbing)
    high = min(autopilot.full_power, ceiling(power, y, power.config.highest_dpt))
    room = KEPT_ASIDE * autopilot.engines_alone_yaw_share * (autopilot.high_power - autopilot.low_power)
    limited = max(min(wanted, high - room), autopilot.low_power + room)
    if limited == wanted:
        integrate_missing_acceleration(autopilot, error)
    autopilot.power_setting = limited


@kernel
def record_deviations(autopilot, altitude_m, airspeed_mps, heading, bank, t):
    """Note the deviation of every channel from its command: its mean of late, and the largest, of angles
    once SETTLED_S have passed. Of the airspeed the mean is judged;
    `largest_instant_airspeed_deviation` is at one instant."""
    where = (altitude_m, airspeed_mps, heading, bank)
    for c in range(N_CHANNELS):
        if not autopilot.is_commanded[c]:
            continue
        away = where[c] - autopilot.command[c]
        if c == HEADING:
            away = wrap_to_half_turn(away)
        autopilot.mean_deviation[c] += autopilot.dt / MEAN_S * (away - autopilot.mean_deviation[c])
        if c == SPEED:
            autopilot.largest_instant_airspeed_deviation = max(
                autopilot.largest_instant_airspeed_deviation, abs(away)
            )
            away = autopilot.mean_deviation[c]
            from_held = where[c] - autopilot.airspeed_to_fly
            autopilot.mean_deviation_from_airspeed_to_fly += (
                autopilot.dt / MEAN_S * (from_held - autopilot.mean_deviation_from_airspeed_to_fly)
            )
            autopilot.largest_deviation_from_airspeed_to_fly = max(
                autopilot.largest_deviation_from_airspeed_to_fly,
                abs(autopilot.mean_deviation_from_airspeed_to_fly),
            )
        if c in (ALTITUDE, SPEED) or t >= autopilot.changed_at_s[c] + SETTLED_S:
            autopilot.largest_deviation[c] = max(autopilot.largest_deviation[c], abs(away))


THRUST = "dpt"  # the signal that stands for the engine
STEP = 1e-30  # of a complex step
ITERATIONS, CLOSE = 12, 1e-9
STEEPEST_RAD, MOST_THRUST = 0.5, 3.0  # beyond, the polynomials have solutions that no aircraft flies
PER_FLAP, GUESS = -0.12, (0.1, 0.5, 0.0)  # alpha over flap, and alpha, slipstream, elevator without it
MOST_DEG_S = (12.0, 6.0, 10.0)  # asked of a healthy aircraft: a transport's manoeuvres
MOST_BANK_DEG = 30.0
STEEPEST_ALPHA_DEG = 15.0
SPARE_ALPHA_DEG = 1.0, 2.0  # at least and at most, below the highest at which the model is valid
SPARE_MPS, SPARE_SHARE = 2.0, 0.2  # above the validated airspeeds' end; at most this share of them
POWER_SIDESLIP_RAD = 0.2  # that full power may lead to with a rudder that is lost; 0.6 is a departure
# Of 0, 0.7, 1.5 and 3 deg kept of the flap at the end of the airspeeds that can be held, the one with which
# most jams were kept; and how fast a limit moves the command: about as fast as drag slows the aircraft down.
FLAP_RESERVE_DEG, MAX_AIRSPEED_RATE_MPS2 = 0.7, 1.0
LEAST_DIHEDRAL = 0.01  # of an aircraft that hardly rolls by sideslip: it is then not flown by it
_UNIT = dict(zip(CHANNELS, (1.0, 1.0, radians(1.0), radians(1.0)), strict=True))


def set_up_autopilot(autopilot: np.void, control: np.void, declared: Declared) -> None:
    """Fill the record (dtype AUTOPILOT); control: the law's, already assembled."""
    profile = declared.autopilot
    if profile is None or not profile.channels:
        return
    autopilot["enabled"], autopilot["dt"] = 1, 1.0 / declared.rate_hz
    set_up_profile(autopilot, declared)
    autopilot["changed_at_s"], autopilot["largest_deviation"] = -inf, NOT_JUDGED
    autopilot["gain"] = tuple(_gains(declared.aircraft).values())
    autopilot["gravity"] = GRAVITY_MPS2
    _set_up_aircraft_values(autopilot, declared)
    less, more = (declared.aircraft.envelope.alpha_deg[1] - spare for spare in SPARE_ALPHA_DEG)
    autopilot["steepest_alpha"] = radians(min(less, max(STEEPEST_ALPHA_DEG, more)))
    autopilot["max_healthy_rate"], autopilot["max_healthy_bank"] = (
        np.radians(MOST_DEG_S),
        radians(MOST_BANK_DEG),
    )
    for name in ("trim", "low", "high"):
        autopilot[f"{name}_power"] = control["power"]["config"][name]
    autopilot["allowed_power"] = control["power"]["config"]["high"]
    control["reference"]["config"]["steered"] = 1
    _set_up_level_flight_table(autopilot["holding"], control["layout"], declared)


def _gains(aircraft: Aircraft) -> dict[str, float]:
    """The gains; those of the airspeed slower by what the engine lags, which its loop has beside its own."""
    thrust = aircraft.engine.thrust
    slower = 1.0 + (thrust.lag_s if thrust and aircraft.airspeed_by == "power" else 0.0) / GAINS["airspeed_s"]
    return GAINS | {"speed": GAINS["speed"] / slower, "speed_i": GAINS["speed_i"] / slower**2}


def set_up_profile(autopilot: np.void, declared: Declared) -> None:
    """Fill in the legs; in flight too, where those that have been begun are the same as before."""
    for c, (name, unit) in enumerate(_UNIT.items()):
        legs = getattr(declared.autopilot, name)
        autopilot["n_legs"][c] = len(legs)
        for j, leg in enumerate(legs):
            autopilot["leg_starts_at_s"][c, j] = leg.at_s
            autopilot["leg_value"][c, j] = nan if leg.value is None else leg.value * unit
            autopilot["leg_max_command_rate"][c, j] = getattr(
                leg, "climb_mps", getattr(leg, "change_mps2", inf)
            )


def _set_up_aircraft_values(autopilot: np.void, declared: Declared) -> None:
    """What the loops take from the aircraft: thrust, roll by sideslip, slowest airspeed."""
    aircraft = declared.aircraft
    terms = {name: term.value for name, term in aircraft.terms.items()}
    mass_kg = aircraft.mass.mass_kg * declared.design_model.mass
    per_mass = aircraft.geometry.wing_area_m2 / mass_kg
    autopilot["thrust"] = per_mass * np.array([terms.get(THRUST_TERM, 0.0), terms.get("CX_adpt2", 0.0)])
    autopilot["pitch_holds_airspeed"] = aircraft.airspeed_by == "pitch"
    if aircraft.airspeed_by == "power" and THRUST_TERM not in terms:
        set_up_engine(autopilot["engine"], aircraft.engine.thrust, mass_kg)
    by_sideslip = terms.get("Cl_beta", 0.0) / terms.get("Cl_p", -1.0)
    autopilot["dihedral"] = max(by_sideslip, LEAST_DIHEDRAL) * 2.0 / aircraft.geometry.span_m
    autopilot["dpt_cubed_held_by_sideslip"] = inf
    if terms.get("Cn_dpt3"):
        beta = POWER_SIDESLIP_RAD
        held = terms.get("Cn_beta", 0.0) * beta + terms.get("Cn_beta3", 0.0) * beta**3
        autopilot["dpt_cubed_held_by_sideslip"] = max(held / abs(terms["Cn_dpt3"]), 0.0)
    slowest, fastest = aircraft.envelope.airspeed_mps
    autopilot["slowest_mps"] = slowest + min(SPARE_MPS, SPARE_SHARE * (fastest - slowest))


def _set_up_level_flight_table(holding: np.void, layout: np.void, declared: Declared) -> None:
    """The table of level flight, where the aircraft's file has forces and a flap for the elevator."""
    aircraft, flap = declared.aircraft, int(layout["stand_in"])
    holding["from_s"], holding["bank"], holding["fastest"] = -1.0, radians(MOST_BANK_DEG), inf
    if flap < 0 or not aircraft.forces or THRUST not in aircraft.signals:
        return
    speeds_mps = np.linspace(*aircraft.envelope.airspeed_mps, N_QDYN)
    holding["qdyn"] = 0.5 * SEA_LEVEL_DENSITY_KG_M3 * speeds_mps**2
    holding["flap"] = np.linspace(layout["low"][flap], layout["high"][flap], N_FLAP)
    surfaces = aircraft.surfaces[layout["main"][PITCH]], aircraft.surfaces[flap]
    model = declared.design_model
    mass_kg, scale = aircraft.mass.mass_kg * model.mass, tuple(model.coefficients.items())
    qdyn_pa, flap_rad = tuple(holding["qdyn"]), tuple(holding["flap"])
    needed = elevator_needed(aircraft, surfaces, mass_kg, scale, qdyn_pa, flap_rad)
    holding["has_table"], holding["elevator"] = bool(np.isfinite(needed).all()), needed
    holding["max_airspeed_rate_mps2"], holding["flap_reserve"] = (
        MAX_AIRSPEED_RATE_MPS2,
        radians(FLAP_RESERVE_DEG),
    )


@lru_cache(maxsize=32)
def elevator_needed(
    aircraft: Aircraft,
    surfaces: tuple[str, str],
    mass_kg: float,
    scale: tuple[tuple[str, float], ...],
    qdyn_pa: tuple[float, ...],
    flap_rad: tuple[float, ...],
) -> np.ndarray:
    """Deflection (n, m) rad for level flight at qdyn (n,) and flap (m,); not a number where there is none.

    surfaces: elevator and flap of this aircraft. scale: what the designer multiplies single terms by.
    """
    q, flap = (values.ravel() for values in np.meshgrid(qdyn_pa, flap_rad, indexing="ij"))
    load = mass_kg * GRAVITY_MPS2 / (q * aircraft.geometry.wing_area_m2)
    neutral = {factor: 0.0 for term in aircraft.terms.values() for factor in term.factors}
    ratio = dict(scale)

    def imbalance(unknown: np.ndarray) -> np.ndarray:
        alpha, thrust, elevator = unknown.T
        of = neutral | {"alpha": alpha, THRUST: thrust, surfaces[0]: elevator, surfaces[1]: flap}
        CX, CZ, Cm = (aircraft.coefficient(name, of, ratio) for name in ("CX", "CZ", "Cm"))
        return np.stack([CX - load * np.sin(alpha), CZ + load * np.cos(alpha), Cm], -1)

    unknown = np.tile(GUESS, (q.size, 1))
    unknown[:, 0] += PER_FLAP * flap
    for _ in range(ITERATIONS):
        slopes = [imbalance(unknown + 1j * STEP * e).imag / STEP for e in np.eye(3)]
        unknown = unknown - np.linalg.solve(np.stack(slopes, -1), imbalance(unknown)[..., None])[..., 0]
    solved = np.abs(imbalance(unknown)).max(axis=1) < CLOSE
    flyable = (np.abs(unknown[:, 0]) < STEEPEST_RAD) & (np.abs(unknown[:, 1]) < MOST_THRUST)
    return np.where(solved & flyable, unknown[:, 2], np.nan).reshape(len(qdyn_pa), len(flap_rad))
