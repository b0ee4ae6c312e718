"""Over speed, altitude and excitation: how small a fault of each surface is certain to be found."""

from collections.abc import Sequence
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np

from beaver_ftc.documents.errors import BadInput, BeaverFtcError
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.detectability.excitation import Excitation, excitation
from beaver_ftc.studies.detectability.grid import (
    DETECT_WITHIN_S,
    EXCITATIONS,
    ISOLATE_WITHIN_S,
    Row,
    altitudes_of,
    speeds_of,
)
from beaver_ftc.studies.detectability.mismatch import (
    best_in_window,
    detection_magnitude,
    exclusion_magnitude,
    mismatch,
)
from beaver_ftc.studies.detectability.output import write
from beaver_ftc.studies.engine.flown import Progress, flown
from beaver_ftc.studies.engine.statistics import quantile


def run_survey(
    out: Path,
    scenario: Scenario,
    speeds_mps: Sequence[float] = (),
    altitudes_m: Sequence[float] = (),
    excitations: Sequence[float] = EXCITATIONS,
    progress: Progress | None = None,
) -> list[Row]:
    """Write `out/<scenario>-detectability/`; return one row a fault and grid point.

    Raises BadInput if another scheme than the sharpened one diagnoses.
    """
    from beaver_ftc.results.writer import result_folder

    _refuse_other_schemes(scenario)
    name = survey_name(scenario)
    speeds_mps = speeds_mps or speeds_of(scenario.airframe)
    altitudes_m = altitudes_m or altitudes_of(scenario.airframe)
    grid = list(product(speeds_mps, altitudes_m, excitations))
    points = flown(out / name, grid, partial(_point, scenario), list[Row], asked=scenario, progress=progress)
    with points as found, result_folder(out, name) as folder:
        rows = [row for point in found for row in point]
        write(folder, scenario.name, rows)
    return rows


def survey_name(scenario: Scenario) -> str:
    """The name of the survey's result folder, at most 100 characters."""
    return f"{scenario.name[:86]}-detectability"


def _refuse_other_schemes(scenario: Scenario) -> None:
    fdi = scenario.fdi
    sharp = fdi.sharpen.pole_bank and fdi.sharpen.memory and fdi.sharpen.shared_effectiveness
    if fdi.scheme != "adaptive-estimators" or not sharp or max(fdi.pole_bank_per_s, default=0.0) < 1e6:
        raise BadInput(
            f"{scenario.name}: fdi: detectability is worked out for the sharpened scheme, allowed: "
            "scheme adaptive-estimators, sharpen all, a filter of 1e6 in pole_bank_per_s"
        )


def _point(scenario: Scenario, point: tuple[float, float, float]) -> list[Row]:
    speed, altitude, scale = point
    place = {"airspeed_mps": speed, "altitude_m": altitude, "excitation": scale}
    try:
        seen = excitation(at(scenario, speed, altitude, scale))
    except BeaverFtcError as error:
        return [{**place, "fault": fault, **_nothing(str(error))} for fault in scenario.airframe.primary]
    return [{**place, "fault": fault, **judge(seen, fault)} for fault in seen.moment]


def at(scenario: Scenario, speed_mps: float, altitude_m: float, excitation: float) -> Scenario:
    """The scenario flown elsewhere, its references scaled."""
    document = scenario.model_dump(mode="json", exclude_none=True)
    document["initial"] |= {"airspeed_mps": speed_mps, "altitude_m": altitude_m}
    document["reference"] = {
        axis: [_scaled(signal, excitation) for signal in signals]
        for axis, signals in document["reference"].items()
    }
    return Scenario.model_validate({**document, "faults": [], "expect": {}})


def _scaled(signal: Row, factor: float) -> Row:
    (kind, parameters), *_ = signal.items()
    scaled = dict(parameters)
    for name in ("amplitude_deg_s", "values_deg_s"):
        if name in scaled:
            scaled[name] = (np.asarray(scaled[name]) * factor).tolist()
    return {kind: scaled}


def _nothing(why: str) -> Row:
    magnitudes = dict.fromkeys(("detected", "detected_median", "isolated", "isolated_median"))
    return {**magnitudes, "confused_with": None, "why": why}


def judge(seen: Excitation, fault: str) -> Row:
    """Magnitudes from which a fault is certain to be found along a flight.

    detected, isolated: whenever it strikes; `_median`: in half of the instants at which it may strike;
    None: not even a total loss. confused_with: the fault that survives longest; why: in words.
    """
    z, frames = seen.moment[fault], [_frames(s, seen.dt) for s in (DETECT_WITHIN_S, ISOLATE_WITHIN_S)]
    if len(z) < frames[1]:
        return _nothing("the flight ends before a fault could be isolated")
    found = best_in_window(detection_magnitude(z, seen.bound), frames[0])
    excluded = {
        other: best_in_window(exclusion_magnitude(z, of_other, seen.bound), frames[1])
        for other, of_other in seen.moment.items()
        if other != fault
    }
    isolated = np.maximum(found[: len(z) - frames[1] + 1], np.max(list(excluded.values()), axis=0))
    rival = max(excluded, key=lambda other: (excluded[other].max(), np.median(excluded[other])))
    return {
        "detected": _certain(found.max()),
        "detected_median": _certain(quantile(np.sort(found), 0.5)),
        "isolated": _certain(isolated.max()),
        "isolated_median": _certain(quantile(np.sort(isolated), 0.5)),
        "confused_with": rival,
        "why": _why(seen, fault, rival, found, excluded[rival], frames[1]),
    }


def _frames(seconds: float, dt: float) -> int:
    return max(round(seconds / dt), 1)


def _certain(magnitude: float) -> float | None:
    return float(magnitude) if magnitude <= 1.0 else None


def _why(
    seen: Excitation, fault: str, rival: str, found: np.ndarray, excluded: np.ndarray, frames: int
) -> str:
    """What limits this fault at the worst instant for it to strike."""
    z, other = seen.moment[fault], seen.moment[rival]
    if found.max() > 1.0:
        share = 1.0 / found.max()
        return f"{fault} hardly used: in {DETECT_WITHIN_S:g} s a total loss is {share:.0%} of twice the bound"
    if excluded.max() > 1.0:
        start = int(excluded.argmax())
        window = slice(start, start + frames)
        left = mismatch(z[window], other[window], seen.bound[window]).max()
        return (
            f"for {ISOLATE_WITHIN_S:g} s {rival} explains a total loss but for {left:.0%} of twice the bound"
        )
    if excluded.max() <= found.max():
        return "isolated once detected"
    return f"{rival} explains smaller ones"
