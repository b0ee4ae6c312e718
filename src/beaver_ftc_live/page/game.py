"""A game against the detector: a fault begins unseen; the faster right name, of player or diagnosis, wins."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput, suggestion
from beaver_ftc.results import DeclaredFault, Onset
from beaver_ftc.scenario.faults import TYPES
from beaver_ftc_live.page.messages import Message

EARLIEST_S, LATEST_S = 4.0, 20.0  # range of the begin of the hidden fault, from the start of the round
IDLE, WAITING, BROKEN, OVER = "idle", "waiting", "broken", "over"
NOTHING = "nothing"

Fault = dict[str, Any]  # as in a scenario, without its times


@dataclass
class Game:
    """A round. phase: one of IDLE, WAITING (for the fault), BROKEN and OVER. mode: `random`, or `second` if
    another person chooses the fault. due_s, broken_s: times of flight at which the fault should begin, and
    has begun. yours, detector: name and time of the answer of the player and of the diagnosis. score: numbers
    of rounds that the player and the detector have won.
    """

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
        """Whether the page must hide the fault and the verdict."""
        return self.phase in (WAITING, BROKEN)

    def next_round(self, mode: str, now_s: float, kinds: list[Fault], rng: np.random.Generator) -> "Game":
        """A new round. In the mode `random`, one of these faults begins at a random time."""
        game = Game(phase=WAITING, mode=mode, score=self.score)
        if mode == "random":
            game.fault = kinds[int(rng.integers(len(kinds)))]
            game.due_s = now_s + float(rng.uniform(EARLIEST_S, LATEST_S))
        return game

    def is_due(self, now_s: float) -> bool:
        """Whether the hidden fault must begin now."""
        return self.phase == WAITING and now_s >= self.due_s

    def broke(self, fault: Fault, now_s: float) -> None:
        """Note a fault that has begun, in either mode."""
        self.phase, self.fault, self.broken_s = BROKEN, fault, now_s

    def named(self, name: str, now_s: float) -> None:
        """Note the first name that the diagnosis has given in this round."""
        if self.hidden and self.detector is None:
            self.detector = name, now_s

    def answer(self, name: str | None, names: tuple[str, ...], now_s: float) -> None:
        """Note the answer of the player. Only the first answer of a round counts, and it is wrong before the
        fault. Raises BadInput without a round, and for an unknown name."""
        if not self.hidden:
            raise BadInput("game: no round is on, allowed: start one")
        if name not in names:
            raise BadInput(f"answer: {name!r:.60} is not known{suggestion(str(name), names)}")
        if self.yours is None:
            self.yours = str(name), now_s

    def settle(self, wait_s: float, now_s: float) -> bool:
        """End the round if the player has answered, and if the diagnosis has named a surface, no fault has
        begun, or wait_s has passed since the answer. Returns whether the round has ended."""
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
        """`you` or `detector`: the one with the smaller delay of a right answer; None if neither is right."""
        times = {"you": self._delay_s(self.yours), "detector": self._delay_s(self.detector)}
        right = {player: delay_s for player, delay_s in times.items() if delay_s is not None}
        return min(right, key=lambda player: right[player]) if right else None

    def _delay_s(self, answer: tuple[str, float] | None) -> float | None:
        """Time from the fault to a right answer, s; None if the answer was wrong or came before the fault."""
        if answer is None or self.broken_s is None:
            return None
        name, time_s = answer
        broken = DeclaredFault(self.fault.get("actuator"), self.fault["type"], self.broken_s)
        return Onset(self.broken_s).delay_s(time_s) if broken.is_named_by(name) else None

    def stop(self) -> None:
        """End the round without a winner."""
        self.phase = OVER if self.hidden else IDLE

    def shown(self) -> Message:
        """The game for a page; the fault and the answers only after the round."""
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
    """The faults of a round. A surface that is not in `primary` moves only if it replaces another one: on it,
    only faults that show without a command, such as a runaway."""
    hidden = sorted((fault.place, kind, fault) for kind, row in TYPES.items() for fault in row.hidden)
    return [
        {"type": kind, "actuator": surface, **fault.keys}
        for surface in surfaces
        for _, kind, fault in hidden
        if surface in primary or fault.on_any_surface
    ]
