"""What the autopilot keeps: the profile to fly, its limits, its memory, and how far it was off."""

from beaver_ftc.compiled import record
from beaver_ftc.control.outer.thrust import ENGINE

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
# fifth as fast as the inner loops, the path a quarter of that: gusts set the pace, not comfort.
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

# What can be held (holding.py): the elevator that level flight takes, over dynamic pressure and flap (rad);
# what acts like the elevator and what of it is commanded, smoothed (rad); the airspeeds between which level
# flight can be held (m/s); and of each limit since when it has bitten (s), and its value at last (SI).
FASTEST, SLOWEST, BANK_LIMIT = range(3)
N_QDYN, N_FLAP = 12, 5
HOLDING = record(
    known=int, limiting=int, frames=int, reserve=float, pace=float, qdyn=N_QDYN, flap=N_FLAP,
    elevator=(N_QDYN, N_FLAP), acting=float, centre=float, fastest=float, slowest=float, bank=float,
    in_force=(int, 3), from_s=3, value=3,
)  # fmt: skip

# A leg: from when on, to which value (not a number: hold what is), how fast. SI and rad.
AUTOPILOT = record(
    enabled=int, flying=int, dt=float,
    legs=(int, N_CHANNELS), leg=(int, N_CHANNELS),  # how many, and which is next
    at_s=(N_CHANNELS, MAX_LEGS), value=(N_CHANNELS, MAX_LEGS), speed=(N_CHANNELS, MAX_LEGS),
    commanded=(int, N_CHANNELS),  # whether the channel is flown by now
    goal=N_CHANNELS, command=N_CHANNELS, pace=N_CHANNELS,
    moving=N_CHANNELS,  # per second, of the command at this instant
    changed_at_s=N_CHANNELS,
    # what is known of the aircraft
    gravity=float, thrust=2,  # m/s2 per dpt and Pa: at no alpha, and per alpha
    engine=ENGINE, glides=int,  # what else is known of it; whether pitch holds the airspeed
    trim_power=float, low_power=float, high_power=float,  # in the units of its setting
    climb_in_trim=float,  # rad, with the engine as trimmed
    dihedral=float,  # roll rate per sideslip and airspeed, 1/m
    full_power=float, allowed_power=float,  # the highest there is now, and that the rudder allows
    weathercock=float,  # cube of the dpt whose yawing moment the largest sideslip accepted holds
    slowest_mps=float, steepest_alpha=float,
    most=3,  # rad/s, of the rates asked for with all surfaces healthy
    limit=3, most_bank=float, bank_limit=float,
    # memory
    alpha=float, airspeed=float,  # smoothed, rad and m/s
    usual=float,  # airspeed of late, m/s
    drift=float,  # rad/s of turning found missing
    lift=float,  # rad of path angle found missing
    throttle=float, rolled=float,  # m/s2, rad/s: found missing
    jammed=float,  # share of roll that rudder and dihedral carry
    loose=float,  # 1: nothing acts in yaw
    by_power=float,  # share of the time of late in which engines alone act there
    rates=3, gain=GAIN,
    sets_power=int, setting=float,  # whether the engine is set by now, and to what
    power_airspeed=float,  # m/s, to hold while power stands in for a lost pitch
    held=float, held_moving=float, holding=HOLDING,  # airspeed to fly, m/s, and its change
    # how far off, at most; and the mean deviation of late, from what is commanded and, airspeed, held
    # `worst` is NOT_JUDGED until a channel is: of angles that takes SETTLED_S
    mean_off=N_CHANNELS, held_off=float, held_worst=float, worst=N_CHANNELS,
    largest_off=float,  # m/s, of the airspeed from what is commanded, at one instant
)  # fmt: skip
