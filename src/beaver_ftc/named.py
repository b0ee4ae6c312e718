"""What the diagnosis of every fault type has found, in words: surface, type, candidates, estimate.

estimate, by type: theta in [-1, 0] of a loss of effectiveness; deflection in rad of a stuck, floating or
runaway surface; offset in rad of a bias; amplitude in rad of an oscillation.
"""

from collections.abc import Iterator
from math import isfinite, pi, sqrt

import numpy as np

from beaver_ftc.design.coefficients import SURFACES
from beaver_ftc.diagnosis import fault_types as ft
from beaver_ftc.diagnosis.state import NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.frame import DOMINANT_AXIS

Found = dict[str, object]
_NOTHING: Found = {
    "isolated": None,
    "isolation_type": None,
    "estimate": None,
    "isolation_time_s": None,
    "candidates": (),
}


def found(fdi: np.void) -> Found:
    """isolated, isolation_type, candidates, estimate and more of a Flight diagnosed for every type."""
    verdict = int(fdi["isolated"])
    if not fdi["detected"]:
        return dict(_NOTHING)
    at_s = float(fdi["isolated_at_s"])
    if verdict == NOT_ISOLATED:
        return {**_NOTHING, "candidates": tuple(_open_questions(fdi))}
    if verdict == UNANTICIPATED:
        said = {"isolated": "unanticipated", "isolation_type": "unanticipated", "isolation_time_s": at_s}
        return {**_NOTHING, **said}
    s = int(fdi["estimator"][verdict]["surface"])
    kind = int(fdi["type"])
    return {
        "isolated": SURFACES[s],
        "isolation_time_s": at_s,
        "isolation_type": ft.TYPES[kind] if kind >= 0 else None,
        "type_time_s": float(fdi["type_at_s"]) if kind >= 0 else None,
        "candidates": (ft.TYPES[kind],) if kind >= 0 else tuple(_types_left(fdi, s)),
        "estimate": _estimate(fdi, s, kind),
        "estimate_interval": _interval(fdi, s, kind),
        "frequency_rad_s": _frequency_rad_s(fdi, s) if kind == ft.OSCILLATORY else None,
    }


def _alive(fdi: np.void, s: int, kind: int) -> bool:
    surface = fdi["surface"][s]
    return not (fdi["estimator"][ft.POSITION_FIRST + s]["excluded"] or surface["type_excluded"][kind])


def _types_left(fdi: np.void, s: int) -> list[str]:
    """Types still possible on surface s, each once.

    One that may take any course counts only if no simpler does, and a slow surface until it would have moved.
    """
    left = [kind for kind in range(len(ft.TYPES)) if _alive(fdi, s, kind)]
    if any(kind < ft.N_CONSTANT for kind in left):
        early = fdi["evidence"] - fdi["surface"][s]["quiet"] < fdi["patience"]
        stays = {ft.OSCILLATORY, ft.GROWING_BIAS} | ({ft.SLOW} if early else set())
        left = [kind for kind in left if kind < ft.N_CONSTANT or kind in stays]
    return list(dict.fromkeys(ft.TYPES[kind] for kind in left))


def _open_questions(fdi: np.void) -> Iterator[str]:
    """`surface:type` for each that is possible; bare surfaces and `unanticipated` where no type fits."""
    possible = [s for s in range(len(SURFACES)) if not fdi["estimator"][ft.POSITION_FIRST + s]["excluded"]]
    for s in possible:
        types = _types_left(fdi, s)
        yield from (f"{SURFACES[s]}:{kind}" for kind in types) if types else (SURFACES[s],)
    if not any(_types_left(fdi, s) for s in possible):
        yield "unanticipated"


def _estimate(fdi: np.void, s: int, kind: int) -> float | None:
    surface = fdi["surface"][s]
    if kind in (ft.CONSTANT_LOSS, ft.VARYING_LOSS):
        return float(fdi["estimator"][s]["theta"][DOMINANT_AXIS[s]])
    if kind == ft.GROWING_BIAS:
        return float(0.5 * (surface["low"] + surface["high"]) - surface["command"])
    if kind in (ft.STUCK, ft.BIAS):
        return float(0.5 * (surface["set_low"][kind] + surface["set_high"][kind]))
    if kind in (ft.UP, ft.DOWN):
        return float(surface["travel_high"] if _alive(fdi, s, ft.UP) else surface["travel_low"])
    if kind == ft.OSCILLATORY:
        return float(sqrt(2.0 * surface["squares"] / (surface["last_flip"] - surface["first_flip"])))
    return 0.0 if kind == ft.FLOAT else None


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
    return half_cycles * pi / (float(fdi["dt"]) * int(surface["last_flip"] - surface["first_flip"]))
