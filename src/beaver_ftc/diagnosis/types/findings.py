"""The verdict on fault types in words: surface, type, candidates, estimate.

A finding is a dictionary with the keys of NO_FINDINGS, and of `_finding_on_surface` for a named fault. The
type's row says what the estimate is, and in which unit (`FaultType.estimate_parameter`).

    fdi      record of `schemes.fdi_dtype`
    s        surface
    names    of all surfaces, in the order of the aircraft
    kind     type, or -1 while it is open
    plane    pitch, or roll and yaw: a group of surfaces (`layout.group`) that pairs.py diagnoses by itself
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from beaver_ftc.diagnosis.conclusion import NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.diagnosis.isolation import PITCH_GROUP
from beaver_ftc.diagnosis.types import GIVE_UP, SCALE_COMMAND, registry
from beaver_ftc.diagnosis.types.registry import CAN_LOOK_LIKE, CONSTANT, MODE, N_CONSTANT
from beaver_ftc.diagnosis.types.verdict import BY_ESTIMATOR, DEDUCED_FAULTY

FindingDict = dict[str, Any]
NO_FINDINGS: FindingDict = {
    "isolated": None, "isolation_type": None, "estimate": None, "isolation_time_s": None,
    "candidates": (), "faults": (),
}  # fmt: skip


def fault_finding_dict(fdi: np.void, names: Sequence[str]) -> FindingDict:
    """The finding of a flight that is diagnosed for every type; NO_FINDINGS before the alarm."""
    if not fdi["verdict"]["detected"]:
        return dict(NO_FINDINGS)
    if fdi["types"]["pair"]["enabled"]:
        return _find_pair(fdi, names)
    return _find_one(fdi, names)


def _find_pair(fdi: np.void, names: Sequence[str]) -> FindingDict:
    """The finding where pairs are diagnosed: its own keys are those of the fault isolated first, and its key
    `faults` has the findings of all faults and open planes.

        surfaces isolated    verdict            own keys                      `faults`
        some                 any                the first isolated            those, then the open planes
        none                 unanticipated      unanticipated                 the open planes
        none                 another            candidates of open planes     the open planes

    An open plane has an alarm and no isolated surface. A statistical alarm names no plane: it opens both,
    while no surface is isolated.
    """
    status = fdi["types"]["surface"]["status"]
    alarms = fdi["types"]["pair"]["group_alarm"]
    estimator = fdi["verdict"]["isolated_estimator"]
    isolated = np.flatnonzero(status["is_isolated"]).tolist()
    isolated.sort(key=lambda s: status["isolated_at_s"][s])
    faults = [_finding_on_surface(fdi, s, int(status["fault_type"][s]), names) for s in isolated]
    groups = [np.flatnonzero(fdi["layout"]["group"] == group).tolist() for group in range(len(alarms))]
    if not alarms.any() and not faults and estimator == NOT_ISOLATED:
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
    """The finding where one fault is diagnosed: of the isolated fault, or the candidates while none is."""
    conclusion = fdi["verdict"]
    estimator = int(conclusion["isolated_estimator"])
    if estimator == NOT_ISOLATED:
        return {**NO_FINDINGS, "candidates": tuple(_candidate_texts(fdi, range(len(names)), names))}
    if estimator == UNANTICIPATED:
        label = "unanticipated"
        at_s = float(conclusion["isolated_at_s"])
        return {**NO_FINDINGS, "isolated": label, "isolation_type": label, "isolation_time_s": at_s}
    s = int(fdi["isolation"]["estimator"][estimator]["surface"])
    return _finding_on_surface(fdi, s, int(conclusion["fault_type"]), names)


def _finding_on_surface(fdi: np.void, s: int, kind: int, names: Sequence[str]) -> FindingDict:
    """The finding on surface s, which is isolated: times in s, the estimate and its interval in the unit of
    the type, frequency in rad/s."""
    status = fdi["types"]["surface"][s]["status"]
    return {
        "isolated": names[s],
        "isolation_time_s": float(status["isolated_at_s"]),
        "isolation_type": registry.TYPE_NAMES[kind] if kind >= 0 else None,
        "type_time_s": float(status["typed_at_s"]) if kind >= 0 else None,
        "candidates": (registry.TYPE_NAMES[kind],) if kind >= 0 else tuple(_type_names(fdi, s)),
        "estimate": estimate_fault_parameter(fdi, s, kind),
        "estimate_interval": _by_row("estimate_parameter_interval", fdi, s, kind),
        "frequency_rad_s": _by_row("estimate_frequency_rad_s", fdi, s, kind),
    }


def estimate_fault_parameter(fdi: np.void, s: int, h: int) -> float | None:
    """The size of a fault of type h on surface s; None if the type has none, or is open (-1)."""
    estimate: float | None = _by_row("estimate_parameter", fdi, s, h)
    return estimate


def _by_row(name: str, fdi: np.void, s: int, h: int) -> Any:
    """What the function `name` in the row of type h returns for surface s; None while the type is open
    (-1)."""
    return getattr(registry.TYPES[h], name)(fdi, s, h) if h >= 0 else None


def _may_be_faulty(fdi: np.void, s: int) -> bool:
    """Whether surface s is isolated, or can be faulty (as `verdict.can_be_faulty`, for Python code)."""
    srf = fdi["types"]["surface"][s]
    basis = srf["status"]["basis"]
    can_be = not srf["not_at_position"] if basis == BY_ESTIMATOR else basis == DEDUCED_FAULTY
    return bool(srf["status"]["is_isolated"] or can_be)


def _type_names(fdi: np.void, s: int) -> list[str]:
    """Names of the types that are possible on surface s, each once.

    1. If the surface cannot be faulty (`_may_be_faulty`), none; else the types that are not excluded.
    2. If a constant type is among them, the flight may be explained by it. After half a cycle in which this
       could have been refuted (`brief` is false), a varying type counts only if it must show itself, or can
       look like one of the constant types. Coarse sets (has_eG) refute too little for this rule.
    3. If pairs are diagnosed, and a constant type that gives up the surface is possible in pitch, every
       constant type is possible: the other surface of pitch may be off as well.
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
        kinds += sorted(range(N_CONSTANT), key=lambda h: MODE[h] == SCALE_COMMAND)  # losses last
    return list(dict.fromkeys(registry.TYPE_NAMES[h] for h in kinds))


def _candidate_texts(fdi: np.void, surfaces: Iterable[int], names: Sequence[str]) -> Iterator[str]:
    """The candidates on these surfaces, as texts.

    case                                                        texts
    pairs, plane of pitch, no second fault fits the first       unanticipated, nothing else
    a surface that may be faulty, with types                    surface:type for each type
    a surface that may be faulty, without types                 surface
    pairs are diagnosed                                         also both, as elevator+flap
    no surface has a type                                       also unanticipated
    """
    pair = fdi["types"]["pair"]
    first = int(pair["first_pitch"])  # -1 for none: then not in `surfaces`, and the status is not used
    status = fdi["types"]["surface"]["status"][first]
    explained_by_first = status["may_be_sole"] or status["is_isolated"]
    if pair["enabled"] and first in surfaces and not explained_by_first:
        yield "unanticipated"  # no second fault explains what the first one leaves
        return
    kinds = {s: _type_names(fdi, s) for s in surfaces if _may_be_faulty(fdi, s)}
    for s, type_names in kinds.items():
        yield from [f"{names[s]}:{name}" for name in type_names] or [names[s]]
    if pair["enabled"]:
        yield "+".join(names[s] for s in surfaces)
    if not any(kinds.values()):
        yield "unanticipated"
