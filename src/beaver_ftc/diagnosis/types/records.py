"""The records of the fault types, and their configuration.

types: of `fault_types_dtype`.
"""

from functools import lru_cache
from math import ceil, pi, radians

import numpy as np

from beaver_ftc.compiled import record, sized
from beaver_ftc.diagnosis.actuators import DEFAULT_RATE_RAD_S, servo_data
from beaver_ftc.diagnosis.state import PITCH_GROUP, fill
from beaver_ftc.diagnosis.types import OBSERVATION_RECORD
from beaver_ftc.diagnosis.types.registry import N_TYPES, TYPES
from beaver_ftc.scenario.declared import Declared

# Of frames examined together where gyros are noisy: much less than the slowest half-cycle, by default 3.1 s.
BLOCK_DURATION_S = 0.2
MAX_BLOCK = 256  # frames of a block
N_KEPT = 3  # frames, or blocks, of which the orders are kept: the elapsed one and two before it

# Commands to one surface, rad; [0] belongs to the elapsed frame or block, [1] to the one before.
COMMANDS_RECORD = record(
    history=(N_KEPT, MAX_BLOCK), cmd_min=N_KEPT,
    cmd_max=N_KEPT,
    u_min=2, u_max=2,  # where a healthy surface was within it
    # G of the surface within the elapsed frame or block, on its dominant axis, rad/s2 per rad
    G_min=float, G_max=float,
)  # fmt: skip

# Configuration: the actuator of one surface; rad. runaway: rad/s; approaches: shares of the way in a JSBSim
# step; uncertain: 0 or 1. It acts where it can reach: a part of its travel is nearer to zero.
ACTUATOR_CONFIG_RECORD = record(
    stop_lo=float, stop_hi=float, reach_lo=float, reach_hi=float, runaway=float,
    approaches=2, steps=2, band=float, uncertain=int,
    # the least step of a slow one, and from where on its lag or dead band makes steps smaller
    slow_step=float, near=float,
)  # fmt: skip

# The set of each type's parameter: types/__init__.py; and what was known of the first of two faults when it
# was named: pairs.py.
FEASIBLE_SETS_RECORD = record(low=N_TYPES, high=N_TYPES, excluded=(int, N_TYPES))

# Counts of frames in which something was wrong: all; those in which a surface that was given up stayed at its
# rest position; those since a stop could last hide a deflection. The first such frame, and where the surface
# was in it, rad.
EVIDENCE_RECORD = record(
    n_anomalous=int, n_rest=int, n_unhidden=int, k_first=int, first_lo=float, first_hi=float
)

# Whether the surface may be the only one at fault; what decides whether it can be at fault:
# BY_ESTIMATOR, DEDUCED_FAULTY or DEDUCED_HEALTHY (verdict.py);
# whether it is isolated, of which type, -1 if open, and since when, s: pairs.py.
STATUS_RECORD = record(
    may_be_sole=int, basis=int, is_isolated=int, isolated_at_s=float, fault_type=int, typed_at_s=float
)

# The mode of accommodation, -1 for none; frames since the fault last showed: verdict.py.
ACCOMMODATION_RECORD = record(mode=int, n_silent=int)

# Where a surface can be that a type has held and released, rad: release.py. held: where it is held by then;
# set: the set of the type before the release.
RELEASE_RECORD = record(
    back_lo=(2, N_TYPES), back_hi=(2, N_TYPES), released=(int, N_TYPES), held_lo=N_TYPES, held_hi=N_TYPES,
    set_lo=(2, N_TYPES), set_hi=(2, N_TYPES),
)  # fmt: skip

# What the types go by: whether a frame shows one instant, instants in it, whether a surface returns by its
# actuator, frames of half of the slowest oscillation, whether a fault is declared to stay as it is and errors
# of the surfaces' own terms are; frames of a block and its duration; dt s.
TYPES_CONFIG_RECORD = record(
    single_instant=int, n_substeps=int, returns_lagged=int, half_frames=int, abrupt=int, has_eG=int,
    frames_per_block=int, block_duration_s=float, dt=float,
)  # fmt: skip

# Two faults at once: pairs.py; alarms of the groups, and what is known of the first fault in pitch.
# n_unstored: frames since a type was excluded on its surface that is not yet excluded in the stored sets.
FAULT_PAIR_RECORD = record(
    enabled=int, group_alarm=(int, 2), lateral_outside=int, first_pitch=int, n_unstored=int
)

# Blocks of frames.
FRAME_BLOCK_RECORD = record(n_so_far=int, nu=3, nu_bound=3, n_start=3)


@lru_cache
def surface_types_dtype() -> np.dtype:
    """One surface's records: configuration, observations (types/__init__.py), the memories of the types, and
    what is concluded. not_at_position: as verdict.py keeps it."""
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
    """Faults of every type on n surfaces: types/."""
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
    """Fill the configuration of the types and the actuator of each surface; travel (2, n): the stops, rad."""
    fdi, dt = declared.fdi, 1.0 / declared.rate_hz
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
    data, h = servo_data(declared), dt / declared.substeps
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
