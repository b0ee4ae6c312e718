"""The diagnosis' memory: one record, so that a frame is one call into compiled code."""

from functools import lru_cache

import numpy as np

from beaver_ftc.aircraft.schema import MAX_MONOMIALS, MAX_TERMS, MAX_TERMS_OF_ONE
from beaver_ftc.design.terms import N_SIGNALS
from beaver_ftc.diagnosis.air import AIR
from beaver_ftc.diagnosis.derived import admitted_dtype
from beaver_ftc.diagnosis.error_map import error_map_dtype
from beaver_ftc.diagnosis.forces import FORCES_FELT
from beaver_ftc.diagnosis.types.memory import surface_dtype
from beaver_ftc.diagnosis.watch import WATCH
from beaver_ftc.scenario.diagnosis import MAX_POLES

MAX_ESTIMATORS = 16
NOT_ISOLATED, UNANTICIPATED = -1, -2
INTERVAL, PUBLISHED = 0, 1
LOSS, POSITION = 0, 1  # kinds of hypothesis: fault_class.py
ROLL, PITCH, YAW, SIDE, NORMAL = range(5)  # axes, and the accelerometers beside them: forces.py

# Centres of the network's basis functions, rad; and its memory.
ALPHA_CENTRES = np.linspace(-0.1, 0.5, 9)
BETA_CENTRES = np.linspace(-0.3, 0.3, 5)
N_BASIS = len(ALPHA_CENTRES) + len(BETA_CENTRES)
NETWORK = np.dtype(
    [
        ("gain", "f8"), ("leak_per_s", "f8"), ("weight_limit", "f8"),
        ("weights", "f8", (3, N_BASIS)), ("basis", "f8", (N_BASIS,)), ("output", "f8", (3,)),
    ],
    align=True,
)  # fmt: skip

# What a fault adds to the angular acceleration, as its estimator supposes: offset + theta Z, give or take.
EFFECT = np.dtype([("offset", "f8", (3,)), ("Z", "f8", (3,)), ("spread", "f8", (3,))], align=True)

ESTIMATOR = np.dtype(
    [
        ("kind", "i8"), ("surface", "i8"),
        ("low", "f8"), ("high", "f8"),  # the known set of theta
        ("excluded", "i8"), ("excluded_at_s", "f8"), ("unasked", "i8", (3,)),
        ("shown", "i8"), ("doubted", "i8"),
        ("xhat", "f8", (3,)), ("residual", "f8", (3,)), ("lower", "f8", (3,)), ("upper", "f8", (3,)),
        ("omega", "f8", (3,)), ("rise", "f8", (3,)), ("fall", "f8", (3,)), ("bound", "f8", (3,)),
        ("bound_eta", "f8", (3,)), ("bound_noise", "f8", (3,)),
        ("theta", "f8", (3,)), ("covariance", "f8", (3,)),
        ("effect", EFFECT), ("block_effect", EFFECT),  # of the frame; mean over a block
        ("furthest", "f8"),  # rad, from neutral, that the surface can have been in the frame
        # what bank.py and membership.py keep
        ("across", "f8", (3,)), ("reach_low", "f8", (MAX_POLES, 4)), ("reach_high", "f8", (MAX_POLES, 4)),
        ("theta_low", "f8", (3,)), ("theta_high", "f8", (3,)),
    ],
    align=True,
)  # fmt: skip

# What the statistical detector keeps: air.py, whitening.py, likelihood.py. A block is the axes whose noise
# goes together: pitch, and roll with yaw, the latter twice. States of a filter: what is left of the rate,
# then the drift. Every hypothesis is tried from every onset: that is a lane of a block, and what lanes keep
# lies side by side for vector instructions, lane slot * MAX_HYPOTHESES + hypothesis.
N_SLOTS = 10
N_TONES = 16
N_READINGS = 5  # alpha, beta, airspeed, dynamic pressure, engine power: readings.py
MAX_HYPOTHESES, MAX_REGRESSORS = 8, 3 * MAX_TERMS_OF_ONE + 4 + N_READINGS
MAX_VIEWS = 16
PITCH_BLOCK, LATERAL, RETURNING = 0, 1, 2  # the last is the second view of roll and yaw
LANES = N_SLOTS * MAX_HYPOTHESES
EITHER, WORST_CASE, STATISTICS = 0, 1, 2  # whose alarms count
LEAST_UNCERTAINTY_RAD_S2 = 1e-3  # reckoned with: a bound that passes zero does not stay there
STEP, ALPHA3, GROWING, ENDING = 2, 3, 4, 5  # further kinds of hypothesis: likelihood.py
# Which sign of a correlation speaks for one: a loss takes away, one that ends gives back; 0: either does.
SENSE = {LOSS: -1.0, STEP: 0.0, ALPHA3: 0.0, GROWING: -1.0, ENDING: 1.0}

HYPOTHESIS = np.dtype(
    [
        ("kind", "i8"), ("surface", "i8"), ("axis", "i8"), ("alarms", "i8"), ("column", "i8"),
        ("signature", "f8", (2,)), ("growth_keep", "f8"),
        ("score", "f8"), ("theta", "f8"), ("certainty", "f8"), ("at_least", "f8"), ("at_most", "f8"),
    ],
    align=True,
)  # fmt: skip

LANE = np.dtype(
    [
        ("sense", "f8", (LANES,)), ("shaped", "f8", (2, LANES)), ("response", "f8", (4, LANES)),
        ("weight", "f8", (2, LANES)),  # S^-1 g_s of the frame
        ("correlation", "f8", (LANES,)), ("information", "f8", (LANES,)),
        ("overlap", "f8", (MAX_REGRESSORS, LANES)), ("slack", "f8", (LANES,)),
        ("missing", "f8", (LANES,)),  # of a loss that grows, what is yet to come
        ("held", "f8", (2, LANES)),  # of a loss that ends, its signature as it did
        # what a bounded uncertainty can add to the correlation: as it stays, as it swings, at its pace
        ("stays", "f8", (LANES,)), ("swings", "f8", (LANES,)), ("drifts", "f8", (LANES,)),
        # what it comes to, the last three as log likelihood ratios
        ("score", "f8", (LANES,)),
        ("at_least", "f8", (LANES,)), ("at_most", "f8", (LANES,)), ("likelihood", "f8", (LANES,)),
    ],
    align=True,
)  # fmt: skip

BLOCK = np.dtype(
    [
        ("n", "i8"), ("axis", "i8", (2,)), ("lag", "f8"), ("keep", "f8"), ("stronger", "f8"),
        ("state", "f8", (4,)), ("rest", "f8", (4,)), ("innovation", "f8", (2,)), ("scratch", "f8", (2,)),
        ("P_xx", "f8", (2, 2)), ("P_xd", "f8", (2, 2)), ("P_dd", "f8", (2, 2)),
        ("drift", "f8", (2, 2)), ("jitter", "f8", (2,)), ("noise", "f8", (2,)),
        ("S_inverse", "f8", (2, 2)), ("K_x", "f8", (2, 2)), ("K_d", "f8", (2, 2)),
        # alarm level; share of it that chance is given beside what is bounded; omega dt of the latter
        ("level", "f8"), ("chance", "f8"), ("pace", "f8"), ("stay", "f8", (2,)), ("swing", "f8", (2,)),
        ("n_regressors", "i8"), ("tolerance", "f8", (MAX_REGRESSORS,)),
        ("regressor", "f8", (MAX_REGRESSORS, 2)), ("regressor_state", "f8", (MAX_REGRESSORS, 4)),
        ("regressor_response", "f8", (MAX_REGRESSORS, 2)),
        ("n_hypotheses", "i8"), ("hypothesis", HYPOTHESIS, (MAX_HYPOTHESES,)),
        ("lane", LANE),
    ],
    align=True,
)  # fmt: skip

# Oscillations (tones.py): what all views share, and what each keeps.
LISTENING = np.dtype(
    [
        ("slowest", "f8"), ("fastest", "f8"),  # m/s: beyond, nothing is heard
        ("every", "i8"), ("level", "f8"), ("keep", "f8"),  # frames; standard deviations; of a sum
        # by the angle of a frame; by that of a sum, and twice that, times `keep`
        ("turn", "f8", (2, N_TONES)), ("turn_kept", "f8", (2, N_TONES)), ("turn_twice", "f8", (2, N_TONES)),
        ("heard", "f8", (N_TONES,)),  # at most, of an uncertainty within one
        ("width", "f8", (N_TONES,)),  # larger variance of the two parts of N, of both together one
    ],
    align=True,
)  # fmt: skip
TONES = np.dtype(
    [
        ("count", "i8"), ("sum", "f8"), ("sums", "f8", (MAX_REGRESSORS,)),  # of frames, and of regressors
        ("tone", "f8", (2, N_TONES)), ("overlap", "f8", (MAX_REGRESSORS, 2, N_TONES)),
        # of |N|: what coefficients and a bounded uncertainty explain; of the latter, its size and its beat
        ("slack", "f8", (N_TONES,)), ("room", "f8", (N_TONES,)),
        ("steady", "f8", (N_TONES,)), ("beat", "f8", (2, N_TONES)), ("information", "f8"),
        ("score", "f8"),  # of the loudest, as a score of likelihood.py of the same chance
    ],
    align=True,
)  # fmt: skip

# The rates along a direction, `mix` (across.py), in a block of one axis. surface: whose column it is across,
# AN_AXIS of none, THE_VANE of an error of the incidence. plane: of the column; tolerated: anything at all;
# inertial: the force by an angle that no vane gave; clears: what it shows is no vane's doing; cleared_by: the
# force of the views that clear its vane, 0 where it asks none. held: its largest score, slowly forgotten.
# axis: that an alarm of it is said to be about. past_gust: across the rolling gust too. column: of length 1.
AN_AXIS, THE_VANE = -1, -2
VIEW = np.dtype(
    [
        ("surface", "i8"), ("axis", "i8"), ("mix", "f8", (5,)), ("plane", "i8", (2,)),
        ("past_gust", "i8"), ("column", "f8", (5,)), ("tolerated", "i8"),
        ("inertial", "i8"), ("clears", "i8"), ("cleared_by", "i8"),
        ("bounded", "f8", (1,)), ("by_rates", "f8", (3,)), ("by_forces", "f8", (3,)), ("held", "f8"),
        ("block", BLOCK), ("tones", TONES),
    ],
    align=True,
)  # fmt: skip

STATISTICAL = np.dtype(
    [
        ("share", "f8"),  # one over the instants in a frame
        ("enabled", "i8"), ("alarm_level", "f8"), ("naming_level", "f8"), ("keep", "f8"),
        ("n_columns", "i8"),  # of the log
        ("rapidity", "f8"),  # 1/s: intensity of the drift of an uncertainty over its bound squared
        ("bounded", "f8", (3,)), ("deflection", "f8", (3,)), ("jitter", "f8", (3,)), ("tolerated", "i8"),
        ("n_blocks", "i8"), ("block", BLOCK, (3,)), ("n_views", "i8"), ("views", VIEW, (MAX_VIEWS,)),
        ("forces", FORCES_FELT), ("listening", LISTENING),
        ("air", AIR), ("inertial_air", AIR), ("terms", "f8", (MAX_TERMS,)),
        # readings.py: whether errors of the air data count; their noise, and the jitter of all else; scratch
        ("read", "i8"), ("reading_noise", "f8", (N_READINGS,)), ("own_jitter", "f8", (3,)),
        ("direction", "f8", (N_SIGNALS,)), ("slope", "f8", (MAX_MONOMIALS,)), ("moved", "f8", (3,)),
        ("score", "f8"), ("axis", "i8"), ("closest", "f8"), ("detected_at_s", "f8"),
    ],
    align=True,
)  # fmt: skip


@lru_cache
def verdict_dtype(n: int) -> np.dtype:
    """A plug-in's verdict. isolated: a surface, NOT_ISOLATED or UNANTICIPATED."""
    fields = [
        ("detected", "i8"), ("axis", "i8"), ("isolated", "i8"), ("theta", "f8"),
        ("estimates", "i8"), ("effectiveness", "f8", (n,)),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


# The bank of detection filters; filter 0 is the published one (bank.py).
BANK = np.dtype(
    [
        ("n", "i8"), ("decay", "f8", (MAX_POLES,)),
        ("residual", "f8", (MAX_POLES, 3)), ("threshold", "f8", (MAX_POLES, 3)),
        ("eta", "f8", (MAX_POLES, 3)), ("noise", "f8", (MAX_POLES, 3)),
        ("closest", "f8", (MAX_POLES,)),  # largest share of its bound each filter reached in healthy flight
    ],
    align=True,
)  # fmt: skip

# The fault detection and approximation estimator (detection.py).
FDAE = np.dtype(
    [
        ("pole", "f8", (3,)), ("decay", "f8", (3,)), ("xhat", "f8", (3,)), ("residual", "f8", (3,)),
        ("threshold", "f8", (3,)), ("threshold_eta", "f8", (3,)), ("threshold_noise", "f8", (3,)),
        ("network", NETWORK),
    ],
    align=True,
)  # fmt: skip

# Two faults at once (types/pairs.py): alarms of the groups, and what is known of the first fault in pitch.
PAIR = np.dtype(
    [
        ("enabled", "i8"), ("alarmed", "i8", (2,)), ("no_lateral_pair", "i8"), ("first", "i8"),
        ("unsettled", "i8"),
    ],
    align=True,
)  # fmt: skip

# Blocks of frames (types/blocks.py).
FRAME_BLOCK = np.dtype(
    [
        ("length", "i8"), ("filled", "i8"), ("span_s", "f8"),
        ("innovation", "f8", (3,)), ("bound", "f8", (3,)), ("noise", "f8", (3,)),
    ],
    align=True,
)  # fmt: skip


@lru_cache
def conclusion_dtype(n: int) -> np.dtype:
    """What is concluded about n surfaces. isolated: an estimator, NOT_ISOLATED or UNANTICIPATED. type: of the
    isolated fault, -1 if open. lead: the surface the law acts upon, and what it does about it. effectiveness:
    of every surface, where a plug-in `estimates` it."""
    fields = [
        ("detected", "i8"), ("detected_at_s", "f8"), ("detected_axis", "i8"),
        ("isolated", "i8"), ("isolated_at_s", "f8"), ("type", "i8"), ("type_at_s", "f8"),
        ("lead", "i8"), ("lead_kind", "i8"), ("estimates", "i8"), ("effectiveness", "f8", (n,)),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


@lru_cache
def layout_dtype(n: int) -> np.dtype:
    """Axis and group of each of n surfaces, the other one of a group of two, or -1; the main surface of each
    axis; the estimators of a surface's loss and position, or -1."""
    fields = [
        ("dominant_axis", "i8", (n,)), ("group", "i8", (n,)), ("partner", "i8", (n,)), ("main", "i8", (3,)),
        ("loss_of", "i8", (n,)), ("position_of", "i8", (n,)),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


@lru_cache
def bound_dtype(n: int) -> np.dtype:
    """Bounds on the uncertainty. eta_bar, eta_bar_now: over the elapsed frame and at this instant, rad/s2.
    noise: on what a gyro's error changes by, rad/s. frame: on one frame's innovation, rad/s2. own: of the
    errors of n surfaces' own terms, per rad of deflection and at the command, means over the frame."""
    fields = [
        ("inertia", "f8", (3,)), ("constant", "f8", (3,)), ("earth_rate", "f8"),
        ("admitted", admitted_dtype(n)), ("error_map", error_map_dtype(n)),
        ("eta_bar", "f8", (3,)), ("eta_bar_now", "f8", (3,)),
        ("noise", "f8", (3,)), ("noise_then", "f8", (3,)), ("frame", "f8", (3,)),
        ("own_errors", "i8"), ("own_per_rad", "f8", (3, n)), ("own", "f8", (3, n)),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


@lru_cache
def diagnosis_dtype(n: int) -> np.dtype:
    """The diagnosis' memory for an aircraft with n surfaces."""
    fields = [
        ("enabled", "i8"), ("thresholds", "i8"), ("authority", "i8"), ("dt", "f8"),
        ("bound", bound_dtype(n)), ("innovation", "f8", (3,)), ("bank", BANK), ("fdae", FDAE),
        ("verdict", conclusion_dtype(n)), ("layout", layout_dtype(n)),
        # the isolation estimators, and the sharpened scheme's switches
        ("n_estimators", "i8"), ("estimator", ESTIMATOR, (MAX_ESTIMATORS,)),
        ("forgetting", "f8"), ("fie_decay", "f8", (3,)),
        ("memory", "i8"), ("shared", "i8"), ("membership", "i8"), ("abrupt", "i8"),
        # faults of every type: types/
        ("every_type", "i8"), ("whole", "i8"), ("instants", "i8"), ("returns", "i8"), ("patience", "i8"),
        ("surface", surface_dtype(), (n,)), ("frame", "i8"), ("pair", PAIR), ("block", FRAME_BLOCK),
        ("statistical", STATISTICAL), ("watch", WATCH),
    ]  # fmt: skip
    return np.dtype(fields, align=True)
