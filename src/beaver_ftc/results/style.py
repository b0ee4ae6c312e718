"""How things look, on paper as on the screen: one table for the figures and the report.

Colours are Okabe and Ito's, which colour-blind readers can distinguish; dashes, widths and letters do so in
grey.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from beaver_ftc.results.model import Metrics

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE, GREY = (
    "#000000", "#e69f00", "#56b4e9", "#009e73", "#0072b2", "#d55e00", "#cc79a7", "#8a8a8a",
)  # fmt: skip
SOFTWARE_MARK = "beaver-ftc"  # name of the software in the metadata of our pictures
SERIES = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, GREY, BLACK)  # colours of curves without a role


@dataclass(frozen=True)
class Look:
    """How a role is drawn. dash: lengths on, off, ..., points; empty is a solid line. width: points. z_order:
    a curve with a larger one covers the others."""

    colour: str
    dash: tuple[float, ...] = ()
    width: float = 1.4
    z_order: int = 2


LOOKS = {
    "actual": Look(BLUE, (), 1.4, 4),
    "target": Look("#444444", (7, 3), 1.4, 5),
    "command": Look(GREY, (1.5, 2), 1.4, 3),
    "demand": Look("#b9b9b9", (), 1.0, 1),  # pale: thinned to its extremes it is a band
    "unlike": Look(VERMILION, (1.5, 1.5), 1.2, 5),
    "residual": Look(BLACK, (), 1.2, 4),
    "bound": Look(VERMILION, (5, 3), 1.3, 3),
    # An axis has the colour of the surface that leads it: aileron, elevator, rudder.
    "p": Look(SKY, (7, 3), 1.4, 4),
    "q": Look(ORANGE, (), 1.4, 5),
    "r": Look(PURPLE, (2, 2), 1.6, 4),
    # One colour a surface in every picture: aileron, elevator, rudder, flap, further ones.
    "surface 0": Look(SKY, (7, 2, 1.5, 2), 1.8, 3),
    "surface 1": Look(ORANGE, (), 1.8, 2),
    "surface 2": Look(PURPLE, (6, 4), 1.8, 4),
    "surface 3": Look(GREEN, (2, 3), 2.2, 5),
    "surface 4": Look(BLUE, (9, 3), 1.8, 3),
    "surface 5": Look(VERMILION, (1.5, 2), 1.8, 3),
    "surface 6": Look(BLACK, (4, 2), 1.4, 2),
    "surface 7": Look(GREY, (), 2.2, 1),
}
LOOKS |= {f"effective {i}": Look(LOOKS[f"surface {i}"].colour, (), 1.5, 3) for i in range(8)}
SHADES = {"saturated": "#faf6cf", "excluded": "#e4e4e4"}  # background of a stretch of time, by its meaning
PLUM = "#8f4a74"  # a darker purple, for letters and thin lines
CRIMSON = "#7d0a1e"  # for the loss of the aircraft alone
MODE_COLOURS = {"nominal": "#bfe5d9", "adaptive": SKY, "reallocated": ORANGE, "unanticipated": PURPLE}


@dataclass(frozen=True)
class Mark:
    """An instant that is marked on each time axis: a line over the panel and a symbol at its edge."""

    name: str
    time_s: float
    colour: str
    dash: tuple[float, ...]
    symbol: str
    letter: str

    @property
    def label(self) -> str:
        """Name and time, for the legend."""
        return f"{self.name} {self.time_s:.2f} s"


def marks(metrics: Metrics) -> list[Mark]:
    """The marks of fault, detection, isolation and departure that came before the end of the flight."""
    fault = metrics.fault
    departure = metrics.departure
    event_marks = (
        ("fault", fault.at_s if fault else None, VERMILION, (), "v", "F"),
        ("detection", metrics.detection.time_s, BLACK, (4, 2), "D", "D"),
        ("isolation", metrics.isolation.time_s, PLUM, (6, 2, 1, 2), "s", "I"),
        ("departure", departure.time_s if departure else None, CRIMSON, (1, 2), "X", "X"),
    )
    end_s = departure.time_s if departure else metrics.flight.flown_s
    return [
        Mark(name, time, *look) for name, time, *look in event_marks if time is not None and time <= end_s
    ]


def closeup_window(event_marks: Sequence[Mark]) -> tuple[float, float] | None:
    """Begin and end, s, of the closer view: from 0.5 s before the first event to 2 s after the last one, but
    at most 12 s after the first. A departure counts only if there is no other event. None without an
    event."""
    if not event_marks:
        return None
    times_s = [mark.time_s for mark in event_marks if mark.name != "departure"] or [event_marks[0].time_s]
    return min(times_s) - 0.5, min(max(times_s), min(times_s) + 10.0) + 2.0
