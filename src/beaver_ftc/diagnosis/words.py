"""What the diagnosis of every fault type has found, in words: surface, type, candidates, estimate.

estimate, by type: theta in [-1, 0] of a loss of effectiveness; deflection in rad of a stuck, floating or
runaway surface; offset in rad of a bias; amplitude in rad of an oscillation.
"""

from collections.abc import Iterable, Iterator
from math import isfinite, pi, sqrt
from typing import Any

import numpy as np

from beaver_ftc.design.coefficients import SURFACES
from beaver_ftc.design.model import AILERON, ELEVATOR, FLAP, RUDDER
from beaver_ftc.diagnosis import fault_types as ft
from beaver_ftc.diagnosis.fault_types import DOMINANT_AXIS
from beaver_ftc.diagnosis.state import NOT_ISOLATED, UNANTICIPATED

PLANES = ((ELEVATOR, FLAP), (AILERON, RUDDER))  # as pairs.py numbers them

Found = dict[str, Any]
_NOTHING: Found = {
    "isolated": None,
    "isolation_type": None,
    "estimate": None,
    "isolation_time_s": None,
    "candidates": (),
    "faults": (),
}


def found(fdi: np.void) -> Found:
    """isolated, isolation_type, candidates, estimate and more of a Flight diagnosed for every type."""
    if not fdi["detected"]:
        return dict(_NOTHING)
    if fdi["pairs"]:
        return _found_of_several(fdi)
    return _found_of_one(fdi)


def _found_of_several(fdi: np.void) -> Found:
    """The fault named first as if it were alone, and all of them; what is open in a plane where none is."""
    at_fault = sorted(
        (s for s in range(len(SURFACES)) if fdi["surface"][s]["named"]),
        key=lambda s: (fdi["surface"][s]["named_at_s"], s),
    )
    faults = [_found_on(fdi, s, int(fdi["surface"][s]["type"])) for s in at_fault]
    open_planes = [
        {**_NOTHING, "candidates": tuple(_open_questions(fdi, plane))}
        for alarmed, plane in zip(fdi["alarmed"], PLANES, strict=True)
        if alarmed and not set(plane) & set(at_fault)
    ]
    if faults:
        return {**faults[0], "faults": (*faults, *open_planes)}
    if int(fdi["isolated"]) == UNANTICIPATED:
        return {**_found_of_one(fdi), "faults": tuple(open_planes)}
    left = tuple(candidate for plane in open_planes for candidate in plane["candidates"])
    return {**_NOTHING, "candidates": left, "faults": tuple(open_planes)}


def _found_of_one(fdi: np.void) -> Found:
    verdict, at_s = int(fdi["isolated"]), float(fdi["isolated_at_s"])
    if verdict == NOT_ISOLATED:
        return {**_NOTHING, "candidates": tuple(_open_questions(fdi))}
    if verdict == UNANTICIPATED:
        said = {"isolated": "unanticipated", "isolation_type": "unanticipated", "isolation_time_s": at_s}
        return {**_NOTHING, **said}
    s, kind = int(fdi["estimator"][verdict]["surface"]), int(fdi["type"])
    return {**_found_on(fdi, s, kind), "isolation_time_s": at_s, "type_time_s": _at_s(fdi["type_at_s"], kind)}


def _at_s(instant_s: float, kind: int) -> float | None:
    return float(instant_s) if kind >= 0 else None


def _found_on(fdi: np.void, s: int, kind: int) -> Found:
    """What is known of surface s, which is at fault; kind: of which type, -1 if open."""
    return {
        "isolated": SURFACES[s],
        "isolation_time_s": float(fdi["surface"][s]["named_at_s"]),
        "isolation_type": ft.TYPES[kind] if kind >= 0 else None,
        "type_time_s": _at_s(fdi["surface"][s]["type_at_s"], kind),
        "candidates": (ft.TYPES[kind],) if kind >= 0 else tuple(_types_left(fdi, s)),
        "estimate": _estimate(fdi, s, kind),
        "estimate_interval": _interval(fdi, s, kind),
        "frequency_rad_s": _frequency_rad_s(fdi, s) if kind == ft.OSCILLATORY else None,
    }


def _possible(fdi: np.void, s: int) -> bool:
    surface = fdi["surface"][s]
    if surface["named"] or surface["standing"] == ft.BY_DEDUCTION:
        return True
    return not (surface["standing"] == ft.RULED_OUT or fdi["estimator"][ft.POSITION_FIRST + s]["excluded"])


def _alive(fdi: np.void, s: int, kind: int) -> bool:
    return _possible(fdi, s) and not fdi["surface"][s]["type_excluded"][kind]


def _types_left(fdi: np.void, s: int) -> list[str]:
    """Types still possible on surface s, each once.

    One that may take any course counts only if no simpler does, and a slow surface until it would have moved.
    """
    left = [kind for kind in range(len(ft.TYPES)) if _alive(fdi, s, kind)]
    if any(kind < ft.N_CONSTANT for kind in left) and not fdi["own_errors"]:
        early = fdi["surface"][s]["evidence"] - fdi["surface"][s]["quiet"] < fdi["patience"]
        stays = {ft.OSCILLATORY, ft.GROWING_BIAS} | ({ft.SLOW} if early else set())
        left = [kind for kind in left if kind < ft.N_CONSTANT or kind in stays]
    if fdi["pairs"] and s in PLANES[0] and {ft.STUCK, ft.UP, ft.DOWN} & set(left):
        left += [ft.STUCK, ft.FLOAT, ft.UP, ft.BIAS, ft.CONSTANT_LOSS]  # if the other one is off as well
    return list(dict.fromkeys(ft.TYPES[kind] for kind in left))


def _open_questions(fdi: np.void, among: Iterable[int] = range(len(SURFACES))) -> Iterator[str]:
    """`surface:type` for each that is possible; bare surfaces and `unanticipated` where no type fits.

    Of one plane also both its surfaces, as `elevator+flap`.
    """
    possible = [s for s in among if _possible(fdi, s)]
    for s in possible:
        types = _types_left(fdi, s)
        yield from (f"{SURFACES[s]}:{kind}" for kind in types) if types else (SURFACES[s],)
    if fdi["pairs"]:
        yield "+".join(SURFACES[s] for s in among)
    if not any(_types_left(fdi, s) for s in possible):
        yield "unanticipated"


def _estimate(fdi: np.void, s: int, kind: int) -> float | None:
    surface = fdi["surface"][s]
    if kind in (ft.CONSTANT_LOSS, ft.VARYING_LOSS):
        return _theta(fdi, s, kind)
    if kind == ft.GROWING_BIAS:
        return float(0.5 * (surface["low"] + surface["high"]) - surface["command"])
    if kind in (ft.STUCK, ft.BIAS):
        return float(0.5 * (surface["set_low"][kind] + surface["set_high"][kind]))
    if kind in (ft.UP, ft.DOWN):
        return float(surface["travel_high"] if _alive(fdi, s, ft.UP) else surface["travel_low"])
    if kind == ft.OSCILLATORY:
        return float(sqrt(2.0 * surface["squares"] / (surface["last_flip"] - surface["first_flip"])))
    return 0.0 if kind == ft.FLOAT else None


def _theta(fdi: np.void, s: int, kind: int) -> float:
    """Of a loss; beside another fault the estimator, which fits all axes of its surface, is not asked."""
    surface = fdi["surface"][s]
    if fdi["pairs"] and kind == ft.CONSTANT_LOSS:
        return float(0.5 * (surface["set_low"][kind] + surface["set_high"][kind]) - 1.0)
    return float(fdi["estimator"][s]["theta"][DOMINANT_AXIS[s]])


def _interval(fdi: np.void, s: int, kind: int) -> tuple[float, float] | None:
    """The set the estimated constant is certain to lie in."""
    if kind not in (ft.CONSTANT_LOSS, ft.STUCK, ft.BIAS):
        return None
    low, high = float(fdi["surface"][s]["set_low"][kind]), float(fdi["surface"][s]["set_high"][kind])
    if kind == ft.CONSTANT_LOSS:
        low, high = low - 1.0, high - 1.0
    return (low, high) if isfinite(low) and isfinite(high) else None


def _frequency_rad_s(fdi: np.void, s: int) -> float:
    surface = fdi["surface"][s]
    half_cycles = int(surface["flips"]) - 1
    return half_cycles * pi / (float(fdi["span_s"]) * int(surface["last_flip"] - surface["first_flip"]))
