"""The bound recommended for a set of runs, and what it costs the guarantee of detection."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import ceil, floor, log10
from typing import TYPE_CHECKING

from beaver_ftc.studies.mismatch.states import AXES

if TYPE_CHECKING:
    from beaver_ftc.loop.flight import Flight
    from beaver_ftc.scenario.schema import Scenario
    from beaver_ftc.studies.mismatch.tally import Tally

PUBLISHED_CASE = "elevator-partial-loss"
LEAST_RAD_S2 = 1e-4  # of a bound that is widened
PerAxis = dict[str, float]


@dataclass(frozen=True)
class Recommendation:
    """The constant part of eta_bar, rad/s2 per axis, that covers all of `runs` runs.

    coverage: the chance that one more run of the same kind stays within it, runs / (runs + 1): it is as
    likely as any other to be the worst of all.
    settled: flown with it, no run exceeds it or raises a false alarm.
    """

    constant_rad_s2: PerAxis
    runs: int
    settled: bool = True

    @property
    def coverage(self) -> float:
        return self.runs / (self.runs + 1)

    def at_least(self, constant_rad_s2: PerAxis) -> "Recommendation":
        """The same, no axis below these."""
        largest = {axis: max(c, constant_rad_s2[axis]) for axis, c in self.constant_rad_s2.items()}
        return replace(self, constant_rad_s2=largest)


def recommend(tallies: Iterable["Tally"]) -> Recommendation:
    """The smallest constants that would have covered every run, rounded up to two digits."""
    needed = [[bound.smallest_constant_rad_s2 for bound in tally.bounds] for tally in tallies]
    worst = [max(column) for column in zip(*needed, strict=True)]
    return Recommendation({axis: rounded_up(c) for axis, c in zip(AXES, worst, strict=True)}, len(needed))


def widened(recommended: Recommendation) -> Recommendation:
    """A fifth more: for an alarm although nothing was exceeded, as rounding and noise may raise it."""
    wider = {axis: rounded_up(max(1.2 * c, LEAST_RAD_S2)) for axis, c in recommended.constant_rad_s2.items()}
    return replace(recommended, constant_rad_s2=wider)


def rounded_up(value: float, digits: int = 2) -> float:
    """The next number of this many significant digits that is not below `value`."""
    if value <= 0.0:
        return 0.0
    step = digits - 1 - floor(log10(value))
    scaled = value * 10.0**step
    return ceil(scaled - 1e-9 * scaled) / 10.0**step if step >= 0 else ceil(scaled) * 10.0**-step


@dataclass(frozen=True)
class Guarantee:
    """The published elevator case, flown with a bound: delays in s from the fault, None for never."""

    constant_rad_s2: PerAxis
    guaranteed_delay_s: float | None
    detection_delay_s: float | None
    false_alarm: bool


def guarantee_with(constant_rad_s2: PerAxis, like: "Scenario") -> Guarantee:
    """Fly the published elevator case with this bound and the design model of `like`."""
    from beaver_ftc.loop.loop import fly

    flight = fly(published_case(constant_rad_s2, like))
    fault_s = flight.scenario.faults[0].at_s
    return Guarantee(
        constant_rad_s2, flight.guaranteed_delay_s, _delay(flight, fault_s), _false_alarm(flight, fault_s)
    )


def published_case(constant_rad_s2: PerAxis, like: "Scenario") -> "Scenario":
    """The built-in published elevator case with the design model of `like` and this constant bound."""
    from beaver_ftc.scenario.loader import load_scenario

    case = load_scenario(PUBLISHED_CASE).model_copy(update={"design_model": like.design_model})
    return with_bound(case, constant_rad_s2)


def with_bound(scenario: "Scenario", constant_rad_s2: PerAxis) -> "Scenario":
    """The scenario with another constant part of the bound."""
    per_axis = scenario.fdi.bounds.constant_rad_s2.model_copy(update=constant_rad_s2)
    bounds = scenario.fdi.bounds.model_copy(update={"constant_rad_s2": per_axis})
    return scenario.model_copy(update={"fdi": scenario.fdi.model_copy(update={"bounds": bounds})})


def _delay(flight: "Flight", fault_s: float) -> float | None:
    at_s = flight.detection_time_s
    return None if at_s is None or at_s < fault_s else round(at_s - fault_s, 9)


def _false_alarm(flight: "Flight", fault_s: float) -> bool:
    return flight.detection_time_s is not None and flight.detection_time_s < fault_s
