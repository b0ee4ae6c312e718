"""The detectors that `diagnose --detector` and `compare --flights` can use on recorded flights.

    bank-of-filters             the filters of `diagnose`
    sliding-least-squares       effectiveness from the last 20 s, all samples with equal weight
    forgetting-least-squares    effectiveness from all past samples, weights exp(-age / 20 s) [Ljung1999]
    others                      the detectors of the control loop (`loop_detectors`)

`compare --flights` alone also uses the freeze rule, which needs no model: a servo output that has not moved
for 6 s is faulty.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from beaver_ftc.documents import BadInput, suggestion
from beaver_ftc.plugins import DETECTORS, is_compiled, made, registered
from beaver_ftc_logs.bank import build_bank
from beaver_ftc_logs.diagnose import check_log_fits_model, diagnose, finish_rows
from beaver_ftc_logs.groups import expand_groups
from beaver_ftc_logs.log_rows import LogRows, join_names
from beaver_ftc_logs.loop_detectors import run_loop_detector
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import Floats, RecordedFlight
from beaver_ftc_logs.regression import innovations
from beaver_ftc_logs.runs import trailing_sums
from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.time_base import unchanged_s
from beaver_ftc_logs.trust import without_dead_rows

LEAST_SQUARES_MEMORY_S = 20.0
MIN_FROZEN_OUTPUT_S = 6.0
_MIN_LOSS_SD = 5.0  # least loss that raises an alarm, in standard deviations of its estimate
_SD_OF_90_PERCENT = 1.645  # half the width of an interval that holds 90 % of the normal law
_PRIOR_INFORMATION = 4.0  # 1 / (1/2)^2: a gain of standard deviation 1/2
OUR_DETECTOR = "bank-of-filters"


def _least_squares(samples: Samples, model: Model, fades: bool) -> LogRows:
    """Effectiveness a of the groups, by least squares of the whitened residual r = X theta + noise:

        theta = (M0 + sum X' X)^-1 sum X' r,   a_g = 1 + theta[3 + g],   P = (M0 + sum X' X)^-1

    The sums are over the memory of the detector (`_memory_sums`), b = sum X' r. theta (3 + G,): trim in
    standard deviations of the noise, and a_g - 1. X (n, 3, 3 + G): their whitened effects on the rates. r (n,
    3): residual of a healthy vehicle. M0: prior information, with a standard deviation of trim_sd for the
    trim and of 1/2 for a_g. P: covariance of theta.
    """
    flight = innovations(samples, model)
    sd = [*np.sqrt(np.diag(flight.R)), *np.ones(len(model.groups))]
    X = np.where(flight.is_known[:, None, None], flight.columns() * sd, 0.0)
    M = _memory_sums(np.einsum("nai,naj->nij", X, X), samples.dt_s, fades)
    b = _memory_sums(np.einsum("nai,na->ni", X, flight.e @ flight.W), samples.dt_s, fades)
    M0 = np.diag([1.0 / model.settings.trim_sd**2] * 3 + [_PRIOR_INFORMATION] * len(model.groups))
    P = np.linalg.inv(M + M0)
    theta = np.einsum("nij,nj->ni", P, b)
    errors = np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2)[:, 3:], 0.0))
    return _rows_of_estimate(samples, model, 1.0 + theta[:, 3:], errors)


def _memory_sums(x: Floats, dt_s: float, fades: bool) -> Floats:
    """Sums of x (n, ...) over the memory that ends at each sample. fades: with weights exp(-age / 20 s)."""
    if fades:
        from scipy.signal import lfilter

        return lfilter([1.0], [1.0, -np.exp(-dt_s / LEAST_SQUARES_MEMORY_S)], x, axis=0)
    return trailing_sums(x, LEAST_SQUARES_MEMORY_S / dt_s)[0]


def _rows_of_estimate(samples: Samples, model: Model, a: Floats, sd: Floats) -> LogRows:
    """Rows of an estimate a of the effectiveness with standard deviation sd, (n, G) each.

        levels in the settings    estimate                    a fault is
        yes                       level nearest to a          an estimate below 1
        no                        a, limited to 0 and 1       a + _MIN_LOSS_SD sd < 1

    low, high: the 90 % interval of a, extended to the estimate. A group without labelled levels has those of
    the bank.
    """
    bank = build_bank(model)
    low, high = (np.clip(a + sign * _SD_OF_90_PERCENT * sd, 0.0, 1.0) for sign in (-1.0, 1.0))
    nearest = np.clip(a, 0.0, 1.0)
    lost = a + _MIN_LOSS_SD * sd < 1.0
    if model.settings.levels:
        for g, name in enumerate(model.group_names):
            labelled = model.settings.levels.get(name)
            levels = np.array([*labelled, 1.0]) if labelled else np.unique(bank.effectiveness[:, g])
            nearest[:, g] = levels[np.abs(nearest[:, g, None] - levels).argmin(axis=1)]
        lost = nearest < 1.0
    low = expand_groups(np.minimum(low, nearest), model)
    high = expand_groups(np.maximum(high, nearest), model)
    names = join_names(lost, model.group_names)
    return LogRows.of_names(samples.t_s, names, expand_groups(nearest, model), low, high)


def diagnose_by_freeze_rule(log: RecordedFlight, samples: Samples, model: Model) -> LogRows | None:
    """Rows by the freeze rule on the logged servo outputs; None if the vehicle file names none, or none is
    logged."""
    surfaces = list(model.vehicle.surfaces)
    outputs = {
        name: log.columns[output.column]
        for name, output in model.vehicle.outputs.items()
        if output.column in log.columns
    }
    if not outputs:
        return None
    frozen = np.zeros((len(samples.t_s), len(surfaces)), dtype=bool)
    for name, column in outputs.items():
        frozen[:, surfaces.index(name)] = unchanged_s(column, samples.t_s) > MIN_FROZEN_OUTPUT_S
    a = 1.0 - frozen
    return LogRows.of_names(samples.t_s, join_names(frozen, surfaces), a, a, a)


_FLIGHT_DETECTORS: dict[str, Callable[[Samples, Model], LogRows]] = {
    "sliding-least-squares": partial(_least_squares, fades=False),
    "forgetting-least-squares": partial(_least_squares, fades=True),
}


def detector_names() -> list[str]:
    """The names of all detectors for recorded flights. The compiled detectors of the loop are not among them:
    they need a simulation."""
    of_the_loop = [name for name in registered(DETECTORS) if not is_compiled(DETECTORS, name)]
    return [OUR_DETECTOR, *_FLIGHT_DETECTORS, *of_the_loop]


def check_detector_name(name: str) -> None:
    """Raise BadInput for a name that is no detector for recorded flights."""
    known = detector_names()
    if name not in known:
        raise BadInput(f"--detector {name}: is not known{suggestion(name, known)}")


def diagnose_with_detector(name: str, samples: Samples, model: Model) -> LogRows:
    """The rows of one detector of `detector_names`. Raises BadInput for a log that does not fit the model."""
    if name == OUR_DETECTOR:
        return diagnose(samples, model)
    check_log_fits_model(samples, model)
    rows_by = _FLIGHT_DETECTORS.get(name) or partial(run_loop_detector, made(DETECTORS, name))
    return finish_rows(samples, model, rows_by(without_dead_rows(samples, model), model))
