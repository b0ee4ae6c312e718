"""The rows of the fault types as arrays, their records, and the examination of a frame by every type.

Every file under `table/` is read, in the order of its name: a new type is one more row.

*Examination.* In each frame, or block of frames: where was each surface, and was anything wrong? A frame is
judged one frame later: with several JSBSim frames in one of ours a fault may begin or end within a frame,
which then shows a part of it; such a frame, next to a healthy one, is skipped.

Where the noise of a gyro makes single frames uninformative, frames are examined in blocks. Summed over a
block the innovation holds the noise of its two ends alone, n[k+N] - n[k]. So the mean over N frames has the
bound

    mean eta_bar + (nbar[k] + nbar[k+N]) / (N dt)

which gives the mean position of the surface, weighted by its effectiveness G, whose sign stays. The weighted
mean of a constant position, offset or effectiveness is exact; that of a varying one lies between its
extremes. To the types a block is like a frame that consists of several JSBSim frames: a block next to a
healthy one is skipped.

types: of `fault_types_dtype`. estimators: those of the isolation, by the layout. bound: of `bound_dtype`.
"""

import pkgutil
from functools import lru_cache
from importlib import import_module
from math import ceil, pi, radians
from typing import Any

import numpy as np

from beaver_ftc.compiled import kernel, one_of, record, sized
from beaver_ftc.diagnosis import isolation
from beaver_ftc.diagnosis.actuators import DEFAULT_RATE_RAD_S, servo_data
from beaver_ftc.diagnosis.sets import EMPTY_SET, UNLIMITED_SET
from beaver_ftc.diagnosis.state import PITCH_GROUP, fill
from beaver_ftc.diagnosis.types import (
    GIVE_UP,
    OBSERVATION_RECORD,
    REST_EXCLUDES_TYPE,
    REST_HIDES_TYPE,
    REST_POSITION_IS_PARAMETER,
    FaultType,
    Kernel,
    clip_travel,
    copy_observation,
    intersect_set,
    observe_surface,
    put_set,
    release,
    set_anomalous,
    table,
)
from beaver_ftc.scenario.declared import Declared

BLOCK_DURATION_S = (
    0.2  # of frames examined together where gyros are noisy: much less than the slowest half-cycle, 3.1 s
)


def _load_types() -> tuple[FaultType, ...]:
    """Those of a constant parameter first, then by rank: a type's number is its place."""
    names = sorted(f"{table.__name__}.{info.name}" for info in pkgutil.iter_modules(table.__path__))
    rows = [row for name in names for row in import_module(name).TYPES]
    return tuple(sorted(rows, key=lambda row: (not row.has_constant_parameter, row.sort_rank, row.name)))


TYPES = _load_types()
N_TYPES = len(TYPES)
N_CONSTANT = sum(row.has_constant_parameter for row in TYPES)
TYPE_NAMES: tuple[str, ...] = tuple(row.name for row in TYPES)
DESCRIPTIONS_IN_TYPE_ORDER: tuple[str, ...] = tuple(row.description or row.name for row in TYPES)
SAME_NAME = tuple(TYPE_NAMES.index(name) for name in TYPE_NAMES)  # the first type of the same name


def _type_column(name: str) -> np.ndarray:
    """A column of whole numbers or flags of the table, by type."""
    return np.array([int(getattr(row, name)) for row in TYPES])


def _parts_of(name: str) -> dict[int, Kernel]:
    """This part of each type that has it."""
    parts = {h: getattr(row, name) for h, row in enumerate(TYPES)}
    return {h: part for h, part in parts.items() if part is not None}


# The columns that verdict.py reads; `FaultType` says what they are.
MODE, STOP_SIDE, REST, HOLDS = (
    _type_column(name)
    for name in ("accommodation_mode", "stop_direction", "evidence_at_rest", "holds_surface")
)
SHOW_HALF_CYCLES = _type_column("show_half_cycles")
WAIT_HALF_CYCLES = _type_column("wait_half_cycles")
FOLLOWS_COMMAND = _type_column("follows_command")
MUST_SHOW = np.array([row.has_shown is not None for row in TYPES])
CAN_LOOK_LIKE = np.array([[other.name in row.can_look_like for other in TYPES] for row in TYPES])
SERVES = np.array(
    [[mode in (row.accommodation_mode, *row.other_accommodation_modes) for row in TYPES] for mode in range(4)]
)
# Masks of types (N_TYPES,): all, those of a constant parameter, others; of these, those that must show
# themselves and those that need not; those of one mode, and those that can look like one type.
ALL, CONSTANT = np.ones(N_TYPES, bool), np.arange(N_TYPES) < N_CONSTANT
VARYING = ~CONSTANT
VARYING_SHOWN, VARYING_QUIET = VARYING & MUST_SHOW, VARYING & ~MUST_SHOW
VARYING_OF_MODE = VARYING & (np.arange(4)[:, None] == MODE)
VARYING_LIKE = VARYING & CAN_LOOK_LIKE.T
HIDDEN_AT_REST = REST == REST_HIDES_TYPE
# The same of one name, by the first type of it; of any name, by TYPE_UNDECIDED (-1)
NAMED = np.array([*(np.array(SAME_NAME) == h for h in range(N_TYPES)), ALL])
# Types that give the deflection error of a surface, in the order in which they are used.
ERROR_TYPES = np.array(
    sorted(_parts_of("deflection_error"), key=lambda h: TYPES[h].deflection_error_precedence), dtype=int
)
END_TYPE = np.array([TYPE_NAMES.index(row.end_type) if row.end_type else -1 for row in TYPES])


def type_index_of(name: str, *, has_constant_parameter: bool = True, stop_direction: int = 0) -> int:
    """The number of a type, by its name in the table; stop_direction: of the stop to which it runs."""
    sought = (name, has_constant_parameter, stop_direction)
    return [(row.name, row.has_constant_parameter, row.stop_direction) for row in TYPES].index(sought)


def _by_type(name: str, default: Any) -> Kernel:
    """A kernel (h, *arguments) that returns what this part of type h returns for these arguments; `default`
    for a type without it."""

    @kernel
    def otherwise(*arguments):
        return default

    return one_of(_parts_of(name), otherwise)


reset_memory = _by_type("reset_memory", None)
parameter_range = _by_type("parameter_range", UNLIMITED_SET)
see_frame = _by_type("see_frame", None)
consistent_interval = _by_type("consistent_interval", UNLIMITED_SET)
has_shown = _by_type("has_shown", True)
motion_rules_out = _by_type("motion_rules_out", False)
deflection_range = _by_type("deflection_range", EMPTY_SET)
deflection_error = _by_type("deflection_error", np.nan)

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

# Configuration: the actuator of one surface, rad. It acts where it can reach: a part of its travel is nearer
# to zero.
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


@kernel
def restart_types(types):
    """Nothing is known of any surface yet."""
    for srf in types.surface:
        restart_surface(srf)


@kernel
def restart_surface(srf):
    """Nothing is known of this surface yet."""
    srf.sets.excluded[:] = 0
    srf.last.lo, srf.last.hi = srf.actuator.reach_lo, srf.actuator.reach_hi
    srf.evidence.k_first = -1
    srf.evidence.n_anomalous = srf.evidence.n_rest = srf.evidence.n_unhidden = 0
    for h in range(N_TYPES):
        put_set(srf, h, parameter_range(h, srf, h))
        reset_memory(h, srf, h)
        release.allow_before(srf, h)


@kernel
def record_commands(types, u, ext):
    """Add a frame to the commands u (n,) of the surfaces; ext: extremes, within it, of where healthy
    surfaces were and of G, of a `model_prediction.frame_means_dtype`.
    """
    n = types.config.frames_per_block
    for s, srf in enumerate(types.surface):
        cmd = srf.commands
        if types.block.n_so_far == 0:
            for b in range(N_KEPT - 1, 0, -1):
                cmd.history[b, :n] = cmd.history[b - 1, :n]
                cmd.cmd_min[b], cmd.cmd_max[b] = (cmd.cmd_min[b - 1], cmd.cmd_max[b - 1])
            cmd.u_min[1], cmd.u_max[1] = cmd.u_min[0], cmd.u_max[0]
            cmd.cmd_min[0] = cmd.u_min[0] = cmd.G_min = np.inf
            cmd.cmd_max[0] = cmd.u_max[0] = cmd.G_max = -np.inf
        p = clip_travel(srf, u[s])
        cmd.history[0, types.block.n_so_far] = p
        cmd.cmd_min[0], cmd.cmd_max[0] = (min(cmd.cmd_min[0], p), max(cmd.cmd_max[0], p))
        cmd.u_min[0] = min(cmd.u_min[0], ext.u_min[s])
        cmd.u_max[0] = max(cmd.u_max[0], ext.u_max[s])
        cmd.G_min = min(cmd.G_min, ext.G_min[s])
        cmd.G_max = max(cmd.G_max, ext.G_max[s])


@kernel
def observe_surfaces(types, layout, est, nu, nu_max):
    """Find where each surface was in the elapsed frame, or block, if it alone is at fault."""
    anomalous = not isolation.eta_explains(nu, nu_max)
    for s, srf in enumerate(types.surface):
        copy_observation(srf.earlier, srf.judged)
        copy_observation(srf.judged, srf.last)
        set_anomalous(srf, anomalous)
        fie, axis = est[layout.position[s]], layout.dominant_axis[s]
        eff = fie.mean_effect if types.config.frames_per_block > 1 else fie.effect
        observe_surface(types.config, srf, fie, axis, nu, nu_max, eff)


@kernel
def count_anomaly(srf):
    """Count a frame as evidence, and as evidence since a stop could last hide a swing (`judge_frame`)."""
    srf.evidence.n_anomalous += 1
    srf.evidence.n_unhidden += 1


@kernel
def judge_types(c, srf, k):
    """Test every type of one surface with the judged frame, in which something was wrong."""
    ev, now = srf.evidence, srf.judged
    if now.lo > now.hi:
        return
    if ev.k_first < 0:
        (ev.k_first, ev.first_lo, ev.first_hi) = (k, now.lo, now.hi)
    for h in range(N_TYPES):
        if HOLDS[h]:
            intersect_set(srf, h, release.held_set(c, srf, h, *deflection_range(h, c, srf, h, k)))
        else:
            intersect_set(srf, h, consistent_interval(h, c, srf, h, k))


@kernel
def judge_frame(types):
    """Judge the frame before the elapsed one."""
    c, k = types.config, types.frame_index - 1
    returns = c.returns_lagged and types.frame_index > 0
    for s, srf in enumerate(types.surface):
        rests = c.abrupt and srf.accommodation.mode == GIVE_UP and not srf.judged.anomalous
        judges = srf.judged.anomalous and (c.single_instant or (srf.earlier.anomalous and srf.last.anomalous))
        for h in range(N_TYPES):
            see_frame(h, c, srf, h, k, not (rests or judges))
            if returns and HOLDS[h]:
                lo, hi = deflection_range(h, c, srf, h, k if c.single_instant else k - 1)
                release.begin_release(c, srf, h, lo, hi, STOP_SIDE[h])
        if rests:
            count_rest(types, s)
        if judges:
            count_anomaly(srf)
            judge_types(c, srf, k)
        for h in range(N_TYPES):
            if returns and HOLDS[h]:
                release.advance_returns(c, srf, h)
        if srf.judged.hides[0] or srf.judged.hides[1]:
            srf.evidence.n_unhidden = 0
    types.frame_index += 1


@kernel
def observe_frame(types, layout, est, nu, bound):
    """Observe the elapsed frame, or the block that it completes, and judge the one before."""
    if types.config.frames_per_block > 1:
        extend_block(types, layout, est, nu, bound)
        return
    observe_surfaces(types, layout, est, nu, bound.nu_max)
    judge_frame(types)


@kernel
def extend_block(types, layout, est, nu, bound):
    """Add the elapsed frame to the means over its block; with the last frame, observe the block and judge
    the one before:

    nu_bound = mean eta_bar + (nbar[k] + nbar[k+N]) / (N dt)
    """
    c, block = types.config, types.block
    share = 1.0 / c.frames_per_block
    if block.n_so_far == 0:
        block.nu[:] = block.nu_bound[:] = 0.0
        block.n_start[:] = bound.n_old
    for j in layout.position:
        isolation.add_to_mean(est[j].mean_effect, est[j].effect, share, block.n_so_far == 0)
    block.n_so_far += 1
    for i in range(3):
        block.nu[i] += share * nu[i]
        block.nu_bound[i] += share * bound.eta_bar[i]
        if block.n_so_far == c.frames_per_block:
            block.nu_bound[i] += (block.n_start[i] + bound.n_gyro[i]) / c.block_duration_s
    if block.n_so_far == c.frames_per_block:
        block.n_so_far = 0
        observe_surfaces(types, layout, est, block.nu, block.nu_bound)
        judge_frame(types)


@kernel
def count_rest(types, s):
    """A surface given up, and commanded to where it happens to be, shows by its quiet that it does not swing.

    That is evidence against the other surfaces too, as far as only one of them all is in question. It takes a
    fault that is declared to stay: of one that may go, the quiet may be that of health.
    """
    srf = types.surface[s]
    if not agrees_at_rest(srf):
        return
    for i, other in enumerate(types.surface):
        if i == s or (srf.status.may_be_sole and other.status.may_be_sole):
            count_anomaly(other)
    srf.evidence.n_rest += 1
    if srf.evidence.n_rest > types.config.half_frames and not types.config.has_eG:
        for h in range(N_TYPES):
            if REST[h] == REST_EXCLUDES_TYPE:
                srf.sets.excluded[h] = 1


@kernel
def agrees_at_rest(srf):
    """Whether the judged frame agrees with where the surface is known to stand."""
    for h in range(N_TYPES):
        outside = srf.judged.lo > srf.sets.high[h] or srf.judged.hi < srf.sets.low[h]
        if REST[h] == REST_POSITION_IS_PARAMETER and outside:
            return False
    return True
