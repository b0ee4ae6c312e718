"""The rows of the fault types as arrays, and their kernels as one kernel for each part.

Every file under `table/` is read: a new type is one more row. The number h of a type is its place in TYPES.
"""

import pkgutil
from importlib import import_module
from typing import Any

import numpy as np

from beaver_ftc.compiled import kernel, one_of
from beaver_ftc.diagnosis.sets import EMPTY_SET, UNLIMITED_SET
from beaver_ftc.diagnosis.types import MODES, REST_HIDES_TYPE, FaultType, Kernel, table


def _load_types() -> tuple[FaultType, ...]:
    """The rows of all files: types with a constant parameter first, then by rank and name. Kernels rely on
    this order: the constant types are 0 to N_CONSTANT - 1."""
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
    """The part `name` of each type h that has it: h -> part."""
    parts = {h: getattr(row, name) for h, row in enumerate(TYPES)}
    return {h: part for h, part in parts.items() if part is not None}


# Columns of the table, by type; `FaultType` says what they are.
MODE = _type_column("accommodation_mode")
STOP_SIDE = _type_column("stop_direction")
REST = _type_column("evidence_at_rest")
HOLDS = _type_column("holds_surface")
SHOW_HALF_CYCLES = _type_column("show_half_cycles")
WAIT_HALF_CYCLES = _type_column("wait_half_cycles")
FOLLOWS_COMMAND = _type_column("follows_command")
MUST_SHOW = np.array([row.has_shown is not None for row in TYPES])
# CAN_LOOK_LIKE[h, j]: whether type h can look like type j. SERVES[mode, h]: whether a mode serves type h.
CAN_LOOK_LIKE = np.array([[other.name in row.can_look_like for other in TYPES] for row in TYPES])
SERVES = np.array(
    [[mode in (row.accommodation_mode, *row.other_accommodation_modes) for row in TYPES] for mode in MODES]
)
# Masks of types (N_TYPES,): all; with a constant parameter, and varying ones; of the varying ones, those that
# must show themselves, and the quiet ones, which need not; of one mode, VARYING_OF_MODE[mode]; those that can
# look like type h, VARYING_LIKE[h].
ALL, CONSTANT = np.ones(N_TYPES, bool), np.arange(N_TYPES) < N_CONSTANT
VARYING = ~CONSTANT
VARYING_SHOWN, VARYING_QUIET = VARYING & MUST_SHOW, VARYING & ~MUST_SHOW
VARYING_OF_MODE = VARYING & (np.array(MODES)[:, None] == MODE)
VARYING_LIKE = VARYING & CAN_LOOK_LIKE.T
HIDDEN_AT_REST = REST == REST_HIDES_TYPE
# NAMED[h]: mask of the types that have the name of type h, if h is the first of them; NAMED[-1], the last
# row, which the number TYPE_UNDECIDED (-1) selects: all types.
NAMED = np.array([*(np.array(SAME_NAME) == h for h in range(N_TYPES)), ALL])
# Types that can give the deflection error of a surface, in the order of their precedence.
ERROR_TYPES = np.array(
    sorted(_parts_of("deflection_error"), key=lambda h: TYPES[h].deflection_error_precedence), dtype=int
)
# END_TYPE[h]: the type that h becomes at the end of its range, -1 for none.
END_TYPE = np.array([TYPE_NAMES.index(row.end_type) if row.end_type else -1 for row in TYPES])


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
