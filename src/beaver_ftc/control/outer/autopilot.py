"""The autopilot: where each channel of the commanded profile should be now, from the legs of the scenario;
and body-rate references and an engine setting for that.

    climb    gamma_c = (h' + k (hc - h)) / V + what was found missing,   theta_c = gamma_c + alpha (smoothed)
             theta' = k (theta_c - theta)
    speed    a = V' + k (Vc - V) + what was found missing + g (gamma_c - gamma in trim), by engine power
    gliding  gamma_c = gamma in trim - (V' + k (Vc - V) + what was found missing) / g: airspeed by pitch
    heading  phi_c = V / g k (psi_c - psi),   phi' = k (phi_c - phi)
    turn     psi' = g tan phi / V: coordinated [Etkin1996, sec. 7.6]; and the body rates of these angles'
             rates, with sideslip washed out by the rudder

Every demand is limited, and what a limit cut off is not integrated. The limits on rates and bank shrink
with what the surfaces that are left can give; climb and descent are bounded by the power there is, so that
the airspeed is kept. Where the ailerons no longer act, the roll is flown by sideslip: rudder and dihedral.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.control.allocation import attainable, remaining
from beaver_ftc.control.outer.holding import protect
from beaver_ftc.control.outer.state import ALTITUDE, BANK, HEADING, N_CHANNELS, SPEED
from beaver_ftc.control.outer.thrust import gained, look_up, power_for, thrust_per_inhg
from beaver_ftc.control.power import ceiling
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA
from beaver_ftc.diagnosis.state import PITCH, ROLL, YAW
from beaver_ftc.scenario.signals import MEAN_S, TIME_TOLERANCE_S

MOST_PATH_RAD = 0.15
MOST_SIDESLIP_RAD = 0.14
MOST_MISSING = 0.1  # rad of path angle, and times gravity of acceleration
MOST_DRIFT_RAD_S = 0.1  # of turning that a bank without a turn stands for
USUAL_S, USUAL_MPS = 20.0, 3.0  # airspeed that power alone can hold: within so much of what it has been
CUT_INHG_S, RAISE_INHG_S = 8.0, 1.0  # about as fast as the engine follows; and slower than a gust lasts
KEPT_ASIDE = 0.15  # of the power's range at either end, for engines that alone yaw the aircraft
PACE_BY_POWER, BY_POWER_S = 0.25, 5.0  # of the loops of bank and heading there, and since when it counts
SETTLED_S = 30.0  # after a change of heading


@kernel
def clamp(value, most):
    """value within -most and most."""
    return min(max(value, -most), most)


@kernel
def turn(angle):
    """The same direction within half a turn, rad."""
    return angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))


@kernel
def begin_leg(autopilot, c, now, t):
    """Take up the next leg of channel c, which is at `now` as measured."""
    j = autopilot.leg[c]
    autopilot.leg[c] = j + 1
    if not autopilot.commanded[c]:
        autopilot.commanded[c] = 1
        autopilot.command[c] = now
    value = autopilot.value[c, j]
    autopilot.goal[c] = autopilot.command[c]
    if not np.isnan(value):
        away = value - autopilot.command[c]
        autopilot.goal[c] += turn(away) if c == HEADING else away
        autopilot.changed_at_s[c] = t
    autopilot.pace[c] = autopilot.speed[c, j]


@kernel
def advance(autopilot, measured, t):
    """Bring every channel's command to t s; measured (N_CHANNELS,): where they are."""
    for c in range(N_CHANNELS):
        while (
            autopilot.leg[c] < autopilot.legs[c]
            and t >= autopilot.at_s[c, autopilot.leg[c]] - TIME_TOLERANCE_S
        ):
            begin_leg(autopilot, c, measured[c], t)
        if autopilot.commanded[c]:
            away, most = autopilot.goal[c] - autopilot.command[c], autopilot.pace[c] * autopilot.dt
            step = min(max(away, -most), most)
            autopilot.command[c] += step
            autopilot.moving[c] = step / autopilot.dt if most < np.inf else 0.0


@kernel
def steer(autopilot, control, u, measured, unexplained, t):
    """One frame, at t s: fill autopilot.rates (3,) rad/s, and the engine setting where an airspeed is
    commanded. control: the records of the law (control/state.py). u, unexplained: see `holding.protect`.
    """
    layout, surfaces, saturated = control.layout, control.surfaces, control.allocation.output.saturated
    axes, power, by_engines = control.axes, control.power, control.engines.output.authority
    y, attitude = measured.y, measured.attitude
    if not autopilot.flying:
        take_over(autopilot, y, attitude)
    advance(autopilot, (measured.altitude, y[AIRSPEED], attitude[YAW], attitude[ROLL]), t)
    follow(autopilot, layout, surfaces, saturated, by_engines[1, YAW] > 0.0, y)
    limit(autopilot, layout, axes.G, axes.hold, by_engines)
    protect(autopilot, layout, surfaces, u, unexplained, y, t)
    push = slope_of(autopilot, power, y)
    rudder = layout.main[YAW]
    left, at_stop = surfaces.output.effectiveness[rudder], saturated[rudder]
    autopilot.full_power = full_power(autopilot, power, left, at_stop, y)
    path = path_of(autopilot, measured, push)
    to_body(autopilot, y, attitude, rolling(autopilot, attitude), pitching(autopilot, y, attitude, path))
    autopilot.sets_power = autopilot.commanded[SPEED] and not autopilot.glides
    if autopilot.sets_power:
        throttle(autopilot, power, y, path, push)


@kernel
def take_over(autopilot, y, attitude):
    """In trim: smoothed signals and the engine as they are."""
    autopilot.flying = 1
    autopilot.alpha, autopilot.airspeed = y[ALPHA], y[AIRSPEED]
    autopilot.usual = y[AIRSPEED]
    autopilot.climb_in_trim = attitude[PITCH] - y[ALPHA]


@kernel
def follow(autopilot, layout, surfaces, saturated, engines_yaw, y):
    """Smooth what is noisy, and note whether the ailerons or the rudder are gone; ailerons at their stop give
    no more roll, whatever their estimated effectiveness. engines_yaw: whether engines can yaw the
    aircraft."""
    dt, least, effectiveness = (
        autopilot.dt,
        surfaces.config.least_effectiveness,
        surfaces.output.effectiveness,
    )
    autopilot.alpha += dt / autopilot.gain.alpha_s * (y[ALPHA] - autopilot.alpha)
    autopilot.airspeed += dt / autopilot.gain.airspeed_s * (y[AIRSPEED] - autopilot.airspeed)
    at_stop = saturated[layout.main[ROLL]] == 1
    gone = remaining(layout, effectiveness, ROLL) < least or at_stop
    autopilot.jammed += dt / autopilot.gain.jammed_s * (gone - autopilot.jammed)
    free = remaining(layout, effectiveness, YAW) < least
    autopilot.loose += dt / autopilot.gain.jammed_s * (free - autopilot.loose)
    if engines_yaw:
        by_power = free or saturated[layout.main[YAW]] == 1
        autopilot.by_power += dt / BY_POWER_S * (by_power - autopilot.by_power)


@kernel
def limit(autopilot, layout, G, hold, engine_authority):
    """Rates and bank that the surfaces left can give: their spare acceleration for a while. G (3, n): with
    the effectiveness of each in it; hold (3,) rad/s2; engine_authority: as in `allocation.attainable`."""
    for i in range(3):
        least, greatest = attainable(G, layout, engine_authority, i)
        spare = max(min(greatest - hold[i], hold[i] - least), 0.0)
        autopilot.limit[i] = min(autopilot.most[i], spare * autopilot.gain.authority_s)
    by_sideslip = autopilot.jammed * autopilot.dihedral * autopilot.airspeed * MOST_SIDESLIP_RAD
    autopilot.limit[ROLL] = max(autopilot.limit[ROLL], by_sideslip)
    steepest = autopilot.most_bank * (1.0 - max(0.5 * autopilot.jammed, 0.2 * autopilot.loose))
    autopilot.bank_limit = min(steepest, autopilot.limit[ROLL] * autopilot.gain.bank_s)


@kernel
def slope_of(autopilot, power, y):
    """Acceleration along the path per unit of power, m/s2, where no table has it; the table's are brought to
    this airspeed."""
    if autopilot.engine.settings:
        look_up(autopilot.engine, autopilot.airspeed)
        return 0.0
    return thrust_per_inhg(autopilot.thrust, autopilot.alpha, autopilot.airspeed, power, y)


@kernel
def full_power(autopilot, power, left, at_stop, y):
    """The highest power with what is left of the rudder: the Beaver's propeller yaws with dpt^3.

    What the rudder lacks, sideslip makes up for. The slower, the less: a climb beyond it ends in slow flight.
    A rudder at its stop holds no more, whatever is believed of it: power then goes back until it comes off.
    left: effectiveness of the rudder.
    """
    high = autopilot.high_power
    if at_stop:
        lowest = ceiling(power, y, autopilot.weathercock ** (1.0 / 3.0))
        cut = min(autopilot.allowed_power, power.output.command[0]) - CUT_INHG_S * autopilot.dt
        autopilot.allowed_power = min(max(cut, lowest), high)
    else:
        autopilot.allowed_power = min(autopilot.allowed_power + RAISE_INHG_S * autopilot.dt, high)
    if left >= 1.0:
        return autopilot.allowed_power
    held = max(left, 0.0) * power.config.highest_dpt**3 + (1.0 - left) * autopilot.weathercock
    return min(autopilot.allowed_power, ceiling(power, y, held ** (1.0 / 3.0)))


@kernel
def path_of(autopilot, measured, push):
    """Path angle to fly, rad; the one that is flown where no altitude is commanded."""
    if autopilot.glides and autopilot.commanded[SPEED]:
        return glide_of(autopilot)
    if not autopilot.commanded[ALTITUDE]:
        return measured.attitude[PITCH] - autopilot.alpha
    V = autopilot.airspeed
    error = autopilot.command[ALTITUDE] - measured.altitude
    wanted = (autopilot.moving[ALTITUDE] + autopilot.gain.altitude * error) / V + autopilot.lift
    low, high = paths(autopilot, push)
    path = min(max(wanted, low), high)
    if path == wanted:
        lift = autopilot.lift + autopilot.dt * autopilot.gain.altitude_i * error / V
        autopilot.lift = clamp(lift, MOST_MISSING)
    return path


@kernel
def glide_of(autopilot):
    """Path angle at which gravity brings the airspeed to where it is commanded, rad."""
    error = autopilot.held - autopilot.airspeed
    along = autopilot.held_moving + autopilot.throttle + autopilot.gain.speed * error
    steeper = along / autopilot.gravity
    limited = clamp(steeper, MOST_PATH_RAD)
    if limited == steeper:
        find_missing(autopilot, error)
    return autopilot.climb_in_trim - limited


@kernel
def find_missing(autopilot, error):
    """Integrate the acceleration that an airspeed takes in addition to the computed one; error m/s."""
    found = autopilot.throttle + autopilot.dt * autopilot.gain.speed_i * error
    autopilot.throttle = clamp(found, MOST_MISSING * autopilot.gravity)


@kernel
def paths(autopilot, push):
    """The steepest descent and climb, rad: what the engine sustains, and what airspeed there is to spare."""
    slow = autopilot.slowest_mps
    fast, idle, full = np.inf, autopilot.trim_power, autopilot.trim_power
    if autopilot.commanded[SPEED]:
        slow = max(slow, autopilot.held - autopilot.gain.spare_mps)
        fast = autopilot.held + autopilot.gain.spare_mps
        idle, full = autopilot.low_power, max(autopilot.full_power, autopilot.low_power)
    trim, engine = autopilot.trim_power, autopilot.engine
    at_idle = autopilot.climb_in_trim + gained(engine, push, trim, idle) / autopilot.gravity
    at_full = autopilot.climb_in_trim + gained(engine, push, trim, full) / autopilot.gravity
    low = at_idle - autopilot.gain.path_per_mps * (fast - autopilot.airspeed)
    high = at_full + autopilot.gain.path_per_mps * (autopilot.airspeed - slow)
    return max(low, -MOST_PATH_RAD), min(max(high, -MOST_PATH_RAD), MOST_PATH_RAD)


@kernel
def pitching(autopilot, y, attitude, path):
    """The rate of the pitch attitude, rad/s."""
    if not (autopilot.commanded[ALTITUDE] or (autopilot.glides and autopilot.commanded[SPEED])):
        return 0.0
    wanted = path + autopilot.alpha * np.cos(attitude[ROLL]) - attitude[PITCH]
    rate = clamp(autopilot.gain.attitude * wanted, autopilot.limit[PITCH])
    return min(rate, autopilot.gain.protection * (autopilot.steepest_alpha - y[ALPHA]))


@kernel
def rolling(autopilot, attitude):
    """The rate of the bank angle, rad/s; slower where engines alone yaw and roll."""
    pace = 1.0 - autopilot.jammed * autopilot.by_power * (1.0 - PACE_BY_POWER)
    if autopilot.commanded[HEADING]:
        error = turn(autopilot.command[HEADING] - attitude[YAW])
        left = 1.0 - autopilot.loose * (1.0 - autopilot.gain.loose)
        found = autopilot.drift + autopilot.dt * autopilot.loose * autopilot.gain.heading_i * error
        autopilot.drift = autopilot.loose * clamp(found, MOST_DRIFT_RAD_S)
        turning = pace * left * autopilot.gain.heading * error + autopilot.moving[HEADING] + autopilot.drift
        bank = autopilot.airspeed / autopilot.gravity * turning
    elif autopilot.commanded[BANK]:
        bank = autopilot.command[BANK]
    else:
        return 0.0
    away = clamp(bank, autopilot.bank_limit) - attitude[ROLL]
    wanted = pace * autopilot.gain.bank * away + autopilot.jammed * autopilot.rolled
    rate = clamp(wanted, autopilot.limit[ROLL])
    if rate == wanted:
        autopilot.rolled += autopilot.jammed * autopilot.dt * pace * autopilot.gain.bank_i * away
    return rate


@kernel
def to_body(autopilot, y, attitude, rolling, pitching):
    """Body rates of the attitude's rates (rad/s) in a coordinated turn; the rudder keeps the sideslip."""
    rates = autopilot.rates
    sin_roll, cos_roll = np.sin(attitude[ROLL]), np.cos(attitude[ROLL])
    sin_pitch, cos_pitch = np.sin(attitude[PITCH]), np.cos(attitude[PITCH])
    lateral = autopilot.commanded[HEADING] or autopilot.commanded[BANK]
    turning = 0.0
    if lateral:
        turning = autopilot.gravity / autopilot.airspeed * sin_roll / max(cos_roll, 0.1)
    rates[ROLL] = rolling - turning * sin_pitch
    rates[PITCH] = pitching * cos_roll + turning * cos_pitch * sin_roll
    rates[YAW] = 0.0
    if lateral:
        sideslip = -rolling / (autopilot.dihedral * autopilot.airspeed)
        wanted = autopilot.jammed * clamp(sideslip, MOST_SIDESLIP_RAD)
        keeping = autopilot.gain.sideslip * (y[BETA] - wanted)
        rates[YAW] = turning * cos_pitch * cos_roll - pitching * sin_roll + keeping
    rates[YAW] = clamp(rates[YAW], autopilot.limit[YAW])


@kernel
def throttle(autopilot, power, y, path, push):
    """Set the power; while power stands in for a lost pitch, also the airspeed for its law and the
    acceleration that the path takes: that law has an airspeed loop of its own."""
    error = autopilot.held - autopilot.airspeed
    autopilot.usual += autopilot.dt / USUAL_S * (autopilot.airspeed - autopilot.usual)
    along = autopilot.held_moving + autopilot.throttle
    if power.memory.engaged:
        autopilot.power_airspeed = autopilot.usual + clamp(autopilot.held - autopilot.usual, USUAL_MPS)
        error = autopilot.power_airspeed - autopilot.airspeed
    else:
        along += autopilot.gain.speed * error
    climbing = autopilot.gravity * (path - autopilot.climb_in_trim)
    wanted = power_for(autopilot.engine, push, autopilot.trim_power, along + climbing)
    high = min(autopilot.full_power, ceiling(power, y, power.config.highest_dpt))
    room = KEPT_ASIDE * autopilot.by_power * (autopilot.high_power - autopilot.low_power)
    limited = max(min(wanted, high - room), autopilot.low_power + room)
    if limited == wanted:
        find_missing(autopilot, error)
    autopilot.setting = limited


@kernel
def judge(autopilot, altitude_m, airspeed_mps, heading, bank, t):
    """Note the deviation of every channel from its command: its mean of late, and the largest, of angles
    once SETTLED_S have passed. Of the airspeed the mean is judged; `largest_off` is at one instant."""
    where = (altitude_m, airspeed_mps, heading, bank)
    for c in range(N_CHANNELS):
        if not autopilot.commanded[c]:
            continue
        away = where[c] - autopilot.command[c]
        if c == HEADING:
            away = turn(away)
        autopilot.mean_off[c] += autopilot.dt / MEAN_S * (away - autopilot.mean_off[c])
        if c == SPEED:
            autopilot.largest_off = max(autopilot.largest_off, abs(away))
            away = autopilot.mean_off[c]
            from_held = where[c] - autopilot.held
            autopilot.held_off += autopilot.dt / MEAN_S * (from_held - autopilot.held_off)
            autopilot.held_worst = max(autopilot.held_worst, abs(autopilot.held_off))
        if c in (ALTITUDE, SPEED) or t >= autopilot.changed_at_s[c] + SETTLED_S:
            autopilot.worst[c] = max(autopilot.worst[c], abs(away))
