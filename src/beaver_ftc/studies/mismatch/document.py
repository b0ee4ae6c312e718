"""The mismatch of one flight as a document: `mismatch.json`, its CSV and its table.

Accelerations in rad/s2. `share` is a source's RMS over the RMS of the total: sources may cancel, so
shares need not add up to 1. `bound_share` is the largest part of the bound eta_bar that a source has used
at any frame.
"""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.studies.mismatch.bound import Guarantee, Recommendation
from beaver_ftc.studies.mismatch.sources import SOURCES
from beaver_ftc.studies.mismatch.split import UNEXPLAINED
from beaver_ftc.studies.mismatch.states import AXES
from beaver_ftc.studies.mismatch.tally import TOTAL, AxisBound, Figures, Tally
from beaver_ftc.studies.present.tables import finite

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario
    from beaver_ftc.studies.linear_systems import Mode
    from beaver_ftc.studies.mismatch.linear import LinearAnalysis

Document = dict[str, Any]
NAMES = (*SOURCES, UNEXPLAINED, TOTAL)
FAULT = "fault"


def document(scenario: "Scenario", tally: Tally, metrics: Document) -> Document:
    """What the split of a flight amounts to."""
    return {
        "scenario": scenario.name,
        "frames": tally.frames,
        "unit": "rad/s2",
        "design_model": scenario.design_model.model_dump(mode="json"),
        "axes": {axis: _axis(tally, i) for i, axis in enumerate(AXES)},
        "dominant": dominant(tally),
        "bound": {axis: _bound(tally.bounds[i], tally, i) for i, axis in enumerate(AXES)},
        "closure": float(tally.figures[UNEXPLAINED].largest.max()),
        "false_alarm": metrics["false_alarm"],
        "detection": metrics["detection"],
        "isolation": {key: metrics["isolation"][key] for key in ("fault", "delay_s", "correct")},
    }


def _axis(tally: Tally, i: int) -> Document:
    found = {name: _figures(tally.figures[name], tally, i) for name in NAMES}
    for source, parts in tally.parts.items():
        if parts:
            found[source]["parts"] = {name: _figures(figures, tally, i) for name, figures in parts.items()}
    return found


def _figures(figures: Figures, tally: Tally, i: int) -> Document:
    rms = float(np.sqrt(figures.square_sum[i] / max(tally.frames, 1)))
    whole = float(tally.rms(TOTAL)[i])
    return {
        "rms": rms,
        "max": float(figures.largest[i]),
        "share": rms / whole if whole > 0.0 else 0.0,
        "bound_share": finite(figures.bound_share[i]),
    }


def dominant(tally: Tally) -> Document | None:
    """The source, faults aside, that has used most of a bound: the reason for most of the threshold."""
    names = [name for name in SOURCES if name != FAULT]
    used = np.array([np.nan_to_num(tally.figures[name].bound_share, posinf=1e300) for name in names])
    if not used.any():
        return None
    which, i = np.unravel_index(int(used.argmax()), used.shape)
    return {
        "source": names[which],
        "axis": AXES[i],
        "bound_share": finite(tally.figures[names[which]].bound_share[i]),
    }


def _bound(bound: AxisBound, tally: Tally, i: int) -> Document:
    return {
        "constant_rad_s2": float(tally.constant[i]),
        "smallest_constant_rad_s2": bound.smallest_constant_rad_s2,
        "worst_ratio": finite(bound.worst_ratio),
        "worst_at_s": bound.worst_at_s,
        "exceeded_s": bound.exceeded_frames * tally.frame_s,
        "exceeded_times": bound.stays,
        "exceedances": [{**vars(stay), "peak_ratio": finite(stay.peak_ratio)} for stay in bound.exceedances],
    }


def recommendation_document(recommended: Recommendation) -> Document:
    """The bound recommended for a set of runs."""
    return {
        "constant_rad_s2": recommended.constant_rad_s2,
        "runs": recommended.runs,
        "coverage": recommended.coverage,
        "settled": recommended.settled,
    }


def guarantee_document(declared: Guarantee, recommended: Guarantee) -> Document:
    """The published elevator case flown with the bound as declared and as recommended."""
    return {"declared": dict(vars(declared)), "recommended": dict(vars(recommended))}


def linear_document(analysis: "LinearAnalysis") -> Document:
    """Modes side by side, how far the models are apart, zeros of the surface-to-rate channels."""
    from beaver_ftc.studies.linear_systems import CHANNELS, MODES, zeros

    apart = {name: analysis.deviation(name) for name in analysis.models if name != "truth"}
    return {
        "airspeed_mps": analysis.point.airspeed_mps,
        "altitude_m": analysis.point.altitude_m,
        "modes": {
            mode: {
                **{name: _mode(found[mode]) for name, found in analysis.modes.items()},
                "deviation": {name: each[mode] for name, each in apart.items()},
                "jsbsim_own_deviation": analysis.own_deviation[mode],
            }
            for mode in MODES
        },
        "zeros": {
            f"{surface} to {rate}": {
                name: [
                    [float(zero.real), float(zero.imag)]
                    for zero in zeros(
                        model.A, model.B[:, model.inputs.index(surface)], model.states.index(rate)
                    )
                ]
                for name, model in analysis.models.items()
            }
            for surface, rate in CHANNELS
        },
    }


def _mode(mode: "Mode") -> Document:
    return {
        "real_per_s": mode.pole.real,
        "imaginary_rad_s": mode.pole.imag,
        "frequency_rad_s": mode.frequency_rad_s,
        "damping": mode.damping,
    }


def rows(found: Document) -> Iterator[Document]:
    """One row per axis, source and part of a document."""
    for axis, sources in found["axes"].items():
        for source, figures in sources.items():
            for part, of in [("", figures), *figures.get("parts", {}).items()]:
                yield {
                    "scenario": found["scenario"],
                    "axis": axis,
                    "source": source,
                    "part": part,
                    "rms_rad_s2": of["rms"],
                    "max_rad_s2": of["max"],
                    "share": of["share"],
                    "bound_share": of["bound_share"],
                }


def write_csv(path: Path, table: list[Document]) -> None:
    """Write rows of equal keys as a CSV file with a header; null is an empty cell."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(table[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(table)
