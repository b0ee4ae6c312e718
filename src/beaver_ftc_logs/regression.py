"""The one regression of a flight: the regressors of the next sample's rates, what a model leaves of them
(`Innovations`), and least squares on both. What identifies, doubts, detects and bounds selects from it.

    rates[k] = c + A' x[k] + sum over groups g of a_g F_g[k] + noise,      F_g[k] = sum_j B_gj u_g[k-j]

    n, G, h, L, f   samples; groups; past samples of the rates, of the commands, of the X signals
    c               intercept (3,), rad/s
    x, A            the past: rates[k-1..k-h], signals[k-1..k-f], (3 h + X f,); its coefficients (.., 3)
    u, U            command of a group, a share of its travel; of all groups at lags 1 to L (n, G, L)
    a               effectiveness of each group (G,)
    B, F            response (G, L, 3), rad/s; what the groups do while they are healthy (n, G, 3), rad/s
    y               rates that the past leaves unexplained (n, 3), rad/s
    e, R, W         residual (n, 3), rad/s; its covariance (3, 3), (rad/s)2; whitening matrix: e W is white
    ma, ar          moving average of the noise, 1 first; its predictor from those before, (.., 3, 3)

Surfaces whose commands are proportional to one another move together while they are healthy: their effects
cannot be distinguished by any fit, so they form one group with one response.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from beaver_ftc_logs import least_squares
from beaver_ftc_logs.model import Model, NoiseModel
from beaver_ftc_logs.recording import Floats, Ints, Mask
from beaver_ftc_logs.runs import runs_between, trailing_sums
from beaver_ftc_logs.samples import Samples, mixer_matrix, whiten_samples
from beaver_ftc_logs.vehicle import Vehicle

_PARALLEL_TOLERANCE = 1e-9  # of the squared cosine of two rows of the mixer: rounding
_N_PARTS = 4  # of a flight
_MIN_PART_ROWS = 60
BOUND_MARGIN = 4.0  # standard errors from a gain to its bounds
# A response is quick if it differs from its mean over so many seconds.
_QUICK_SPAN_S = 0.5


@dataclass(frozen=True)
class FitPart:
    """A flight (or half of one) and which of its samples the fit may use, is_usable (n,). fits: to this
    flight and others."""

    samples: Samples
    is_usable: Mask
    fits: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def halves(self) -> tuple["FitPart", "FitPart"]:
        """The usable samples in two halves."""
        rows = np.flatnonzero(self.is_usable)
        middle = int(rows[len(rows) // 2]) if len(rows) else 0
        is_first = np.arange(len(self.is_usable)) < middle
        first = self.is_usable & is_first
        second = self.is_usable & ~is_first
        return FitPart(self.samples, first), FitPart(self.samples, second)

    def innovations(self, model: Model) -> "Innovations":
        """The samples in use by a model, commands as effective as labels say."""
        flight = innovations(self.samples, model, labelled=True)
        return flight.at(np.flatnonzero(self.is_usable & flight.is_known))


Parts = Sequence[FitPart]


def usual_step_s(parts: Parts) -> float:
    """The usual step of the samples of all flights, s."""
    return float(np.median([part.samples.dt_s for part in parts]))


# Surfaces that move together, by their places.
Groups = list[list[int]]


def group_surfaces(vehicle: Vehicle) -> Groups:
    """Surfaces by what excites them: those in one group get proportional commands."""
    M = mixer_matrix(vehicle)
    groups: Groups = []
    for i, m in enumerate(M):
        for group in groups:
            first = M[group[0]]
            if (m @ first) ** 2 >= (1.0 - _PARALLEL_TOLERANCE) * (m @ m) * (first @ first):
                group.append(i)
                break
        else:
            groups.append([i])
    return groups


def build_regressors(
    samples: Samples, groups: Groups, h: int, L: int, labelled: bool, f: int
) -> tuple[Floats, Floats, Mask]:
    """The regressors of each sample: the past x (n, 3 h + X f), the commands U (n, G, L) of the groups, and
    whether all of it is known and no gap lies within, (n,).

    labelled: as of `group_commands`.
    """
    v = group_commands(samples, groups, labelled)
    rates = [_delay_rows(samples.rates, k, np.nan) for k in range(1, h + 1)]
    X = np.column_stack([*rates, *(_delay_rows(samples.signals, k, np.nan) for k in range(1, f + 1))])
    U = np.stack([_delay_rows(v, k, np.nan) for k in range(1, L + 1)], axis=2)
    ok = np.isfinite(X).all(axis=1) & np.isfinite(U).all(axis=(1, 2))
    ok &= np.isfinite(samples.rates).all(axis=1)
    ok &= samples.stretch_number == _delay_rows(samples.stretch_number, max(h, L), -1)
    return X, U, ok


def group_commands(samples: Samples, groups: Groups, labelled: bool) -> Floats:
    """The command of each group, (n, G); labelled: each surface's times its labelled effectiveness, 1 where
    there is no label."""
    u = samples.commands
    if labelled:
        u = u * np.where(np.isfinite(samples.labels), samples.labels, 1.0)
    return np.column_stack([u[:, group].sum(axis=1) for group in groups])


def _delay_rows(values: np.ndarray, lag: int, fill: float) -> np.ndarray:
    """The rows `lag` samples later, `fill` where there is no past."""
    lag = min(lag, len(values))
    return np.concatenate([np.full((lag, *values.shape[1:]), fill), values[: len(values) - lag]])


def group_indices(model: Model) -> Groups:
    """The model's groups as positions of their surfaces."""
    names = list(model.vehicle.surfaces)
    return [[names.index(name) for name in group] for group in model.groups]


def expand_groups(values: Floats | Mask, model: Model) -> Floats:
    """Each surface's column (n, S) of those of the groups (n, G): its group's, 1 where it is in none."""
    index = np.full(len(model.vehicle.surfaces), -1)
    for g, group in enumerate(group_indices(model)):
        index[group] = g
    return np.take(np.column_stack([values, np.ones(len(values))]), index, axis=1)


@dataclass(frozen=True)
class Innovations:
    """What the past does not explain of a flight's rates, a row a sample: y = c + sum_g F_g + e in health.

    rows (n,): place of each row in the flight. is_known (n,): whether all of the past is there; else a row
    of e is 0. y (n, 3), F (n, G, 3), c (3,) rad/s: as in the head of this file, less what earlier residuals
    predict of them. noise: of the flight.
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
        """Logarithm of the size of a sample's noise before it was whitened, log det(R)^1/2 - 3 log sum ma."""
        return 0.5 * float(np.linalg.slogdet(self.R)[1]) - 3.0 * float(np.log(sum(self.noise.average)))

    def residual_runs(self) -> list[Floats]:
        """The residuals of each run of rows that follow one another, (n, 3) each."""
        return [self.e[begin:end] for begin, end in runs_between(np.diff(self.rows) > 1)]

    def at(self, rows: Ints | slice) -> "Innovations":
        """Some of the rows."""
        chosen = {name: getattr(self, name)[rows] for name in ("rows", "is_known", "y", "F")}
        return replace(self, **chosen)

    def columns(self) -> Floats:
        """Effects of trim and responses in standard deviations of the noise, (n, 3, 3 + G)."""
        trim = np.broadcast_to(np.eye(3), (len(self.F), 3, 3))
        return (np.concatenate([trim, self.F], axis=1) @ self.W).transpose(0, 2, 1)

    def regression(self) -> tuple[Floats, Floats]:
        """Regressors Z (3 n, 3 + G) of trim and responses, and the rates v (3 n,), whitened."""
        return self.columns().reshape(3 * len(self.F), -1), (self.y @ self.W).ravel()

    def gain_bounds(self, share: float) -> tuple[Floats, Floats, float]:
        """By least squares of v on Z, as of `regression`: the gain that each response surely is not below,
        and not above, (G,) each, 1 as in the model; and the scale of the noise, in variances of it.

            X = Z / s,   P = (X' X + eps n I)^-1,   b = P X' v,   e = v - X b
            bounds = (b -+ BOUND_MARGIN sqrt(diag(P) mean(e^2) / share)) / s

        eps: a small number, which keeps the bounds finite and far apart where columns make one another up.
        share: as how many white samples one counts.
        """
        Z, v = self.regression()
        s = least_squares.rms_of_columns(Z)
        X = Z / s
        ridge = least_squares.EIGENVALUE_FLOOR * len(X) * np.eye(X.shape[1])
        P = np.linalg.inv(X.T @ X + ridge)
        b = P @ (X.T @ v)
        e2 = (v - X @ b) ** 2
        margin = BOUND_MARGIN * np.sqrt(np.maximum(np.diag(P), 0.0) * e2.mean() / share)
        low = (b - margin) / s
        high = (b + margin) / s
        return low[3:], high[3:], least_squares.noise_scale(e2)

    def gains(self) -> Floats:
        """The gain of each response, (G,), by least squares of y on trim and responses."""
        return np.asarray(np.linalg.lstsq(*self.regression(), rcond=None)[0][3:])

    def quick_power(self, rate_hz: float) -> Floats:
        """Power of the quick part of the responses an axis, in variances of the noise, (n,): of the
        difference from their mean over the last half second."""
        sums, n = trailing_sums(self.F, _QUICK_SPAN_S * rate_hz)
        quick = (self.F - sums / n[:, None, None]) @ self.W
        return (quick**2).sum(axis=(1, 2)) / 3.0

    def quick_scale(self, model: Model) -> Floats:
        """Variance q of the residual over that of the noise, (n,): above 1 where the responses are quicker
        than usual in the fit, since a share of the quick part may be missing, or be too much.

        Slow commands of healthy flight hardly show how a surface responds to a step. The error after a step
        is no noise: it has the same sign in many samples.
        """
        excess = np.maximum(self.quick_power(model.rate_hz) - self.noise.usual_quick_power, 0.0)
        return 1.0 + model.settings.quick_error**2 * excess


def innovations(samples: Samples, model: Model, labelled: bool = False) -> Innovations:
    """A flight by a model, every sample a row; labelled: as in `build_regressors`. Where the model knows the
    flight's noise, less the prediction of each residual from those before it: a healthy flight leaves a white
    residual.

    Summed in the same order whatever the length of the flight, so that a row does not depend on later ones.
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
    whole = known.copy()
    for lag in range(1, len(ar) + 1):
        whole &= _delay_rows(known, lag, False)
    y = np.nan_to_num(y)
    F = np.nan_to_num(F)
    c = c - c @ ar.sum(axis=0)
    return Innovations(np.arange(len(y)), whole, y, F, c, noise)


def by_noise(samples: Samples, model: Model) -> list[tuple[Samples, Model]]:
    """A flight whitened by each noise of a model, and the model with this noise alone; both as they are where
    the model has none."""
    return [
        (whiten_samples(samples, noise.average), model.model_copy(update={"colours": [noise]}))
        for noise in model.colours
    ] or [(samples, model)]


def by_axis(values: Floats) -> dict[str, float]:
    """The numbers of p, q and r by name."""
    return dict(zip("pqr", values.tolist(), strict=True))


def axis_text(values: dict[str, float]) -> str:
    """The numbers of p, q and r as text."""
    return ", ".join(f"{axis} {value:.3f}" for axis, value in values.items())


def subtract_noise(values: Floats, ar: Floats) -> Floats:
    """Values v (n, ..., 3) less their prediction: v[k] - sum_j ar[j-1]' v[k-j], with ar (p, 3, 3)."""
    rest = values.copy()
    if not len(ar) or not values.size:
        return rest
    sources, targets = (np.moveaxis(a.reshape(len(values), -1, 3), 0, -1) for a in (values, rest))
    for (i, j), taps in zip(np.ndindex(3, 3), ar.reshape(-1, 9).T, strict=True):
        for source, target in zip(np.ascontiguousarray(sources[:, i]), targets[:, j], strict=True):
            target[1:] -= np.convolve(source, taps)[: len(source) - 1]
    return rest


def split_parts(rows: Ints) -> list[Ints] | None:
    """The rows of a flight in its parts; None where one is too short."""
    parts = np.array_split(rows, _N_PARTS)
    return parts if min(map(len, parts)) >= _MIN_PART_ROWS else None


def regressor_names(model: Model) -> list[str]:
    """Names of the columns of the fit after the constant, in their order."""
    h = model.history
    signals = model.vehicle.regressor_columns
    commands = [(f"command of {'+'.join(group)}",) for group in model.groups]
    lagged = [
        ("pqr", h),
        (signals, model.vehicle.n_signal_lags(h)),
        *((one, model.lags) for one in commands),
    ]
    return [f"{name}[-{k}]" for names, most in lagged for k in range(1, most + 1) for name in names]
