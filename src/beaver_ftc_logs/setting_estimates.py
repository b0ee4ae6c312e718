"""Settings of the filter that the fitted flights show: by their labels, or by parts left out of a fit.

r           variance of the noise
"""

from itertools import groupby

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_logs import least_squares
from beaver_ftc_logs.fit_parts import Parts
from beaver_ftc_logs.folds import held_out_folds
from beaver_ftc_logs.model import FilterSettings, Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats

# Spans of the means that distinguish the drift of the trim from the colour of the residual, s.
_TRIM_SPANS_S = (2.0, 8.0)
# Number of samples with quick responses that a flight must have for a mean of their errors.
_MIN_QUICK_SAMPLES = 10
# Number of changes that are assumed before the labels are read; half of them are repairs.
_N_PRIOR_CHANGES = 20


def labelled_faults(parts: Parts, model: Model) -> Document:
    """levels, changes_per_hour and repair_share by the labels of surfaces that are a group of their own;
    empty if these labels show no fault.

        changes_per_hour = sqrt(usual (n + 1) / hours),      repair_share = (m + n0 / 2) / (n + n0)

    n, m: number of changes of the labels, and of those that restore health; n0: _N_PRIOR_CHANGES; hours:
    usable time of all flights, h; usual: the default of `FilterSettings`, 1/h. Labelled flights are often
    tests with many faults, and later flights may have fewer: so the rate is the geometric mean of theirs and
    the usual one.
    """
    surfaces = list(model.vehicle.surfaces)
    levels: dict[str, list[float]] = {}
    changed_to: list[float] = []
    for name in [group[0] for group in model.groups if len(group) == 1]:
        faults: set[float] = set()
        for flight_levels in _label_levels(parts, surfaces.index(name)):
            changed_to += flight_levels[1:]
            faults |= {level for level in flight_levels if level < 1}
        if faults:
            levels[name] = sorted(faults)
    if not levels:
        return {}
    n = len(changed_to)
    hours = sum(part.is_usable.sum() * part.samples.dt_s for part in parts) / 3600.0
    rate = np.sqrt((n + 1) / hours * FilterSettings().changes_per_hour)
    repair_share = (changed_to.count(1.0) + _N_PRIOR_CHANGES / 2) / (n + _N_PRIOR_CHANGES)
    return {"levels": levels, "changes_per_hour": float(rate), "repair_share": repair_share}


def _label_levels(parts: Parts, i: int) -> list[list[float]]:
    """The levels of the label of surface i in their order, for each flight: the labels NaN, 1, 1, 0.6, 0.6, 1
    have the levels 1, 0.6, 1. A label is NaN where none is known."""
    labels = [part.samples.labels[:, i][part.is_usable] for part in parts]
    return [[round(level, 6) for level, _ in groupby(label[np.isfinite(label)].tolist())] for label in labels]


def quick_error_share(parts: Parts, model: Model) -> float:
    """Error of unusually quick responses, as a share of them, between 0 and 1: the largest of the flights
    left out; 1 if none of them has _MIN_QUICK_SAMPLES samples with such responses.

    In variances of the noise of the fit, the residual of a sample has the variance r (1 + share^2 power):

        share^2 = mean over the unusual samples of (square / r - 1) / power

    r: variance of the noise of this flight, at least 1; power (n,): of the quick responses; square (n,): of
    the residual less its median, the mean of three axes.
    """
    shares = []
    for fold in held_out_folds(parts, model):
        flight = fold.innovations()
        power = flight.quick_power(fold.model.rate_hz)
        unusual = power > flight.noise.usual_quick_power
        if unusual.sum() >= _MIN_QUICK_SAMPLES:
            squares = ((flight.e - np.median(flight.e, axis=0)) @ flight.W) ** 2
            r = max(least_squares.noise_scale(squares), 1.0)
            shares.append(((squares[unusual].mean(axis=1) / r - 1.0) / power[unusual]).mean())
    return float(np.sqrt(np.clip(max(shares, default=1.0), 0.0, 1.0)))


def estimate_trim_walk(parts: Parts, model: Model) -> list[float]:
    """Drift of the trim in a sample that parts left out show, in residual sd, for p, q and r; at least the
    usual.

    The residual is the sum of a random walk, with steps of variance w, and of noise whose mean over n samples
    has the variance c / n. The difference between two successive means of n samples has the variance v. Two
    values of n give w and c:

        v = 2 c / n + 2 n w / 3,      w = 3 (n2 v2 - n1 v1) / (2 (n2^2 - n1^2))
    """
    flights = [fold.innovations() for fold in held_out_folds(parts, model)]
    runs = [(run, np.diag(flight.R)) for flight in flights for run in flight.residual_runs()]

    def squared_steps(n: int) -> Floats:
        """Squares of the differences between successive means of n samples, in variances r, (.., 3), within
        each run."""
        means = [run[: len(run) // n * n].reshape(-1, n, 3).mean(axis=1) for run, _ in runs]
        steps = (np.diff(mean, axis=0) for mean in means)
        return np.vstack([d**2 / np.maximum(r, MIN_DIVISOR) for d, (_, r) in zip(steps, runs, strict=True)])

    n1, n2 = (round(span_s * model.rate_hz) for span_s in _TRIM_SPANS_S)
    short = squared_steps(n1)
    long = squared_steps(n2)
    usual = np.array(FilterSettings().trim_walk)
    if not len(short) or not len(long):
        return usual.tolist()
    v1 = short.mean(axis=0)
    v2 = long.mean(axis=0)
    w = 1.5 * (n2 * v2 - n1 * v1) / (n2**2 - n1**2)
    return np.maximum(np.sqrt(np.maximum(w, 0.0)), usual).tolist()
