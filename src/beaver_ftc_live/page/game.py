"""You against the detector: something breaks unseen, you name it, the diagnosis names it, times compare."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput, suggestion
from beaver_ftc.results import DeclaredFault, Onset
from beaver_ftc.scenario.faults import TYPES
from beaver_ftc_live.page.messages import Message

EARLIEST_S, LATEST_S = 4.0, 20.0  # of the hidden fault, after the start of the round
IDLE, WAITING, BROKEN, OVER = "idle", "waiting", "broken", "over"
NOTHING = "nothing"

Fault = dict[str, Any]  # as in a scenario, without its times


@dataclass
class Game:
    """One round at a time; times in s of flight. score: rounds won by you and by the detector."""

    phase: str = IDLE
    mode: str = "random"
    fault: Fault = field(default_factory=dict)
    due_s: float = float("inf")
    broken_s: float | None = None
    yours: tuple[str, float] | None = None
    detector: tuple[str, float] | None = None
    score: list[int] = field(default_factory=lambda: [0, 0])

    @property
    def hidden(self) -> bool:
        """Whether the page must not show what is broken, nor what the diagnosis says."""
        return self.phase in (WAITING, BROKEN)

    def next_round(self, mode: str, now_s: float, kinds: list[Fault], rng: np.random.Generator) -> "Game":
        """A new round; in `random` one of these faults will come at a time nobody is told."""
        game = Game(phase=WAITING, mode=mode, score=self.score)
        if mode == "random":
            game.fault = kinds[int(rng.integers(len(kinds)))]
            game.due_s = now_s + float(rng.uniform(EARLIEST_S, LATEST_S))
        return game

    def is_due(self, now_s: float) -> bool:
        """Whether the hidden fault has to come now."""
        return self.phase == WAITING and now_s >= self.due_s

    def broke(self, fault: Fault, now_s: float) -> None:
        """Something has been broken, by chance or by the second person."""
        self.phase, self.fault, self.broken_s = BROKEN, fault, now_s

    def named(self, name: str, now_s: float) -> None:
        """The diagnosis has named a surface."""
        if self.hidden and self.detector is None:
            self.detector = name, now_s

    def answer(self, name: str | None, names: tuple[str, ...], now_s: float) -> None:
        """You name a surface. The first answer counts, later ones do not; before the fault it is wrong."""
        if not self.hidden:
            raise BadInput("game: no round is on, allowed: start one")
        if name not in names:
            raise BadInput(f"answer: {name!r:.60} is not known{suggestion(str(name), names)}")
        if self.yours is None:
            self.yours = str(name), now_s

    def settle(self, wait_s: float, now_s: float) -> bool:
        """End the round once both have spoken, or you have and the detector had its time; tells if so."""
        if not self.hidden or self.yours is None:
            return False
        if self.detector is None and self.broken_s is not None and now_s < self.yours[1] + wait_s:
            return False
        self.phase = OVER
        winner = self.winner
        if winner is not None:
            self.score[0 if winner == "you" else 1] += 1
        return True

    @property
    def winner(self) -> str | None:
        """you, detector or nobody (None): who named the right surface first, or at all."""
        times = {who: self._delay_s(said) for who, said in (("you", self.yours), ("detector", self.detector))}
        right = {who: delay_s for who, delay_s in times.items() if delay_s is not None}
        return min(right, key=lambda who: right[who]) if right else None

    def _delay_s(self, said: tuple[str, float] | None) -> float | None:
        """From the fault to the right answer, s; None if it was wrong or too early."""
        if said is None or self.broken_s is None:
            return None
        name, time_s = said
        broken = DeclaredFault(self.fault.get("actuator"), self.fault["type"], self.broken_s)
        return Onset(self.broken_s).delay_s(time_s) if broken.is_named_by(name) else None

    def stop(self) -> None:
        """Give the round up."""
        self.phase = OVER if self.hidden else IDLE

    def shown(self) -> Message:
        """What a page may know."""
        phase = WAITING if self.hidden else self.phase
        always = {"phase": phase, "mode": self.mode, "answered": self.yours is not None, "score": self.score}
        if self.phase != OVER:
            return always
        return always | {
            "fault": self.fault, "broken_s": self.broken_s, "winner": self.winner,
            "yours": self.yours, "detector": self.detector,
            "your_delay_s": self._delay_s(self.yours), "its_delay_s": self._delay_s(self.detector),
        }  # fmt: skip


def hidden_faults(surfaces: tuple[str, ...], primary: tuple[str, ...]) -> list[Fault]:
    """What may break unseen: what can be felt. A surface that only stands in for others is still while all is
    well: on it only some faults show, such as a runaway."""
    hidden = sorted((of.place, kind, of) for kind, row in TYPES.items() for of in row.hidden)
    return [
        {"type": kind, "actuator": surface, **of.keys}
        for surface in surfaces
        for _, kind, of in hidden
        if surface in primary or of.on_any_surface
    ]
