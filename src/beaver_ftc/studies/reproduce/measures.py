"""The measures of `claims.yaml`: functions from flights to the numbers of the statements of [Zhang2005].

The time to an event that never happens is infinite, and so is the error of a part that a flight does not
have. claims.yaml has the unit of each measure under `measures`.
"""

from collections.abc import Iterator

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S
from beaver_ftc.diagnosis.bounds import ROUNDING_RAD_S2
from beaver_ftc.plant.conditions import trimmed
from beaver_ftc.plant.linear import differences
from beaver_ftc.scenario.faults import LossOfEffectiveness
from beaver_ftc.studies.detectability.certain import mismatch, moments_of
from beaver_ftc.studies.engine.statistics import or_never
from beaver_ftc.studies.reproduce.choices import AMPLITUDE_DEG_S
from beaver_ftc.studies.reproduce.flown import ESTIMATORS, Flown

SETTLED_S = 2.0  # from the start or a fault to steady tracking: two time constants of the error
TRANSIENT_S = 3.0  # time after the fault that contains detection, isolation and hand-over
GOOD = 0.1  # the limit `good` of claims.yaml
TAKEN_OVER = 0.2  # the limit `taken-over`


def _after(earlier_s: float, later_s: float) -> float:
    """Time from an earlier event to a later one, s; infinite if one of them never happens. earlier_s,
    later_s: times of the events."""
    return round(later_s - earlier_s, 9) if np.isfinite([earlier_s, later_s]).all() else np.inf


def _frames(flight: Flown, span_s: float) -> float:
    """The size of a span of time, in frames. Its sign is dropped, because a lag must be near 0 in both
    directions."""
    return abs(round(span_s / flight.frame_s)) if np.isfinite(span_s) else np.inf


def _ratio(error: float, other: float) -> float:
    """error / other; infinite if `error` is, even if `other` is infinite too."""
    return error / other if np.isfinite(error) else np.inf


# Detection and isolation


def detection(flight: Flown) -> float:
    """Time from the fault to the alarm, s; infinite without an alarm after the fault."""
    return or_never(flight.metrics.detection.delay_s)


def detected(*flights: Flown) -> float:
    """Number of faults that are detected, without a false alarm before them."""
    return sum(map(np.isfinite, map(detection, flights)))


def isolation(flight: Flown) -> float:
    """Time from the alarm to the right name, s; infinite if the name at the end is wrong or missing."""
    return _after(flight.alarm_s, flight.rightly_named_s)


def isolated(*flights: Flown) -> float:
    """Number of faults that are detected and rightly named."""
    return sum(np.isfinite(isolation(flight) + detection(flight)) for flight in flights)


def handled(*flights: Flown) -> float:
    """Number of faults that are detected, rightly named, and tracked with an error of at most GOOD."""
    return sum(isolated(flight) and tracking(flight, flight.axis) <= GOOD for flight in flights)


def order(*flights: Flown) -> float:
    """The smallest of the numbers of frames from fault to detection and from detection to isolation, over all
    flights; 0 if one never happens."""
    steps = [step(flight) for flight in flights for step in (detection, isolation)]
    return _frames(flights[0], min(steps)) if np.isfinite(steps).all() else 0.0


def before_fault(flight: Flown) -> float:
    """Largest |residual| / threshold of the detection estimator before the fault; above 1: a false alarm."""
    return float(np.max(flight.shares()[:, flight.between(0.0, flight.fault_at_s)]))


def own_estimator(*flights: Flown) -> float:
    """Largest |residual| / threshold of the isolation estimator of the true fault; above 1 it is excluded."""
    return max(float(np.max(flight.shares_of(flight.struck))) for flight in flights)


def alarm_lag(flight: Flown) -> float:
    """Time from the first residual beyond its threshold to the alarm, frames."""
    return _frames(flight, _after(flight.first_beyond_s(flight.shares()), flight.alarm_s))


def exclusion_lag(flight: Flown) -> float:
    """Time from the first residual beyond its threshold to the exclusion, frames; the largest of the
    estimators that do not fit the fault."""
    return max(
        _frames(flight, _after(flight.first_beyond_s(flight.shares_of(other)), flight.excluded_at_s(other)))
        for other in _others(flight)
    )


def _others(flight: Flown) -> list[str]:
    """The isolation estimators that do not fit the fault."""
    return [other for other in ESTIMATORS if other != flight.struck]


def _last_exclusion_s(flight: Flown) -> float:
    """Time at which the last estimator that does not fit the fault was excluded, s."""
    return max(map(flight.excluded_at_s, _others(flight)))


def last_to_go(flight: Flown) -> float:
    """Time from the alarm to the exclusion of the last estimator that does not fit the fault, s."""
    return _after(flight.alarm_s, _last_exclusion_s(flight))


def conclusion_lag(flight: Flown) -> float:
    """Time from the exclusion of the last estimator that does not fit the fault to the right name, frames."""
    return _frames(flight, _after(_last_exclusion_s(flight), flight.rightly_named_s))


def estimators(flight: Flown) -> float:
    """Number of estimators at work: the detection estimator, and each isolation estimator with a residual."""
    return 1.0 + sum(bool(flight.residuals_of(other).any()) for other in ESTIMATORS)


at_work = estimators  # the same number: claims.yaml limits `at_work` from above, `estimators` from below


def residuals(flight: Flown) -> float:
    """Number of residuals that the isolation estimators generate."""
    return sum(int(flight.residuals_of(other).any(axis=1).sum()) for other in ESTIMATORS)


def activation(flight: Flown) -> float:
    """Time between the alarm and the first residual of any isolation estimator, frames."""
    begun = np.any([flight.residuals_of(other).any(axis=0) for other in ESTIMATORS], axis=0)
    return _frames(flight, _after(flight.alarm_s, flight.first_s(begun)))


def generalised(*flights: Flown) -> float:
    """Number of pairs (flight, isolation estimator) in which the estimator works, and is excluded if and only
    if it does not fit the fault."""
    return sum(
        bool(flight.residuals_of(estimator).any())
        and np.isfinite(flight.excluded_at_s(estimator)) == (estimator != flight.struck)
        for flight in flights
        for estimator in ESTIMATORS
    )


def named(flight: Flown) -> float:
    """Time after the alarm with exactly one estimator not excluded, s. In a flight with an unknown fault,
    this is a wrong name."""
    return round(sum(map(flight.named_s, ESTIMATORS)), 9)


def left(flight: Flown) -> float:
    """Number of ESTIMATORS that are never excluded. One that the scheme does not have counts, too."""
    return sum(not np.isfinite(flight.excluded_at_s(estimator)) for estimator in ESTIMATORS)


def after_mismatch(*flights: Flown) -> float:
    """The largest number of frames from the alarm, or from a mismatch above 1 if this comes later, to the
    exclusion of an estimator. Estimators whose mismatch never exceeds 1 are not counted; infinite if none is
    counted.

    The mismatch is M_sj of detectability/certain.py along the flight itself.
    """
    lags = [
        _frames(flight, _after(certain_s, max(certain_s, flight.excluded_at_s(other))))
        for flight in flights
        for other, certain_s in _certain_at_s(flight)
    ]
    return max(lags, default=np.inf)


def _certain_at_s(flight: Flown) -> Iterator[tuple[str, float]]:
    """(other fault, time s) for each other fault whose mismatch with the loss exceeds 1. The time is the
    first such instant after the loss, or the alarm if this comes later. Nothing if the fault is no loss."""
    fault = flight.scenario.faults[0]
    if not isinstance(fault, LossOfEffectiveness):
        return
    moment, bound, _ = moments_of(flight.scenario, flight.log)
    z = fault.magnitude * moment.pop(flight.struck)
    after_fault = flight.between(flight.fault_at_s)
    for other, z_other in moment.items():
        exceeds = after_fault & (mismatch(z, z_other, bound) > 1.0)
        if exceeds.any():
            yield other, max(flight.alarm_s, flight.first_s(exceeds))


# Estimation


def learnt_before(flight: Flown) -> float:
    """Largest output of the detection estimator's network before the alarm, rad/s2."""
    early = flight.log["detected"] == 0
    return float(np.abs(flight.of_axes("{}_network_rad_s2")[:, early]).max())


def unapproximated(flight: Flown) -> float:
    """RMS pitch acceleration that neither the design model nor the network of the detection estimator
    explains, over that which the model alone does not explain, from SETTLED_S after the fault on."""
    after = flight.between(flight.fault_at_s + SETTLED_S)
    if flight.metrics.departure or not after.any():
        return np.inf
    unexplained = flight.unexplained_rad_s2("q")[after]
    unlearnt = unexplained - flight.log["q_network_rad_s2"][after]
    return float(np.linalg.norm(unlearnt) / np.linalg.norm(unexplained))


def learning(*flights: Flown) -> float:
    """RMS tracking error from 13 s after the fault on, over that of the first 5 s after it; the largest of
    the flights.

    The flights last 18 s after the fault (cases.AFTER_S), so that both spans are 5 s long.
    """
    return max(
        _ratio(
            flight.kept_deg_s(flight.axis, flight.fault_at_s + 13.0),
            flight.rms_deg_s(flight.axis, flight.fault_at_s, flight.fault_at_s + 5.0),
        )
        for flight in flights
    )


def outside(*flights: Flown) -> float:
    """Largest distance of theta = effectiveness - 1 from [-1, 0], of the estimates of the diagnosis and those
    that the law uses."""
    columns = [f"{surface}_effectiveness_{kind}" for surface in ESTIMATORS for kind in ("estimate", "used")]
    effectiveness = np.concatenate([flight.log[column] for flight in flights for column in columns])
    return float(np.nanmax(np.maximum(effectiveness - 1.0, -effectiveness).clip(0.0)))


def unbounded(flight: Flown) -> float:
    """1e6 (max |error| / bound - 1): excess of the model error from SETTLED_S to the fault over the bound of
    the paper, ppm; negative if the error stays within.

    The logged eta_bar is the bound of the paper plus `added`, rad/s2, for the rotation W of the Earth and
    rounding: W (2 sum |rates| + W) + ROUNDING, as bounds.add_published_bound adds it with kappa = 1 for the
    Beaver.
    """
    healthy = flight.between(SETTLED_S, flight.fault_at_s)
    # sum of |rates| at the row before, at which the frame begins
    rates = np.roll(sum(np.abs(flight.log[f"{axis}_rad_s"]) for axis in AXES), 1)
    added = EARTH_RATE_RAD_S * (2.0 * rates + EARTH_RATE_RAD_S) + ROUNDING_RAD_S2
    shares = [
        np.abs(flight.unexplained_rad_s2(a)) / (flight.log[f"{a}_eta_bar_rad_s2"] - added) for a in AXES
    ]
    return 1e6 * (max(float(np.max(share[healthy])) for share in shares) - 1.0)


# Control


def separation(flight: Flown) -> float:
    """Magnitude of the slowest pole of the rates over that of the fastest pole of the other states. The poles
    of each group are computed with constant states of the other group."""
    plant, trim = trimmed(flight.scenario)
    linear = differences(plant, trim)
    is_rate = np.isin(linear.states, AXES)
    rates, others = (
        np.abs(np.linalg.eigvals(linear.A[np.ix_(group, group)])) for group in (is_rate, ~is_rate)
    )
    return float(rates.min() / others.max())


def tracking(flight: Flown, axis: str) -> float:
    """RMS error of an axis from SETTLED_S after the fault on, as a share of the amplitude of its reference;
    infinite if the aircraft is lost."""
    return flight.kept_deg_s(axis, flight.fault_at_s + SETTLED_S) / AMPLITUDE_DEG_S


def worst_tracking(*flights: Flown) -> float:
    """The largest `tracking` of several faults, each on the axis of its effect."""
    return max(tracking(flight, flight.axis) for flight in flights)


def healthy_tracking(flight: Flown) -> float:
    """RMS error of the worst axis of a healthy flight, as a share of the amplitude of its reference."""
    return max(flight.kept_deg_s(axis, SETTLED_S) for axis in AXES) / AMPLITUDE_DEG_S


def deterioration(flight: Flown) -> float:
    """RMS pitch rate error from the fault to the end of the flight, over that from SETTLED_S to the fault."""
    return flight.rms_deg_s("q", flight.fault_at_s) / flight.rms_deg_s("q", SETTLED_S, flight.fault_at_s)


def _beside(flights: tuple[Flown, ...], after_s: float) -> float:
    """RMS error from after_s after the fault on, over that of another law; the largest of several faults,
    each on the axis of its effect. Ours is infinite if the aircraft is lost; that of the other law ends at a
    loss. flights: those with our law, then those with the other law, in the same order of faults."""
    half = len(flights) // 2
    ratios = []
    for ours, other in zip(flights[:half], flights[half:], strict=True):
        span = ours.axis, ours.fault_at_s + after_s
        ratios.append(_ratio(ours.kept_deg_s(*span), other.rms_deg_s(*span)))
    return max(ratios)


def beside_passive(*flights: Flown) -> float:
    """RMS error from SETTLED_S after the fault on, over that of a robust law without a diagnosis; the largest
    of several faults."""
    return _beside(flights, SETTLED_S)


def transient(*flights: Flown) -> float:
    """RMS pitch rate error in the first TRANSIENT_S after the fault, over that with a sudden hand-over."""
    gradual, sudden = (
        flight.rms_deg_s("q", flight.fault_at_s, flight.fault_at_s + TRANSIENT_S) for flight in flights
    )
    return gradual / sudden


def beside_nominal(*flights: Flown) -> float:
    """RMS error after the fault over that of the nominal law, the largest of several faults."""
    return _beside(flights, 0.0)


def flown_on(flight: Flown) -> float:
    """Time that the aircraft flies after the begin of the fault, s."""
    return float(flight.log["t_s"][-1] - flight.fault_at_s)


def in_charge(flight: Flown) -> float:
    """Time from the alarm to the adaptive mode, s."""
    return _after(flight.alarm_s, flight.mode_at_s("adaptive"))


def activated_near_10(flight: Flown) -> float:
    """Distance of the begin of the adaptive mode from 10 s, s."""
    return abs(_after(10.0, flight.mode_at_s("adaptive")))


def reallocation(flight: Flown) -> float:
    """Time from the name to the reallocation, s."""
    return _after(or_never(flight.metrics.isolation.time_s), flight.mode_at_s("reallocated"))


def decisions(flight: Flown) -> float:
    """Number of decisions taken, of two: the adaptive mode began; the flap has taken over the demand of the
    elevator."""
    adaptive = np.isfinite(flight.mode_at_s("adaptive"))
    return float(adaptive) + float(share_of_elevator(flight) <= TAKEN_OVER)


def share_of_elevator(flight: Flown) -> float:
    """Range of the command of the elevator over that of the flap, from TRANSIENT_S after the fault on;
    infinite if the flap does not move."""
    after = flight.between(flight.fault_at_s + TRANSIENT_S)
    if not after.any():
        return np.inf
    elevator, flap = (float(np.ptp(flight.log[f"{s}_cmd_rad"][after])) for s in ("elevator", "flap"))
    return elevator / flap if flap else np.inf


def flap_rate(flight: Flown) -> float:
    """Largest rate of the command of the flap, deg/s."""
    rates = np.diff(flight.log["flap_cmd_rad"]) / np.diff(flight.log["t_s"])
    return float(np.max(np.abs(np.degrees(rates))))
