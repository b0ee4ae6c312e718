"""The bound recommended for a set of runs, and what it costs the guarantee of detection."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import ceil, floor, log10
from typing import TYPE_CHECKING, Any

from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.loader import load_scenario
from beaver_ftc.studies.mismatch.models import AXES
from beaver_ftc.studies.mismatch.split import Tally, tally_of_flight

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

PUBLISHED_CASE = "elevator-partial-loss"
MAX_ROUNDS = 10  # of flights with a larger bound
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


def recommend(tallies: Iterable[Tally]) -> Recommendation:
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
    flight = fly(published_case(constant_rad_s2, like))
    fault_s, at_s = flight.scenario.faults[0].at_s, flight.detection_time_s
    delay_s = None if at_s is None or at_s < fault_s else round(at_s - fault_s, 9)
    early = at_s is not None and at_s < fault_s
    return Guarantee(constant_rad_s2, flight.guaranteed_delay_s, delay_s, early)


def published_case(constant_rad_s2: PerAxis, like: "Scenario") -> "Scenario":
    """The built-in published elevator case with the design model of `like` and this constant bound."""
    case = load_scenario(PUBLISHED_CASE).model_copy(update={"design_model": like.design_model})
    return with_bound(case, constant_rad_s2)


def with_bound(scenario: "Scenario", constant_rad_s2: PerAxis) -> "Scenario":
    """The scenario with another constant part of the bound."""
    per_axis = scenario.fdi.bounds.constant_rad_s2.model_copy(update=constant_rad_s2)
    bounds = scenario.fdi.bounds.model_copy(update={"constant_rad_s2": per_axis})
    return scenario.model_copy(update={"fdi": scenario.fdi.model_copy(update={"bounds": bounds})})


def recommended_for(scenarios: Sequence["Scenario"], kept: Sequence[Tally]) -> dict[str, Any]:
    """The bound that covers these flights, and the published elevator case flown with it and the design.

    The case is one of the flights to be covered: a bound that suits calmer air alone would raise a false
    alarm in it, and guarantee nothing.
    """
    first = scenarios[0]
    declared = first.fdi.bounds.constant_rad_s2.model_dump()
    case = published_case(declared, first)
    covered = settle([*scenarios, case], [*kept, tally_of_flight(case)[0]])
    recommended = replace(covered, runs=len(scenarios))
    return {
        "recommended": {
            "constant_rad_s2": recommended.constant_rad_s2,
            "runs": recommended.runs,
            "coverage": recommended.coverage,
            "settled": recommended.settled,
        },
        "guarantee": {
            "declared": vars(guarantee_with(declared, first)),
            "recommended": vars(guarantee_with(recommended.constant_rad_s2, first)),
        },
    }


def settle(scenarios: Sequence["Scenario"], kept: Sequence[Tally]) -> Recommendation:
    """The recommended bound, flown with until no flight exceeds it or raises a false alarm.

    A bound too small raises an alarm, after which another law flies; without that alarm the flight, and its
    mismatch, is another. So every flight is flown again with what is recommended.
    """
    tallies, recommended = list(kept), recommend(kept)
    for _ in range(MAX_ROUNDS):
        constant = recommended.constant_rad_s2
        again = [tally_of_flight(with_bound(scenario, constant)) for scenario in scenarios]
        short = [tally for tally, flown in again if tally.exceeded or flown["false_alarm"]]
        if not short:
            return replace(recommended, runs=len(scenarios))
        tallies += short
        larger = recommend(tallies).at_least(constant)
        recommended = larger if larger.constant_rad_s2 != constant else widened(larger)
    return replace(recommended, runs=len(scenarios), settled=False)
