"""Outer loops: altitude, airspeed, heading and bank by body rates and engine power.

The autopilot computes where each channel of the commanded profile should be now, from the legs of the
scenario. From this it computes body-rate references, which the law follows, and an engine setting.

    altitude  gamma_c = (H_c' + K (H_c - H)) / V + M                              `path_angle_to_fly`
    pitch     theta_c' = K (theta_c - theta),  theta_c = gamma_c + alpha cos phi  `pitch_attitude_rate`
    airspeed  A = V_c' + K (V_c - V) + M + g (gamma_c - gamma_trim)               `set_power`
    gliding   gamma_c = gamma_trim - (V_c' + K (V_c - V) + M) / g                 `glide_path_angle`
    heading   phi_c = V / g (psi_c' + K (psi_c - psi) + M)                        `bank_to_turn`
    bank      phi_c' = K (phi_c - phi) + M                                        `bank_angle_rate`
    turn      psi' = g tan phi / V: coordinated [Etkin1996, sec. 7.6]             `set_body_rates`

    H, V           m, m/s    altitude; airspeed, smoothed
    gamma, alpha   rad       path angle; angle of attack, smoothed
    theta, phi     rad       pitch attitude, bank
    psi            rad       heading
    A, g           m/s2      acceleration along the path, by engine power; gravity
    K, K_i         1/s, 1/s2 gain of the loop; gain of its integral
    M                        integral of the loop's error (`missing_...`), in the unit of the sum it is in
    ..._c, '                 commanded; rate of change

Each demand is limited. While a limit cuts a demand off, its error is not integrated. The limits on rates and
bank shrink with the remaining authority of the surfaces. The power that there is bounds climb and descent, so
that the airspeed is kept. Where the ailerons no longer act, the roll is flown by sideslip: rudder and
dihedral.

The airspeed to fly is the commanded one, as far as it can be held (envelope_protection.py).
autopilot_setup.py has the record and fills it; profile.py has the commands.

    power      setting of the engine, in its own unit (inHg of a piston engine)
    push       acceleration along the path per unit of power, m/s2 (thrust.py)
    y          measured signals (design/table.py)
    attitude   (3,) rad, roll, pitch and yaw angle
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.control.authority import attainable, remaining
from beaver_ftc.control.envelope_protection import limit_airspeed_to_fly
from beaver_ftc.control.power import ceiling
from beaver_ftc.control.profile import (
    ALTITUDE,
    BANK,
    HEADING,
    SPEED,
    advance_commands,
    clamp,
)
from beaver_ftc.control.thrust import gained, look_up, power_for, thrust_per_inhg
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA
from beaver_ftc.diagnosis.state import PITCH, ROLL, YAW
from beaver_ftc.plant.instruments import wrapped

MOST_PATH_RAD = 0.15  # steepest climb or descent to demand
MOST_SIDESLIP_RAD = 0.14  # largest sideslip to demand, in order to roll by it
LEAST_COS_BANK = 0.1  # least divisor of the turn rate: 84 deg, beyond any bank that is demanded
MOST_MISSING = 0.1  # largest M of the path angle, rad, and, times gravity, of the acceleration
MOST_DRIFT_RAD_S = 0.1  # largest M of the turn rate: a bank that is held without a turn
RECENT_AIRSPEED_S = 20.0  # time constant with which the recent airspeed is averaged
MAX_FROM_RECENT_MPS = 3.0  # power alone can hold an airspeed within this distance of the recent one
# Rates at which the allowed power falls, about as fast as the engine follows, and rises, slower than a gust
# lasts.
CUT_INHG_S, RAISE_INHG_S = 8.0, 1.0
BANK_LOST_WITH_ROLL, BANK_LOST_WITH_YAW = 0.5, 0.2  # shares of the bank limit lost without ailerons, rudder
KEPT_ASIDE = 0.15  # share of the power's range, at either end, for engines that alone yaw the aircraft
LOOP_GAIN_SHARE_BY_POWER = 0.25  # factor on the bank and heading loops where engines alone yaw the aircraft
BY_POWER_S = 5.0  # time constant of the share of the time in which engines alone yaw the aircraft


@kernel
def steer(autopilot, control, u, measured, unexplained, t):
    """One frame, at t s: fill autopilot.rates (3,) rad/s, and the engine setting where an airspeed is
    commanded and power holds it.

    control: the records of the law (control/state.py). u, unexplained: see `limit_airspeed_to_fly`. path:
    gamma_c, rad; rolling, pitching: phi_c', theta_c', rad/s. The order matters: each step reads the limits of
    the steps before.
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
    """Take over in trim: the smoothed signals begin as measured, and the path angle is gamma_trim."""
    autopilot.flying = 1
    autopilot.alpha = y[ALPHA]
    autopilot.airspeed = autopilot.recent_airspeed_mps = y[AIRSPEED]
    autopilot.climb_in_trim = attitude[PITCH] - y[ALPHA]


def forget_losses(autopilot: np.void) -> None:
    """Forget which surfaces are lost, the integrals that follow from the losses, and the airspeeds that can
    be held with them: a law that takes over from an oracle must not receive the truth."""
    for share in ("roll_loss_share", "yaw_loss_share", "engines_alone_yaw_share"):
        autopilot[share] = 0.0
    autopilot["missing_roll_rate"] = autopilot["missing_turn_rate"] = 0.0
    for field in ("n_averaged_frames", "limits_airspeed", "mean_acting_elevator", "mean_commanded_elevator"):
        autopilot["holding"][field] = 0


@kernel
def smooth_signals_and_losses(autopilot, layout, surfaces, saturated, engines_yaw, y):
    """Smooth angle of attack and airspeed, and the shares of roll and yaw that are lost:

        x <- x + dt / tau (signal - x)

        x                          signal                                               tau, s
        alpha, airspeed            y                                                    alpha_s, airspeed_s
        roll_loss_share            1 if less than `least` of roll remains, or the       jammed_s
                                   main surface of roll is at its stop
        yaw_loss_share             1 if less than `least` of yaw remains                jammed_s
        engines_alone_yaw_share    1 if yaw is lost or its main surface at its stop     BY_POWER_S

    At its stop a surface gives no more, whatever its estimated effectiveness. engines_yaw: whether engines
    can yaw the aircraft; the last share stays if not.
    """
    dt, gain = autopilot.dt, autopilot.gain
    least = surfaces.config.least_effectiveness
    effectiveness = surfaces.output.effectiveness
    autopilot.alpha += dt / gain.alpha_s * (y[ALPHA] - autopilot.alpha)
    autopilot.airspeed += dt / gain.airspeed_s * (y[AIRSPEED] - autopilot.airspeed)
    at_stop = saturated[layout.main[ROLL]] == 1
    roll_lost = remaining(layout, effectiveness, ROLL) < least or at_stop
    autopilot.roll_loss_share += dt / gain.jammed_s * (roll_lost - autopilot.roll_loss_share)
    yaw_lost = remaining(layout, effectiveness, YAW) < least
    autopilot.yaw_loss_share += dt / gain.jammed_s * (yaw_lost - autopilot.yaw_loss_share)
    if engines_yaw:
        by_power = yaw_lost or saturated[layout.main[YAW]] == 1
        autopilot.engines_alone_yaw_share += dt / BY_POWER_S * (by_power - autopilot.engines_alone_yaw_share)


@kernel
def limit_rates_and_bank(autopilot, layout, G, hold, engine_authority):
    """Limit the rates (rad/s) and the bank (rad) to those that the spare acceleration of the surfaces can
    reach, and end, within a time:

        rate_i = min(max_healthy_rate_i, authority_s spare_i)
        spare_i = max(min(greatest_i - hold_i, hold_i - least_i), 0)
        rate_roll >= roll_loss_share dihedral V MOST_SIDESLIP_RAD           by sideslip
        bank = min(max_healthy_bank (1 - lost), bank_s rate_roll)
        lost = max(BANK_LOST_WITH_ROLL roll_loss_share, BANK_LOST_WITH_YAW yaw_loss_share)

    G (3, n): with the effectiveness of each in it; hold (3,) rad/s2; least, greatest, engine_authority: as in
    `authority.attainable`.
    """
    rate, gain, roll_loss = autopilot.rate_limit, autopilot.gain, autopilot.roll_loss_share
    for i in range(3):
        least, greatest = attainable(G, layout, engine_authority, i)
        spare = max(min(greatest - hold[i], hold[i] - least), 0.0)
        rate[i] = min(autopilot.max_healthy_rate[i], spare * gain.authority_s)
    by_sideslip = roll_loss * autopilot.dihedral * autopilot.airspeed * MOST_SIDESLIP_RAD
    rate[ROLL] = max(rate[ROLL], by_sideslip)
    lost = max(BANK_LOST_WITH_ROLL * roll_loss, BANK_LOST_WITH_YAW * autopilot.yaw_loss_share)
    steepest = autopilot.max_healthy_bank * (1.0 - lost)
    autopilot.bank_limit = min(steepest, rate[ROLL] * gain.bank_s)


@kernel
def acceleration_per_power(autopilot, power, y):
    """The push, m/s2 per unit of power. An engine with a table of thrust needs none: its table is brought to
    this airspeed, and the push is 0."""
    if autopilot.engine.settings:
        look_up(autopilot.engine, autopilot.airspeed)
        return 0.0
    return thrust_per_inhg(autopilot.thrust, autopilot.alpha, autopilot.airspeed, power, y)


@kernel
def change_allowed_power(autopilot, power, at_stop, y):
    """Reduce the allowed power, by CUT_INHG_S from the present one, while the rudder is at its stop
    (at_stop): it can hold no more yawing moment of the propeller then, whatever its estimated effectiveness.
    Then raise it again, by RAISE_INHG_S. It never falls below the power whose yawing moment sideslip alone
    holds, nor rises above high_power."""
    high = autopilot.high_power
    if at_stop:
        lowest = ceiling(power, y, autopilot.dpt_cubed_held_by_sideslip ** (1.0 / 3.0))
        cut = min(autopilot.allowed_power, power.output.command[0]) - CUT_INHG_S * autopilot.dt
        autopilot.allowed_power = min(max(cut, lowest), high)
    else:
        autopilot.allowed_power = min(autopilot.allowed_power + RAISE_INHG_S * autopilot.dt, high)


@kernel
def highest_power(autopilot, power, E, y):
    """The highest setting with the remaining effectiveness `E` of the rudder, at most the allowed power: the
    propeller of the Beaver yaws the aircraft with dpt^3, and what the rudder lacks, sideslip makes up for.

        dpt^3 held = E highest_dpt^3 + (1 - E) dpt_cubed_held_by_sideslip

    The slower the flight, the lower is this power. A climb with more power would end in slow flight.
    """
    if E >= 1.0:
        return autopilot.allowed_power
    dpt3_held = max(E, 0.0) * power.config.highest_dpt**3 + (1.0 - E) * autopilot.dpt_cubed_held_by_sideslip
    return min(autopilot.allowed_power, ceiling(power, y, dpt3_held ** (1.0 / 3.0)))


@kernel
def path_angle_to_fly(autopilot, measured, push):
    """gamma_c, path angle to fly, rad. Where no altitude is commanded, it is the present one.

        gamma_c = (H_c' + K (H_c - H)) / V + M,    M <- M + dt K_i (H_c - H) / V        unless limited

    M: missing_path_angle. Where pitch holds the airspeed: see `glide_path_angle`.
    """
    if autopilot.pitch_holds_airspeed and autopilot.is_commanded[SPEED]:
        return glide_path_angle(autopilot)
    if not autopilot.is_commanded[ALTITUDE]:
        return measured.attitude[PITCH] - autopilot.alpha
    V, gain, M = autopilot.airspeed, autopilot.gain, autopilot.missing_path_angle
    error = autopilot.command[ALTITUDE] - measured.altitude
    climb_mps = autopilot.command_rate[ALTITUDE] + gain.altitude * error
    demand = climb_mps / V + M
    low, high = path_angle_limits(autopilot, push)
    path = min(max(demand, low), high)
    if path == demand:
        autopilot.missing_path_angle = clamp(M + autopilot.dt * gain.altitude_i * error / V, MOST_MISSING)
    return path


@kernel
def glide_path_angle(autopilot):
    """Path angle at which gravity brings the airspeed to where it is commanded, rad, within MOST_PATH_RAD of
    gamma_trim:

    gamma_c = gamma_trim - (V_c' + K (V_c - V) + M) / g,    M: missing_acceleration, m/s2
    """
    error = autopilot.airspeed_to_fly - autopilot.airspeed
    along = autopilot.airspeed_to_fly_rate + autopilot.missing_acceleration + autopilot.gain.speed * error
    demand = along / autopilot.gravity
    limited = clamp(demand, MOST_PATH_RAD)
    if limited == demand:
        integrate_missing_acceleration(autopilot, error)
    return autopilot.climb_in_trim - limited


@kernel
def integrate_missing_acceleration(autopilot, error):
    """M <- M + dt K_i error, within +- MOST_MISSING g: the acceleration, m/s2, that an airspeed takes in
    addition to the computed one; error m/s."""
    missing = autopilot.missing_acceleration + autopilot.dt * autopilot.gain.speed_i * error
    autopilot.missing_acceleration = clamp(missing, MOST_MISSING * autopilot.gravity)


@kernel
def path_angle_limits(autopilot, push):
    """The steepest descent and climb, rad: those that the engine sustains, and a share for the airspeed that
    there is to spare:

        low = gamma_trim + gained(idle) / g - path_per_mps (fast - V)       at least -MOST_PATH_RAD
        high = gamma_trim + gained(full) / g + path_per_mps (V - slow)      within +- MOST_PATH_RAD

    slow, fast: the airspeeds, m/s, at which nothing is to spare: spare_mps below and above the airspeed to
    fly, and slow at least slowest_mps. Without a commanded airspeed the engine stays as trimmed, slow is
    slowest_mps, and low is -MOST_PATH_RAD. gained: thrust.py, m/s2.
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
    """theta_c' = K (theta_c - theta), the rate of the pitch attitude, rad/s, with theta_c = path + alpha cos
    phi: within its limit, and at most `protection` times (steepest_alpha - angle of attack). 0 if neither an
    altitude nor a glide is flown."""
    glides = autopilot.pitch_holds_airspeed and autopilot.is_commanded[SPEED]
    if not (autopilot.is_commanded[ALTITUDE] or glides):
        return 0.0
    demand = path + autopilot.alpha * np.cos(attitude[ROLL]) - attitude[PITCH]
    rate = clamp(autopilot.gain.attitude * demand, autopilot.rate_limit[PITCH])
    return min(rate, autopilot.gain.protection * (autopilot.steepest_alpha - y[ALPHA]))


@kernel
def bank_angle_rate(autopilot, attitude):
    """phi_c' = share K (phi_c - phi) + roll_loss M, the rate of the bank angle, rad/s:

        share = 1 - roll_loss engines_alone_yaw_share (1 - LOOP_GAIN_SHARE_BY_POWER)
        M <- M + roll_loss dt share K_i (phi_c - phi)        unless limited

    The loop is slower where engines alone yaw and roll the aircraft. phi_c is within bank_limit; M:
    missing_roll_rate, rad/s.
    """
    gain, roll_loss = autopilot.gain, autopilot.roll_loss_share
    share = 1.0 - roll_loss * autopilot.engines_alone_yaw_share * (1.0 - LOOP_GAIN_SHARE_BY_POWER)
    if autopilot.is_commanded[HEADING]:
        bank = bank_to_turn(autopilot, share, attitude[YAW])
    elif autopilot.is_commanded[BANK]:
        bank = autopilot.command[BANK]
    else:
        return 0.0
    error = clamp(bank, autopilot.bank_limit) - attitude[ROLL]
    demand = share * gain.bank * error + roll_loss * autopilot.missing_roll_rate
    rate = clamp(demand, autopilot.rate_limit[ROLL])
    if rate == demand:
        autopilot.missing_roll_rate += roll_loss * autopilot.dt * share * gain.bank_i * error
    return rate


@kernel
def bank_to_turn(autopilot, share, heading):
    """phi_c = V / g (psi_c' + share loose K (psi_c - psi) + M), rad: bank of the coordinated turn to the
    commanded heading.

        loose = 1 - yaw_loss (1 - gain.loose)
        M <- yaw_loss (M + dt yaw_loss K_i (psi_c - psi))        M, missing_turn_rate, within MOST_DRIFT_RAD_S

    So where nothing acts in yaw, the loop is slower, and integrates its error.
    """
    gain, yaw_loss = autopilot.gain, autopilot.yaw_loss_share
    error = wrapped(autopilot.command[HEADING] - heading)
    loose = 1.0 - yaw_loss * (1.0 - gain.loose)
    missing = autopilot.missing_turn_rate + autopilot.dt * yaw_loss * gain.heading_i * error
    autopilot.missing_turn_rate = yaw_loss * clamp(missing, MOST_DRIFT_RAD_S)
    turning = share * loose * gain.heading * error + autopilot.command_rate[HEADING]
    return autopilot.airspeed / autopilot.gravity * (turning + autopilot.missing_turn_rate)


@kernel
def set_body_rates(autopilot, y, attitude, rolling, pitching):
    """Body rates (p, q, r), rad/s, of the rates of bank and pitch attitude in a coordinated turn:

        p = phi' - psi' sin theta,    q = theta' cos phi + psi' cos theta sin phi
        r = psi' cos theta cos phi - theta' sin phi + K (beta - beta_c),    psi' = g tan phi / V

    beta_c, rad: -roll_loss_share phi' / (dihedral V), the sideslip that rolls the aircraft as far as ailerons
    are lost; phi' / (dihedral V) within MOST_SIDESLIP_RAD. If neither heading nor bank is commanded, psi' and
    r are 0. r stays within its limit. rolling, pitching: phi', theta', rad/s.
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
        beta_c = autopilot.roll_loss_share * clamp(sideslip, MOST_SIDESLIP_RAD)
        damping = autopilot.gain.sideslip * (y[BETA] - beta_c)
        rates[YAW] = turning * cos_pitch * cos_roll - pitching * sin_roll + damping
    rates[YAW] = clamp(rates[YAW], autopilot.rate_limit[YAW])


@kernel
def set_power(autopilot, power, y, path, push):
    """Set the power that gives the acceleration along the path

        A = V_c' + K (V_c - V) + M + g (gamma_c - gamma_trim),    m/s2

    V_c: airspeed_to_fly; M: missing_acceleration, integrated unless the power is limited. While power stands
    in for a lost pitch, K is 0 and power_airspeed is set: the law of power.py has an airspeed loop of its
    own, which can hold V_c within MAX_FROM_RECENT_MPS of the recent airspeed. At either end of the range, a
    room is kept for engines that alone yaw the aircraft; the upper end is full_power, or `ceiling` if it is
    lower. path: gamma_c, rad.
    """
    V, V_c = autopilot.airspeed, autopilot.airspeed_to_fly
    error = V_c - V
    autopilot.recent_airspeed_mps += autopilot.dt / RECENT_AIRSPEED_S * (V - autopilot.recent_airspeed_mps)
    recent = autopilot.recent_airspeed_mps
    along = autopilot.airspeed_to_fly_rate + autopilot.missing_acceleration
    if power.memory.engaged:
        autopilot.power_airspeed = recent + clamp(V_c - recent, MAX_FROM_RECENT_MPS)
        error = autopilot.power_airspeed - V
    else:
        along += autopilot.gain.speed * error
    climbing = autopilot.gravity * (path - autopilot.climb_in_trim)
    demand = power_for(autopilot.engine, push, autopilot.trim_power, along + climbing)
    high = min(autopilot.full_power, ceiling(power, y, power.config.highest_dpt))
    room = KEPT_ASIDE * autopilot.engines_alone_yaw_share * (autopilot.high_power - autopilot.low_power)
    limited = max(min(demand, high - room), autopilot.low_power + room)
    if limited == demand:
        integrate_missing_acceleration(autopilot, error)
    autopilot.power_setting = limited
