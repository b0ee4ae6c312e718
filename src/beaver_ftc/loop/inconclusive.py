"""In what share of a flight's frames the built-in diagnosis could conclude nothing, and why: counted frame by
frame (`note_inconclusive`), and in words (`inconclusive_of`)."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.atmosphere import altitude_of
from beaver_ftc.diagnosis.error_map import N_MAP_COORDINATES, map_row, outside_span
from beaver_ftc.scenario.measured_range import (
    ALTITUDE,
    BETWEEN,
    LATE,
    Span,
    as_altitudes,
    lies_outside,
    measured_spans,
    outside,
    quantities,
)

# Frames in which the diagnosis concludes nothing, of so many watched. undiagnosed: there is none. late: the
# flight is older than any that was measured. beyond: outside the map of the model's error in this quantity,
# which was then between least and greatest. between: inside the range of each quantity, but in no box.
INCONCLUSIVE = record(
    watched=int, frames=int, from_s=float, undiagnosed=int, late=int, between=int,
    beyond=(int, N_MAP_COORDINATES), least=N_MAP_COORDINATES, greatest=N_MAP_COORDINATES,
)  # fmt: skip


SCHEME, NO_DIAGNOSIS = "scheme", "no diagnosis ran: fdi.scheme is none"
Reason = dict[str, Any]


@kernel
def note_inconclusive(inconclusive, fdi, t):
    """Count this frame, and why nothing can be concluded in it; t s."""
    enabled, error_map = fdi.config.enabled, fdi.bound.error_map
    inconclusive.watched += 1
    if enabled and (error_map.n_boxes == 0 or not error_map.outside):
        return
    if inconclusive.frames == 0:
        inconclusive.from_s = t
    inconclusive.frames += 1
    if not enabled:
        inconclusive.undiagnosed += 1
    elif map_row(error_map) < 0:
        inconclusive.late += 1
    else:
        note_place(inconclusive, error_map)


@kernel
def note_place(inconclusive, error_map):
    """Count the quantities in which this place is outside the map."""
    explained = False
    for i in range(error_map.coordinates.size):
        if outside_span(error_map, i):
            now, first = error_map.coordinates[i], inconclusive.beyond[i] == 0
            inconclusive.least[i] = now if first else min(now, inconclusive.least[i])
            inconclusive.greatest[i] = now if first else max(now, inconclusive.greatest[i])
            inconclusive.beyond[i] += 1
            explained = True
    inconclusive.between += not explained


def inconclusive_of(frame: np.void, aircraft: Aircraft) -> dict[str, Any] | None:
    """share: of all frames; from_s: the first of them; reasons: each with its share, which may overlap, with
    the span that was measured and that flown outside of it. None if there was no such frame."""
    counted = frame["accounts"]["inconclusive"]
    if not counted["frames"]:
        return None
    watched = int(counted["watched"])
    reasons = sorted(_reasons(counted, aircraft, float(frame["t"])), key=lambda reason: -reason["share"])
    for reason in reasons:
        reason["share"] /= watched
    share = int(counted["frames"]) / watched
    return {"share": share, "from_s": float(counted["from_s"]), "reasons": reasons}


def _reasons(counted: np.void, aircraft: Aircraft, end_s: float) -> Iterator[Reason]:
    """Each reason that was one; share: still the number of frames."""
    spans = measured_spans(aircraft)
    if counted["undiagnosed"]:
        yield _reason(SCHEME, int(counted["undiagnosed"])) | {"says": NO_DIAGNOSIS}
    if counted["late"]:
        yield _reason(LATE, int(counted["late"]), spans[LATE], (spans[LATE][1], end_s))
    for i, name in enumerate(quantities(aircraft)):
        if counted["beyond"][i]:
            flown = float(counted["least"][i]), float(counted["greatest"][i])
            flown = as_altitudes(flown) if name == ALTITUDE else flown
            yield _reason(name, int(counted["beyond"][i]), spans[name], flown)
    if counted["between"]:
        yield _reason(BETWEEN, int(counted["between"]))


def _reason(quantity: str, frames: int, measured: Span | None = None, flown: Span | None = None) -> Reason:
    return {
        "quantity": quantity, "share": frames, "measured": measured, "flown": flown,
        "says": outside(quantity, measured),
    }  # fmt: skip


def inconclusive_now(frame: np.void, aircraft: Aircraft) -> str:
    """Why the built-in diagnosis can conclude nothing at the frame just flown; empty if it can."""
    error_map = frame["fdi"]["bound"]["error_map"]
    if not frame["fdi"]["config"]["enabled"]:
        return NO_DIAGNOSIS
    if not error_map["n_boxes"] or not error_map["outside"]:
        return ""
    spans, names = measured_spans(aircraft), quantities(aircraft)
    place = dict(zip(names, error_map["coordinates"].tolist(), strict=False)) | {
        LATE: float(error_map["time_s"])
    }
    place[ALTITUDE] = altitude_of(place[ALTITUDE])
    why = [outside(name, spans[name]) for name in lies_outside(place, spans)]
    return "; ".join(why) or outside(BETWEEN, None)
