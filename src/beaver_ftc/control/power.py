"""Engine power, the last that acts on pitch when neither elevator nor flap does.

    pz = pz_trim - k_V (V - Vbar) + k_att att,    T_V Vbar' = V - Vbar,    att' = q - q_ref - att / T_att

Airspeed fed back to power damps the phugoid, as when an airliner was flown on its engines alone
[Burcham1997]. Washed out, so that power does not fight the airspeed to which a jammed elevator trims the
aircraft: it has not the moment for that. att is what the pitch rate has missed of late: nose too high, and
more power lowers it, Cm_dpt being negative.

Power has little moment and a right-half-plane zero from there to the attitude: it can steady the aircraft,
not make it follow a pitch rate.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.control.state import ORACLE
from beaver_ftc.design.model import AIRSPEED, DPT, QDYN
from beaver_ftc.diagnosis.state import PITCH

LEAST_LACK_RAD_S2 = 0.05  # of pitch acceleration: what 2 to 3 inHg give


@kernel
def unable(control, surface):
    """Whether a surface is given up or stands at a stop."""
    return control.effectiveness[surface] < control.least_effectiveness or control.saturated[surface] == 1


@kernel
def pitch_is_lost(control):
    """Whether elevator and flap are given up, or cannot between them give what pitch demands.

    A flap that can still act is asked for what the elevator lacks, so a lack says that it has nothing left.
    """
    elevator, flap = control.main[PITCH], control.stand_in
    most = control.effectiveness[elevator]
    if flap >= 0:
        most = max(most, control.effectiveness[flap])
    lacking = unable(control, elevator) and abs(control.shortfall[PITCH]) > LEAST_LACK_RAD_S2
    return most < control.least_effectiveness or lacking


@kernel
def watch(control, t):
    """Take over once pitch has been lost for a while, hand back once it has not been for longer. t s.

    lost counts up while it is and down while it is not, between 0 and 1: swings past zero keep what they add.
    """
    power = control.power
    change = power.impatience if pitch_is_lost(control) else -power.forgiveness
    power.lost = min(max(power.lost + change, 0.0), 1.0)
    if power.lost == 1.0 and not power.engaged:
        power.engaged, power.attitude = 1, 0.0
        if power.from_s < 0.0:
            power.from_s = t
    elif power.lost == 0.0:
        power.engaged = 0


@kernel
def follow(control, x, y):
    """Bring airspeed, its slow mean and the attitude missed to this frame; x (3,) rad/s, y (5,)."""
    power = control.power
    if power.usual_speed == 0.0:
        power.speed = power.usual_speed = y[AIRSPEED]
    power.speed += power.smoothing * (y[AIRSPEED] - power.speed)
    power.usual_speed += power.washout * (power.speed - power.usual_speed)
    error = x[PITCH] - control.governed_rate[PITCH]
    power.attitude += control.dt * error - power.leak * power.attitude


@kernel
def ceiling(power, y, highest_dpt):
    """Highest manifold pressure (inHg) whose slipstream leaves the rudder enough to fly with; y (5,).

    The propeller yaws with dpt^3: slow and at full power, more than the rudder can hold.
    """
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
def steer(control, x, y, known, t):
    """Move the manifold pressure by one frame; x (3,) rad/s, y (5,), known: there is an alarm, t s."""
    power = control.power
    follow(control, x, y)
    if known or control.law == ORACLE:
        watch(control, t)
    before = power.command[0]
    power.command[0] = min(max(wanted(power, y), before - power.step), before + power.step)
    power.in_use = power.engaged or power.moved
    power.moved = power.command[0] != power.trim
    if power.in_use:
        power.frames += power.engaged
        power.least = min(power.least, power.command[0])
        power.greatest = max(power.greatest, power.command[0])
