"""What came of a derivation: as a document, as text, and as a page on the aircraft.

The page has its terms, its error over the envelope, and what can be diagnosed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import radians
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft
from beaver_ftc.aircraft.aircraft import MOMENTS
from beaver_ftc.design.context import DesignFunctions
from beaver_ftc.design.model import design_record
from beaver_ftc.design.terms import N_Y
from beaver_ftc.plant.trim import TrimPoint
from beaver_ftc.scenario.diagnosis import Bounds

DEFLECTION_DEG = 3.0  # beside neutral: what flight with the built-in references asks of a surface
_NEAR = 1  # box and share of the travel of such a flight
NAME = "derived.md"
WHY_NOT_USED = (
    "they stay where its own flight control has them; most go in detents, at a pace no law controls with"
)


@dataclass(frozen=True)
class Derived:
    """What came of it: the folder, the aircraft, its trim, the largest errors (3,) rad/s2 over the samples
    of the fit and over those it did not see, and what is to be known of it. further: surfaces that are not
    used, by property, and where they stay. took_s: how long it took."""

    aircraft: Aircraft
    trim: TrimPoint
    fitted_rad_s2: np.ndarray
    checked_rad_s2: np.ndarray
    notes: tuple[str, ...] = field(default=())
    as_filed: Aircraft | None = None  # as its own file has it
    further: Mapping[str, float] = field(default_factory=dict)
    took_s: float = 0.0


def smallest_losses(aircraft: Aircraft) -> dict[str, dict[str, Any]]:
    """Of each surface: the axis it shows on, rad/s2 per rad there, and the loss of effectiveness, as a share,
    that theory is certain to detect at DEFLECTION_DEG; above 1 none is."""
    if aircraft.file.model_error_map is None:
        return {}
    error = near_trim(aircraft)
    G = DesignFunctions(design_record(aircraft)).G(_usual_y(aircraft))
    found = {}
    for s, (surface, axis) in enumerate(zip(aircraft.surfaces, aircraft.dominant_axis, strict=True)):
        eta = error[AXES[axis]] + getattr(Bounds().constant_rad_s2, AXES[axis])
        per_rad = abs(float(G[axis, s]))
        found[surface] = {
            "axis": AXES[axis],
            "per_rad_rad_s2": per_rad,
            "bound_rad_s2": eta,
            "certain_loss": 2.0 * eta / max(per_rad * radians(DEFLECTION_DEG), 1e-12),
        }
    return found


def near_trim(aircraft: Aircraft) -> dict[str, float]:
    """The declared error in the second box, for surfaces within the second share of their travel, rad/s2."""
    error_map = aircraft.file.model_error_map
    if error_map is None:
        return dict(zip(AXES, aircraft.model_error_rad_s2, strict=True))
    box = error_map.boxes[min(_NEAR, len(error_map.boxes) - 1)]
    level = min(_NEAR, len(error_map.travel_share) - 1)
    return {axis: getattr(box, f"error_{axis}_rad_s2")[0][level] for axis in AXES}


def _usual_y(aircraft: Aircraft) -> np.ndarray:
    """The measured signals of level flight, as the innermost box has them."""
    error_map = aircraft.file.model_error_map
    assert error_map is not None
    box, usual = error_map.boxes[0], aircraft.usual_signals
    V, density = 0.5 * sum(box.airspeed_mps), 0.5 * sum(box.density_kg_m3)
    y = np.zeros(N_Y)
    y[:4] = usual["alpha"], 0.5 * sum(box.beta_rad), V, 0.5 * density * V * V
    y[4 : 4 + len(aircraft.signals)] = [usual[name] for name in aircraft.signals]
    return y


def page_of(made: Derived) -> str:
    """The page, Markdown."""
    aircraft, trim = made.aircraft, made.trim
    low, high = aircraft.envelope.airspeed_mps
    least, most = aircraft.envelope.alpha_deg
    lines = [
        f"# {aircraft.name}", "", f"{aircraft.file.description}.", "",
        f"Envelope {low:g} to {high:g} m/s, angle of attack {least:g} to {most:g} deg; trim at "
        f"{trim.airspeed_mps:.1f} m/s and {trim.altitude_m:.0f} m. Derived in {made.took_s:.1f} s.", "",
        "## What is to be known", "",
        *([f"- {note}" for note in made.notes] or ["Nothing unusual was found."]), "",
        *_diagnosed(aircraft), *_not_used(made), *_errors(aircraft), *_terms(aircraft),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _diagnosed(aircraft: Aircraft) -> list[str]:
    lines = [
        "## What can be diagnosed", "",
        f"At {DEFLECTION_DEG:g} deg from neutral, in the second box below, with the published bound.", "",
        "| surface | shows in | rad/s2 per rad | bound, rad/s2 | smallest loss certain to be detected |",
        "|---|---|---|---|---|",
    ]  # fmt: skip
    for surface, of in smallest_losses(aircraft).items():
        loss = of["certain_loss"]
        says = f"{loss:.0%}" if loss <= 1.0 else f"none: a total one needs {DEFLECTION_DEG * loss:.1f} deg"
        lines.append(
            f"| {surface} | {of['axis']} | {of['per_rad_rad_s2']:.3g} | {of['bound_rad_s2']:.3g} | {says} |"
        )
    return [*lines, ""]


def _not_used(made: Derived) -> list[str]:
    """Surfaces the aircraft has beside those of its file, if it was not known before."""
    if made.as_filed:
        return []
    if not made.further:
        return ["Its aerodynamics see no other surface.", ""]
    lines = [
        "## Surfaces that are not used", "",
        f"Its aerodynamics see these too: {WHY_NOT_USED}. So none of them stands in for a surface that has "
        "failed, and their own failures are not looked for.", "",
        "| surface | in level flight |", "|---|---|",
    ]  # fmt: skip
    return [*lines, *(f"| `{name}` | {value:g} |" for name, value in made.further.items()), ""]


def _errors(aircraft: Aircraft) -> list[str]:
    error_map = aircraft.file.model_error_map
    if error_map is None:
        return []
    shares = ", ".join(f"{share:g}" for share in error_map.travel_share)
    lines = [
        "## The error over the envelope", "",
        f"Largest error, rad/s2, in boxes about trim, for surfaces within {shares} of their travel, in the "
        f"first {error_map.until_s[0]:g} s of a flight. Outside of the last box nothing is concluded.", "",
        "| airspeed, m/s | angle of attack, rad | p | q | r |", "|---|---|---|---|---|",
    ]  # fmt: skip
    for box in error_map.boxes:
        errors = [
            " ".join(f"{error:.3g}" for error in getattr(box, f"error_{axis}_rad_s2")[0]) for axis in AXES
        ]
        speed, alpha = (f"{low:.4g} to {high:.4g}" for low, high in (box.airspeed_mps, box.alpha_rad))
        lines.append(f"| {speed} | {alpha} | {' | '.join(errors)} |")
    return [*lines, ""]


def _terms(aircraft: Aircraft) -> list[str]:
    lines = ["## Terms", "", "| coefficient | term | value |", "|---|---|---|"]
    for term in aircraft.moments:
        if term.name in aircraft.terms and term.coefficient in MOMENTS:
            factors = " ".join(term.factors) or "1"
            lines.append(f"| {term.coefficient} | {factors} | {term.value:.6g} |")
    return lines


def document_of(made: Derived) -> dict[str, Any]:
    """Terms by coefficient, errors by axis, the envelope and the trim."""
    aircraft = made.aircraft
    return {
        "aircraft": aircraft.name,
        "folder": str(aircraft.folder),
        "surfaces": {name: [t.min_rad, t.max_rad] for name, t in aircraft.travel.items()},
        "terms": {c: sum(t.coefficient == c for t in aircraft.moments) for c in ("Cl", "Cm", "Cn")},
        "envelope": aircraft.envelope.model_dump(),
        "trim": {
            "airspeed_mps": made.trim.airspeed_mps,
            "altitude_m": made.trim.altitude_m,
            "alpha_rad": made.trim.alpha_rad,
            "gamma_rad": made.trim.gamma_rad,
            "settings": dict(made.trim.settings),
        },
        "largest_error_rad_s2": {
            "fitted": dict(zip(AXES, map(float, made.fitted_rad_s2), strict=True)),
            "checked": dict(zip(AXES, map(float, made.checked_rad_s2), strict=True)),
            "declared": dict(zip(AXES, aircraft.model_error_rad_s2, strict=True)),
        },
        "near_trim_rad_s2": near_trim(aircraft),
        "smallest_certain_loss": {name: of["certain_loss"] for name, of in smallest_losses(aircraft).items()},
        "further_surfaces": dict(made.further),
        "notes": list(made.notes),
        "own_file": differences(made.as_filed, made.aircraft) if made.as_filed else None,
        "took_s": round(made.took_s, 2),
    }


def text_of(document: dict[str, Any]) -> str:
    """The document as a page of text."""
    low, high = document["envelope"]["airspeed_mps"]
    least, most = document["envelope"]["alpha_deg"]
    terms = ", ".join(f"{name} {count}" for name, count in document["terms"].items())
    lines = [
        f"{document['aircraft']}: {terms} terms",
        f" envelope   {low:g} to {high:g} m/s, angle of attack {least:g} to {most:g} deg",
        f" surfaces   {', '.join(document['surfaces'])}",
        f" {'largest error, rad/s2':24}{'p':>10}{'q':>10}{'r':>10}",
    ]
    kinds = {"fitted": "states of the fit", "checked": "states not seen", "declared": "declared bound"}
    for kind, errors in document["largest_error_rad_s2"].items():
        lines.append(f"   {kinds[kind]:22}" + "".join(f"{errors[axis]:10.4f}" for axis in AXES))
    losses = document["smallest_certain_loss"].items()
    says = ", ".join(f"{name} {f'{loss:.0%}' if loss <= 1.0 else 'none'}" for name, loss in losses)
    lines.append(f" certain to be detected at {DEFLECTION_DEG:g} deg: losses from {says}")
    if document["own_file"]:
        lines.append(f" {'coefficient':24}{'own file':>12}{'found':>12}")
        lines += [f"   {of['term']:22}{of['own']:12.5g}{of['found']:12.5g}" for of in document["own_file"]]
    lines += [f" note: {note}" for note in document["notes"]]
    if document["further_surfaces"]:
        lines.append(f" not used: {', '.join(document['further_surfaces'])}: {WHY_NOT_USED}")
    lines.append(
        f" written in {document['took_s']:.1f} s to {document['folder']}, with a page on it, derived.md"
    )
    return "\n".join(lines)


def differences(as_filed: Aircraft, found: Aircraft) -> list[dict[str, Any]]:
    """Each term of an aircraft's own file, and the coefficient that was found for the same product."""
    values = {(t.coefficient, *sorted(t.factors)): t.value for t in found.moments}
    return [
        {"term": t.name, "own": t.value, "found": values.get((t.coefficient, *sorted(t.factors)), 0.0)}
        for t in as_filed.moments
        if t.value
    ]
