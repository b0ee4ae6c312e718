"""The autopilot's loops of altitude, pitch attitude and airspeed: path angle, pitch rate and engine power.

    altitude  gamma_c = (H_c' + K (H_c - H)) / V + M                              `path_angle_to_fly`
    pitch     theta_c' = K (theta_c - theta),  theta_c = gamma_c + alpha cos phi  `pitch_attitude_rate`
    airspeed  A = V_c' + K (V_c - V) + M + g (gamma_c - gamma_trim)               `set_power`
    gliding   gamma_c = gamma_trim - (V_c' + K (V_c - V) + M) / g                 `glide_path_angle`

V_c is the airspeed to fly. The power that there is bounds climb and descent, so that the airspeed is kept.

    ap      record AUTOPILOT (autopilot_setup.py); gamma_trim is its climb_in_trim
    A       m/s2            acceleration along the path, by engine power
    M       rad or m/s2     missing_path_angle of the first loop, missing_acceleration of the others
    power   setting of the engine, in its own unit; as an argument, the record POWER of power.py
    push    m/s2            acceleration along the path per unit of power (thrust.py)
    path    rad             gamma_c

Other letters: autopilot.py.
"""

import numpy as np

from beaver_ftc.aircraft import PITCH, ROLL
from beaver_ftc.compiled import kernel
from beaver_ftc.control.profile import ALTITUDE, SPEED, clamp
from beaver_ftc.control.slipstream_limit import ceiling
from beaver_ftc.control.thrust import gained, look_up, power_for, thrust_per_inhg
from beaver_ftc.design.table import ALPHA

MOST_PATH_RAD = 0.15  # steepest climb or descent to demand
MOST_MISSING = 0.1  # largest M of the path angle, rad, and, times gravity, of the acceleration
MAX_FROM_RECENT_MPS = 3.0  # power alone can hold an airspeed within this distance of the recent one
# Rates at which the allowed power falls, about as fast as the engine follows, and rises, slower than a gust
# lasts.
CUT_INHG_S, RAISE_INHG_S = 8.0, 1.0
KEPT_ASIDE = 0.15  # share of the power's range, at either end, for engines that alone yaw the aircraft


@kernel
def acceleration_per_power(ap, power, y):
    """The push, m/s2 per unit of power. An engine with a table of thrust needs none: its table is brought to
    this airspeed, and the push is 0."""
    if ap.engine.settings:
        look_up(ap.engine, ap.airspeed)
        return 0.0
    return thrust_per_inhg(ap.thrust, ap.alpha, ap.airspeed, power, y)


@kernel
def set_highest_power(ap, power, at_stop, E, y):
    """Fill allowed_power P and full_power, by whether the rudder is at its stop and its effectiveness E:

        P <- max(min(P, present) - CUT_INHG_S dt, P(sideslip))    at the stop    then at most high_power
        P <- P + RAISE_INHG_S dt                                  otherwise
        full_power = min(P, P(E highest_dpt^3 + (1 - E) sideslip)) if E < 1, else P

    sideslip: sideslip_dpt_cubed. P(dpt^3): `ceiling`, the power whose propeller has this slipstream.
    The propeller of the Beaver yaws the aircraft with dpt^3, and what the rudder lacks, sideslip makes up
    for. At its stop the rudder can hold no more of this moment, whatever its estimated effectiveness. The
    slower the flight, the lower is full_power: a climb with more power would end in slow flight.
    """
    sideslip = ap.sideslip_dpt_cubed
    if at_stop:
        cut = min(ap.allowed_power, power.output.command[0]) - CUT_INHG_S * ap.dt
        P = max(cut, ceiling(power, y, sideslip ** (1.0 / 3.0)))
    else:
        P = ap.allowed_power + RAISE_INHG_S * ap.dt
    P = min(P, ap.high_power)
    ap.allowed_power = P
    if E < 1.0:
        dpt3_held = max(E, 0.0) * power.config.highest_dpt**3 + (1.0 - E) * sideslip
        P = min(P, ceiling(power, y, dpt3_held ** (1.0 / 3.0)))
    ap.full_power = P


@kernel
def path_angle_to_fly(ap, measured, push):
    """gamma_c, path angle to fly, rad. Where no altitude is commanded, it is the present one.

        gamma_c = (H_c' + K (H_c - H)) / V + M,    M <- M + dt K_i (H_c - H) / V        unless limited

    Where pitch holds the airspeed: see `glide_path_angle`.
    """
    if ap.pitch_holds_airspeed and ap.is_commanded[SPEED]:
        return glide_path_angle(ap)
    if not ap.is_commanded[ALTITUDE]:
        return measured.attitude[PITCH] - ap.alpha
    V = ap.airspeed
    gain = ap.gain
    M = ap.missing_path_angle
    error = ap.command[ALTITUDE] - measured.altitude
    demand = (ap.command_rate[ALTITUDE] + gain.altitude * error) / V + M
    low, high = path_angle_limits(ap, push)
    path = min(max(demand, low), high)
    if path == demand:
        ap.missing_path_angle = clamp(M + ap.dt * gain.altitude_i * error / V, MOST_MISSING)
    return path


@kernel
def glide_path_angle(ap):
    """Path angle at which gravity brings the airspeed to where it is commanded, rad, within MOST_PATH_RAD of
    gamma_trim:

    gamma_c = gamma_trim - (V_c' + K (V_c - V) + M) / g
    """
    error = ap.airspeed_to_fly - ap.airspeed
    demand = (ap.to_fly_rate + ap.missing_acceleration + ap.gain.speed * error) / ap.gravity
    limited = clamp(demand, MOST_PATH_RAD)
    if limited == demand:
        integrate_missing_acceleration(ap, error)
    return ap.climb_in_trim - limited


@kernel
def integrate_missing_acceleration(ap, error):
    """M <- M + dt K_i error, within +- MOST_MISSING g: the acceleration, m/s2, that an airspeed takes in
    addition to the computed one; error m/s."""
    M = ap.missing_acceleration + ap.dt * ap.gain.speed_i * error
    ap.missing_acceleration = clamp(M, MOST_MISSING * ap.gravity)


@kernel
def path_angle_limits(ap, push):
    """The steepest descent and climb, rad: those that the engine sustains, and a share for the airspeed that
    there is to spare:

        low = gamma_trim + gained(idle) / g - path_per_mps (fast - V)       at least -MOST_PATH_RAD
        high = gamma_trim + gained(full) / g + path_per_mps (V - slow)      within +- MOST_PATH_RAD

    slow, fast: the airspeeds, m/s, at which nothing is to spare: spare_mps below and above the airspeed to
    fly, and slow at least slowest_mps. Without a commanded airspeed the engine stays as trimmed, slow is
    slowest_mps, and low is -MOST_PATH_RAD. gained: thrust.py, m/s2, over the setting in trim.
    """
    gain = ap.gain
    trim = ap.trim_power
    slow = ap.slowest_mps
    fast = np.inf
    idle = trim
    full = trim
    if ap.is_commanded[SPEED]:
        slow = max(slow, ap.airspeed_to_fly - gain.spare_mps)
        fast = ap.airspeed_to_fly + gain.spare_mps
        idle = ap.low_power
        full = max(ap.full_power, ap.low_power)
    at_idle = ap.climb_in_trim + gained(ap.engine, push, trim, idle) / ap.gravity
    at_full = ap.climb_in_trim + gained(ap.engine, push, trim, full) / ap.gravity
    low = at_idle - gain.path_per_mps * (fast - ap.airspeed)
    high = at_full + gain.path_per_mps * (ap.airspeed - slow)
    return max(low, -MOST_PATH_RAD), clamp(high, MOST_PATH_RAD)


@kernel
def pitch_attitude_rate(ap, y, attitude, path):
    """theta_c' = K (theta_c - theta), the rate of the pitch attitude, rad/s, with theta_c = path + alpha cos
    phi: within its limit, and at most `protection` times (steepest_alpha - angle of attack). 0 if neither an
    altitude nor a glide is flown."""
    glides = ap.pitch_holds_airspeed and ap.is_commanded[SPEED]
    if not (ap.is_commanded[ALTITUDE] or glides):
        return 0.0
    demand = path + ap.alpha * np.cos(attitude[ROLL]) - attitude[PITCH]
    rate = clamp(ap.gain.attitude * demand, ap.rate_limit[PITCH])
    return min(rate, ap.gain.protection * (ap.steepest_alpha - y[ALPHA]))


@kernel
def set_power(ap, power, y, path, push):
    """Set the power that gives the acceleration along the path

        A = V_c' + K (V_c - V) + M + g (gamma_c - gamma_trim),    m/s2

    M is integrated unless the power is limited. While power stands in for a lost pitch, K is 0 and
    power_airspeed is set: the law of power.py has an airspeed loop of its own, which can hold V_c within
    MAX_FROM_RECENT_MPS of the recent airspeed. At either end of the range, a room is kept for engines that
    alone yaw the aircraft; the upper end is full_power, or `ceiling` if it is lower.
    """
    V = ap.airspeed
    V_c = ap.airspeed_to_fly
    recent = ap.recent_airspeed_mps
    error = V_c - V
    A = ap.to_fly_rate + ap.missing_acceleration
    if power.memory.engaged:
        ap.power_airspeed = recent + clamp(V_c - recent, MAX_FROM_RECENT_MPS)
        error = ap.power_airspeed - V
    else:
        A += ap.gain.speed * error
    A += ap.gravity * (path - ap.climb_in_trim)
    demand = power_for(ap.engine, push, ap.trim_power, A)
    high = min(ap.full_power, ceiling(power, y, power.config.highest_dpt))
    room = KEPT_ASIDE * ap.engine_yaw_share * (ap.high_power - ap.low_power)
    limited = max(min(demand, high - room), ap.low_power + room)
    if limited == demand:
        integrate_missing_acceleration(ap, error)
    ap.power_setting = limited
