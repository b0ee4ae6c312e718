"""The records of the fault types, and their configuration.

Frames are examined in blocks of `frames_per_block` frames. Where that is 1, a block is one frame, and "block"
below means a frame. (2, N_TYPES): the slots EARLIER and LATER of release.py, by type.

types: of `fault_types_dtype`.
"""

from functools import lru_cache
from math import ceil, pi, radians

import numpy as np

from beaver_ftc.compiled import fill, record, sized
from beaver_ftc.diagnosis.isolation import PITCH_GROUP
from beaver_ftc.diagnosis.model_prediction import DEFAULT_RATE_RAD_S, servo_data
from beaver_ftc.diagnosis.types.observations import OBSERVATION_RECORD
from beaver_ftc.diagnosis.types.registry import N_TYPES, TYPES
from beaver_ftc.scenario.declared import Declared

# Least duration of a block where gyros are noisy: much less than the slowest half-cycle, by default 3.1 s.
BLOCK_DURATION_S = 0.2
MAX_BLOCK = 256  # frames of a block
N_KEPT = 3  # blocks whose commands are kept: the elapsed one and two before it

# Commands to one surface, limited by its stops, rad. First index: 0 the elapsed block, 1 the one before, 2
# the one before that.
COMMANDS_RECORD = record(
    history=(N_KEPT, MAX_BLOCK),  # the command of each frame of the block
    cmd_min=N_KEPT, cmd_max=N_KEPT,  # the least and the greatest of them
    u_min=2, u_max=2,  # least and greatest deflection of a healthy surface within the block
    # least and greatest G within the elapsed block, on the surface's dominant axis, rad/s2 per rad
    G_min=float, G_max=float,
)  # fmt: skip

# Configuration: the actuator of one surface. A step is one JSBSim step.
ACTUATOR_CONFIG_RECORD = record(
    stop_lo=float, stop_hi=float,  # rad
    # Deflections, rad, whose moment the surface can have: its travel, extended to 0, because a surface that
    # has lost effectiveness acts like one nearer to 0.
    reach_lo=float, reach_hi=float,
    runaway=float,  # least rate of a runaway, rad/s
    approaches=2,  # least and greatest share of the way to its command that the surface moves in a step
    steps=2,  # least and greatest limit of a step, rad
    band=float,  # dead band: within this distance from its command the surface may stay, rad
    uncertain=int,  # whether errors of the actuators are declared
    slow_step=float,  # least step of a surface under a rate-limit fault, rad
    near=float,  # within this distance from its command lag or dead band may make that step smaller, rad
)  # fmt: skip

# The feasible set of each type's parameter, its least and greatest value, and whether the type is excluded.
FEASIBLE_SETS_RECORD = record(low=N_TYPES, high=N_TYPES, excluded=(int, N_TYPES))

# Evidence, counted in blocks that are judged.
EVIDENCE_RECORD = record(
    # blocks in which something was wrong, and blocks in which nothing was wrong, but a surface that was given
    # up (this one, or the other of two that may each be the only one at fault) stayed where it rests: this is
    # evidence too (`count_rest`)
    n_anomalous=int,
    n_rest=int,  # of n_anomalous, the blocks in which this surface stayed where it rests
    n_unhidden=int,  # of n_anomalous, the blocks since a stop could last hide a deflection
    k_first=int,  # the first block in which something was wrong and a position explains it, -1 for none
    first_lo=float, first_hi=float,  # where the surface was in block k_first, rad
)  # fmt: skip

STATUS_RECORD = record(
    # whether the surface may be the only one at fault. With pairs: the only one in pitch, so 0 for surfaces
    # of roll and yaw, and for all once a second fault has begun in pitch
    may_be_sole=int,
    # what decides whether it can be at fault: BY_ESTIMATOR, DEDUCED_FAULTY or DEDUCED_HEALTHY (verdict.py)
    basis=int,
    is_isolated=int, isolated_at_s=float,
    fault_type=int, typed_at_s=float,  # type of the isolated fault, -1 if open; since when, s
)  # fmt: skip

# The mode of accommodation, -1 for none; frames since one last agreed with the fault (`modes.count_silence`).
ACCOMMODATION_RECORD = record(mode=int, n_silent=int)

# The return of a surface that a type has held and released, rad; release.py has the theory. back: where the
# surface can be on its way; released: whether it has been released; held: where a release within the judged
# block begins, low > high if none can; set: the set of the type's parameter before the release.
RELEASE_RECORD = record(
    back_lo=(2, N_TYPES), back_hi=(2, N_TYPES), released=(int, N_TYPES), held_lo=N_TYPES, held_hi=N_TYPES,
    set_lo=(2, N_TYPES), set_hi=(2, N_TYPES),
)  # fmt: skip

# Configuration that all types read.
TYPES_CONFIG_RECORD = record(
    single_instant=int,  # whether a block is one JSBSim step
    n_substeps=int,  # JSBSim steps in a frame
    returns_lagged=int,  # whether a repaired surface returns with lag or rate limit
    half_frames=int,  # blocks in half a cycle of the slowest oscillation
    abrupt=int,  # whether a fault is declared to stay as it is
    has_eG=int,  # as in `bound_dtype`: whether errors of each surface's own terms count
    frames_per_block=int, block_duration_s=float, dt=float,
)  # fmt: skip

# Two faults at once (pairs.py).
FAULT_PAIR_RECORD = record(
    enabled=int,
    group_alarm=(int, 2),  # whether PITCH_GROUP and LATERAL_GROUP have an alarm
    lateral_outside=int,  # whether no deflections of ailerons and rudder within reach explain a frame
    first_pitch=int,  # surface of the first fault in pitch, -1 for none
    n_unstored=int,  # frames since `sets` of first_pitch exclude a type that its `first_sets` do not
)  # fmt: skip

# The block that is being filled: frames so far; means of innovation and bound, rad/s2; nbar at its start,
# rad/s.
FRAME_BLOCK_RECORD = record(n_so_far=int, nu=3, nu_bound=3, n_start=3)


@lru_cache
def surface_types_dtype() -> np.dtype:
    """The records of one surface: configuration, observations of three blocks (observations.py), the
    memories of the types, and what is concluded.

    not_at_position: whether the estimator of its position is excluded. first_sets: its feasible sets as
    stored when its fault was the first of two (pairs.py).
    """
    memories = {row.memory_record_name: row.memory_dtype for row in TYPES if row.memory_dtype}
    return record(
        actuator=ACTUATOR_CONFIG_RECORD, commands=COMMANDS_RECORD, last=OBSERVATION_RECORD,
        judged=OBSERVATION_RECORD, earlier=OBSERVATION_RECORD,
        evidence=EVIDENCE_RECORD, sets=FEASIBLE_SETS_RECORD,
        release=RELEASE_RECORD,
        **memories,
        not_at_position=int, status=STATUS_RECORD, accommodation=ACCOMMODATION_RECORD,
        first_sets=FEASIBLE_SETS_RECORD,
    )  # fmt: skip


@sized
def fault_types_dtype(n: int) -> np.dtype:
    """Faults of every type on n surfaces; frame_index: number of the elapsed block."""
    return record(
        config=TYPES_CONFIG_RECORD,
        frame_index=int,
        pair=FAULT_PAIR_RECORD,
        block=FRAME_BLOCK_RECORD,
        surface=(surface_types_dtype(), n),
    )


def configure_types(
    types: np.void, layout: np.void, servos: np.void, declared: Declared, travel: np.ndarray
) -> None:
    """Fill the configuration of the types, but for has_eG (schemes/__init__.py), and the actuator of each
    surface. layout: of `layout_dtype`; servos: the declared actuators; travel (2, n): the stops, rad."""
    fdi = declared.fdi
    dt = 1.0 / declared.rate_hz
    n_block = ceil(BLOCK_DURATION_S / dt) if declared.sensors.declared.gyros_vary else 1
    assert n_block <= MAX_BLOCK  # because a scenario's rate is at most 1000 Hz
    half = pi / fdi.slowest_oscillation_rad_s / (n_block * dt)
    fill(
        types["config"], frames_per_block=n_block, single_instant=declared.substeps == 1 and n_block == 1,
        block_duration_s=n_block * dt, half_frames=ceil(min(half, 1e9)),  # longer than any flight
        n_substeps=declared.substeps, returns_lagged=servos["real"], dt=dt,
        abrupt=fdi.fault_profile == "abrupt",
    )  # fmt: skip
    fill(types["pair"], first_pitch=-1, enabled=fdi.pairs)
    data = servo_data(declared)
    h = dt / declared.substeps
    for s, (srf, lo, hi) in enumerate(zip(types["surface"], *travel, strict=True)):
        approaches, steps, band = (servos[field][s] for field in ("approaches", "steps", "band"))
        rate_rad_s = data["rate_limit_rad_s"][s] or DEFAULT_RATE_RAD_S
        slowest = 1.0 - data["rate_limit_error"][s]
        slow_step = min(radians(fdi.slowest_rate_deg_s) * h, steps[0])
        fill(
            srf["actuator"], stop_lo=lo, stop_hi=hi, reach_lo=min(lo, 0.0), reach_hi=max(hi, 0.0),
            approaches=approaches, steps=steps, band=band, uncertain=servos["uncertain"],
            runaway=0.5 * slowest * rate_rad_s, slow_step=slow_step, near=slow_step / approaches[0] + band,
        )  # fmt: skip
        may_be_sole = not fdi.pairs or layout["group"][s] == PITCH_GROUP
        fill(srf["status"], may_be_sole=may_be_sole, fault_type=-1)
        srf["accommodation"]["mode"] = -1
