"""The costs by which methods are tuned, ours and rivals alike: what the tables of benchmark.md show.

A detector flies with our default law, over faulted flights F and healthy flights H:

    J = mean over F of [ d / (d + 1 s) + w ] / 2  +  mean over F and H of a

d is the delay of its alarm, infinite for a fault that it misses; w is 1 if the name at the end is wrong or
missing, a is 1 for an alarm without a fault. 0 is the best, 2 the worst.

A law flies with our default scheme, over faulted flights:

    J = geometric mean of e / e_oracle

e is the RMS tracking error of all axes after the fault, and e_oracle that of the oracle in the same flight.
An aircraft that is lost counts `LOST`. A candidate is admissible if

    - healthy, it keeps the gain and phase margins that the scenario asks of the default law, at every surface
      that leads an axis, over the airspeeds of the envelope;
    - the RMS rate of all surfaces together, over the same flights, is at most `EFFORT` times that of the
      default law.

One that is not admissible costs `INADMISSIBLE` and more, the more the further it is from it.

A flight of a plug-in ends with a false alarm, after which it costs the most whatever follows. A trial is
ended early once it cannot win: of a detector, whose costs only add up, once the sum exceeds the
lowest so far; of a law, once the mean over `LEAST_FLIGHTS` or more flights is `HOPELESS` times the lowest so
far. Its cost is then the mean up to there.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from math import exp, inf, isfinite, isnan, log, sqrt
from statistics import fmean

import numpy as np

from beaver_ftc.documents.errors import BeaverFtcError
from beaver_ftc.loop.loop import Loop, fly
from beaver_ftc.plugins import DETECTORS, LAWS
from beaver_ftc.results.metrics import Truth
from beaver_ftc.studies.compare.margins_in_flight import margins_of
from beaver_ftc.studies.compare.trial import (
    CALIBRATION,
    LAW,
    ORACLE,
    SCHEME,
    Entry,
    Result,
    SetFlight,
    of_set,
    result_of,
    with_entry,
    with_values,
)
from beaver_ftc.studies.margins import Margin

# Of a detector.
DELAY_S = 1.0  # an alarm this late costs half of a missed one
# Of a law: shares of 1, but for LEAST_FLIGHTS.
LOST = 100.0  # of e_oracle: the error of a flight that loses the aircraft, and the largest of any flight
EFFORT = 1.1  # of the RMS surface rate of the default law
LEAST_FLIGHTS = 4  # that a mean of a trial needs, before it ends the trial
HOPELESS = 1.5  # of the lowest J
# In place of J.
INADMISSIBLE = 1e3  # above every J
FAILED = 1e6  # of a candidate that cannot be flown at all

Values = Mapping[str, float]


@cache
def flights(grade: str, most: int | None, draw: int = 0, draws: int = 1) -> tuple[SetFlight, ...]:
    """The flights that a grade's methods are tuned on; kinds of flights take turns. draw: see `of_sweep`.
    draws: so many from this one on, together."""
    of_kind: dict[str, list[SetFlight]] = {}
    for number in range(draw, draw + draws):
        for case in of_set(CALIBRATION + grade, most, number):
            of_kind.setdefault(case.scenario.name.rpartition("-")[0], []).append(case)
    placed = [
        ((i + 0.5) / len(cases), k, case)
        for k, cases in enumerate(of_kind.values())
        for i, case in enumerate(cases)
    ]
    return tuple(case for _, _, case in sorted(placed, key=lambda place: place[:2]))


class _FalseAlarm(Exception):
    """A plug-in has raised an alarm without a fault: nothing that follows changes what its flight costs."""


def _end_with_false_alarm(loop: Loop) -> Callable[[], None]:
    """Watch a flight (`fly`): end it with the first false alarm of its plug-in. What is returned is called at
    its end, and changes nothing then."""
    plugins = loop.plugin_frame
    is_false = Truth.of(loop.scenario).onset.is_false

    def after_frame() -> None:
        if plugins is not None and plugins.verdict.detected and is_false(plugins.t_s):
            raise _FalseAlarm

    loop.after_frame = after_frame if plugins is not None else None
    return after_frame


def flown(case: SetFlight, entry: Entry, group: str, values: Values) -> Result:
    """One flight of an entry with these values of its detector or law."""
    scenario = with_values(with_entry(case.scenario, entry), group, values)
    watch = _end_with_false_alarm if group == DETECTORS else None
    try:
        return result_of(fly(scenario, watch=watch), entry, 0.0)
    except _FalseAlarm:
        return Result(entry, True, 0.0, bool(scenario.faults))


class Cost:
    """J over flights of an entry; _lowest: of the best trial so far."""

    def __init__(self, group: str, entry: Entry, cases: Sequence[SetFlight]) -> None:
        self._group = group
        self._entry = entry
        self._cases = cases
        self._lowest = inf

    def parts(self, values: Values) -> list[float]:
        """The part of each flight in J with these values."""
        return [part for _, part in self._flights(values)]

    def _flights(self, values: Values) -> Iterator[tuple[Result, float]]:
        """Fly one after the other; the result of each, and its part in J."""
        for n, case in enumerate(self._cases):
            result = flown(case, self._entry, self._group, values)
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
        """J with these values."""
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
        """Of a false alarm, and of a fault its delay and a wrong name."""
        cost = result.false_alarm / len(self._cases)
        if result.faulted:
            d = result.delay_s
            late = d / (d + DELAY_S) if isfinite(d) else 1.0
            cost += (late + (not result.correct)) / 2.0 / self._faulted
        return cost


class LawCost(Cost):
    """J of a law, exp(mean of all parts), with what makes a candidate inadmissible."""

    def __init__(self, name: str, grade: str, most: int | None, draw: int, draws: int = 1) -> None:
        cases = [case for case in flights(grade, most, draw, draws) if case.scenario.faults]
        super().__init__(LAWS, Entry(SCHEME, name), cases)
        self._oracle, self._effort_allowed = yardsticks(grade, most, draw, draws)

    def __call__(self, values: Values) -> float:
        """J with these values."""
        try:
            short = self.shortfall(values)
            return INADMISSIBLE * (1.0 + short) if short else self._tracking(values)
        except BeaverFtcError:
            return FAILED

    def margins(self, values: Values) -> list[Margin]:
        """The margins of the healthy loop."""
        return margins_of(with_values(with_entry(self._cases[0].scenario, self._entry), LAWS, values))

    def shortfall(self, values: Values) -> float:
        """By which share the worst margin is too small; zero if all are kept. One that is NaN is none."""
        asked = self._cases[0].scenario.control
        gain_db, phase_deg = least_margins(self.margins(values))
        shares = gain_db / asked.gain_margin_db, phase_deg / asked.phase_margin_deg
        return max(0.0, *(1.0 if isnan(share) else 1.0 - share for share in shares))

    def _tracking(self, values: Values) -> float:
        results = list[Result]()
        logs = list[float]()
        for result, part in self._flights(values):
            results.append(result)
            logs.append(part)
            if len(logs) >= LEAST_FLIGHTS and exp(fmean(logs)) > HOPELESS * self._lowest:
                break
        excess = effort(results) / (EFFORT * self._effort_allowed)
        if not isfinite(excess):
            return FAILED
        if excess > 1.0 and len(results) == len(self._cases):
            return INADMISSIBLE * excess
        cost = exp(fmean(logs))
        self._lowest = min(self._lowest, cost)
        return cost

    def _part(self, n: int, result: Result) -> float:
        """The logarithm of the error over the oracle's."""
        rms_deg_s = result.rms_deg_s
        return log(min(rms_deg_s / self._oracle[n], LOST) if isfinite(rms_deg_s) else LOST)


@cache
def yardsticks(grade: str, most: int | None, draw: int, draws: int) -> tuple[tuple[float, ...], float]:
    """The oracle's error in each faulted flight, deg/s; and the default law's RMS surface rate, deg/s."""
    cases = [case for case in flights(grade, most, draw, draws) if case.scenario.faults]
    oracle = tuple(flown(case, Entry(SCHEME, ORACLE), LAWS, {}).rms_deg_s for case in cases)
    return oracle, effort([flown(case, Entry(SCHEME, LAW), LAWS, {}) for case in cases])


def effort(results: Sequence[Result]) -> float:
    """RMS rate of all surfaces over flights, deg/s; of a flight that is lost, up to there."""
    return sqrt(fmean(result.energy_deg2_s2 for result in results))


def least_margins(margins: Sequence[Margin]) -> tuple[float, float]:
    """The smallest gain margin, dB, and phase margin, deg; NaN if any is."""
    gains_db = [gain_db for margin in margins for gain_db in (margin.up_db, margin.down_db)]
    return float(np.min(gains_db)), float(np.min([margin.phase_deg for margin in margins]))
