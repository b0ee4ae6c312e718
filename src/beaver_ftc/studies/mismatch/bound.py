"""The bound that is recommended for a set of runs, and its effect on the guaranteed detection."""

from collections.abc import Sequence
from math import ceil, floor, log10

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents.files import Document
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.judgement import Truth
from beaver_ftc.scenario.schema import Scenario, load_scenario
from beaver_ftc.studies.mismatch.split import split_flight

PUBLISHED_CASE = "elevator-partial-loss"
MAX_ROUNDS = 10  # of flights, each with a larger bound
LEAST_RAD_S2 = 1e-4  # smallest bound after widening, also of a bound of 0
PerAxis = dict[str, float]  # constant part of eta_bar, rad/s2, by axis


def recommend(needed: Sequence[np.ndarray], at_least: PerAxis | None = None) -> PerAxis:
    """The smallest constant parts of eta_bar, rad/s2 by axis, that would have covered every run.

    needed: of each run, the constant part (3,) rad/s2 that would have covered it. Each axis has the largest,
    rounded up to two digits; none is below `at_least`, by default 0.
    """
    least = at_least or dict.fromkeys(AXES, 0.0)
    largest = np.max(needed, axis=0).tolist()
    return {axis: max(least[axis], rounded_up(value)) for axis, value in zip(AXES, largest, strict=True)}


def widened(constant_rad_s2: PerAxis) -> PerAxis:
    """The bound of all axes times 1.2, at least LEAST_RAD_S2 and rounded up: for flights that exceed the
    bound or have a false alarm although they need no larger one, which rounding and noise may cause."""
    return {axis: rounded_up(max(1.2 * c, LEAST_RAD_S2)) for axis, c in constant_rad_s2.items()}


def rounded_up(value: float) -> float:
    """The smallest number of two significant digits that is not below `value` by more than a part in 1e9."""
    if value <= 0.0:
        return 0.0
    step = 1 - floor(log10(value))
    return float(f"{ceil((1.0 - 1e-9) * value * 10.0**step)}e{-step}")


def guarantee_with(constant_rad_s2: PerAxis, like: Scenario) -> Document:
    """The results of the published elevator case with this bound and the design model of `like`.

    Delays are in s from the first frame with the fault; None: never.
    """
    flight = fly(published_case(constant_rad_s2, like))
    onset = Truth.of(flight.scenario).onset
    alarm_s = flight.detection_time_s
    return {
        "constant_rad_s2": constant_rad_s2,
        "guaranteed_delay_s": flight.guaranteed_delay_s,
        "detection_delay_s": onset.delay_s(alarm_s),
        "false_alarm": alarm_s is not None and onset.is_false(alarm_s),
    }


def published_case(constant_rad_s2: PerAxis, like: Scenario) -> Scenario:
    """The built-in published elevator case with the design model of `like` and this constant bound."""
    case = load_scenario(PUBLISHED_CASE).model_copy(update={"design_model": like.design_model})
    return with_bound(case, constant_rad_s2)


def with_bound(scenario: Scenario, constant_rad_s2: PerAxis) -> Scenario:
    """The scenario with this constant part of the bound."""
    return scenario.with_({"fdi.bounds.constant_rad_s2": constant_rad_s2})


def recommended_for(scenarios: Sequence[Scenario], needed: Sequence[np.ndarray]) -> Document:
    """The bound that covers these flights, and the published elevator case with this bound and their design
    model.

    scenarios: the flights. needed: for each, the constant part (3,) rad/s2 that would have covered it. The
    published case is covered, too: with a bound for calmer air alone, it would have a false alarm and
    guarantee nothing.

    coverage: probability, at least, that one more run of the same kind stays within the bound of all axes,
    1 - 3 / (runs + 1) or 0: on each axis, each of runs + 1 runs is equally likely to be the worst.
    """
    first = scenarios[0]
    runs = len(scenarios)
    declared = first.fdi.bounds.constant_rad_s2.model_dump()
    case = published_case(declared, first)
    constant, settled = settle([*scenarios, case], [*needed, split_flight(case)[0].smallest_constant])
    return {
        "recommended": {
            "constant_rad_s2": constant, "runs": runs, "settled": settled,
            "coverage": max(1.0 - len(AXES) / (runs + 1), 0.0),
        },
        "guarantee": {
            "declared": guarantee_with(declared, first), "recommended": guarantee_with(constant, first),
        },
    }  # fmt: skip


def settle(scenarios: Sequence[Scenario], needed: Sequence[np.ndarray]) -> tuple[PerAxis, bool]:
    """The recommended bound, and whether no flight with it exceeds it or has a false alarm, within
    MAX_ROUNDS.

    A too small bound raises an alarm, after which the law changes. Without this alarm, the flight and its
    mismatch differ. All flights are therefore flown again with each recommended bound.
    """
    constant = recommend(needed)
    for _ in range(MAX_ROUNDS):
        flights = (split_flight(with_bound(scenario, constant)) for scenario in scenarios)
        larger_needed = [
            flight.smallest_constant for flight, metrics in flights if flight.exceeded or metrics.false_alarm
        ]
        if not larger_needed:
            return constant, True
        needed = [*needed, *larger_needed]
        larger = recommend(needed, constant)
        constant = larger if larger != constant else widened(larger)
    return constant, False
