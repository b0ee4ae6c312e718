"""Results of the diagnosis in flight as short texts, for STATUSTEXT of MAVLink and for the terminal."""

from typing import Any, NamedTuple

from beaver_ftc_links.sitl.vehicle import Flown
from beaver_ftc_live.page.messages import verdict_in_words

# MAV_SEVERITY.
EMERGENCY = 0
CRITICAL = 2
WARNING = 4
INFO = 6
MOST_KEPT = 200  # largest number of texts in the metrics
ESTIMATED_S = 1.0  # time from the name of a loss to the text on its size
_PREFIX = "FDI: "
_LOSS = "loss_of_effectiveness"


class Text(NamedTuple):
    """A result: time of flight, s; MAV_SEVERITY; text."""

    t_s: float
    severity: int
    text: str


class Teller:
    """Compares the verdict of a flight with that of the frame before. kept: the texts so far."""

    def __init__(self) -> None:
        self.kept: list[Text] = []
        self.begin()

    def begin(self) -> None:
        """Forget the verdict and the texts of the flight before."""
        self._said: tuple[Any, ...] = (False, None, None, ())
        self._lost = False
        self._named_s = -1.0
        self._listening = False
        self.kept.clear()

    def news(self, sim: Flown) -> list[Text]:
        """The texts on the last frame; mostly none."""
        begins = bool(sim.listens_from_s) and not self._listening
        if not (begins or sim.alarmed or sim.departed):
            return []
        new = [(INFO, "listening")] if begins else []
        self._listening |= begins
        texts = [Text(sim.t_s, severity, _PREFIX + text) for severity, text in new + self._new(sim)]
        self.kept += texts[: MOST_KEPT - len(self.kept)]
        return texts

    def _new(self, sim: Flown) -> list[tuple[int, str]]:
        verdict = sim.verdict
        found = []
        before = self._said
        open_between = tuple(dict.fromkeys(name.partition(":")[0] for name in verdict.candidates))
        self._said = now = verdict.detected, verdict.isolated, verdict.type, open_between
        if verdict.detected and not before[0]:
            where = f"on {verdict.axis}" if verdict.axis else "between the instruments"
            found.append((WARNING, f"alarm {where}"))
        if verdict.isolated and before[1:3] != now[1:3]:
            found.append((CRITICAL, verdict_in_words(verdict)))
            self._named_s = sim.t_s if verdict.type == _LOSS else -1.0
        elif verdict.detected and not verdict.isolated and open_between and before[3] != now[3]:
            found.append((WARNING, " or ".join(open_between)))
        if 0.0 <= self._named_s <= sim.t_s - ESTIMATED_S and verdict.estimate is not None:
            self._named_s = -1.0
            found.append((INFO, f"{verdict.isolated}, {round(-100.0 * verdict.estimate) + 0} % lost"))
        if sim.departed and not self._lost:
            self._lost = True
            found.append((EMERGENCY, "the aircraft is lost"))
        return found
