"""How the statements of [Zhang2005] are read as numbers: each measure takes the flights and names of cases.

What never happens is infinite; nothing is there to be seen of a flight that ends before.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S
from beaver_ftc.diagnosis.bounds import ROUNDING_RAD_S2
from beaver_ftc.plant.conditions import trimmed
from beaver_ftc.plant.linear import differences
from beaver_ftc.scenario.faults import LossOfEffectiveness
from beaver_ftc.studies.detectability.certain import mismatch, moments_of
from beaver_ftc.studies.reproduce.cases import ESTIMATORS, SETTLED_S, Flown
from beaver_ftc.studies.reproduce.choices import AMPLITUDE_DEG_S

Flights = Mapping[str, Flown]

AXIS = {"aileron": "p", "elevator": "q", "rudder": "r", "unanticipated": "q"}  # where a case shows
RATES = ("p", "q", "r")  # among the states of a linear aircraft
LOST, STILL = "aircraft lost", "the flap stands still"
TRANSIENT_S = 3.0  # after the fault: detection, isolation and hand-over
GOOD, TAKEN_OVER = 0.1, 0.2  # the limits `good` and `taken-over` of claims.yaml


class Measure(NamedTuple):
    """What a number is of, its unit, whether it is to be at least its limit, how it is measured, and what to
    say of an infinite one."""

    quantity: str
    unit: str
    at_least: bool
    of: Callable[..., float]
    none: str


MEASURES: dict[str, Measure] = {}
Measuring = Callable[..., float]


def _measure(
    quantity: str, unit: str = "", at_least: bool = False, none: str = "never"
) -> Callable[[Measuring], Measuring]:
    def register(of: Measuring) -> Measuring:
        MEASURES[of.__name__] = Measure(quantity, unit, at_least, of, none)
        return of

    return register


def _after(earlier_s: float | None, later_s: float | None) -> float:
    """From an event to another, s; infinite if either is missing."""
    if earlier_s is None or later_s is None or not np.isfinite([earlier_s, later_s]).all():
        return np.inf
    return round(later_s - earlier_s, 9)


def _frames(flown: Flown, span_s: float) -> float:
    """A span of time in frames, whichever way."""
    return abs(round(span_s / flown.frame_s)) if np.isfinite(span_s) else np.inf


def _ratio(error: float, other: float) -> float:
    """Of two errors; infinite where the first is, whatever the other."""
    return error / other if np.isfinite(error) else np.inf


# Detection and isolation


@_measure("detection", "s after the fault")
def detection(flights: Flights, name: str) -> float:
    """From the fault to the alarm."""
    delay = flights[name].metrics.detection.delay_s
    return np.inf if delay is None else delay


@_measure("faults detected", at_least=True)
def detected(flights: Flights, *names: str) -> float:
    """How many of the faults raise the alarm."""
    return sum(np.isfinite(detection(flights, name)) for name in names)


@_measure("isolation", "s after detection")
def isolation(flights: Flights, name: str) -> float:
    """From the alarm to the right name; infinite if anything else is named in the end."""
    found = flights[name].metrics
    if not found.isolation.correct:
        return np.inf
    return _after(found.detection.time_s, found.isolation.time_s)


@_measure("faults isolated", at_least=True)
def isolated(flights: Flights, *names: str) -> float:
    """How many of the faults are detected and rightly named."""
    return sum(np.isfinite(isolation(flights, name) + detection(flights, name)) for name in names)


@_measure("faults detected, isolated and tracked within 10 %", at_least=True)
def handled(flights: Flights, *names: str) -> float:
    """How many of the faults are detected, rightly named, and leave tracking good."""
    return sum(isolated(flights, n) and tracking(flights, n, AXIS[n]) <= GOOD for n in names)


@_measure("shortest step from one to the next", "frames", at_least=True)
def order(flights: Flights, *names: str) -> float:
    """The fewest frames between fault and detection, or detection and isolation."""
    steps = [step(flights, name) for name in names for step in (detection, isolation)]
    return _frames(flights[names[0]], min(steps)) if np.isfinite(steps).all() else 0.0


@_measure("largest |residual| / threshold before the fault")
def before_fault(flights: Flights, name: str) -> float:
    """How near the detection estimator comes to a false alarm."""
    flown = flights[name]
    return float(np.max(flown.shares()[:, flown.between(0.0, flown.fault_at_s)]))


@_measure("largest |residual| / threshold")
def own_estimator(flights: Flights, *names: str) -> float:
    """How near the isolation estimators of the true faults come to being excluded."""
    return max(float(np.max(flights[name].shares_of(name))) for name in names)


@_measure("between first crossing and alarm", "frames")
def alarm_lag(flights: Flights, name: str) -> float:
    """From the first residual beyond its threshold to the alarm."""
    flown = flights[name]
    first_s = flown.first_s(flown.shares().max(axis=0) > 1.0)
    return _frames(flown, _after(first_s, flown.metrics.detection.time_s))


@_measure("between first crossing and exclusion", "frames")
def exclusion_lag(flights: Flights, name: str) -> float:
    """From a residual beyond its threshold to the exclusion, of the slower of those that do not fit."""
    flown = flights[name]
    first_s = {other: flown.first_s(flown.shares_of(other).max(axis=0) > 1.0) for other in _others(name)}
    return max(_frames(flown, _after(at_s, flown.excluded_at_s(other))) for other, at_s in first_s.items())


def _others(name: str) -> list[str]:
    """The isolation estimators that do not fit a fault."""
    return [other for other in ESTIMATORS if other != name]


def _last_exclusion_s(flown: Flown, name: str) -> float:
    return max(map(flown.excluded_at_s, _others(name)))


@_measure("last exclusion", "s after detection")
def last_to_go(flights: Flights, name: str) -> float:
    """From the alarm to the exclusion of the last estimator that does not fit."""
    flown = flights[name]
    return _after(flown.metrics.detection.time_s, _last_exclusion_s(flown, name))


@_measure("between last exclusion and conclusion", "frames")
def conclusion_lag(flights: Flights, name: str) -> float:
    """From the exclusion of the last estimator that does not fit to the right name."""
    flown = flights[name]
    isolation = flown.metrics.isolation
    lag_s = _after(_last_exclusion_s(flown, name), isolation.time_s)
    return _frames(flown, lag_s) if isolation.correct else np.inf


@_measure("estimators at work", at_least=True)
def estimators(flights: Flights, name: str) -> float:
    """The detection estimator and every isolation estimator that has a residual."""
    return 1.0 + sum(bool(flights[name].residuals_of(other).any()) for other in ESTIMATORS)


@_measure("estimators at work")
def at_work(flights: Flights, name: str) -> float:
    """The same, to be at most so many."""
    return estimators(flights, name)


@_measure("residuals of isolation estimators", at_least=True)
def residuals(flights: Flights, name: str) -> float:
    """How many residuals the isolation estimators generate."""
    return sum(int(flights[name].residuals_of(other).any(axis=1).sum()) for other in ESTIMATORS)


@_measure("between detection and the first isolation residual", "frames")
def activation(flights: Flights, name: str) -> float:
    """Between the alarm and the first residual of any isolation estimator."""
    flown = flights[name]
    begun = np.any([flown.residuals_of(other).any(axis=0) for other in ESTIMATORS], axis=0)
    return _frames(flown, _after(flown.metrics.detection.time_s, flown.first_s(begun)))


@_measure("pairs of fault and estimator that answer so", at_least=True)
def generalised(flights: Flights, *names: str) -> float:
    """In how many of the pairs an estimator is excluded exactly if the fault is not its own."""
    return sum(
        bool(flights[n].residuals_of(e).any()) and np.isfinite(flights[n].excluded_at_s(e)) == (e != n)
        for n in names
        for e in ESTIMATORS
    )


@_measure("total time with the name of a known fault", "s")
def named(flights: Flights, name: str) -> float:
    """For how long a known fault was the only one left, none of them being there."""
    return round(sum(flights[name].named_s(estimator) for estimator in ESTIMATORS), 9)


@_measure("known faults left at the end")
def left(flights: Flights, name: str) -> float:
    """How many isolation estimators are not excluded."""
    return sum(not np.isfinite(flights[name].excluded_at_s(estimator)) for estimator in ESTIMATORS)


@_measure("last exclusion", "frames after the alarm and a mismatch beyond 1")
def after_mismatch(flights: Flights, *names: str) -> float:
    """How long after both an estimator is excluded, at most; one whose mismatch stays below 1 is not counted.

    The mismatch is M_sj of detectability.py, along the flight itself.
    """
    lags = [
        _frames(flights[name], _after(certain_s, max(certain_s, flights[name].excluded_at_s(other))))
        for name in names
        for other, certain_s in _certain_at_s(flights[name], name).items()
    ]
    return max(lags, default=np.inf)


def _certain_at_s(flown: Flown, name: str) -> dict[str, float]:
    """Of each other fault whose mismatch with a loss exceeds 1 after it: when it does after the alarm, s."""
    fault = flown.scenario.faults[0]
    if not isinstance(fault, LossOfEffectiveness):
        return {}
    moment, bound, _ = moments_of(flown.scenario, flown.log)
    z, since = fault.magnitude * moment[name], flown.between(flown.fault_at_s)
    alarm_s, found = flown.metrics.detection.time_s or np.inf, {}
    for other in set(moment) - {name}:
        beyond = since & (mismatch(z, moment[other], bound) > 1.0)
        if beyond.any():
            found[other] = max(alarm_s, flown.first_s(beyond))
    return found


# Estimation


@_measure("largest network output before detection", "rad/s2")
def learnt_before(flights: Flights, name: str) -> float:
    """What the network of the detection estimator takes for a fault before there is an alarm."""
    log = flights[name].log
    return max(float(np.max(np.abs(log[f"{a}_network_rad_s2"][log["detected"] == 0]))) for a in AXES)


@_measure("left of the unexplained pitching", "of it", none=LOST)
def unapproximated(flights: Flights, name: str) -> float:
    """RMS of what the detection estimator's network leaves of the unexplained acceleration, over its RMS."""
    flown = flights[name]
    after = flown.between(flown.fault_at_s + SETTLED_S)
    if flown.metrics.departure or not after.any():
        return np.inf
    unexplained = flown.unexplained_rad_s2("q")[after]
    return float(
        np.linalg.norm(unexplained - flown.log["q_network_rad_s2"][after]) / np.linalg.norm(unexplained)
    )


@_measure("largest RMS error in the last 5 s", "of that in the first 5 s of the fault", none=LOST)
def learning(flights: Flights, *names: str) -> float:
    """What is left of the tracking error once a fault has been there for a while; of the worst of several."""
    return max(_left_of_error(flights[name], AXIS[name.removesuffix("-parametric")]) for name in names)


def _left_of_error(flown: Flown, axis: str) -> float:
    early = flown.rms_deg_s(axis, flown.fault_at_s, flown.fault_at_s + 5.0)
    return _ratio(flown.kept_deg_s(axis, flown.fault_at_s + 13.0), early)


@_measure("farthest outside")
def outside(flights: Flights, *names: str) -> float:
    """How far a theta that diagnosis or law estimates, one less than the effectiveness, leaves [-1, 0]."""
    columns = [f"{surface}_effectiveness_{what}" for surface in ESTIMATORS for what in ("estimate", "used")]
    effectiveness = np.concatenate([flights[name].log[column] for name in names for column in columns])
    return float(np.nanmax(np.maximum(effectiveness - 1.0, -effectiveness).clip(0.0)))


@_measure("largest excess of the model error over the bound", "ppm of the bound")
def unbounded(flights: Flights, name: str) -> float:
    """By how much the model error before the fault exceeds the bound of the paper, ppm of this bound; below 0
    if it stays within. Our thresholds also contain the Earth's rotation and rounding; the paper's bound does
    not."""
    flown = flights[name]
    healthy = flown.between(SETTLED_S, flown.fault_at_s)
    rates = sum(np.abs(flown.log[f"{axis}_rad_s"]) for axis in AXES)
    ours = EARTH_RATE_RAD_S * (2.0 * rates + EARTH_RATE_RAD_S) + ROUNDING_RAD_S2  # worst_case.by_earth
    largest = max(
        float(
            np.max((np.abs(flown.unexplained_rad_s2(a)) / (flown.log[f"{a}_eta_bar_rad_s2"] - ours))[healthy])
        )
        for a in AXES
    )
    return 1e6 * (largest - 1.0)


# Control


@_measure("slowest of the body rates", "of the fastest other variable", at_least=True)
def separation(flights: Flights, name: str) -> float:
    """Slowest pole of p, q, r over the fastest of the other states; each with those of the other held."""
    plant, trim = trimmed(flights[name].scenario)
    linear = differences(plant, trim)
    inner = np.isin(linear.states, RATES)
    poles = [np.abs(np.linalg.eigvals(linear.A[np.ix_(of, of)])) for of in (inner, ~inner)]
    return float(poles[0].min() / poles[1].max())


@_measure("RMS error", "of the reference's amplitude", none=LOST)
def tracking(flights: Flights, name: str, axis: str) -> float:
    """RMS error of an axis after the fault, once settled; infinite if the aircraft is lost."""
    return _settled_deg_s(flights[name], axis) / AMPLITUDE_DEG_S


def _settled_deg_s(flown: Flown, axis: str) -> float:
    return flown.kept_deg_s(axis, flown.fault_at_s + SETTLED_S)


@_measure("largest RMS error", "of the reference's amplitude", none=LOST)
def worst_tracking(flights: Flights, *names: str) -> float:
    """The same, of the worst of several faults, each on the axis where it shows."""
    return max(tracking(flights, name, AXIS[name]) for name in names)


@_measure("largest RMS error", "of the reference's amplitude", none=LOST)
def healthy_tracking(flights: Flights, name: str) -> float:
    """RMS error of the worst axis of a healthy flight."""
    return max(flights[name].kept_deg_s(axis, SETTLED_S) for axis in AXES) / AMPLITUDE_DEG_S


@_measure("RMS error of q", "times that before", at_least=True)
def deterioration(flights: Flights, name: str) -> float:
    """RMS pitch rate error after the fault over that before, over all the flight there is."""
    flown = flights[name]
    return flown.rms_deg_s("q", flown.fault_at_s) / flown.before_deg_s("q")


@_measure("largest RMS error", "of the passive law's", none=LOST)
def beside_passive(flights: Flights, *names: str) -> float:
    """RMS error after the fault over that of a robust law without a diagnosis, of the worst of the faults."""
    return max(
        _ratio(
            _settled_deg_s(flights[n], AXIS[n]),
            flights[f"{n}-passive"].rms_deg_s(AXIS[n], flights[n].fault_at_s + SETTLED_S),
        )
        for n in names
    )


@_measure("RMS error of q in the transient", "of that after a sudden hand-over", none=LOST)
def transient(flights: Flights, gradual: str, sudden: str) -> float:
    """RMS pitch rate error of the first TRANSIENT_S after the fault, over that of another hand-over."""
    first, second = (
        flown.rms_deg_s("q", flown.fault_at_s, flown.fault_at_s + TRANSIENT_S)
        for flown in (flights[gradual], flights[sudden])
    )
    return first / second


@_measure("largest RMS error", "of the nominal law's", none=LOST)
def beside_nominal(flights: Flights, *names: str) -> float:
    """RMS error after the fault over that of the nominal law, of the worst of several faults."""
    ours, nominal = ([flights[name + end] for name in names] for end in ("", "-nominal"))
    return max(
        _ratio(one.kept_deg_s("q", one.fault_at_s), other.rms_deg_s("q", other.fault_at_s))
        for one, other in zip(ours, nominal, strict=True)
    )


@_measure("flown on", "s after the fault", at_least=True)
def flown_on(flights: Flights, name: str) -> float:
    """How long the aircraft is kept after the fault."""
    return float(flights[name].log["t_s"][-1] - flights[name].fault_at_s)


def _mode_at_s(flown: Flown, mode: str) -> float | None:
    return next((change.time_s for change in flown.metrics.supervisor if change.mode == mode), None)


@_measure("in charge", "s after detection")
def in_charge(flights: Flights, name: str) -> float:
    """From the alarm to the adaptive law."""
    flown = flights[name]
    return _after(flown.metrics.detection.time_s, _mode_at_s(flown, "adaptive"))


@_measure("from 10 s to the adaptive law", "s")
def activated_near_10(flights: Flights, name: str) -> float:
    """How far from 10 s the adaptive law takes over."""
    return abs(_after(10.0, _mode_at_s(flights[name], "adaptive")))


@_measure("reallocation", "s after isolation")
def reallocation(flights: Flights, name: str) -> float:
    """From the name to the reallocation."""
    flown = flights[name]
    return _after(flown.metrics.isolation.time_s, _mode_at_s(flown, "reallocated"))


@_measure("decisions taken", at_least=True)
def decisions(flights: Flights, name: str) -> float:
    """Reconfigured, and the demand carried by another surface."""
    adaptive = _mode_at_s(flights[name], "adaptive") is not None
    return float(adaptive) + float(share_of_elevator(flights, name) <= TAKEN_OVER)


@_measure("travel of the elevator", "of the flap's", none=STILL)
def share_of_elevator(flights: Flights, name: str) -> float:
    """Range of the elevator's command over that of the flap's, after the hand-over."""
    flown = flights[name]
    after = flown.between(flown.fault_at_s + TRANSIENT_S)
    if not after.any():
        return np.inf
    elevator, flap = (
        float(np.ptp(flown.log[f"{surface}_cmd_rad"][after])) for surface in ("elevator", "flap")
    )
    return elevator / flap if flap else np.inf


@_measure("fastest motion of the flap", "deg/s")
def flap_rate(flights: Flights, name: str) -> float:
    """Fastest motion the flap is commanded."""
    log = flights[name].log
    return float(np.max(np.abs(np.degrees(np.diff(log["flap_cmd_rad"]) / np.diff(log["t_s"])))))
