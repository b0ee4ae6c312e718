"""What the autopilot keeps: the profile to fly, its limits, its memory, and how far it was off."""

import numpy as np

ALTITUDE, SPEED, HEADING, BANK = range(4)
N_CHANNELS = 4
MAX_LEGS = 100
CHANNELS = ("altitude_m", "airspeed_mps", "heading_deg", "bank_deg")
LIMITED = "airspeed_limited_mps"  # the commanded one, as far as it can be held
COLUMNS = (
    "altitude_command_m", "airspeed_command_mps", "heading_command_rad", "bank_command_rad",
    LIMITED,
)  # fmt: skip

# Of each loop, 1/s and of what it finds missing 1/s2; smoothing, s; and what bounds the demands.
GAIN = np.dtype(
    [
        ("altitude", "f8"), ("altitude_i", "f8"), ("attitude", "f8"), ("speed", "f8"), ("speed_i", "f8"),
        ("bank", "f8"), ("bank_i", "f8"), ("heading", "f8"), ("heading_i", "f8"), ("sideslip", "f8"),
        ("alpha_s", "f8"), ("airspeed_s", "f8"), ("jammed_s", "f8"),
        ("authority_s", "f8"), ("bank_s", "f8"), ("spare_mps", "f8"), ("path_per_mps", "f8"),
        ("protection", "f8"), ("loose", "f8"),
    ],
    align=True,
)  # fmt: skip

# What can be held (holding.py): the elevator that level flight takes, over dynamic pressure and flap (rad);
# what acts like the elevator and what of it is commanded, smoothed (rad); the airspeeds between which level
# flight can be held (m/s); and of each limit since when it has bitten (s), and its value at last (SI).
FASTEST, SLOWEST, BANK_LIMIT = range(3)
N_QDYN, N_FLAP = 12, 5
HOLDING = np.dtype(
    [
        ("known", "i8"), ("limiting", "i8"), ("frames", "i8"), ("reserve", "f8"), ("pace", "f8"),
        ("qdyn", "f8", (N_QDYN,)), ("flap", "f8", (N_FLAP,)), ("elevator", "f8", (N_QDYN, N_FLAP)),
        ("acting", "f8"), ("centre", "f8"), ("fastest", "f8"), ("slowest", "f8"), ("bank", "f8"),
        ("in_force", "i8", (3,)), ("from_s", "f8", (3,)), ("value", "f8", (3,)),
    ],
    align=True,
)  # fmt: skip

# A leg: from when on, to which value (not a number: hold what is), how fast. SI and rad.
AUTOPILOT = np.dtype(
    [
        ("enabled", "i8"), ("flying", "i8"), ("dt", "f8"),
        ("legs", "i8", (N_CHANNELS,)), ("leg", "i8", (N_CHANNELS,)),  # how many, and which is next
        ("at_s", "f8", (N_CHANNELS, MAX_LEGS)), ("value", "f8", (N_CHANNELS, MAX_LEGS)),
        ("speed", "f8", (N_CHANNELS, MAX_LEGS)),
        ("commanded", "i8", (N_CHANNELS,)),  # whether the channel is flown by now
        ("goal", "f8", (N_CHANNELS,)), ("command", "f8", (N_CHANNELS,)), ("pace", "f8", (N_CHANNELS,)),
        ("moving", "f8", (N_CHANNELS,)),  # per second, of the command at this instant
        ("changed_at_s", "f8", (N_CHANNELS,)),
        # what is known of the aircraft
        ("gravity", "f8"), ("thrust", "f8", (2,)),  # m/s2 per dpt and Pa: at no alpha, and per alpha
        ("trim_inhg", "f8"), ("low_inhg", "f8"), ("high_inhg", "f8"), ("step_inhg", "f8"),
        ("climb_in_trim", "f8"),  # rad, with the engine as trimmed
        ("dihedral", "f8"),  # roll rate per sideslip and airspeed, 1/m
        ("full_inhg", "f8"), ("allowed_inhg", "f8"),  # the highest there is now, and that the rudder allows
        ("weathercock", "f8"),  # cube of the dpt whose yawing moment the largest sideslip accepted holds
        ("slowest_mps", "f8"), ("steepest_alpha", "f8"),
        ("most", "f8", (3,)),  # rad/s, of the rates asked for with all surfaces healthy
        ("limit", "f8", (3,)), ("most_bank", "f8"), ("bank_limit", "f8"),
        # memory
        ("alpha", "f8"), ("airspeed", "f8"),  # smoothed, rad and m/s
        ("usual", "f8"),  # airspeed of late, m/s
        ("drift", "f8"),  # rad/s of turning found missing
        ("lift", "f8"),  # rad of path angle found missing
        ("throttle", "f8"), ("rolled", "f8"),  # m/s2, rad/s: found missing
        ("jammed", "f8"),  # share of roll that rudder and dihedral carry
        ("loose", "f8"),  # 1: nothing acts in yaw
        ("rates", "f8", (3,)),
        ("gain", GAIN),
        ("held", "f8"), ("held_moving", "f8"), ("holding", HOLDING),  # airspeed to fly, m/s, and its change
        # how far off, at most; and the mean deviation of late, from what is commanded and, airspeed, held
        ("mean_off", "f8", (N_CHANNELS,)), ("held_off", "f8"), ("held_worst", "f8"),
        ("worst", "f8", (N_CHANNELS,)),
    ],
    align=True,
)  # fmt: skip
