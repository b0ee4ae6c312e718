"""Outer loops: altitude, airspeed, heading and bank by body rates and engine power.

The autopilot computes where each channel of the commanded profile should be now, from the legs of the
scenario (profile.py). From this it computes body-rate references, which the law follows, and an engine
setting:

    what the aircraft has lost, and what it can do      this file
    the airspeed to fly, as far as it can be held       envelope_protection.py
    path angle, pitch attitude and engine power         vertical_loops.py
    heading and bank                                    lateral_loops.py
    the rates of bank and pitch as body rates           this file

    H, V           m, m/s    altitude; airspeed, smoothed
    gamma, alpha   rad       path angle; angle of attack, smoothed
    theta, phi     rad       pitch attitude, bank
    psi            rad       heading
    g              m/s2      gravity
    K, K_i         1/s, 1/s2 gain of the loop; gain of its integral
    M                        integral of the loop's error (`missing_...`), in the unit of the sum it is in
    ..._c, '                 commanded; rate of change

Each demand is limited. While a limit cuts a demand off, its error is not integrated. The limits on rates and
bank shrink with the remaining authority of the surfaces. Where the ailerons no longer act, the roll is flown
by sideslip: rudder and dihedral.

    ap         record AUTOPILOT; autopilot_setup.py has and fills it
    y          measured signals (design/table.py)
    attitude   (3,) rad, roll, pitch and yaw angle
"""

import numpy as np

from beaver_ftc.aircraft import PITCH, ROLL, YAW
from beaver_ftc.compiled import kernel
from beaver_ftc.control.authority import attainable, remaining
from beaver_ftc.control.envelope_protection import limit_airspeed_to_fly
from beaver_ftc.control.lateral_loops import bank_angle_rate
from beaver_ftc.control.profile import BANK, HEADING, SPEED, advance_commands, clamp
from beaver_ftc.control.vertical_loops import (
    acceleration_per_power,
    path_angle_to_fly,
    pitch_attitude_rate,
    set_highest_power,
    set_power,
)
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA

MOST_SIDESLIP_RAD = 0.14  # largest sideslip to demand, in order to roll by it
LEAST_COS_BANK = 0.1  # least divisor of the turn rate: 84 deg, beyond any bank that is demanded
BANK_LOST_WITH_ROLL, BANK_LOST_WITH_YAW = 0.5, 0.2  # shares of the bank limit lost without ailerons, rudder
RECENT_AIRSPEED_S = 20.0  # time constant with which the recent airspeed is averaged
BY_POWER_S = 5.0  # time constant of the share of the time in which engines alone yaw the aircraft


@kernel
def steer(ap, control, u, measured, unexplained, t):
    """One frame, at t s: fill ap.rates (3,) rad/s, and the engine setting where an airspeed is commanded and
    power holds it.

    control: the records of the law (control/state.py). u, unexplained: see `limit_airspeed_to_fly`. path:
    gamma_c, rad; rolling, pitching: phi_c', theta_c', rad/s. The order matters: each step reads the limits of
    the steps before.
    """
    layout = control.layout
    surfaces = control.surfaces
    saturated = control.allocation.output.saturated
    axes = control.axes
    power = control.power
    by_engines = control.engines.output.authority
    y = measured.y
    attitude = measured.attitude
    rudder = layout.main[YAW]
    if not ap.flying:
        take_over(ap, y, attitude)
    advance_commands(ap, (measured.altitude, y[AIRSPEED], attitude[YAW], attitude[ROLL]), t)
    ap.sets_power = ap.is_commanded[SPEED] and not ap.pitch_holds_airspeed
    smooth_signals_and_losses(ap, layout, surfaces, saturated, by_engines[1, YAW] > 0.0, y)
    limit_rates_and_bank(ap, layout, axes.G, axes.hold, by_engines)
    limit_airspeed_to_fly(ap, layout, surfaces, u, unexplained, y, t)
    push = acceleration_per_power(ap, power, y)
    set_highest_power(ap, power, saturated[rudder], surfaces.output.effectiveness[rudder], y)
    path = path_angle_to_fly(ap, measured, push)
    rolling = bank_angle_rate(ap, attitude)
    pitching = pitch_attitude_rate(ap, y, attitude, path)
    set_body_rates(ap, y, attitude, rolling, pitching)
    if ap.sets_power:
        set_power(ap, power, y, path, push)


@kernel
def take_over(ap, y, attitude):
    """Take over in trim: the smoothed signals begin as measured, and the path angle is gamma_trim."""
    ap.flying = 1
    ap.alpha = y[ALPHA]
    ap.airspeed = ap.recent_airspeed_mps = y[AIRSPEED]
    ap.climb_in_trim = attitude[PITCH] - y[ALPHA]


def forget_losses(autopilot: np.void) -> None:
    """Forget which surfaces are lost, the integrals that follow from the losses, and the airspeeds that can
    be held with them: a law that takes over from an oracle must not receive the truth."""
    for share in ("roll_loss_share", "yaw_loss_share", "engine_yaw_share"):
        autopilot[share] = 0.0
    autopilot["missing_roll_rate"] = autopilot["missing_turn_rate"] = 0.0
    for field in ("n_averaged_frames", "limits_airspeed", "mean_acting_elevator", "mean_commanded_elevator"):
        autopilot["holding"][field] = 0


@kernel
def smooth_signals_and_losses(ap, layout, surfaces, saturated, engines_yaw, y):
    """Smooth angle of attack and airspeed, and the shares of roll and yaw that are lost:

        x <- x + dt / tau (signal - x)

        x                          signal                                               tau, s
        alpha, airspeed            y                                                    alpha_s, airspeed_s
        recent_airspeed_mps        airspeed, while power holds it                       RECENT_AIRSPEED_S
        roll_loss_share            1 if less than `least` of roll remains, or the       jammed_s
                                   main surface of roll is at its stop
        yaw_loss_share             1 if less than `least` of yaw remains                jammed_s
        engine_yaw_share           1 if yaw is lost or its main surface at its stop     BY_POWER_S

    At its stop a surface gives no more, whatever its estimated effectiveness. engines_yaw: whether engines
    can yaw the aircraft; the last share stays if not.
    """
    dt = ap.dt
    gain = ap.gain
    main = layout.main
    effectiveness = surfaces.output.effectiveness
    least = surfaces.config.least_effectiveness
    ap.alpha += dt / gain.alpha_s * (y[ALPHA] - ap.alpha)
    ap.airspeed += dt / gain.airspeed_s * (y[AIRSPEED] - ap.airspeed)
    if ap.sets_power:
        ap.recent_airspeed_mps += dt / RECENT_AIRSPEED_S * (ap.airspeed - ap.recent_airspeed_mps)
    roll_lost = remaining(layout, effectiveness, ROLL) < least or saturated[main[ROLL]] == 1
    ap.roll_loss_share += dt / gain.jammed_s * (roll_lost - ap.roll_loss_share)
    yaw_lost = remaining(layout, effectiveness, YAW) < least
    ap.yaw_loss_share += dt / gain.jammed_s * (yaw_lost - ap.yaw_loss_share)
    if engines_yaw:
        by_power = yaw_lost or saturated[main[YAW]] == 1
        ap.engine_yaw_share += dt / BY_POWER_S * (by_power - ap.engine_yaw_share)


@kernel
def limit_rates_and_bank(ap, layout, G, hold, by_engines):
    """Limit the rates (rad/s) and the bank (rad) to those that the spare acceleration of the surfaces can
    reach, and end, within a time:

        rate_i = min(max_healthy_rate_i, authority_s spare_i)
        spare_i = max(min(greatest_i - hold_i, hold_i - least_i), 0)
        rate_roll >= roll_loss_share dihedral V MOST_SIDESLIP_RAD           by sideslip
        bank = min(max_healthy_bank (1 - lost), bank_s rate_roll)
        lost = max(BANK_LOST_WITH_ROLL roll_loss_share, BANK_LOST_WITH_YAW yaw_loss_share)

    G (3, n): with the effectiveness of each in it; hold (3,) rad/s2; least, greatest, by_engines: as in
    `authority.attainable`.
    """
    rate = ap.rate_limit
    gain = ap.gain
    roll_loss = ap.roll_loss_share
    for i in range(3):
        least, greatest = attainable(G, layout, by_engines, i)
        spare = max(min(greatest - hold[i], hold[i] - least), 0.0)
        rate[i] = min(ap.max_healthy_rate[i], spare * gain.authority_s)
    rate[ROLL] = max(rate[ROLL], roll_loss * ap.dihedral * ap.airspeed * MOST_SIDESLIP_RAD)
    lost = max(BANK_LOST_WITH_ROLL * roll_loss, BANK_LOST_WITH_YAW * ap.yaw_loss_share)
    ap.bank_limit = min(ap.max_healthy_bank * (1.0 - lost), rate[ROLL] * gain.bank_s)


@kernel
def set_body_rates(ap, y, attitude, rolling, pitching):
    """Fill the body rates (p, q, r), rad/s, of the rates of bank and pitch attitude phi', theta' (rolling,
    pitching), rad/s, in a coordinated turn [Etkin1996, sec. 7.6]:

        p = phi' - psi' sin theta,    q = theta' cos phi + psi' cos theta sin phi
        r = psi' cos theta cos phi - theta' sin phi + K (beta - beta_c),    psi' = g tan phi / V

    beta_c, rad: -roll_loss_share phi' / (dihedral V), the sideslip that rolls the aircraft as far as ailerons
    are lost; phi' / (dihedral V) within MOST_SIDESLIP_RAD. If neither heading nor bank is commanded, psi' and
    r are 0. r stays within its limit.
    """
    sin_roll = np.sin(attitude[ROLL])
    cos_roll = np.cos(attitude[ROLL])
    sin_pitch = np.sin(attitude[PITCH])
    cos_pitch = np.cos(attitude[PITCH])
    turning = 0.0
    yawing = 0.0
    if ap.is_commanded[HEADING] or ap.is_commanded[BANK]:
        turning = ap.gravity / ap.airspeed * sin_roll / max(cos_roll, LEAST_COS_BANK)
        sideslip = -rolling / (ap.dihedral * ap.airspeed)
        beta_c = ap.roll_loss_share * clamp(sideslip, MOST_SIDESLIP_RAD)
        yawing = turning * cos_pitch * cos_roll - pitching * sin_roll + ap.gain.sideslip * (y[BETA] - beta_c)
    ap.rates[ROLL] = rolling - turning * sin_pitch
    ap.rates[PITCH] = pitching * cos_roll + turning * cos_pitch * sin_roll
    ap.rates[YAW] = clamp(yawing, ap.rate_limit[YAW])
