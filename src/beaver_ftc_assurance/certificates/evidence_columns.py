"""Additional columns of the log, with which the statements of a certificate are checked."""

from collections.abc import Sequence

import numpy as np

from beaver_ftc.design import AXES
from beaver_ftc.results import Document
from beaver_ftc_assurance.certificates import kinds
from beaver_ftc_assurance.certificates.certified import EvidenceColumns, PartialColumn
from beaver_ftc_assurance.certificates.tape import Tape


def evidence_columns(tape: Tape, surfaces: Sequence[str], statements: Sequence[Document]) -> EvidenceColumns:
    """The columns for these statements. For the fault of an estimator: its effect. For a fault type on a
    surface: the effect of the surface's position, the travel, the flags of the types that are excluded at the
    end of the tape, and the definitions of types that the checker does not define.
    """
    columns: EvidenceColumns = {}
    # `what` of a statement is None for the alarm, the name of an estimator, or a surface and a type in words.
    surfaces_of_types = [
        statement["what"].partition(" ")[0]
        for statement in statements
        if statement["what"] and " " in statement["what"]
    ]
    estimator_names = {statement["what"] for statement in statements} | {
        f"{surface}_position" for surface in surfaces_of_types
    }
    for e, name in enumerate(tape.names):
        if name in estimator_names:
            columns |= _effect_columns(tape, e)
    for surface in dict.fromkeys(surfaces_of_types):
        low, high = kinds.travel_rad(tape, surfaces.index(surface))
        columns |= _constants({f"{surface}_travel_low_rad": low, f"{surface}_travel_high_rad": high})
    for s, kind, first in kinds.excluded_types(tape):
        if surfaces[s] in surfaces_of_types and first < tape.end:
            flags = np.append(0.0, tape.types[:, s, kind] > 0)
            columns[kinds.exclusion_column(surfaces[s], kind)] = PartialColumn(tape.first - 1, flags)
            columns |= _constants(kinds.type_definition_columns(tape, surfaces[s], s, kind))
    return columns


def _effect_columns(tape: Tape, e: int) -> EvidenceColumns:
    """Offset, slope and spread of the effect of estimator e's fault by axis, and the range of its parameter.
    The effect is known in the frames of the tape only: NaN in the rows before and after.
    """
    name = f"fie_{tape.names[e]}"
    columns: EvidenceColumns = {}
    for quantity, unit in (("offset", "_rad_s2"), ("slope", ""), ("spread", "_rad_s2")):
        padded = np.pad(getattr(tape, quantity)[:, e], ((1, 1), (0, 0)), constant_values=np.nan)
        for axis, values in zip(AXES, padded.T, strict=True):
            columns[f"{name}_{axis}_{quantity}{unit}"] = PartialColumn(tape.first - 1, values)
    estimator = tape.alarm.diagnosis.estimators[e]
    ends = {f"{name}_theta_low": estimator.theta_min, f"{name}_theta_high": estimator.theta_max}
    return columns | _constants(ends)


def _constants(values: dict[str, float]) -> EvidenceColumns:
    """Columns with the same value in every row."""
    return {name: PartialColumn(0, np.array([value])) for name, value in values.items()}
