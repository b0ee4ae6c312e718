"""The columns of the log by which the statements of a certificate are checked, and which a log lacks."""

from collections.abc import Sequence

import numpy as np

from beaver_ftc.design import AXES
from beaver_ftc.results import Document
from beaver_ftc_assurance.certificates import kinds
from beaver_ftc_assurance.certificates.certified import EvidenceColumns, PartialColumn
from beaver_ftc_assurance.certificates.tape import Tape


def evidence_columns(tape: Tape, surfaces: Sequence[str], said: Sequence[Document]) -> EvidenceColumns:
    """The columns for these statements: for each estimator that they speak of the effect of its fault; for
    each fault type on a surface the surface's travel, whether the type is excluded, and what the type is
    where the checker does not define it."""
    found: EvidenceColumns = {}
    of_types = [one["what"].partition(" ")[0] for one in said if one["what"] and " " in one["what"]]
    wanted = {one["what"] for one in said} | {f"{surface}_position" for surface in of_types}
    for e, name in enumerate(tape.names):
        if name in wanted:
            found |= _effect_columns(tape, e)
    for surface in dict.fromkeys(of_types):
        low, high = kinds.travel_rad(tape, surfaces.index(surface))
        found |= _constants({f"{surface}_travel_low_rad": low, f"{surface}_travel_high_rad": high})
    for s, kind, _ in kinds.excluded_types(tape):
        if surfaces[s] in of_types:
            flags = np.append(0.0, tape.types[:, s, kind] > 0)
            found[kinds.exclusion_column(surfaces[s], kind)] = PartialColumn(tape.first - 1, flags)
            found |= _constants(kinds.type_definition_columns(tape, surfaces[s], s, kind))
    return found


def _effect_columns(tape: Tape, e: int) -> EvidenceColumns:
    """Offset, slope and spread of the effect of estimator e's fault by axis, known in the frames of the tape
    only, and the range of its parameter."""
    name = f"fie_{tape.names[e]}"
    found: EvidenceColumns = {}
    for quantity, unit in (("offset", "_rad_s2"), ("slope", ""), ("spread", "_rad_s2")):
        known = np.pad(getattr(tape, quantity)[:, e], ((1, 1), (0, 0)), constant_values=np.nan)
        for axis, values in zip(AXES, known.T, strict=True):
            found[f"{name}_{axis}_{quantity}{unit}"] = PartialColumn(tape.first - 1, values)
    estimator = tape.alarm.diagnosis.estimators[e]
    ends = {f"{name}_theta_low": estimator.theta_min, f"{name}_theta_high": estimator.theta_max}
    return found | _constants(ends)


def _constants(values: dict[str, float]) -> EvidenceColumns:
    """Columns with the same value in every row."""
    return {name: PartialColumn(0, np.array([value])) for name, value in values.items()}
