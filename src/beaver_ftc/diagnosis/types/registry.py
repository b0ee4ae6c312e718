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

types: of `types_dtype`. estimators: those of the isolation, by the layout. bound: of `bound_dtype`.
"""

import pkgutil
from functools import lru_cache
from importlib import import_module
from math import ceil, pi, radians
from typing import Any

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis import isolation
from beaver_ftc.diagnosis.state import PITCH_GROUP
from beaver_ftc.diagnosis.types import contract, table
from beaver_ftc.diagnosis.types.contract import (
    EMPTY_SET,
    GIVE_UP,
    OBSERVATION,
    REST_AGREES,
    REST_EXCLUDES,
    FaultType,
    Kernel,
)
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario

BLOCK_S = (
    0.2  # of frames examined together where gyros are noisy: much less than the slowest half-cycle, 3.1 s
)
RUNAWAY_RATE_RAD_S = pi / 3.0  # of an actuator with no declared rate limit: the aircraft's default


def _rows() -> tuple[FaultType, ...]:
    """Those of a constant parameter first, then by rank: a type's number is its place."""
    names = sorted(f"{table.__name__}.{info.name}" for info in pkgutil.iter_modules(table.__path__))
    rows = [row for name in names for row in import_module(name).TYPES]
    return tuple(sorted(rows, key=lambda row: (not row.constant, row.rank, row.name)))


TYPES = _rows()
N_TYPES = len(TYPES)
N_CONSTANT = sum(row.constant for row in TYPES)
NAMES: tuple[str, ...] = tuple(row.name for row in TYPES)
WORDS: tuple[str, ...] = tuple(row.words or row.name for row in TYPES)
FIRST_OF_NAME = tuple(NAMES.index(name) for name in NAMES)  # the first type of the same name


def _column(name: str) -> np.ndarray:
    """A column of whole numbers or flags of the table, by type."""
    return np.array([int(getattr(row, name)) for row in TYPES])


def _parts(name: str) -> dict[int, Kernel]:
    """This part of each type that has it."""
    parts = {kind: getattr(row, name) for kind, row in enumerate(TYPES)}
    return {kind: part for kind, part in parts.items() if part is not None}


def _looks_like(row: FaultType, other: FaultType) -> bool:
    return other.name in row.mistaken_for


# The columns that verdict.py reads; contract.py says what they are.
ACCOMMODATION, DIRECTION, AT_REST = (_column(name) for name in ("accommodation", "direction", "at_rest"))
SHOWS_WITHIN, HALF_CYCLES = _column("shows_within"), _column("half_cycles")
FOLLOWS_COMMAND = _column("follows_command")
MUST_SHOW = np.array([row.has_shown is not None for row in TYPES])
MISTAKEN_FOR = np.array([[_looks_like(row, other) for other in TYPES] for row in TYPES])
SERVES_TYPE = np.array(
    [[mode == row.accommodation or mode in row.also for row in TYPES] for mode in range(4)]
)
# Types that give the deflection error of a surface, in the order in which they are used.
ERROR_ORDER = np.array(sorted(_parts("expected_error"), key=lambda kind: TYPES[kind].error_rank), dtype=int)
LIMIT_TYPE = np.array([NAMES.index(row.limit) if row.limit else -1 for row in TYPES])


def kind_of(name: str, *, constant: bool = True, direction: int = 0) -> int:
    """The number of a type, by its name in the table; direction: the stop to which it runs, if it does."""
    sought = (name, constant, direction)
    return [(row.name, row.constant, row.direction) for row in TYPES].index(sought)


def _compiled(name: str, arguments: str, lines: list[str], space: dict[str, Any]) -> Kernel:
    """A kernel whose body is `lines`, in which `part_3` is a part of type 3.

    Compiled code calls only what it can name, so the calls are written out, one a type.
    """
    source = "\n    ".join([f"def {name}({arguments}):", *lines])
    exec(compile(source, __file__, "exec"), space)
    return kernel(space[name])


def _call(kind: int, arguments: str) -> str:
    """The call of a part of type `kind`; the argument of that name is its number."""
    given = (str(kind) if argument == "kind" else argument for argument in arguments.split(", "))
    return f"part_{kind}({', '.join(given)})"


def _space(parts: dict[int, Kernel], **further: Any) -> dict[str, Any]:
    """The names that a kernel which calls these parts needs."""
    return {"__name__": __name__, **{f"part_{kind}": part for kind, part in parts.items()}, **further}


def _call_each(name: str, arguments: str, then: Kernel | None = None) -> Kernel:
    """A kernel that calls this part of every type; then(surface, kind, interval): with what that returns."""
    parts = _parts(name)
    taken = ", ".join(argument for argument in arguments.split(", ") if argument != "kind")
    calls = {kind: _call(kind, arguments) for kind in parts}
    lines = [f"then(surface, {kind}, {call})" if then else call for kind, call in calls.items()]
    return _compiled(f"{name}_each", taken, [*lines, "return"], _space(parts, then=then))


def _call_one(name: str, arguments: str, otherwise: Any) -> Kernel:
    """A kernel that returns what this part of the type `kind` returns; `otherwise` for a type without it."""
    parts = _parts(name)
    lines = [f"if kind == {kind}: return {_call(kind, arguments)}" for kind in parts]
    taken = arguments if "kind" in arguments.split(", ") else f"{arguments}, kind"
    return _compiled(f"{name}_of", taken, [*lines, "return otherwise"], _space(parts, otherwise=otherwise))


_FRAME = "config, surface, kind, k"
begin_each = _call_each("begin", "surface, kind")
fill_each = _call_each("whole_range", "surface", contract.replace_set)
on_frame_each = _call_each("on_frame", "config, surface, kind")
on_skipped_frame_each = _call_each("on_skipped_frame", _FRAME)
judge_each = _call_each("judge", _FRAME, contract.intersect_set)
on_release_each = _call_each("on_release", _FRAME)
restore_each = _call_each("restored", "surface, kind", contract.replace_set)
propagate_release_each = _call_each("propagate_release", "config, surface, kind")
has_shown = _call_one("has_shown", "surface", True)
differs = _call_one("differs", "surface, direction", False)
deflection = _call_one("deflection", _FRAME, EMPTY_SET)
expected_error = _call_one("expected_error", "surface, kind", np.nan)

MAX_BLOCK = 256  # frames of a block
N_KEPT_BLOCKS = 3  # frames, or blocks, of which the orders are kept: the elapsed one and two before it

# Commands to one surface, rad; [0] belongs to the elapsed frame or block, [1] to the one before.
COMMANDS = record(
    given=(N_KEPT_BLOCKS, MAX_BLOCK), low=N_KEPT_BLOCKS, high=N_KEPT_BLOCKS,
    least=2, greatest=2,  # where a healthy surface was within it
    G_least=float, G_most=float,  # its effectiveness within the elapsed frame or block
)  # fmt: skip

# Configuration: the actuator of one surface, rad. It acts where it can reach: a part of its travel is nearer
# to zero.
ACTUATOR = record(
    travel_low=float, travel_high=float, reach_low=float, reach_high=float, least_runaway_rate=float,
    approach=float, step=float, slowest_step=float,
)  # fmt: skip

# The set of each type's parameter: contract.py.
FEASIBLE = record(low=N_TYPES, high=N_TYPES, excluded=(int, N_TYPES))

# Frames in which something was wrong, and of them those in which a surface that was given up was quiet, and
# those since a stop could last hide something; the first, and where the surface was in it.
EVIDENCE = record(
    frames=int, rest_frames=int, unhidden_frames=int, started_at=int, start_low=float, start_high=float
)

# Whether the surface may be the one at fault by itself, and what decides whether it can be (verdict.py);
# whether it is named, of which type, -1 if open, and since when, s: pairs.py.
STATUS = record(is_candidate=int, decided_by=int, named=int, named_at_s=float, type=int, type_at_s=float)

# The mode of accommodation, -1 for none; frames since the fault last showed: verdict.py.
ACCOMMODATED = record(mode=int, frames_absent=int)

# Where a surface can be that a type has held and released, rad: table/held_surface.py.
RELEASE = record(
    low=(2, N_TYPES), high=(2, N_TYPES), released=(int, N_TYPES),
    held_low=N_TYPES, held_high=N_TYPES,  # where it is held by then
)  # fmt: skip

# What was known of the first of two faults when it was named: pairs.py.
FIRST_FAULT_SETS = record(low=N_TYPES, high=N_TYPES, excluded=(int, N_TYPES))

# What the types go by: whether a frame shows one instant, instants in it, whether a surface returns by its
# actuator, frames of half of the slowest oscillation, whether a fault is declared to stay as it is and errors
# of the surfaces' own terms are; frames of a block and its duration; dt s.
TYPES_CONFIG = record(
    whole=int, instants=int, released_returns=int, half_cycle_frames=int, abrupt=int,
    has_surface_errors=int, length=int, block_s=float,
    dt=float,
)  # fmt: skip

# Two faults at once: pairs.py; alarms of the groups, and what is known of the first fault in pitch.
FAULT_PAIR = record(enabled=int, alarmed=(int, 2), no_lateral_pair=int, first=int, frames_since_change=int)

# Blocks of frames.
FRAME_BLOCK = record(filled=int, innovation=3, bound=3, noise=3)


@lru_cache
def surface_dtype() -> np.dtype:
    """One surface's records: configuration, observations (contract.py), the memories of the types, and
    what is concluded. refuted: its estimator is excluded (verdict.py)."""
    own = {row.record: row.memory for row in TYPES if row.memory}
    return record(
        actuator=ACTUATOR, commands=COMMANDS, elapsed=OBSERVATION, judged=OBSERVATION, earlier=OBSERVATION,
        evidence=EVIDENCE, feasible=FEASIBLE, release=RELEASE, **own,
        estimator_excluded=int, status=STATUS, accommodation=ACCOMMODATED, known=FIRST_FAULT_SETS,
    )  # fmt: skip


@sized
def types_dtype(n: int) -> np.dtype:
    """Faults of every type on n surfaces: types/."""
    return record(
        config=TYPES_CONFIG, frame=int, pair=FAULT_PAIR, block=FRAME_BLOCK, surface=(surface_dtype(), n)
    )


def configure_types(
    types: np.void, layout: np.void, actuators: np.void, scenario: Scenario, travel: np.ndarray
) -> None:
    """Fill the configuration of the types and the actuator of each surface; travel (2, n) rad: the stops."""
    config, shared, dt = scenario.fdi, types["config"], 1.0 / scenario.rate_hz
    shared["length"] = block = ceil(BLOCK_S / dt) if Declared.of(scenario).sensors.declared.gyros_vary else 1
    shared["whole"], shared["block_s"] = scenario.substeps == 1 and block == 1, block * dt
    shared["half_cycle_frames"] = ceil(pi / config.slowest_oscillation_rad_s / (block * dt))
    shared["instants"], shared["released_returns"], shared["dt"] = scenario.substeps, actuators["real"], dt
    shared["abrupt"] = config.fault_profile == "abrupt"
    types["pair"]["first"], types["pair"]["enabled"] = -1, config.pairs
    surfaces, instant_s = scenario.airframe.surfaces, dt / scenario.substeps
    for s, (name, place, low, high) in enumerate(zip(surfaces, types["surface"], *travel, strict=True)):
        rate_deg_s, actuator = getattr(scenario.actuators, name).rate_limit_deg_s, place["actuator"]
        actuator["travel_low"], actuator["travel_high"] = low, high
        actuator["reach_low"], actuator["reach_high"] = min(low, 0.0), max(high, 0.0)
        actuator["approach"], actuator["step"] = actuators["approach"][s], actuators["step"][s]
        actuator["least_runaway_rate"] = 0.5 * (radians(rate_deg_s) or RUNAWAY_RATE_RAD_S)
        actuator["slowest_step"] = min(radians(config.slowest_rate_deg_s) * instant_s, actuator["step"])
        place["status"]["is_candidate"] = not config.pairs or layout["group"][s] == PITCH_GROUP
        place["accommodation"]["mode"] = place["status"]["type"] = -1


@kernel
def restart_types(types):
    """Nothing is known of any surface yet."""
    for surface in types.surface:
        restart_surface(surface)


@kernel
def restart_surface(surface):
    """Nothing is known of this surface yet."""
    contract.begin_sets(surface)
    fill_each(surface)
    contract.begin_observation(surface)
    surface.evidence.started_at = -1
    surface.evidence.frames = surface.evidence.rest_frames = surface.evidence.unhidden_frames = 0
    begin_each(surface)


@kernel
def record_commands(types, commanded, means):
    """Add a frame to the orders of the surfaces: commanded (n,) rad; positions of healthy surfaces and their
    least and greatest effectiveness within it: means of a `belief.means_dtype`.
    """
    length = types.config.length
    for s, surface in enumerate(types.surface):
        commands = surface.commands
        if types.block.filled == 0:
            for age in range(N_KEPT_BLOCKS - 1, 0, -1):
                commands.given[age, :length] = commands.given[age - 1, :length]
                commands.low[age], commands.high[age] = commands.low[age - 1], commands.high[age - 1]
            commands.low[0], commands.high[0] = np.inf, -np.inf
            commands.least[1], commands.greatest[1] = commands.least[0], commands.greatest[0]
            commands.least[0], commands.greatest[0] = np.inf, -np.inf
            commands.G_least, commands.G_most = np.inf, -np.inf
        order = min(max(commanded[s], surface.actuator.travel_low), surface.actuator.travel_high)
        commands.given[0, types.block.filled] = order
        commands.low[0], commands.high[0] = min(commands.low[0], order), max(commands.high[0], order)
        commands.least[0] = min(commands.least[0], means.u_least[s])
        commands.greatest[0] = max(commands.greatest[0], means.u_most[s])
        commands.G_least = min(commands.G_least, means.G_least[s])
        commands.G_most = max(commands.G_most, means.G_most[s])


@kernel
def observe_frame(types, layout, estimators, innovation, bound):
    """Find where each surface was in the elapsed frame, or block, if it alone is at fault.

    bound (3,): on its innovation (3,) without a fault, rad/s2.
    """
    anomalous = not isolation.is_healthy(innovation, bound)
    for s, surface in enumerate(types.surface):
        contract.shift_observations(surface)
        contract.set_anomalous(surface, anomalous)
        fie, axis = estimators[layout.position_estimator[s]], layout.dominant_axis[s]
        effect = fie.block_effect if types.config.length > 1 else fie.effect
        contract.locate_surface(types.config, surface, fie, axis, innovation, bound, effect)


@kernel
def count_evidence(surface):
    """Count a frame as evidence, and as evidence since a stop could last hide a swing (`judge_frame`)."""
    surface.evidence.frames += 1
    surface.evidence.unhidden_frames += 1


@kernel
def judge_surface(config, surface, k):
    """Hold every type of one surface against the frame before the elapsed one: something was wrong in it."""
    evidence, seen = surface.evidence, surface.judged
    if seen.low > seen.high:
        return
    if evidence.started_at < 0:
        evidence.started_at, evidence.start_low, evidence.start_high = k, seen.low, seen.high
    judge_each(config, surface, k)


@kernel
def judge_frame(types):
    """Judge the frame before the elapsed one."""
    config, k = types.config, types.frame - 1
    for s, surface in enumerate(types.surface):
        on_frame_each(config, surface)
        if config.released_returns and types.frame > 0:
            on_release_each(config, surface, k)
        if config.abrupt and surface.accommodation.mode == GIVE_UP and not surface.judged.anomalous:
            count_rest(types, s)
        elif surface.judged.anomalous and (
            config.whole or (surface.earlier.anomalous and surface.elapsed.anomalous)
        ):
            count_evidence(surface)
            judge_surface(config, surface, k)
        else:
            on_skipped_frame_each(config, surface, k)
        if config.released_returns and types.frame > 0:
            restore_each(surface)
            propagate_release_each(config, surface)
        if surface.judged.stop_hides[0] or surface.judged.stop_hides[1]:
            surface.evidence.unhidden_frames = 0
    types.frame += 1


@kernel
def examine_frame(types, layout, estimators, innovation, bound):
    """Observe the elapsed frame, or the block that it completes, and judge the one before."""
    if types.config.length > 1:
        examine_block(types, layout, estimators, innovation, bound)
        return
    observe_frame(types, layout, estimators, innovation, bound.frame)
    judge_frame(types)


@kernel
def begin_block(types, layout, estimators, noise_before):
    """Begin a block with the elapsed frame; noise_before (3,): as it began."""
    block = types.block
    block.innovation[:], block.bound[:] = 0.0, 0.0
    block.noise[:] = noise_before
    for e in layout.position_estimator:
        isolation.clear_mean_effect(estimators[e].block_effect)


@kernel
def add_to_block(types, layout, estimators, innovation, eta_bar):
    """Add the elapsed frame to the means over the block."""
    block, share = types.block, 1.0 / types.config.length
    for i in range(3):
        block.innovation[i] += share * innovation[i]
        block.bound[i] += share * eta_bar[i]
    for e in layout.position_estimator:
        isolation.add_to_mean_effect(estimators[e].block_effect, estimators[e].effect, share)


@kernel
def examine_block(types, layout, estimators, innovation, bound):
    """Add the elapsed frame to its block; with the last frame, observe the block and judge the one before."""
    config, block = types.config, types.block
    if block.filled == 0:
        begin_block(types, layout, estimators, bound.noise_before)
    add_to_block(types, layout, estimators, innovation, bound.eta_bar)
    block.filled += 1
    if block.filled < config.length:
        return
    block.filled = 0
    for i in range(3):
        block.bound[i] += (block.noise[i] + bound.noise[i]) / config.block_s
    observe_frame(types, layout, estimators, block.innovation, block.bound)
    judge_frame(types)


@kernel
def count_rest(types, s):
    """A surface given up, and commanded to where it happens to be, shows by its quiet that it does not swing.

    That is evidence against the other surfaces too, as far as only one of them all is in question. It takes a
    fault that is declared to stay: of one that may go, the quiet may be that of health.
    """
    surface = types.surface[s]
    if not agrees_with_rest(surface):
        return
    for i, other in enumerate(types.surface):
        if i == s or (surface.status.is_candidate and other.status.is_candidate):
            count_evidence(other)
    surface.evidence.rest_frames += 1
    if surface.evidence.rest_frames > types.config.half_cycle_frames and not types.config.has_surface_errors:
        for kind in range(N_TYPES):
            if AT_REST[kind] == REST_EXCLUDES:
                contract.exclude_type(surface, kind)


@kernel
def agrees_with_rest(surface):
    """Whether the judged frame agrees with where the surface is known to stand."""
    for kind in range(N_TYPES):
        low, high = surface.feasible.low[kind], surface.feasible.high[kind]
        apart = surface.judged.low > high or surface.judged.high < low
        if AT_REST[kind] == REST_AGREES and apart:
            return False
    return True
