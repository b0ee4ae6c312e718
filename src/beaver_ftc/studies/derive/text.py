"""What came of a derivation, as a document and as text."""

from typing import Any

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.studies.derive.derived import Derived
from beaver_ftc.studies.derive.page import DEFLECTION_DEG, WHY_NOT_USED, near_trim, smallest_losses

AXES = ("p", "q", "r")


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
        "own_file": differences(made.given, made.aircraft) if made.given else None,
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
    says = {name: f"{loss:.0%}" if loss <= 1.0 else "none" for name, loss in losses}
    lines.append(f" certain to be detected at {DEFLECTION_DEG:g} deg: losses from " + _listed(says))
    if document["own_file"]:
        lines += _compared(document["own_file"])
    lines += [f" note: {note}" for note in document["notes"]]
    if document["further_surfaces"]:
        lines.append(f" not used: {', '.join(document['further_surfaces'])}: {WHY_NOT_USED}")
    lines.append(
        f" written in {document['took_s']:.1f} s to {document['folder']}, with a page on it, derived.md"
    )
    return "\n".join(lines)


def differences(given: Aircraft, found: Aircraft) -> list[dict[str, Any]]:
    """Each term of an aircraft's own file, and the coefficient that was found for the same product."""
    values = {(t.coefficient, *sorted(t.factors)): t.value for t in found.moments}
    return [
        {"term": t.name, "own": t.value, "found": values.get((t.coefficient, *sorted(t.factors)), 0.0)}
        for t in given.moments
        if t.value
    ]


def _compared(terms: list[dict[str, Any]]) -> list[str]:
    """The coefficients beside those of the aircraft's own file."""
    head = f" {'coefficient':24}{'own file':>12}{'found':>12}"
    return [head, *(f"   {of['term']:22}{of['own']:12.5g}{of['found']:12.5g}" for of in terms)]


def _listed(values: dict[str, str]) -> str:
    return ", ".join(f"{name} {value}" for name, value in values.items())
