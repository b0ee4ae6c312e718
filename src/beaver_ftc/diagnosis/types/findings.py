"""What the diagnosis of every fault type has found, in words: surface, type, candidates, estimate.

estimate, by type: theta in [-1, 0] of a loss of effectiveness; deflection in rad of a stuck, floating or
runaway surface; offset in rad of a bias; amplitude in rad of an oscillation.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from beaver_ftc.diagnosis.state import NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.diagnosis.types import registry
from beaver_ftc.diagnosis.types.contract import FIXED, LOSES
from beaver_ftc.diagnosis.types.pairs import IN_PITCH
from beaver_ftc.diagnosis.types.verdict import BY_DEDUCTION, RULED_OUT

Found = dict[str, Any]
_NOTHING: Found = {
    "isolated": None, "isolation_type": None, "estimate": None, "isolation_time_s": None,
    "candidates": (), "faults": (),
}  # fmt: skip


def found(fdi: np.void, surfaces: Sequence[str]) -> Found:
    """isolated, isolation_type, candidates, estimate and more of a Flight diagnosed for every type.

    surfaces: their names.
    """
    if not fdi["verdict"]["detected"]:
        return dict(_NOTHING)
    if fdi["types"]["pair"]["enabled"]:
        return _found_of_several(fdi, surfaces)
    return _found_of_one(fdi, surfaces)


def _found_of_several(fdi: np.void, names: Sequence[str]) -> Found:
    """The fault named first as if it were alone, and all of them; what is open in a plane where none is."""
    status = fdi["types"]["surface"]["status"]
    at_fault = sorted(np.flatnonzero(status["named"]).tolist(), key=lambda s: status["named_at_s"][s])
    faults = [_found_on(fdi, s, int(status["type"][s]), names) for s in at_fault]
    planes = fdi["types"]["pair"]["alarmed"]
    surfaces_of = [np.flatnonzero(fdi["layout"]["group"] == g).tolist() for g in range(len(planes))]
    if not planes.any() and not faults and int(fdi["verdict"]["isolated"]) == NOT_ISOLATED:
        planes = np.ones_like(planes)  # a statistical alarm by itself says of no plane that it is there
    open_planes = [
        {**_NOTHING, "candidates": tuple(_open_questions(fdi, plane, names))}
        for alarmed, plane in zip(planes, surfaces_of, strict=True)
        if alarmed and not set(plane) & set(at_fault)
    ]
    if faults:
        return {**faults[0], "faults": (*faults, *open_planes)}
    if int(fdi["verdict"]["isolated"]) == UNANTICIPATED:
        return {**_found_of_one(fdi, names), "faults": tuple(open_planes)}
    left = tuple(candidate for plane in open_planes for candidate in plane["candidates"])
    return {**_NOTHING, "candidates": left, "faults": tuple(open_planes)}


def _found_of_one(fdi: np.void, names: Sequence[str]) -> Found:
    verdict, at_s = int(fdi["verdict"]["isolated"]), float(fdi["verdict"]["isolated_at_s"])
    if verdict == NOT_ISOLATED:
        return {**_NOTHING, "candidates": tuple(_open_questions(fdi, range(len(names)), names))}
    if verdict == UNANTICIPATED:
        said = "unanticipated"
        return {**_NOTHING, "isolated": said, "isolation_type": said, "isolation_time_s": at_s}
    s, kind = int(fdi["isolation"]["estimator"][verdict]["surface"]), int(fdi["verdict"]["type"])
    return {
        **_found_on(fdi, s, kind, names),
        "isolation_time_s": at_s,
        "type_time_s": float(fdi["verdict"]["type_at_s"]) if kind >= 0 else None,
    }


def _found_on(fdi: np.void, s: int, kind: int, names: Sequence[str]) -> Found:
    """What is known of surface s, which is at fault; kind: of which type, -1 if open."""
    surface = fdi["types"]["surface"][s]
    return {
        "isolated": names[s],
        "isolation_time_s": float(surface["status"]["named_at_s"]),
        "isolation_type": registry.NAMES[kind] if kind >= 0 else None,
        "type_time_s": float(surface["status"]["type_at_s"]) if kind >= 0 else None,
        "candidates": (registry.NAMES[kind],) if kind >= 0 else tuple(_types_left(fdi, s)),
        "estimate": estimate_of(fdi, s, kind),
        "estimate_interval": _of_type(kind, "interval", fdi, s, kind),
        "frequency_rad_s": _of_type(kind, "frequency_rad_s", fdi, s, kind),
    }


def estimate_of(fdi: np.void, s: int, kind: int) -> float | None:
    """What is known of the size of a fault of this type on surface s; see the top of this file."""
    estimate: float | None = _of_type(kind, "estimate", fdi, s, kind)
    return estimate


def _of_type(kind: int, what: str, *arguments: Any) -> Any:
    """What a type's row says; None while the type is open."""
    return getattr(registry.TYPES[kind], what)(*arguments) if kind >= 0 else None


def _possible(fdi: np.void, s: int) -> bool:
    surface = fdi["types"]["surface"][s]
    if surface["status"]["named"] or surface["status"]["source"] == BY_DEDUCTION:
        return True
    return not (surface["status"]["source"] == RULED_OUT or surface["refuted"])


def _types_left(fdi: np.void, s: int) -> list[str]:
    """Types still possible on surface s, each once.

    Where a constant explains the flight, a type that varies and need not show itself counts only until the
    constant has been seen for long enough, or until those types are excluded that it can look like.
    """
    surface = fdi["types"]["surface"][s]
    left = [kind for kind, out in enumerate(surface["feasible"]["excluded"]) if _possible(fdi, s) and not out]
    constant = [kind for kind in left if kind < registry.N_CONSTANT]
    if constant and not fdi["types"]["config"]["own_errors"]:
        evidence, patience = surface["evidence"], fdi["types"]["config"]["patience"]
        early = evidence["frames"] - evidence["quiet"] < patience
        left = [kind for kind in left if kind in constant or early or _is_open(kind, constant)]
    beside_another = fdi["types"]["pair"]["enabled"] and fdi["layout"]["group"][s] == IN_PITCH
    if beside_another and any(registry.ACCOMMODATION[kind] == FIXED for kind in constant):
        # if the other surface is off as well, each constant may be one of another type
        left += sorted(range(registry.N_CONSTANT), key=lambda kind: registry.ACCOMMODATION[kind] == LOSES)
    return list(dict.fromkeys(registry.NAMES[kind] for kind in left))


def _is_open(kind: int, constant: list[int]) -> bool:
    """Whether a type that varies counts beside these constant ones: it may yet show itself, or looks like
    one of them."""
    return bool(registry.MUST_SHOW[kind] or registry.MISTAKEN_FOR[kind, constant].any())


def _open_questions(fdi: np.void, among: Iterable[int], names: Sequence[str]) -> Iterator[str]:
    """`surface:type` for each that is possible; bare surfaces and `unanticipated` where no type fits.

    Of one plane also both its surfaces, as `elevator+flap`.
    """
    possible = [s for s in among if _possible(fdi, s)]
    for s in possible:
        types = _types_left(fdi, s)
        yield from (f"{names[s]}:{kind}" for kind in types) if types else (names[s],)
    if fdi["types"]["pair"]["enabled"]:
        yield "+".join(names[s] for s in among)
    if not any(_types_left(fdi, s) for s in possible):
        yield "unanticipated"
