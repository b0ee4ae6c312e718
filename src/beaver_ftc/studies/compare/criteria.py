"""The costs J by which our methods and rivals are tuned, and which the tables of benchmark.md show.

A detector flies with our default law, in faulted flights F and healthy flights H:

    J = mean over F of [ d / (d + 1 s) + w ] / 2  +  mean over F and H of a

d: delay of the alarm, s; infinite for a missed fault. w: 1 if the name at the end is wrong or missing, else
0. a: 1 for a false alarm, else 0. After a false alarm, d is infinite and w is 1. The best J is 0, the worst
2.

A law flies with our default scheme, over faulted flights:

    J = geometric mean of e / e_oracle

e: RMS tracking error of all axes after the fault, deg/s. e_oracle: that of the oracle in the same flight. A
lost aircraft counts as e / e_oracle = `LOST`, or as 1 if the oracle loses it, too. A candidate is admissible
if

    - without a fault, it keeps the gain and phase margins that the first of these flights requires of the
      default law, at every surface that leads an axis, at the slowest and the fastest airspeed of the
      envelope: all flights of a grade have the same aircraft and the same requirements;
    - the RMS rate of all surfaces together, over the same flights, is at most `EFFORT` times that of the
      default law; tested if the trial does not end early.

A candidate that is not admissible costs `INADMISSIBLE` or more; the cost grows with the violation.

The flight of a plug-in ends with a false alarm, because nothing after it changes its cost. A trial ends early
if it cannot win or hardly can. The trial of a detector, whose parts only add up, ends when the sum exceeds
the lowest J so far. The trial of a law ends when J over `LEAST_FLIGHTS` or more flights is `HOPELESS` times
the lowest J so far. The cost of such a trial is extrapolated from the flights until then.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from math import exp, inf, isfinite, isnan, log, sqrt
from statistics import fmean

import numpy as np

from beaver_ftc.documents.errors import BeaverFtcError
from beaver_ftc.loop.loop import Loop, fly
from beaver_ftc.plugins import DETECTORS, LAWS
from beaver_ftc.results.judgement import Truth
from beaver_ftc.studies.compare.margins_in_flight import margins_of
from beaver_ftc.studies.compare.sets import CALIBRATION, SetFlight, of_set
from beaver_ftc.studies.compare.trial import (
    LAW,
    ORACLE,
    SCHEME,
    Entry,
    Result,
    result_of,
    with_entry,
    with_values,
)
from beaver_ftc.studies.margins import Margin

# Cost of a detector.
DELAY_S = 1.0  # delay of an alarm at which the term of d is half of that of a missed fault
# Cost of a law.
LOST = 100.0  # e / e_oracle of a flight that loses the aircraft, and the largest of any flight
EFFORT = 1.1  # largest RMS surface rate over that of the default law
LEAST_FLIGHTS = 4  # a trial does not end early before so many flights
HOPELESS = 1.5  # J over the lowest J so far at which a trial ends
# Costs in place of J.
INADMISSIBLE = 1e3  # above every J
FAILED = 1e6  # of a candidate that cannot be flown

Values = Mapping[str, float]


@cache
def flights(grade: str, most: int | None, draw: int = 0, draws: int = 1) -> tuple[SetFlight, ...]:
    """The flights on which the methods of a grade are tuned. Kinds of flights take turns, evenly spread, so
    that the first few flights contain all kinds.

    most: flights of each sweep; None is all. draw: the first draw, as in `of_sweep`. draws: number of draws.
    """
    by_kind: dict[str, list[SetFlight]] = {}
    for number in range(draw, draw + draws):
        for case in of_set(CALIBRATION + grade, most, number):
            by_kind.setdefault(case.scenario.name.rpartition("-")[0], []).append(case)
    turns = [
        ((i + 0.5) / len(cases), k, case)
        for k, cases in enumerate(by_kind.values())
        for i, case in enumerate(cases)
    ]
    return tuple(case for _, _, case in sorted(turns, key=lambda turn: turn[:2]))


class _FalseAlarm(Exception):
    """A plug-in has raised an alarm without a fault: nothing after it changes the cost of its flight."""


def _end_with_false_alarm(loop: Loop) -> Callable[[], None]:
    """Watch a flight, as an argument of `fly`: end it with the first false alarm of its plug-in. The returned
    function is called after each frame if there is a plug-in, and once at the end, without effect."""
    plugins = loop.plugin_frame
    is_false = Truth.of(loop.scenario).onset.is_false

    def after_frame() -> None:
        if plugins is not None and plugins.verdict.detected and is_false(plugins.t_s):
            raise _FalseAlarm

    loop.after_frame = after_frame if plugins is not None else None
    return after_frame


def fly_entry(case: SetFlight, entry: Entry, group: str, values: Values) -> Result:
    """The result of one flight of an entry. values: of its detector or law. group: DETECTORS or LAWS."""
    scenario = with_values(with_entry(case.scenario, entry), group, values)
    watch = _end_with_false_alarm if group == DETECTORS else None
    try:
        return result_of(fly(scenario, watch=watch), entry, 0.0)
    except _FalseAlarm:
        return Result(entry, false_alarm=True, fault_free_s=0.0, faulted=bool(scenario.faults))


class Cost:
    """J of an entry over flights. _lowest: the lowest J of all trials so far."""

    def __init__(self, group: str, entry: Entry, cases: Sequence[SetFlight]) -> None:
        self._group = group
        self._entry = entry
        self._cases = cases
        self._lowest = inf

    def parts(self, values: Values) -> list[float]:
        """The part of each flight in J with these values."""
        return [part for _, part in self._flights(values)]

    def _flights(self, values: Values) -> Iterator[tuple[Result, float]]:
        """Fly all flights in turn; yield the result of each, and its part in J."""
        for n, case in enumerate(self._cases):
            result = fly_entry(case, self._entry, self._group, values)
            yield result, self._part(n, result)

    def _part(self, n: int, result: Result) -> float:
        """The part of flight n in J."""
        raise NotImplementedError


class DetectorCost(Cost):
    """J of a detector: the sum of all parts."""

    def __init__(self, name: str, cases: Sequence[SetFlight]) -> None:
        super().__init__(DETECTORS, Entry(name, LAW), cases)
        self._faulted = sum(bool(case.scenario.faults) for case in cases)

    def __call__(self, values: Values) -> float:
        """J with these values, its extrapolation if the trial ends early, or FAILED."""
        total = 0.0
        try:
            for n, (_, part) in enumerate(self._flights(values), 1):
                total += part
                if total > self._lowest:
                    return total * len(self._cases) / n
        except BeaverFtcError:
            return FAILED
        self._lowest = total
        return total

    def _part(self, n: int, result: Result) -> float:
        """(d / (d + DELAY_S) + w) / 2 over the number of flights with a fault, plus a over that of all. A
        flight that ends before its fault has no first part."""
        cost = result.false_alarm / len(self._cases)
        if result.faulted:
            d = result.delay_s
            late = d / (d + DELAY_S) if isfinite(d) else 1.0
            cost += (late + (not result.correct)) / 2.0 / self._faulted
        return cost


class LawCost(Cost):
    """J of a law, exp(mean of all parts), or the cost of a candidate that is not admissible."""

    def __init__(self, name: str, grade: str, most: int | None, draw: int, draws: int = 1) -> None:
        cases, self._oracle, self._default_effort = yardsticks(grade, most, draw, draws)
        super().__init__(LAWS, Entry(SCHEME, name), cases)
        self._like = cases[0].scenario  # with the aircraft and the requirements of all flights of the grade

    def __call__(self, values: Values) -> float:
        """J with these values, or its extrapolation, or the cost in its place."""
        try:
            short = self.shortfall(values)
            return INADMISSIBLE * (1.0 + short) if short else self._tracking(values)
        except BeaverFtcError:
            return FAILED

    def margins(self, values: Values) -> list[Margin]:
        """The margins of the healthy loop."""
        return margins_of(with_values(with_entry(self._like, self._entry), LAWS, values))

    def shortfall(self, values: Values) -> float:
        """The share by which the worst margin is too small, 1 - margin / required; 0 if all are kept. A NaN
        counts as a margin of 0."""
        required = self._like.control
        gain_db, phase_deg = least_margins(self.margins(values))
        shares = gain_db / required.gain_margin_db, phase_deg / required.phase_margin_deg
        return max(0.0, *(1.0 if isnan(share) else 1.0 - share for share in shares))

    def _tracking(self, values: Values) -> float:
        """J, or the cost of a candidate whose surfaces move too fast, or FAILED if their rate is not
        finite."""
        results, logs = list[Result](), list[float]()
        for result, part in self._flights(values):
            results.append(result)
            logs.append(part)
            if len(logs) >= LEAST_FLIGHTS and exp(fmean(logs)) > HOPELESS * self._lowest:
                break
        excess = effort(results) / (EFFORT * self._default_effort)
        if not isfinite(excess):
            return FAILED
        if excess > 1.0 and len(results) == len(self._cases):
            return INADMISSIBLE * excess
        cost = exp(fmean(logs))
        self._lowest = min(self._lowest, cost)
        return cost

    def _part(self, n: int, result: Result) -> float:
        """log(e / e_oracle), with at most LOST in the logarithm; 0 if the oracle loses the aircraft."""
        rms_deg_s, oracle = result.rms_deg_s, self._oracle[n]
        if not isfinite(oracle):
            return 0.0
        return log(min(rms_deg_s / oracle, LOST) if isfinite(rms_deg_s) else LOST)


@cache
def yardsticks(
    grade: str, most: int | None, draw: int, draws: int
) -> tuple[list[SetFlight], list[float], float]:
    """The faulted flights of a grade; e_oracle in each, deg/s; and the RMS surface rate of the default law
    over all of them, deg/s."""
    cases = [case for case in flights(grade, most, draw, draws) if case.scenario.faults]
    oracle, ours = (
        [fly_entry(case, Entry(SCHEME, law), LAWS, {}) for case in cases] for law in (ORACLE, LAW)
    )
    return cases, [result.rms_deg_s for result in oracle], effort(ours)


def effort(results: Sequence[Result]) -> float:
    """RMS rate of all surfaces over flights, deg/s; a lost flight counts up to the loss."""
    return sqrt(fmean(result.energy_deg2_s2 for result in results))


def least_margins(margins: Sequence[Margin]) -> tuple[float, float]:
    """The smallest gain margin, dB, and phase margin, deg; NaN if any is."""
    gains_db = [gain_db for margin in margins for gain_db in (margin.up_db, margin.down_db)]
    return float(np.min(gains_db)), float(np.min([margin.phase_deg for margin in margins]))
