"""The rows of the table, as arrays over types; the kernels that call a part of every row; and the records.

Every file under `table/` is read, in the order of its name: a new type is one more file.
"""

import pkgutil
from functools import lru_cache
from importlib import import_module
from math import ceil, pi, radians
from typing import Any

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis.state import PITCH_GROUP
from beaver_ftc.diagnosis.types import contract, table
from beaver_ftc.diagnosis.types.contract import EMPTY_SET, OBSERVATION, FaultType, Kernel
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
SERVES = np.array([[mode == row.accommodation or mode in row.also for row in TYPES] for mode in range(4)])
# Types that give the deflection error of a surface, in the order in which they are used.
ERROR_ORDER = np.array(sorted(_parts("expected_error"), key=lambda kind: TYPES[kind].error_rank), dtype=int)
LIMIT = np.array([NAMES.index(row.limit) if row.limit else -1 for row in TYPES])


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

MAX_BLOCK = 256  # frames of a block: examine.py
N_KEPT_BLOCKS = 3  # frames, or blocks, of which the orders are kept: the elapsed one and two before it

# Orders to one surface, rad; [0] belongs to the elapsed frame or block, [1] to the one before: examine.py.
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
# those since a stop could last hide something; the first, and where the surface was in it: examine.py.
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
KNOWN = record(low=N_TYPES, high=N_TYPES, excluded=(int, N_TYPES))

# What the types go by: whether a frame shows one instant, instants in it, whether a surface returns by its
# actuator, frames of half of the slowest oscillation, whether a fault is declared to stay as it is and errors
# of the surfaces' own terms are; frames of a block and its duration; dt s.
TYPES_CONFIG = record(
    whole=int, instants=int, released_returns=int, half_cycle_frames=int, abrupt=int,
    has_surface_errors=int, length=int, block_s=float,
    dt=float,
)  # fmt: skip

# Two faults at once: pairs.py; alarms of the groups, and what is known of the first fault in pitch.
PAIR = record(enabled=int, alarmed=(int, 2), no_lateral_pair=int, first=int, frames_since_change=int)

# Blocks of frames: examine.py.
FRAME_BLOCK = record(filled=int, innovation=3, bound=3, noise=3)


@lru_cache
def surface_dtype() -> np.dtype:
    """One surface's records: configuration, observations (contract.py), the memories of the types, and
    what is concluded. refuted: its estimator is excluded (verdict.py)."""
    own = {row.record: row.memory for row in TYPES if row.memory}
    return record(
        actuator=ACTUATOR, commands=COMMANDS, elapsed=OBSERVATION, judged=OBSERVATION, earlier=OBSERVATION,
        evidence=EVIDENCE, feasible=FEASIBLE, release=RELEASE, **own,
        estimator_excluded=int, status=STATUS, accommodation=ACCOMMODATED, known=KNOWN,
    )  # fmt: skip


@sized
def types_dtype(n: int) -> np.dtype:
    """Faults of every type on n surfaces: types/."""
    return record(config=TYPES_CONFIG, frame=int, pair=PAIR, block=FRAME_BLOCK, surface=(surface_dtype(), n))


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
