"""Outer loops: altitude, airspeed, heading and bank by body rates and engine power.

The autopilot computes where each channel of the commanded profile should be now, from the legs of the
scenario, and body-rate references and an engine setting for that.

    altitude  gamma_c = (H_c' + K (H_c - H)) / V + M                              `path_angle_to_fly`
    pitch     theta_c' = K (theta_c - theta),  theta_c = gamma_c + alpha cos phi  `pitch_attitude_rate`
    airspeed  A = V_c' + K (V_c - V) + M + g (gamma_c - gamma_trim)               `set_power`
    gliding   gamma_c = gamma_trim - (V_c' + K (V_c - V) + M) / g                 `glide_path_angle`
    heading   phi_c = V / g (psi_c' + K (psi_c - psi) + M)                        `bank_to_turn`
    bank      phi_c' = K (phi_c - phi) + M                                        `bank_angle_rate`
    turn      psi' = g tan phi / V: coordinated [Etkin1996, sec. 7.6]             `set_body_rates`

    H, V           m, m/s    altitude; airspeed, smoothed
    gamma, alpha   rad       path angle; incidence, smoothed
    theta, phi     rad       pitch attitude, bank
    psi            rad       heading
    A, g           m/s2      acceleration along the path, by engine power; gravity
    K              1/s       gain of the loop
    M                        found missing: the integral of the loop's error, in the unit of the sum it is in

Every demand is limited, and what a limit cut off is not integrated. The limits on rates and bank shrink with
what the surfaces that are left can give; climb and descent are bounded by the power there is, so that the
airspeed is kept. Where the ailerons no longer act, the roll is flown by sideslip: rudder and dihedral.

The airspeed to fly is the commanded one, as far as it can be held (envelope_protection.py). The record is
filled by autopilot_setup.py; profile.py has the commands.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.control.allocation import attainable, remaining
from beaver_ftc.control.envelope_protection import HOLDING, limit_airspeed_to_fly
from beaver_ftc.control.power import ceiling
from beaver_ftc.control.profile import (
    ALTITUDE,
    BANK,
    HEADING,
    MAX_LEGS,
    N_CHANNELS,
    SPEED,
    advance_commands,
    clamp,
    wrap_to_half_turn,
)
from beaver_ftc.control.thrust import ENGINE, gained, look_up, power_for, thrust_per_inhg
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA
from beaver_ftc.diagnosis.state import PITCH, ROLL, YAW

# K of each loop, 1/s, and of its integral M, `_i`, 1/s2; smoothing, s; and what bounds the demands.
# Attitudes a fifth as fast as the inner loops, the path a quarter of that: gusts set the gains, not comfort.
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

AUTOPILOT = record(
    enabled=int, flying=int, dt=float,
    # profile: legs in SI and rad. A value that is not a number holds what is.
    n_legs=(int, N_CHANNELS), next_leg_index=(int, N_CHANNELS),
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
    # deviations: the mean of late and the largest, from what is commanded and, airspeed, from what is held;
    # `largest_deviation` is NOT_JUDGED until a channel is: of angles that takes SETTLED_S
    mean_deviation=N_CHANNELS, mean_deviation_from_airspeed_to_fly=float,
    largest_deviation_from_airspeed_to_fly=float, largest_deviation=N_CHANNELS,
    largest_instant_airspeed_deviation=float,  # m/s, of the airspeed from what is commanded, at one instant
)  # fmt: skip

MOST_PATH_RAD = 0.15
MOST_SIDESLIP_RAD = 0.14
LEAST_COS_BANK = 0.1  # where the turn rate divides: 84 deg, beyond any bank that is asked for
MOST_MISSING = 0.1  # largest M of the path angle, rad, and, times gravity, of the acceleration
MOST_DRIFT_RAD_S = 0.1  # largest M of the turn rate: a bank that is held without a turn
RECENT_AIRSPEED_S = 20.0  # time constant with which the recent airspeed is averaged
MAX_FROM_RECENT_MPS = 3.0  # power alone can hold an airspeed within so much of the recent one
CUT_INHG_S, RAISE_INHG_S = 8.0, 1.0  # about as fast as the engine follows; and slower than a gust lasts
BANK_LOST_WITH_ROLL, BANK_LOST_WITH_YAW = 0.5, 0.2  # shares of the bank limit without ailerons, rudder
KEPT_ASIDE = 0.15  # of the power's range at either end, for engines that alone yaw the aircraft
LOOP_GAIN_SHARE_BY_POWER = 0.25  # of the loops of bank and heading where engines alone yaw the aircraft
BY_POWER_S = 5.0  # time constant of the share of the time in which engines alone yaw the aircraft


@kernel
def steer(autopilot, control, u, measured, unexplained, t):
    """One frame, at t s: fill autopilot.rates (3,) rad/s, and the engine setting where an airspeed is
    commanded. control: the records of the law (control/state.py). u, unexplained: see
    `limit_airspeed_to_fly`. path, rolling, pitching: gamma_c rad; phi_c', theta_c' rad/s.
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
    change_allowed_power(autopilot, power, saturated[rudder], y)
    autopilot.full_power = highest_power(autopilot, power, surfaces.output.effectiveness[rudder], y)
    path = path_angle_to_fly(autopilot, measured, push)
    rolling = bank_angle_rate(autopilot, attitude)
    pitching = pitch_attitude_rate(autopilot, y, attitude, path)
    set_body_rates(autopilot, y, attitude, rolling, pitching)
    autopilot.sets_power = autopilot.is_commanded[SPEED] and not autopilot.pitch_holds_airspeed
    if autopilot.sets_power:
        set_power(autopilot, power, y, path, push)


@kernel
def take_over(autopilot, y, attitude):
    """In trim: smoothed signals and the engine as they are."""
    autopilot.flying = 1
    autopilot.alpha = y[ALPHA]
    autopilot.airspeed = autopilot.recent_airspeed_mps = y[AIRSPEED]
    autopilot.climb_in_trim = attitude[PITCH] - y[ALPHA]


def forget_losses(autopilot: np.void) -> None:
    """Forget which surfaces are gone, what that left missing, and which airspeeds can be held then: the law
    that takes over from an oracle is not told it."""
    for loss in ("roll_loss_share", "yaw_loss_share", "engines_alone_yaw_share"):
        autopilot[loss] = 0.0
    autopilot["missing_roll_rate"] = autopilot["missing_turn_rate"] = 0.0
    for held in ("n_averaged_frames", "limits_airspeed", "mean_acting_elevator", "mean_commanded_elevator"):
        autopilot["holding"][held] = 0


@kernel
def smooth_signals_and_losses(autopilot, layout, surfaces, saturated, engines_yaw, y):
    """Smooth what is noisy, and note whether the ailerons or the rudder are gone; ailerons at their stop give
    no more roll, whatever their estimated effectiveness. engines_yaw: whether engines can yaw the
    aircraft."""
    dt, gain = autopilot.dt, autopilot.gain
    least = surfaces.config.least_effectiveness
    effectiveness = surfaces.output.effectiveness
    autopilot.alpha += dt / gain.alpha_s * (y[ALPHA] - autopilot.alpha)
    autopilot.airspeed += dt / gain.airspeed_s * (y[AIRSPEED] - autopilot.airspeed)
    at_stop = saturated[layout.main[ROLL]] == 1
    gone = remaining(layout, effectiveness, ROLL) < least or at_stop
    autopilot.roll_loss_share += dt / gain.jammed_s * (gone - autopilot.roll_loss_share)
    free = remaining(layout, effectiveness, YAW) < least
    autopilot.yaw_loss_share += dt / gain.jammed_s * (free - autopilot.yaw_loss_share)
    if engines_yaw:
        by_power = free or saturated[layout.main[YAW]] == 1
        autopilot.engines_alone_yaw_share += dt / BY_POWER_S * (by_power - autopilot.engines_alone_yaw_share)


@kernel
def limit_rates_and_bank(autopilot, layout, G, hold, engine_authority):
    """Rates (rad/s) and bank (rad) that the surfaces left can give: their spare acceleration for a while.

        rate_i = min(max_healthy_rate_i, authority_s spare_i)
        spare_i = min(greatest_i - hold_i, hold_i - least_i)
        rate_roll >= roll_loss_share dihedral V MOST_SIDESLIP_RAD           by sideslip
        bank = min(max_healthy_bank (1 - less), bank_s rate_roll)           less: the greater share lost

    G (3, n): with the effectiveness of each in it; hold (3,) rad/s2; least, greatest, engine_authority: as in
    `allocation.attainable`.
    """
    rate, gain, rolls_less = autopilot.rate_limit, autopilot.gain, autopilot.roll_loss_share
    for i in range(3):
        least, greatest = attainable(G, layout, engine_authority, i)
        spare = max(min(greatest - hold[i], hold[i] - least), 0.0)
        rate[i] = min(autopilot.max_healthy_rate[i], spare * gain.authority_s)
    by_sideslip = rolls_less * autopilot.dihedral * autopilot.airspeed * MOST_SIDESLIP_RAD
    rate[ROLL] = max(rate[ROLL], by_sideslip)
    less = max(BANK_LOST_WITH_ROLL * rolls_less, BANK_LOST_WITH_YAW * autopilot.yaw_loss_share)
    steepest = autopilot.max_healthy_bank * (1.0 - less)
    autopilot.bank_limit = min(steepest, rate[ROLL] * gain.bank_s)


@kernel
def acceleration_per_power(autopilot, power, y):
    """Acceleration along the path per unit of power, m/s2, where no table has it; the table's are brought to
    this airspeed."""
    if autopilot.engine.settings:
        look_up(autopilot.engine, autopilot.airspeed)
        return 0.0
    return thrust_per_inhg(autopilot.thrust, autopilot.alpha, autopilot.airspeed, power, y)


@kernel
def change_allowed_power(autopilot, power, at_stop, y):
    """A rudder at its stop holds no more, whatever its estimate: reduce the power allowed until it comes
    off, and then raise it again. at_stop: whether it is there; y (n_y,)."""
    high = autopilot.high_power
    if at_stop:
        lowest = ceiling(power, y, autopilot.dpt_cubed_held_by_sideslip ** (1.0 / 3.0))
        cut = min(autopilot.allowed_power, power.output.command[0]) - CUT_INHG_S * autopilot.dt
        autopilot.allowed_power = min(max(cut, lowest), high)
    else:
        autopilot.allowed_power = min(autopilot.allowed_power + RAISE_INHG_S * autopilot.dt, high)


@kernel
def highest_power(autopilot, power, left, y):
    """The highest power with what is left of the rudder: the Beaver's propeller yaws with dpt^3.

    What the rudder lacks, sideslip makes up for. The slower, the less: a climb beyond it ends in slow flight.

        dpt^3 held = left highest_dpt^3 + (1 - left) dpt_cubed_held_by_sideslip

    left: effectiveness of the rudder; y (n_y,).
    """
    if left >= 1.0:
        return autopilot.allowed_power
    held = max(left, 0.0) * power.config.highest_dpt**3 + (1.0 - left) * autopilot.dpt_cubed_held_by_sideslip
    return min(autopilot.allowed_power, ceiling(power, y, held ** (1.0 / 3.0)))


@kernel
def path_angle_to_fly(autopilot, measured, push):
    """gamma_c, path angle to fly, rad; the one that is flown where no altitude is commanded.

        gamma_c = (H_c' + K (H_c - H)) / V + M,    M <- M + dt K_i (H_c - H) / V        unless limited

    M: missing_path_angle. push: as in thrust.py.
    """
    if autopilot.pitch_holds_airspeed and autopilot.is_commanded[SPEED]:
        return glide_path_angle(autopilot)
    if not autopilot.is_commanded[ALTITUDE]:
        return measured.attitude[PITCH] - autopilot.alpha
    V, gain, M = autopilot.airspeed, autopilot.gain, autopilot.missing_path_angle
    error = autopilot.command[ALTITUDE] - measured.altitude
    climb_mps = autopilot.command_rate[ALTITUDE] + gain.altitude * error
    wanted = climb_mps / V + M
    low, high = path_angle_limits(autopilot, push)
    path = min(max(wanted, low), high)
    if path == wanted:
        autopilot.missing_path_angle = clamp(M + autopilot.dt * gain.altitude_i * error / V, MOST_MISSING)
    return path


@kernel
def glide_path_angle(autopilot):
    """Path angle at which gravity brings the airspeed to where it is commanded, rad:

    gamma_c = gamma_trim - (V_c' + K (V_c - V) + M) / g,    M: missing_acceleration, m/s2
    """
    error = autopilot.airspeed_to_fly - autopilot.airspeed
    along = autopilot.airspeed_to_fly_rate + autopilot.missing_acceleration + autopilot.gain.speed * error
    steeper = along / autopilot.gravity
    limited = clamp(steeper, MOST_PATH_RAD)
    if limited == steeper:
        integrate_missing_acceleration(autopilot, error)
    return autopilot.climb_in_trim - limited


@kernel
def integrate_missing_acceleration(autopilot, error):
    """M <- M + dt K_i error: the acceleration, m/s2, that an airspeed takes in addition to the computed one;
    error m/s."""
    found = autopilot.missing_acceleration + autopilot.dt * autopilot.gain.speed_i * error
    autopilot.missing_acceleration = clamp(found, MOST_MISSING * autopilot.gravity)


@kernel
def path_angle_limits(autopilot, push):
    """The steepest descent and climb, rad: what the engine sustains, and what airspeed there is to spare.

        low = gamma_trim + gained(idle) / g - path_per_mps (fast - V)
        high = gamma_trim + gained(full) / g + path_per_mps (V - slow)

    slow, fast: the airspeeds, m/s, at which height no longer goes before airspeed; gained: thrust.py, m/s2.
    """
    gain = autopilot.gain
    slow = autopilot.slowest_mps
    fast, idle, full = np.inf, autopilot.trim_power, autopilot.trim_power
    if autopilot.is_commanded[SPEED]:
        slow = max(slow, autopilot.airspeed_to_fly - gain.spare_mps)
        fast = autopilot.airspeed_to_fly + gain.spare_mps
        idle, full = autopilot.low_power, max(autopilot.full_power, autopilot.low_power)
    trim, engine = autopilot.trim_power, autopilot.engine
    at_idle = autopilot.climb_in_trim + gained(engine, push, trim, idle) / autopilot.gravity
    at_full = autopilot.climb_in_trim + gained(engine, push, trim, full) / autopilot.gravity
    low = at_idle - gain.path_per_mps * (fast - autopilot.airspeed)
    high = at_full + gain.path_per_mps * (autopilot.airspeed - slow)
    return max(low, -MOST_PATH_RAD), clamp(high, MOST_PATH_RAD)


@kernel
def pitch_attitude_rate(autopilot, y, attitude, path):
    """theta_c' = K (theta_c - theta), the rate of the pitch attitude, rad/s: within its limit, and no more
    than `protection` times the incidence left below its limit. theta_c = path + alpha cos phi."""
    glides = autopilot.pitch_holds_airspeed and autopilot.is_commanded[SPEED]
    if not (autopilot.is_commanded[ALTITUDE] or glides):
        return 0.0
    wanted = path + autopilot.alpha * np.cos(attitude[ROLL]) - attitude[PITCH]
    rate = clamp(autopilot.gain.attitude * wanted, autopilot.rate_limit[PITCH])
    return min(rate, autopilot.gain.protection * (autopilot.steepest_alpha - y[ALPHA]))


@kernel
def bank_angle_rate(autopilot, attitude):
    """phi_c' = share K (phi_c - phi) + roll_loss M, the rate of the bank angle, rad/s; slower where engines
    alone yaw and roll. M: missing_roll_rate, rad/s, integrated as far as ailerons are lost."""
    gain, roll_loss = autopilot.gain, autopilot.roll_loss_share
    share = 1.0 - roll_loss * autopilot.engines_alone_yaw_share * (1.0 - LOOP_GAIN_SHARE_BY_POWER)
    if autopilot.is_commanded[HEADING]:
        bank = bank_to_turn(autopilot, share, attitude[YAW])
    elif autopilot.is_commanded[BANK]:
        bank = autopilot.command[BANK]
    else:
        return 0.0
    away = clamp(bank, autopilot.bank_limit) - attitude[ROLL]
    wanted = share * gain.bank * away + roll_loss * autopilot.missing_roll_rate
    rate = clamp(wanted, autopilot.rate_limit[ROLL])
    if rate == wanted:
        autopilot.missing_roll_rate += roll_loss * autopilot.dt * share * gain.bank_i * away
    return rate


@kernel
def bank_to_turn(autopilot, share, heading):
    """phi_c = V / g (psi_c' + share left K (psi_c - psi) + M), rad: bank of the coordinated turn to the
    commanded heading. Where nothing acts in yaw, the loop is slower (left), and integrates what it misses: M,
    missing_turn_rate, rad/s."""
    gain, yaw_loss = autopilot.gain, autopilot.yaw_loss_share
    error = wrap_to_half_turn(autopilot.command[HEADING] - heading)
    left = 1.0 - yaw_loss * (1.0 - gain.loose)
    found = autopilot.missing_turn_rate + autopilot.dt * yaw_loss * gain.heading_i * error
    autopilot.missing_turn_rate = yaw_loss * clamp(found, MOST_DRIFT_RAD_S)
    turning = share * left * gain.heading * error + autopilot.command_rate[HEADING]
    return autopilot.airspeed / autopilot.gravity * (turning + autopilot.missing_turn_rate)


@kernel
def set_body_rates(autopilot, y, attitude, rolling, pitching):
    """Body rates (p, q, r), rad/s, of the rates of bank and pitch attitude in a coordinated turn:

        p = phi' - psi' sin theta,    q = theta' cos phi + psi' cos theta sin phi
        r = psi' cos theta cos phi - theta' sin phi + K (beta - beta_c),    psi' = g tan phi / V

    beta_c, rad: the sideslip that rolls the aircraft as far as ailerons are lost, -phi' / (dihedral V).
    Without a commanded turn psi' and r are 0. rolling, pitching: phi', theta', rad/s.
    """
    rates = autopilot.rates
    sin_roll, cos_roll = np.sin(attitude[ROLL]), np.cos(attitude[ROLL])
    sin_pitch, cos_pitch = np.sin(attitude[PITCH]), np.cos(attitude[PITCH])
    lateral = autopilot.is_commanded[HEADING] or autopilot.is_commanded[BANK]
    turning = 0.0
    if lateral:
        turning = autopilot.gravity / autopilot.airspeed * sin_roll / max(cos_roll, LEAST_COS_BANK)
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
    """Set the power that gives the acceleration along the path

        A = V_c' + K (V_c - V) + M + g (gamma_c - gamma_trim),    m/s2

    V_c: airspeed_to_fly; M: missing_acceleration, integrated unless the power is limited. While power stands
    in for a lost pitch, K is 0 and power_airspeed is set: the law of power.py has an airspeed loop of its
    own. path: gamma_c, rad.
    """
    V, fly = autopilot.airspeed, autopilot.airspeed_to_fly
    error = fly - V
    autopilot.recent_airspeed_mps += autopilot.dt / RECENT_AIRSPEED_S * (V - autopilot.recent_airspeed_mps)
    recent = autopilot.recent_airspeed_mps
    along = autopilot.airspeed_to_fly_rate + autopilot.missing_acceleration
    if power.memory.engaged:
        autopilot.power_airspeed = recent + clamp(fly - recent, MAX_FROM_RECENT_MPS)
        error = autopilot.power_airspeed - V
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
