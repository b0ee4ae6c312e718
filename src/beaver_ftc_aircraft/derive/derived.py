"""What came of a derivation: as a document, as text, and as a page on the aircraft.

The page has its terms, its error over the envelope, and what can be diagnosed.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import radians
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES, MOMENTS, Aircraft, ErrorMapSection
from beaver_ftc.design import N_Y, DesignFunctions, design_record
from beaver_ftc.plant import TrimPoint
from beaver_ftc.scenario import Bounds, measured_spans, plural, span_in_words
from beaver_ftc_aircraft.derive.surfaces import Difference

DEFLECTION_DEG = 3.0  # beside neutral: what flight with the built-in references asks of a surface
_NEAR = 1  # box and share of the travel of such a flight, as `fit` makes them
NAME = "derived.md"
_OF_TRIM = ("airspeed_mps", "altitude_m", "alpha_rad", "gamma_rad")
_KINDS = {"fitted": "states of the fit", "checked": "states not seen", "declared": "declared bound"}
WHY_NOT_USED = (
    "they stay where its own flight control has them; most go in detents, at a pace no law controls with"
)


@dataclass(frozen=True)
class Derived:
    """What came of it: the folder, the aircraft, its trim, the largest errors (3,) rad/s2 over the samples
    of the fit and over those it did not see, and what is to be known of it. as_filed: as its own file has it.
    further: surfaces that are not used, by property, and where they stay. took_s: how long it took. files:
    what its model is made of beside itself, and the folder of each. off: where the copy turns most otherwise
    than the model when its surfaces move, if it was copied from one."""

    aircraft: Aircraft
    trim: TrimPoint
    fitted_rad_s2: np.ndarray
    checked_rad_s2: np.ndarray
    notes: tuple[str, ...]
    as_filed: Aircraft | None
    further: Mapping[str, float]
    took_s: float
    files: Mapping[str, str] = field(default_factory=dict)
    off: Difference | None = None

    @property
    def error_map(self) -> ErrorMapSection:
        """The declared error over the envelope: a derivation always finds one."""
        assert self.aircraft.file.model_error_map is not None
        return self.aircraft.file.model_error_map


def smallest_losses(made: Derived) -> dict[str, dict[str, Any]]:
    """Of each surface: the axis it shows on, rad/s2 per rad there, and the loss of effectiveness, as a share,
    that theory is certain to detect at DEFLECTION_DEG; above 1 none is."""
    aircraft, error = made.aircraft, near_trim(made)
    G = DesignFunctions(design_record(aircraft)).G(_usual_y(made))
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


def near_trim(made: Derived) -> dict[str, float]:
    """The declared error in the second box, for surfaces within the second share of their travel, rad/s2."""
    box = made.error_map.boxes[_NEAR]
    return {axis: getattr(box, f"error_{axis}_rad_s2")[0][_NEAR] for axis in AXES}


def _usual_y(made: Derived) -> np.ndarray:
    """The measured signals of level flight, as the innermost box has them."""
    box, usual = made.error_map.boxes[0], made.aircraft.usual_signals
    V, density = 0.5 * sum(box.airspeed_mps), 0.5 * sum(box.density_kg_m3)
    y = np.zeros(N_Y)
    y[:4] = usual["alpha"], 0.5 * sum(box.beta_rad), V, 0.5 * density * V * V
    y[4 : 4 + len(made.aircraft.signals)] = [usual[name] for name in made.aircraft.signals]
    return y


def page_of(made: Derived) -> str:
    """The page, Markdown."""
    aircraft, trim = made.aircraft, made.trim
    parts = [
        f"# {aircraft.name}",
        f"{aircraft.file.description}.",
        f"Envelope {_envelope(aircraft.envelope.model_dump())}; trim at "
        f"{trim.airspeed_mps:.1f} m/s and {trim.altitude_m:.0f} m. Derived in {made.took_s:.1f} s.",
        "## What is to be known",
        "\n".join(f"- {note}" for note in made.notes) or "Nothing unusual was found.",
        *_copied(made),
        *_diagnosed(made), *_not_used(made), *_errors(made), "## Terms", _terms(aircraft),
    ]  # fmt: skip
    return "\n\n".join(parts) + "\n"


def _copied(made: Derived) -> Iterator[str]:
    """What it was copied from, and how far the copy is off it."""
    if made.off:
        yield "## The copy"
        yield (
            "In several states, the surfaces of the copy were moved from stop to stop in JSBSim, those of "
            "the model by its own flight control. Their accelerations differ, as a share of what the whole "
            f"travels do, by at most {made.off}."
        )
    if made.files:
        yield "It is made of these files beside its model:"
        yield _table(("file", "read from"), *((f"`{name}`", place) for name, place in made.files.items()))


def _envelope(envelope: Mapping[str, Any]) -> str:
    """What was sampled, in a line."""
    (low, high), (least, most) = envelope["airspeed_mps"], envelope["alpha_deg"]
    lowest, highest = envelope["altitude_m"]
    airspeed, alpha = f"{low:g} to {high:g} m/s", f"angle of attack {least:g} to {most:g} deg"
    return f"{airspeed}, {alpha}, altitude {lowest:g} to {highest:g} m"


def _table(*rows: Iterable[str]) -> str:
    """The first row is the header."""
    head, *others = (f"| {' | '.join(row)} |" for row in rows)
    return "\n".join([head, "|---" * len([*rows[0]]) + "|", *others])


def _diagnosed(made: Derived) -> Iterator[str]:
    yield "## What can be diagnosed"
    yield f"At {DEFLECTION_DEG:g} deg from neutral, in the second box below, with the published bound."
    head = (
        "surface", "shows in", "rad/s2 per rad", "bound, rad/s2", "smallest loss certain to be detected",
        "smallest jam, off the command",
    )  # fmt: skip
    rows = []
    for surface, of in smallest_losses(made).items():
        certain = _loss_and_jam(of["certain_loss"])
        sizes = (f"{of[name]:.3g}" for name in ("per_rad_rad_s2", "bound_rad_s2"))
        rows.append((surface, of["axis"], *sizes, *certain))
    yield _table(head, *rows)


def _loss_and_jam(certain_loss: float) -> tuple[str, str]:
    """The smallest ones certain to be detected, in words: a jam lacks what a total loss lacks at the
    deflection by which it is off."""
    jam = f"{_short(DEFLECTION_DEG * certain_loss)} deg"
    return f"{certain_loss:.0%}" if certain_loss <= 1.0 else f"none: a total one needs {jam}", jam


def _short(value: float) -> str:
    """Two digits that count, and no exponent where a person would write none."""
    return f"{value:.2g}" if value < 100.0 else f"{value:.0f}"


def _not_used(made: Derived) -> Iterator[str]:
    """Surfaces the aircraft has beside those of its file, if it was not known before."""
    if made.further:
        yield "## Surfaces that are not used"
        yield (
            f"Its aerodynamics see these too: {WHY_NOT_USED}. So none of them stands in for a surface that "
            "has failed, and their own failures are not looked for."
        )
        places = [(f"`{name}`", f"{value:g}") for name, value in made.further.items()]
        yield _table(("surface", "in level flight"), *places)
    elif made.as_filed is None:
        yield "Its aerodynamics see no other surface."


def _errors(made: Derived) -> Iterator[str]:
    shares = ", ".join(f"{share:g}" for share in made.error_map.travel_share)
    yield "## The error over the envelope"
    yield (
        f"Largest error, rad/s2, in boxes about trim, for surfaces within {shares} of their travel, in the "
        f"first {made.error_map.until_s[0]:g} s of a flight. Outside of the last box nothing is concluded: "
        f"there is no "
        "alarm, and no name. The verdict of such a flight says where, why, and in what share of its frames."
    )
    spans = measured_spans(made.aircraft)
    yield "All boxes together:"
    yield _table(
        ("quantity", "measured"), *((plural(n), span_in_words(n, span)) for n, span in spans.items())
    )
    rows = []
    for box in made.error_map.boxes:
        errors = (getattr(box, f"error_{axis}_rad_s2")[0] for axis in AXES)
        ranges = (f"{low:.4g} to {high:.4g}" for low, high in (box.airspeed_mps, box.alpha_rad))
        rows.append([*ranges, *(" ".join(f"{error:.3g}" for error in of_axis) for of_axis in errors)])
    yield _table(("airspeed, m/s", "angle of attack, rad", *AXES), *rows)


def _terms(aircraft: Aircraft) -> str:
    terms = [t for t in aircraft.moments if t.name in aircraft.terms]
    rows = [(t.coefficient, " ".join(t.factors) or "1", f"{t.value:.6g}") for t in terms]
    return _table(("coefficient", "term", "value"), *rows)


def document_of(made: Derived) -> dict[str, Any]:
    """Terms by coefficient, errors by axis, the envelope and the trim."""
    aircraft = made.aircraft
    errors = made.fitted_rad_s2, made.checked_rad_s2, aircraft.model_error_rad_s2
    by_axis = (dict(zip(AXES, map(float, of), strict=True)) for of in errors)
    losses = {name: of["certain_loss"] for name, of in smallest_losses(made).items()}
    return {
        "aircraft": aircraft.name,
        "folder": str(aircraft.folder),
        "surfaces": {name: [t.min_rad, t.max_rad] for name, t in aircraft.travel.items()},
        "terms": {c: sum(t.coefficient == c for t in aircraft.moments) for c in MOMENTS},
        "envelope": aircraft.envelope.model_dump(),
        "trim": {n: getattr(made.trim, n) for n in _OF_TRIM} | {"settings": dict(made.trim.settings)},
        "largest_error_rad_s2": dict(zip(_KINDS, by_axis, strict=True)),
        "near_trim_rad_s2": near_trim(made),
        "smallest_certain_loss": losses,
        "smallest_certain_jam_deg": {name: DEFLECTION_DEG * loss for name, loss in losses.items()},
        "further_surfaces": dict(made.further),
        "notes": list(made.notes),
        "files": dict(made.files),
        "copy_off": {"share": round(made.off.share, 6), "where": str(made.off)} if made.off else None,
        "own_file": differences(made.as_filed, made.aircraft) if made.as_filed else None,
        "took_s": round(made.took_s, 2),
    }


def text_of(document: dict[str, Any]) -> str:
    """The document as a page of text."""
    terms = ", ".join(f"{name} {count}" for name, count in document["terms"].items())
    lines = [
        f"{document['aircraft']}: {terms} terms",
        f" envelope   {_envelope(document['envelope'])}",
        f" surfaces   {', '.join(document['surfaces'])}",
        f" {'largest error, rad/s2':24}{'p':>10}{'q':>10}{'r':>10}",
    ]
    for kind, errors in document["largest_error_rad_s2"].items():
        lines.append(f"   {_KINDS[kind]:22}" + "".join(f"{errors[axis]:10.2g}" for axis in AXES))
    lines.append(f" {'certain to be detected':24}{'jam, off':>10}  loss at {DEFLECTION_DEG:g} deg")
    for name, certain in document["smallest_certain_loss"].items():
        loss, jam = _loss_and_jam(certain)
        lines.append(f"   {name:22}{jam:>10}  {loss}")
    if document["own_file"]:
        lines.append(f" {'coefficient':24}{'own file':>12}{'found':>12}")
        lines += [f"   {of['term']:22}{of['own']:12.5g}{of['found']:12.5g}" for of in document["own_file"]]
    if document["copy_off"]:
        lines.append(f" copy       off the model by at most {document['copy_off']['where']}")
    if document["files"]:
        read = ", ".join(f"{name} from {place}" for name, place in document["files"].items())
        lines.append(f" files      {read}")
    lines += [f" note: {note}" for note in document["notes"]]
    if document["further_surfaces"]:
        lines.append(f" not used: {', '.join(document['further_surfaces'])}: {WHY_NOT_USED}")
    lines.append(f" written in {document['took_s']:.1f} s to {document['folder']}, with a page on it, {NAME}")
    return "\n".join(lines)


def differences(as_filed: Aircraft, found: Aircraft) -> list[dict[str, Any]]:
    """Each term of an aircraft's own file, and the coefficient that was found for the same product."""
    values = {(t.coefficient, *sorted(t.factors)): t.value for t in found.moments}
    return [
        {"term": t.name, "own": t.value, "found": values.get((t.coefficient, *sorted(t.factors)), 0.0)}
        for t in as_filed.moments
        if t.value
    ]
