"""The verdict on fault types in words: surface, type, candidates, estimate.

What the estimate is, and in which unit, the type's row says (`FaultType.estimate_parameter`). fdi: of
`schemes.fdi_dtype`; s: a surface; names: of all surfaces, in the order of the aircraft; kind: a type, or -1
while it is open.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH_GROUP, UNANTICIPATED
from beaver_ftc.diagnosis.types import GIVE_UP, SCALE_COMMAND, registry
from beaver_ftc.diagnosis.types.registry import CAN_LOOK_LIKE, CONSTANT, MODE, N_CONSTANT
from beaver_ftc.diagnosis.types.verdict import DEDUCED_FAULTY, DEDUCED_HEALTHY

FindingDict = dict[str, Any]
NO_FINDINGS: FindingDict = {
    "isolated": None, "isolation_type": None, "estimate": None, "isolation_time_s": None,
    "candidates": (), "faults": (),
}  # fmt: skip


def fault_finding_dict(fdi: np.void, names: Sequence[str]) -> FindingDict:
    """isolated, isolation_type, candidates, estimate and more of a flight diagnosed for every type."""
    if not fdi["verdict"]["detected"]:
        return dict(NO_FINDINGS)
    if fdi["types"]["pair"]["enabled"]:
        return _find_pair(fdi, names)
    return _find_one(fdi, names)


def _find_pair(fdi: np.void, names: Sequence[str]) -> FindingDict:
    """The fault named first as if it were alone, and all of them; what is open in a plane where none is.

        surfaces isolated    verdict            the finding itself            `faults`
        some                 any                the first isolated            those, then the open planes
        none                 unanticipated      unanticipated                 the open planes
        none                 another            candidates of open planes     the open planes

    An open plane has an alarm and no isolated surface.
    """
    status, alarms = fdi["types"]["surface"]["status"], fdi["types"]["pair"]["group_alarm"]
    estimator = fdi["verdict"]["isolated_estimator"]
    isolated = np.flatnonzero(status["is_isolated"]).tolist()
    isolated.sort(key=lambda s: status["isolated_at_s"][s])
    faults = [_finding_on_surface(fdi, s, int(status["fault_type"][s]), names) for s in isolated]
    groups = [np.flatnonzero(fdi["layout"]["group"] == group).tolist() for group in range(len(alarms))]
    if not alarms.any() and not faults and estimator == NOT_ISOLATED:
        # A statistical alarm names no plane: while no surface is isolated, the fault may be in any of them
        alarms = np.ones_like(alarms)
    undecided = [
        {**NO_FINDINGS, "candidates": tuple(_candidate_texts(fdi, members, names))}
        for alarm, members in zip(alarms, groups, strict=True)
        if alarm and not set(members) & set(isolated)
    ]
    if faults:
        return {**faults[0], "faults": (*faults, *undecided)}
    if estimator == UNANTICIPATED:
        return {**_find_one(fdi, names), "faults": tuple(undecided)}
    texts = tuple(text for finding in undecided for text in finding["candidates"])
    return {**NO_FINDINGS, "candidates": texts, "faults": tuple(undecided)}


def _find_one(fdi: np.void, names: Sequence[str]) -> FindingDict:
    """The one fault, or what is possible while none is isolated."""
    found = fdi["verdict"]
    estimator = int(found["isolated_estimator"])
    if estimator == NOT_ISOLATED:
        return {**NO_FINDINGS, "candidates": tuple(_candidate_texts(fdi, range(len(names)), names))}
    if estimator == UNANTICIPATED:
        label, at_s = "unanticipated", float(found["isolated_at_s"])
        return {**NO_FINDINGS, "isolated": label, "isolation_type": label, "isolation_time_s": at_s}
    s = int(fdi["isolation"]["estimator"][estimator]["surface"])
    return _finding_on_surface(fdi, s, int(found["fault_type"]), names)


def _finding_on_surface(fdi: np.void, s: int, kind: int, names: Sequence[str]) -> FindingDict:
    """The finding on surface s, which is at fault."""
    status = fdi["types"]["surface"][s]["status"]
    return {
        "isolated": names[s],
        "isolation_time_s": float(status["isolated_at_s"]),
        "isolation_type": registry.TYPE_NAMES[kind] if kind >= 0 else None,
        "type_time_s": float(status["typed_at_s"]) if kind >= 0 else None,
        "candidates": (registry.TYPE_NAMES[kind],) if kind >= 0 else tuple(_type_names(fdi, s)),
        "estimate": estimate_fault_parameter(fdi, s, kind),
        "estimate_interval": _ask_type("estimate_parameter_interval", fdi, s, kind),
        "frequency_rad_s": _ask_type("estimate_frequency_rad_s", fdi, s, kind),
    }


def estimate_fault_parameter(fdi: np.void, s: int, h: int) -> float | None:
    """The size of a fault of type h on surface s; None if the type has none, or is open (-1)."""
    estimate: float | None = _ask_type("estimate_parameter", fdi, s, h)
    return estimate


def _ask_type(name: str, fdi: np.void, s: int, h: int) -> Any:
    """What this function of the row of type h says of surface s; None while the type is open (-1)."""
    return getattr(registry.TYPES[h], name)(fdi, s, h) if h >= 0 else None


def _may_be_faulty(fdi: np.void, s: int) -> bool:
    """Whether surface s is isolated, or can be faulty (`verdict.can_be_faulty`)."""
    srf = fdi["types"]["surface"][s]
    if srf["status"]["is_isolated"] or srf["status"]["basis"] == DEDUCED_FAULTY:
        return True
    return not (srf["status"]["basis"] == DEDUCED_HEALTHY or srf["not_at_position"])


def _type_names(fdi: np.void, s: int) -> list[str]:
    """Types still possible on surface s, each once.

    1. None if the surface cannot be faulty (`_may_be_faulty`), else those that are not excluded.
    2. Where a constant explains the flight, a type that varies and need not show itself counts only until the
       constant has been seen for long enough, or until those types are excluded that it can look like.
    3. If a constant that gives up the surface is possible in the plane of pitch, and a pair of faults is too,
       then every constant type is: the other surface may be off as well.
    """
    srf = fdi["types"]["surface"][s]
    kinds = np.flatnonzero(srf["sets"]["excluded"] == 0).tolist() if _may_be_faulty(fdi, s) else []
    constant = [h for h in kinds if h < N_CONSTANT]
    if constant and not fdi["types"]["config"]["has_eG"]:
        ev = srf["evidence"]
        brief = ev["n_anomalous"] - ev["n_rest"] < fdi["types"]["config"]["half_frames"]
        alike = CONSTANT | registry.MUST_SHOW | CAN_LOOK_LIKE[:, constant].any(axis=1)
        kinds = [h for h in kinds if brief or alike[h]]
    pitch_pair = fdi["types"]["pair"]["enabled"] and fdi["layout"]["group"][s] == PITCH_GROUP
    if pitch_pair and (MODE[constant] == GIVE_UP).any():
        # if the other surface is off as well, each constant may be one of another type
        kinds += sorted(range(N_CONSTANT), key=lambda h: MODE[h] == SCALE_COMMAND)
    return list(dict.fromkeys(registry.TYPE_NAMES[h] for h in kinds))


def _candidate_texts(fdi: np.void, surfaces: Iterable[int], names: Sequence[str]) -> Iterator[str]:
    """What is possible on these surfaces.

    case                                                        texts
    pairs, plane of pitch, no second fault fits the first       unanticipated, nothing else
    a surface that may be faulty, with types                    surface:type for each type
    a surface that may be faulty, without                       surface
    pairs are diagnosed                                         also both, as elevator+flap
    no surface has a type                                       also unanticipated
    """
    pair = fdi["types"]["pair"]
    first = int(pair["first_pitch"])
    status = fdi["types"]["surface"]["status"][first]
    explained_by_first = status["may_be_sole"] or status["is_isolated"]
    if pair["enabled"] and first in surfaces and not explained_by_first:
        yield "unanticipated"  # no second fault explains what the first one leaves
        return
    kinds = {s: _type_names(fdi, s) for s in surfaces if _may_be_faulty(fdi, s)}
    for s, own in kinds.items():
        yield from [f"{names[s]}:{kind}" for kind in own] or [names[s]]
    if pair["enabled"]:
        yield "+".join(names[s] for s in surfaces)
    if not any(kinds.values()):
        yield "unanticipated"
