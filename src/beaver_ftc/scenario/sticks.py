"""A flight steered by hand as a scenario: what the sticks added to the reference becomes tables."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents.document import Document
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.airframe import checked_against
from beaver_ftc.scenario.consistency import OF_A_FAULT
from beaver_ftc.scenario.loader import validate_scenario
from beaver_ftc.scenario.overrides import aircraft_of
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.table import MAX_ROWS

AXES = ("p", "q", "r")
FILE = "sticks.csv"  # what such a table is said to come from; its values are in the scenario itself


class StickTrack:
    """What was added to the reference, frame by frame; only changes are kept."""

    def __init__(self) -> None:
        self._changes: list[tuple[int, tuple[float, float, float]]] = [(0, (0.0, 0.0, 0.0))]

    def move(self, k: int, rate_deg_s: NDArray[np.float64] | None) -> None:
        """From frame k on, (3,) deg/s; None is none."""
        p, q, r = (0.0, 0.0, 0.0) if rate_deg_s is None else map(float, rate_deg_s)
        if self._changes[-1][1] != (p, q, r):
            if self._changes[-1][0] == k:
                self._changes.pop()
            self._changes.append((k, (p, q, r)))

    @property
    def moved(self) -> bool:
        """Whether anything was ever added."""
        return len(self._changes) > 1 or any(self._changes[0][1])

    def tables(self, rate_hz: float) -> Iterator[tuple[str, list[float], list[float]]]:
        """(axis, times s, rates deg/s) of each axis that was moved: flat between changes, so that straight
        lines give every frame its value to the bit."""
        for i, axis in enumerate(AXES):
            knots: dict[int, float] = {}
            value = 0.0
            for k, rates in self._changes:
                if k > 0 and rates[i] != value:
                    knots[k - 1] = value
                if k == 0 or rates[i] != value:
                    knots[k] = rates[i]
                value = rates[i]
            if any(knots.values()):
                yield axis, [k / rate_hz for k in knots], list(knots.values())


def flown(scenario: Scenario, faults: Sequence[Any], stick: StickTrack, frames: int) -> Scenario:
    """The scenario that flies so many frames again, with these faults and what the stick added.

    Raises BadInput where the stick moved too often for a table.
    """
    end_s = frames / scenario.rate_hz
    data = scenario.model_dump(mode="json", by_alias=True, exclude_unset=True)
    data["duration_s"] = end_s
    data["faults"] = [_dump(fault) for fault in in_force(faults, end_s)]
    if scenario.changes:
        data["changes"] = [_dump(change) for change in scenario.changes if change.at_s < end_s]
    if not data["faults"]:
        expect = data.get("expect", {})
        data["expect"] = {key: value for key, value in expect.items() if key not in OF_A_FAULT}
    for axis, times_s, rates_deg_s in stick.tables(scenario.rate_hz):
        if len(times_s) > MAX_ROWS:
            raise BadInput(
                f"the stick moved too often on {axis}, allowed: {MAX_ROWS // 2} times in a scenario"
            )
        table = {"file": FILE, "column": axis, "time_s": times_s, "values_deg_s": rates_deg_s}
        reference = data.setdefault("reference", {})
        reference[axis] = [*reference.get(axis, []), {"csv": table}]
    with checked_against(*aircraft_of(scenario)):
        return validate_scenario(Document(data))


def _dump(entry: Any) -> Any:
    return entry.model_dump(mode="json", exclude_unset=True)


def in_force(faults: Sequence[Any], end_s: float) -> tuple[Any, ...]:
    """Those that were there in a flight up to end_s."""
    return tuple(
        fault for fault in faults if fault.at_s < end_s and (fault.end_s is None or fault.end_s > fault.at_s)
    )
