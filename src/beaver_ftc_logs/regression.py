"""The one regression of a flight: the regressors of the next sample's rates, the residuals of a model
(`Innovations`), and least squares on these. Identification, checks, detection and bounds all use it. Least
squares on the regressors: orders.py.

    rates[k] = c + A' x[k] + sum over groups g of a_g F_g[k] + noise,      F_g[k] = sum_j B_gj u_g[k-j]

    n, G, D         number of samples; of groups; of signals
    h, L, f         number of past samples of the rates; of the commands; of the signals
    c               intercept (3,), rad/s
    x, X            the past of a sample: rates[k-1..k-h], signals[k-1..k-f], (3 h + D f,); of all samples
    A               coefficients of the past (3 h + D f, 3)
    u, U            commands of the groups, shares of travel, (n, G); the same at the lags 1 to L (n, G, L)
    a               effectiveness of each group, the gain of its response (G,)
    B, F            response (G, L, 3), rad/s; effect of the healthy groups (n, G, 3), rad/s
    y               rates that the past leaves unexplained (n, 3), rad/s
    e, R, W         residual (n, 3), rad/s; its covariance (3, 3), (rad/s)2; whitening matrix: e W is white
    Z, v            whitened regressors of trim and a (3 n, 3 + G), whitened y (3 n,): three rows a sample
    ma              moving average of the noise, 1 first
    p, ar           number of residuals that predict the next; matrices of this prediction (p, 3, 3), the
                    latest residual first

Groups of surfaces are those of `groups`: their surfaces move together and have one response.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from beaver_ftc_logs import least_squares
from beaver_ftc_logs.groups import Groups, group_commands, group_indices
from beaver_ftc_logs.model import Model, NoiseModel
from beaver_ftc_logs.recording import Floats, Ints, Mask
from beaver_ftc_logs.runs import runs_between, trailing_sums
from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.whitening import whiten_samples

_N_PARTS = 4  # number of parts in `split_parts`
_MIN_PART_ROWS = 60  # least number of rows in each
BOUND_MARGIN = 4.0  # standard errors from a gain to its bounds
# A response is quick if it differs from its mean over so many seconds.
_QUICK_SPAN_S = 0.5


def build_regressors(
    samples: Samples, groups: Groups, h: int, L: int, labelled: bool, f: int
) -> tuple[Floats, Floats, Mask]:
    """The regressors of each sample: the past X (n, 3 h + D f) and the commands U (n, G, L) of the groups;
    and known (n,), whether rates and regressors are finite and no gap in the log lies within the last
    max(h, L) samples.

    labelled: as in `group_commands`.
    """
    u = group_commands(samples, groups, labelled)
    rates = [_delay_rows(samples.rates, k, np.nan) for k in range(1, h + 1)]
    X = np.column_stack([*rates, *(_delay_rows(samples.signals, k, np.nan) for k in range(1, f + 1))])
    U = np.stack([_delay_rows(u, k, np.nan) for k in range(1, L + 1)], axis=2)
    known = np.isfinite(X).all(axis=1) & np.isfinite(U).all(axis=(1, 2))
    known &= np.isfinite(samples.rates).all(axis=1)
    known &= samples.stretch_number == _delay_rows(samples.stretch_number, max(h, L), -1)
    return X, U, known


def _delay_rows(values: np.ndarray, lag: int, fill: float) -> np.ndarray:
    """Values (n, ...) delayed by `lag` samples: row k has those of row k - lag, and `fill` if k < lag."""
    lag = min(lag, len(values))
    return np.concatenate([np.full((lag, *values.shape[1:]), fill), values[: len(values) - lag]])


@dataclass(frozen=True)
class Innovations:
    """The part of a flight's rates that the past does not explain, one row for each sample: y = c + sum_g F_g
    + e in health.

    rows (n,): place of each row in the flight. is_known (n,): whether the whole past of the row is known. If
    not, its row of e is 0, and its rows of y and F are finite but have no meaning: select the known rows with
    `at` before `regression`, `gain_bounds` or `gains`. y (n, 3), F (n, G, 3), c (3,) rad/s: as in the head of
    this file, less the part that earlier residuals predict (`subtract_noise`). noise: noise model of the
    flight.
    """

    rows: Ints
    is_known: Mask
    y: Floats
    F: Floats
    c: Floats
    noise: NoiseModel

    @cached_property
    def e(self) -> Floats:
        """Residual of a healthy vehicle, (n, 3)."""
        return np.where(self.is_known[:, None], self.y - self.c - self.F.sum(axis=1), 0.0)

    @cached_property
    def R(self) -> Floats:
        """Covariance of the noise, (3, 3) (rad/s)2."""
        return np.array(self.noise.noise)

    @cached_property
    def W(self) -> Floats:
        """Whitening matrix, (3, 3): W W' = R^-1."""
        return np.linalg.inv(np.linalg.cholesky(self.R)).T

    @property
    def log_size(self) -> float:
        """Logarithm of the size of a sample's noise before it was whitened, (1/2) log det R - 3 log sum(ma).

        The filter sum(ma) / ma(z), which whitens, multiplies the white noise of each of 3 axes by sum(ma).
        """
        return 0.5 * float(np.linalg.slogdet(self.R)[1]) - 3.0 * float(np.log(sum(self.noise.average)))

    def residual_runs(self) -> list[Floats]:
        """The residuals of each run of rows that follow one another, (n, 3) each."""
        return [self.e[begin:end] for begin, end in runs_between(np.diff(self.rows) > 1)]

    def at(self, rows: Ints | slice) -> "Innovations":
        """The innovations of some rows only. rows: positions in these arrays."""
        chosen = {name: getattr(self, name)[rows] for name in ("rows", "is_known", "y", "F")}
        return replace(self, **chosen)

    def columns(self) -> Floats:
        """Effects of trim and responses in standard deviations of the noise, W' [I, F'], (n, 3, 3 + G)."""
        trim = np.broadcast_to(np.eye(3), (len(self.F), 3, 3))
        return (np.concatenate([trim, self.F], axis=1) @ self.W).transpose(0, 2, 1)

    def regression(self) -> tuple[Floats, Floats]:
        """Z (3 n, 3 + G), the regressors of trim and responses, and v (3 n,), both whitened by W."""
        return self.columns().reshape(3 * len(self.F), -1), (self.y @ self.W).ravel()

    def gain_bounds(self, share: float) -> tuple[Floats, Floats, float]:
        """Lower and upper bound on the gain of each response, (G,) each, where the model has the gain 1, and
        the scale of the noise, in variances of it; by `coefficient_bounds` of the regression of v on Z.
        share: number of white samples that have the information of one sample.
        """
        low, high, scale = least_squares.coefficient_bounds(*self.regression(), share, BOUND_MARGIN)
        return low[3:], high[3:], scale  # the first 3 are the trim

    def gains(self) -> Floats:
        """The gain of each response, (G,), by least squares of v on Z (`regression`)."""
        return np.asarray(np.linalg.lstsq(*self.regression(), rcond=None)[0][3:])

    def quick_power(self, rate_hz: float) -> Floats:
        """Power of the quick part of the responses, summed over the groups and averaged over the whitened
        axes, in variances of the noise, (n,):

            sum over g of |(F_g - mean of F_g over the last _QUICK_SPAN_S) W|^2 / 3

        The quick part is the difference of a response from its mean. The mean includes rows that are not
        known.
        """
        sums, counts = trailing_sums(self.F, _QUICK_SPAN_S * rate_hz)
        quick = (self.F - sums / counts[:, None, None]) @ self.W
        return (quick**2).sum(axis=(1, 2)) / 3.0

    def quick_scale(self, model: Model) -> Floats:
        """Variance of the residual over that of the noise, (n,), above 1 where the quick part of the
        responses has more power than was usual in the fit:

            q = 1 + quick_error^2 max(quick power - usual quick power, 0)

        q is the result. Slow commands of healthy flight hardly show how a surface responds to a step, so the
        error of a quick response grows with its power.
        """
        excess = np.maximum(self.quick_power(model.rate_hz) - self.noise.usual_quick_power, 0.0)
        return 1.0 + model.settings.quick_error**2 * excess


def innovations(samples: Samples, model: Model, labelled: bool = False) -> Innovations:
    """The innovations of a flight by a model, one row a sample; labelled: as in `group_commands`. If the
    model has an AR predictor for the noise of the flight, the predicted part is subtracted from y, F and c,
    so that a healthy flight has a white residual.

    `einsum` sums in the same order for any length of the flight, so a row does not depend on later rows.
    """
    h = model.history
    L = model.lags
    f = model.vehicle.n_signal_lags(h)
    X, U, known = build_regressors(samples, group_indices(model), h, L, labelled, f)
    c, A, B = (np.array(values) for values in (model.intercept, model.past, model.response))
    noise = model.noise_of(samples.noise_ma_coefficients)
    ar = noise.ar
    y = subtract_noise(samples.rates - np.einsum("nm,mr->nr", X, A), ar)
    F = subtract_noise(np.einsum("ngl,glr->ngr", U, B), ar)
    is_known = known.copy()
    # The p first rows, and the p rows after an unknown one, are unknown too: `ar` predicts from the p before.
    for lag in range(1, len(ar) + 1):
        is_known &= _delay_rows(known, lag, False)
    c = c - c @ ar.sum(axis=0)
    return Innovations(np.arange(len(y)), is_known, np.nan_to_num(y), np.nan_to_num(F), c, noise)


def by_noise(samples: Samples, model: Model) -> list[tuple[Samples, Model]]:
    """For each noise model of a model: the flight whitened by it, and the model with this noise model alone.
    If there is none: the one pair of the flight and the model as they are."""
    return [
        (whiten_samples(samples, noise.average), model.model_copy(update={"colours": [noise]}))
        for noise in model.colours
    ] or [(samples, model)]


def by_axis(values: Floats) -> dict[str, float]:
    """Three values, of p, q and r, by the name of the axis."""
    return dict(zip("pqr", values.tolist(), strict=True))


def subtract_noise(values: Floats, ar: Floats) -> Floats:
    """t (n, .., 3): values s (n, .., 3) less their prediction by ar, for each index g of the middle axes.
    Values before the first row count as 0.

        t[k, g] = s[k, g] - sum over lags l = 1..p of ar[l-1]' s[k-l, g]

    For each entry (i, j) of the matrices, from axis i of s to axis j of t, the sum is a convolution in time.
    A NaN spreads to all axes of the p next rows at most.
    """
    result = values.copy()
    if not len(ar) or not values.size:
        return result
    s = values.reshape(len(values), -1, 3)
    t = result.reshape(s.shape)  # a view: a subtraction from t changes `result`
    for i, j, g in np.ndindex(3, 3, s.shape[1]):
        t[1:, g, j] -= np.convolve(s[:, g, i], ar[:, i, j])[: len(s) - 1]
    return result


def split_parts(rows: Ints) -> list[Ints] | None:
    """The rows of a flight in _N_PARTS parts; None if one has less than _MIN_PART_ROWS rows."""
    parts = np.array_split(rows, _N_PARTS)
    return parts if min(map(len, parts)) >= _MIN_PART_ROWS else None
