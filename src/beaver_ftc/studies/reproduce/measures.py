"""How the statements of [Zhang2005] are read as numbers: the measures of `claims.yaml`, functions of flights.

The time to an event that never happens is infinite, and so is an error over a part that the flight does not
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
from beaver_ftc.studies.reproduce.cases import ESTIMATORS, SETTLED_S, Flown
from beaver_ftc.studies.reproduce.choices import AMPLITUDE_DEG_S

TRANSIENT_S = 3.0  # from the fault on: detection, isolation and hand-over
GOOD = 0.1  # the limit `good` of claims.yaml
TAKEN_OVER = 0.2  # the limit `taken-over`


def _after(earlier_s: float, later_s: float) -> float:
    """From an earlier event to a later one, s, both at instants in s; infinite if either is missing."""
    return round(later_s - earlier_s, 9) if np.isfinite([earlier_s, later_s]).all() else np.inf


def _frames(flown: Flown, span_s: float) -> float:
    """A span of time in frames, without its sign: the later event may come first."""
    return abs(round(span_s / flown.frame_s)) if np.isfinite(span_s) else np.inf


def _ratio(error: float, other: float) -> float:
    """The first error over the other; infinite if the first is, even if the other is too."""
    return error / other if np.isfinite(error) else np.inf


# Detection and isolation


def detection(flown: Flown) -> float:
    """From the fault to the alarm, s."""
    return or_never(flown.metrics.detection.delay_s)


def detected(*flights: Flown) -> float:
    """Number of faults that raise the alarm."""
    return sum(map(np.isfinite, map(detection, flights)))


def isolation(flown: Flown) -> float:
    """From the alarm to the right name, s; infinite if anything else is named in the end."""
    return _after(flown.alarm_s, flown.rightly_named_s)


def isolated(*flights: Flown) -> float:
    """Number of faults that are detected and rightly named."""
    return sum(np.isfinite(isolation(flown) + detection(flown)) for flown in flights)


def handled(*flights: Flown) -> float:
    """Number of faults that are detected, rightly named, and tracked with an error of at most GOOD."""
    return sum(isolated(flown) and tracking(flown, flown.axis) <= GOOD for flown in flights)


def order(*flights: Flown) -> float:
    """The fewest frames between fault and detection, or detection and isolation; 0 if one never happens."""
    steps = [step(flown) for flown in flights for step in (detection, isolation)]
    return _frames(flights[0], min(steps)) if np.isfinite(steps).all() else 0.0


def before_fault(flown: Flown) -> float:
    """Largest |residual| / threshold of the detection estimator before the fault; above 1: a false alarm."""
    return float(np.max(flown.shares()[:, flown.between(0.0, flown.fault_at_s)]))


def own_estimator(*flights: Flown) -> float:
    """Largest |residual| / threshold of the isolation estimators of the true faults; above 1 excludes one."""
    return max(float(np.max(flown.shares_of(flown.struck))) for flown in flights)


def alarm_lag(flown: Flown) -> float:
    """From the first residual beyond its threshold to the alarm, frames."""
    return _frames(flown, _after(flown.first_beyond_s(flown.shares()), flown.alarm_s))


def exclusion_lag(flown: Flown) -> float:
    """From a residual beyond its threshold to the exclusion, frames, of the slowest that does not fit."""
    return max(
        _frames(flown, _after(flown.first_beyond_s(flown.shares_of(other)), flown.excluded_at_s(other)))
        for other in _others(flown)
    )


def _others(flown: Flown) -> list[str]:
    """The isolation estimators that do not fit the fault."""
    return [other for other in ESTIMATORS if other != flown.struck]


def _last_exclusion_s(flown: Flown) -> float:
    """When the last estimator that does not fit the fault was excluded, s."""
    return max(map(flown.excluded_at_s, _others(flown)))


def last_to_go(flown: Flown) -> float:
    """From the alarm to the exclusion of the last estimator that does not fit, s."""
    return _after(flown.alarm_s, _last_exclusion_s(flown))


def conclusion_lag(flown: Flown) -> float:
    """From the exclusion of the last estimator that does not fit to the right name, frames."""
    return _frames(flown, _after(_last_exclusion_s(flown), flown.rightly_named_s))


def estimators(flown: Flown) -> float:
    """Number of estimators at work: the detection estimator, each isolation estimator with a residual."""
    return 1.0 + sum(bool(flown.residuals_of(other).any()) for other in ESTIMATORS)


at_work = estimators  # claims.yaml limits this one from above, and `estimators` from below


def residuals(flown: Flown) -> float:
    """Number of residuals that the isolation estimators generate."""
    return sum(int(flown.residuals_of(other).any(axis=1).sum()) for other in ESTIMATORS)


def activation(flown: Flown) -> float:
    """Between the alarm and the first residual of any isolation estimator, frames."""
    begun = np.any([flown.residuals_of(other).any(axis=0) for other in ESTIMATORS], axis=0)
    return _frames(flown, _after(flown.alarm_s, flown.first_s(begun)))


def generalised(*flights: Flown) -> float:
    """Number of pairs of flight and estimator in which it is excluded exactly if the fault is not its own."""
    return sum(
        bool(flown.residuals_of(e).any()) and np.isfinite(flown.excluded_at_s(e)) == (e != flown.struck)
        for flown in flights
        for e in ESTIMATORS
    )


def named(flown: Flown) -> float:
    """Time with exactly one known fault left, s: a wrong name, as the flight has an unknown fault."""
    return round(sum(map(flown.named_s, ESTIMATORS)), 9)


def left(flown: Flown) -> float:
    """Number of isolation estimators that are not excluded."""
    return sum(not np.isfinite(flown.excluded_at_s(estimator)) for estimator in ESTIMATORS)


def after_mismatch(*flights: Flown) -> float:
    """The most frames from the alarm, or from a mismatch above 1 if that is later, to an exclusion. An
    estimator whose mismatch stays at 1 or below is not counted; infinite if none is counted.

    The mismatch is M_sj of detectability/certain.py, along the flight itself.
    """
    lags = [
        _frames(flown, _after(certain_s, max(certain_s, flown.excluded_at_s(other))))
        for flown in flights
        for other, certain_s in _certain_at_s(flown)
    ]
    return max(lags, default=np.inf)


def _certain_at_s(flown: Flown) -> Iterator[tuple[str, float]]:
    """Each other fault whose mismatch with the flight's loss exceeds 1, and when: the later one of the first
    such instant after the loss and of the alarm, s. Nothing if the fault is no loss."""
    fault = flown.scenario.faults[0]
    if not isinstance(fault, LossOfEffectiveness):
        return
    moment, bound, _ = moments_of(flown.scenario, flown.log)
    z = fault.magnitude * moment.pop(flown.struck)
    since = flown.between(flown.fault_at_s)
    for other, of in moment.items():
        beyond = since & (mismatch(z, of, bound) > 1.0)
        if beyond.any():
            yield other, max(flown.alarm_s, flown.first_s(beyond))


# Estimation


def learnt_before(flown: Flown) -> float:
    """Largest output of the detection estimator's network before the alarm, rad/s2."""
    early = flown.log["detected"] == 0
    return max(float(np.max(np.abs(flown.log[f"{a}_network_rad_s2"][early]))) for a in AXES)


def unapproximated(flown: Flown) -> float:
    """Pitching that neither the design model nor the detection estimator's network explains, over that which
    the model alone does not explain: RMS accelerations, from SETTLED_S after the fault on."""
    after = flown.between(flown.fault_at_s + SETTLED_S)
    if flown.metrics.departure or not after.any():
        return np.inf
    unexplained = flown.unexplained_rad_s2("q")[after]
    unlearnt = unexplained - flown.log["q_network_rad_s2"][after]
    return float(np.linalg.norm(unlearnt) / np.linalg.norm(unexplained))


def learning(*flights: Flown) -> float:
    """RMS tracking error from 13 s after the fault on over that of its first 5 s; the largest of several.

    These flights last 18 s after the fault (cases.AFTER_S), so both spans are 5 s long.
    """
    return max(
        _ratio(
            flown.kept_deg_s(flown.axis, flown.fault_at_s + 13.0),
            flown.rms_deg_s(flown.axis, flown.fault_at_s, flown.fault_at_s + 5.0),
        )
        for flown in flights
    )


def outside(*flights: Flown) -> float:
    """Largest distance of an estimate of theta = effectiveness - 1, of diagnosis or law, from [-1, 0]."""
    columns = [f"{surface}_effectiveness_{what}" for surface in ESTIMATORS for what in ("estimate", "used")]
    effectiveness = np.concatenate([flown.log[column] for flown in flights for column in columns])
    return float(np.nanmax(np.maximum(effectiveness - 1.0, -effectiveness).clip(0.0)))


def unbounded(flown: Flown) -> float:
    """Excess of the model error before the fault over the bound of the paper, ppm of this bound; below 0 if
    the error stays within. Our thresholds also contain `ours`, for the Earth's rotation and rounding; the
    paper's bound does not. It is that of bounds.add_published_bound, whose kappa is 1 for the Beaver."""
    healthy = flown.between(SETTLED_S, flown.fault_at_s)
    rates = np.roll(sum(np.abs(flown.log[f"{axis}_rad_s"]) for axis in AXES), 1)  # of the row before
    ours = EARTH_RATE_RAD_S * (2.0 * rates + EARTH_RATE_RAD_S) + ROUNDING_RAD_S2
    shares = [np.abs(flown.unexplained_rad_s2(a)) / (flown.log[f"{a}_eta_bar_rad_s2"] - ours) for a in AXES]
    return 1e6 * (max(float(np.max(share[healthy])) for share in shares) - 1.0)


# Control


def separation(flown: Flown) -> float:
    """Magnitude of the slowest pole of the rates over that of the fastest pole of the other states. Either
    group's poles are those with the states of the other group held."""
    plant, trim = trimmed(flown.scenario)
    linear = differences(plant, trim)
    is_rate = np.isin(linear.states, AXES)
    rates, others = (np.abs(np.linalg.eigvals(linear.A[np.ix_(of, of)])) for of in (is_rate, ~is_rate))
    return float(rates.min() / others.max())


def tracking(flown: Flown, axis: str) -> float:
    """RMS error of an axis from SETTLED_S after the fault on, as a share of the amplitude of its reference;
    infinite if the aircraft is lost."""
    return flown.kept_deg_s(axis, flown.fault_at_s + SETTLED_S) / AMPLITUDE_DEG_S


def worst_tracking(*flights: Flown) -> float:
    """The largest `tracking` of several faults, each on the axis where it shows."""
    return max(tracking(flown, flown.axis) for flown in flights)


def healthy_tracking(flown: Flown) -> float:
    """RMS error of the worst axis of a healthy flight, as a share of the amplitude of its reference."""
    return max(flown.kept_deg_s(axis, SETTLED_S) for axis in AXES) / AMPLITUDE_DEG_S


def deterioration(flown: Flown) -> float:
    """RMS pitch rate error from the fault to the end of the flight, over that from SETTLED_S to the fault."""
    return flown.rms_deg_s("q", flown.fault_at_s) / flown.rms_deg_s("q", SETTLED_S, flown.fault_at_s)


def _beside(flights: tuple[Flown, ...], after_s: float) -> float:
    """RMS error from after_s after the fault on, over that of another law; the largest of several faults,
    each on the axis where it shows. The second half of the flights has the same faults with the other law."""
    half = len(flights) // 2
    ratios = []
    for ours, other in zip(flights[:half], flights[half:], strict=True):
        where = ours.axis, ours.fault_at_s + after_s
        ratios.append(_ratio(ours.kept_deg_s(*where), other.rms_deg_s(*where)))
    return max(ratios)


def beside_passive(*flights: Flown) -> float:
    """RMS error from SETTLED_S after the fault on, over that of a robust law without a diagnosis; the largest
    of several faults."""
    return _beside(flights, SETTLED_S)


def transient(*flights: Flown) -> float:
    """RMS pitch rate error of the first TRANSIENT_S after the fault, over that with a sudden hand-over."""
    gradual, sudden = (
        flown.rms_deg_s("q", flown.fault_at_s, flown.fault_at_s + TRANSIENT_S) for flown in flights
    )
    return gradual / sudden


def beside_nominal(*flights: Flown) -> float:
    """RMS error after the fault over that of the nominal law, the largest of several faults."""
    return _beside(flights, 0.0)


def flown_on(flown: Flown) -> float:
    """Time that the aircraft flies after the fault, s."""
    return float(flown.log["t_s"][-1] - flown.fault_at_s)


def in_charge(flown: Flown) -> float:
    """From the alarm to the adaptive law, s."""
    return _after(flown.alarm_s, flown.mode_at_s("adaptive"))


def activated_near_10(flown: Flown) -> float:
    """Time between 10 s of the flight and the instant at which the adaptive law takes over, s."""
    return abs(_after(10.0, flown.mode_at_s("adaptive")))


def reallocation(flown: Flown) -> float:
    """From the name to the reallocation, s."""
    return _after(or_never(flown.metrics.isolation.time_s), flown.mode_at_s("reallocated"))


def decisions(flown: Flown) -> float:
    """Number of decisions taken, of two: the adaptive law took over; the flap carries the demand."""
    adaptive = np.isfinite(flown.mode_at_s("adaptive"))
    return float(adaptive) + float(share_of_elevator(flown) <= TAKEN_OVER)


def share_of_elevator(flown: Flown) -> float:
    """Range of the elevator's command over that of the flap's, from TRANSIENT_S after the fault on."""
    after = flown.between(flown.fault_at_s + TRANSIENT_S)
    if not after.any():
        return np.inf
    elevator, flap = (float(np.ptp(flown.log[f"{s}_cmd_rad"][after])) for s in ("elevator", "flap"))
    return elevator / flap if flap else np.inf


def flap_rate(flown: Flown) -> float:
    """Largest rate of the flap's command, deg/s."""
    rates = np.diff(flown.log["flap_cmd_rad"]) / np.diff(flown.log["t_s"])
    return float(np.max(np.abs(np.degrees(rates))))
