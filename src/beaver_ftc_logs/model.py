"""The model file, in JSON: `identify` writes it, and `diagnose` filters a flight with it.

Every key is checked when the file is read, as in any other file that a user names. The docstrings of the
sections have a line for each key.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from beaver_ftc.documents import Conflict, Location, Number, Section, Whole, deny, read_file, refuse
from beaver_ftc_logs.extremes import PeakTail
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.vehicle import Vehicle

_MAX_FILE_BYTES = 20_000_000

_MAX_COEF = 1e6  # largest magnitude of a coefficient: those of logs are below 100
_MAX_SURFACE_GROUPS = 24  # the filter tries all pairs
_MAX_CONDITION_NUMBER = 1e12  # largest condition number of a covariance
# Keys of `fitted` and `settings` in files of release 1.0.0 that nothing reads any more.
_DEAD_KEYS = ("correlation", "scale", "minutes", "column_sd", "misread", "spread", "hold_s")

Coefficient = Annotated[Number, Field(ge=-_MAX_COEF, le=_MAX_COEF)]
CoefRow = list[Coefficient]
CoefRows = list[CoefRow]
ShareBelowOne = Annotated[Number, Field(ge=0, lt=1)]
OpenShare = Annotated[Number, Field(gt=0, lt=1)]
Share = Annotated[Number, Field(ge=0, le=1)]
Positive = Annotated[Number, Field(gt=0, le=_MAX_COEF)]
NonNegative = Annotated[Number, Field(ge=0, le=_MAX_COEF)]
AtLeastOne = Annotated[Number, Field(ge=1, le=_MAX_COEF)]


def _shape(lists: Any) -> tuple[int, ...] | None:
    """Lengths of nested lists; None where those of one depth differ."""
    try:
        return np.shape(lists)
    except ValueError:
        return None


def _check_covariance(rows: CoefRows) -> CoefRows:
    """The rows of a covariance (3, 3). Refuses another shape, an asymmetric matrix, and a matrix that is not
    positive definite or that 64-bit numbers cannot invert."""
    if _shape(rows) != (3, 3):
        deny("has another shape, allowed: 3 x 3 numbers")
    R = np.array(rows)
    if abs(R - R.T).max() > 1e-6 * abs(R).max():
        deny("is not symmetric, allowed: a covariance")
    smallest, *_, largest = np.linalg.eigvalsh(R)
    if smallest <= 0.0 or largest > _MAX_CONDITION_NUMBER * smallest:
        deny(f"is singular or nearly so, allowed: a covariance, conditioned to {_MAX_CONDITION_NUMBER:g}")
    return rows


Covariance = Annotated[CoefRows, AfterValidator(_check_covariance)]


class _LastingSection(Section):
    """A section of a model file."""

    @model_validator(mode="before")
    @classmethod
    def _drop_dead_keys(cls, data: object) -> object:
        """The data without the keys of release 1.0.0 that nothing reads any more."""
        if not isinstance(data, dict):
            return data
        return {key: value for key, value in data.items() if key not in _DEAD_KEYS}


class FilterSettings(_LastingSection):
    """Prior settings of the filter. sd: standard deviation. trim (3,): offset of the rates of a sample,
    rad/s, that neither past nor commands explain. gain: factor on the response to the commands.

    changes_per_hour: how often a surface changes its effectiveness
    repair_share: share of the changes that restore health
    levels: likelier levels of effectiveness, by group
    level_share: share of faults at the likelier levels
    trim_sd: sd of the trim between flights, in residual sd
    trim_shift: sd of the trim by a shift of each group's command, share of travel
    trim_walk: sd of the change of the trim in a sample, in residual sd, for p, q, r
    gain_sd: sd of the common gain of all groups
    gain_time_s: time constant with which the common gain returns to the model's, s
    own_gain_sd: sd of each group's gain about the common gain
    own_gain_time_s: time constant with which a group's gain returns to the common gain, s
    quick_error: error of responses quicker than those of the fitted flights, as a share of them
    trim_bound: largest distance of the trim from zero, in its sd before the flight
    gain_bound: largest distance of a gain from its mean before the flight, in its sd before the flight
    delays_s: extra delays of the commands that the filter tries, s, each at most a sample
    jam_sd: sd of the offset of the rates in a sample by a stuck surface, in residual sd
    power: information of a sample of the residual, as a share of that of white noise
    tail: degrees of freedom of the residual's t distribution
    noise_memory_s: memory of the running scale of the residual, s
    alarm: probability of a fault that raises the alarm; used if threshold is null
    false_alarms_per_hour: the requested rate, from which `identify` computed threshold
    threshold: Page's sum of the evidence for a fault that raises the alarm, natural logarithm of odds
    name_evidence: Page's sum from which on a fault is named, as a multiple of threshold
    rename_s: for how long another name stands before it counts, s
    one_group: whether one group alone is at fault: a name has every group that is not excluded
    level_step: step of the grid of effectiveness
    bounds: posterior probability that the effectiveness lies inside its bounds
    """

    changes_per_hour: Positive = 12.0
    repair_share: ShareBelowOne = 0.1
    levels: dict[str, Annotated[list[ShareBelowOne], Field(max_length=100)]] = Field({})
    level_share: Share = 0.9
    trim_sd: Positive = 0.5
    trim_shift: NonNegative = 0.0
    trim_walk: list[NonNegative] = Field([3e-4] * 3, min_length=3, max_length=3)
    gain_sd: Number = Field(0.15, gt=0, lt=0.5)
    gain_time_s: Positive = 5e4
    own_gain_sd: Number = Field(0.0, ge=0, lt=0.5)
    own_gain_time_s: Positive = 2000.0
    quick_error: Share = 1.0
    trim_bound: Positive = 4.0
    gain_bound: Positive = 3.0
    delays_s: CoefRow = Field([0.0], min_length=1, max_length=9)
    jam_sd: Positive = 2.0
    power: Number = Field(1.0, gt=0, le=1)
    tail: Number = Field(8.0, gt=2, le=_MAX_COEF)
    noise_memory_s: Positive = 60.0
    alarm: OpenShare = 0.5
    false_alarms_per_hour: Positive | None = None
    threshold: Positive | None = None
    name_evidence: AtLeastOne = 1.0
    rename_s: NonNegative = 0.0
    one_group: bool = False
    level_step: Number = Field(0.1, ge=0.01, le=0.5)
    bounds: OpenShare = 0.9


class FittedRanges(_LastingSection):
    """Ranges in which a model was fitted, and its errors on data that were not fitted: where it is
    credible.

    commands: least and largest command of each surface, share of travel
    rates: least and largest p, q and r, rad/s
    airspeed: least and largest airspeed, m/s
    tied: share of each group's effect that past, signals and other groups make up
    gain_sd: standard error of each group's gain
    still_s: longest time each column stood still, s
    energy_climb: rate of the energy height as without power, m/s
    tail: highest peaks of the alarm statistic (Page's sum) in healthy flights that were not fitted
    """

    commands: CoefRows
    rates: CoefRows
    airspeed: CoefRow | None = None
    tied: CoefRow = Field([])
    gain_sd: list[NonNegative] = Field([])
    still_s: dict[str, Number] = Field({})
    energy_climb: Number | None = None
    tail: PeakTail | None = None


# The ranges of a model whose file states none.
NOTHING_FITTED = FittedRanges(commands=[], rates=[])


class NoiseModel(Section):
    """The noise of some flights. Another gyro, other air or another law gives the residual another spectrum.

    average: 1, c1, ...: moving average of the noise, newest first
    noise: covariance of the residual whitened by average, less the prediction by before, (3, 3), (rad/s)2
    before: AR coefficients: the previous residuals predict the next, latest first, (3 L, 3)
    wider: variance inflation: factor on noise, since gains scatter more in held-out parts, and under
    other laws, than the fit states
    misreads: share of its effect by which the fit may misread each group in this noise
    quick: power, in variances of the noise, that the quick part of the responses exceeds in a tenth
    of the samples fitted; quick part: difference from the mean over the last half second; null: unknown
    """

    average: CoefRow = Field(min_length=1, max_length=1000)
    noise: Covariance
    before: CoefRows = Field([])
    wider: AtLeastOne = 1.0
    misreads: list[ShareBelowOne] = Field([])
    quick: NonNegative | None = None

    @property
    def usual_quick_power(self) -> float:
        """`quick`; infinite if it is unknown, so that no response counts as unusually quick."""
        return float("inf") if self.quick is None else self.quick

    @property
    def ar(self) -> Floats:
        """Autoregressive coefficients of the residual, (L, 3, 3), latest lag first; L is 0 if not fitted."""
        return np.reshape(np.array(self.before), (-1, 3, 3))


class Model(Section):
    """How one vehicle's rates answer their own past and the commands, and how well that is known.

    groups: surfaces that move together when healthy
    past: (3 history + regressor_columns x signal lags, 3)
    response: (groups, lags, 3), a share of command to rad/s a sample
    response_sd: standard errors of `response`, colour included
    noise: covariance of the residual, (3, 3), (rad/s)2
    colours: noise models for `moving_air`: of the fitted flights, of gusts and of noisier gyros
    fitted: what it was fitted on; null or left out: nothing is known
    identified: what it was found from, and how well
    """

    vehicle: Vehicle
    rate_hz: Number = Field(ge=0.1, le=1000)
    groups: list[Annotated[list[str], Field(min_length=1)]] = Field(
        min_length=1, max_length=_MAX_SURFACE_GROUPS
    )
    history: Whole = Field(ge=1, le=50)
    lags: Whole = Field(ge=1, le=50)
    intercept: CoefRow = Field(min_length=3, max_length=3)
    past: CoefRows
    response: list[CoefRows] = Field(min_length=1)
    response_sd: list[list[list[NonNegative]]] = Field(min_length=1)
    noise: Covariance
    colours: list[NoiseModel] = Field([])
    settings: FilterSettings = FilterSettings()
    fitted: Annotated[
        FittedRanges, BeforeValidator(lambda value: NOTHING_FITTED if value is None else value)
    ] = NOTHING_FITTED
    identified: dict[str, object] = Field({})

    @model_validator(mode="after")
    def _check_arrays(self) -> "Model":
        """Refuse arrays and names that do not belong to this vehicle, history and lags."""
        n_signals = len(self.vehicle.regressor_columns) * self.vehicle.n_signal_lags(self.history)
        n_rows = len(self.past)
        n_past = 3 * self.history + n_signals
        reason = f"has {n_rows} rows, allowed: {n_past}, as `identify` writes them: identify it again"
        conflicts = [(("past",), reason)] if n_rows != n_past else []
        refuse([*conflicts, *self._name_mistakes(), *self._shape_mistakes()])
        return self

    def _name_mistakes(self) -> Iterator[Conflict]:
        """Names in groups that are no surface of the vehicle, or are in two groups; levels of an unknown
        group; delays that are longer than a sample."""
        seen: set[str] = set()
        for i, group in enumerate(self.groups):
            for k, name in enumerate(group):
                if name not in self.vehicle.surfaces or name in seen:
                    reason = "is in two groups" if name in seen else "is no surface of the vehicle"
                    yield ("groups", i, k), f"{name!r:.60} {reason}, allowed: each surface once"
                seen.add(name)
        for name in self.settings.levels:
            if name not in self.group_names:
                reason = f"{name!r:.60} is no group, allowed: {', '.join(self.group_names)}"
                yield ("settings", "levels", name), reason
        for k, delay_s in enumerate(self.settings.delays_s):
            if abs(delay_s) * self.rate_hz > 1.0 + 1e-9:
                yield ("settings", "delays_s", k), f"{delay_s:g} is too long, allowed: up to a sample, s"

    def _shape_mistakes(self) -> Iterator[Conflict]:
        """Arrays whose shape contradicts the groups, the lags or the number of rates. An empty array is not
        checked: where it is forbidden, its field says so."""
        G = len(self.groups)
        L = self.lags
        arrays: list[tuple[Location, Any, tuple[int, ...]]] = [
            (("response",), self.response, (G, L, 3)),
            (("response_sd",), self.response_sd, (G, L, 3)),
            (("past",), self.past, (len(self.past), 3)),
        ]
        for i, noise in enumerate(self.colours):
            at = ("colours", i)
            n_ar = -(-len(noise.before) // 3) * 3  # the number of rows, rounded up to a multiple of 3
            arrays.append(((*at, "before"), noise.before, (n_ar, 3)))
            arrays.append(((*at, "misreads"), noise.misreads, (G,)))
            if noise.average[0] != 1.0:
                yield (*at, "average"), "does not begin with 1, allowed: 1, c1, ..."
        shapes = {"commands": (len(self.vehicle.surfaces), 2), "rates": (3, 2), "airspeed": (2,)}
        for key, shape in (shapes | {"tied": (G,), "gain_sd": (G,)}).items():
            arrays.append((("fitted", key), getattr(self.fitted, key), shape))
        for key_path, lists, shape in arrays:
            if lists and _shape(lists) != shape:
                yield key_path, f"has another shape, allowed: {' x '.join(map(str, shape))} numbers"

    @property
    def group_names(self) -> list[str]:
        """The surfaces of each group, joined by +."""
        return ["+".join(group) for group in self.groups]

    def noise_of(self, average: Sequence[float]) -> NoiseModel:
        """The noise model that was fitted to flights of this moving average; if there is none, the noise of
        all flights. average: 1, c1, ..., newest first; empty for a flight that is not whitened."""
        fitted = [noise for noise in self.colours if noise.average == list(average)]
        return fitted[0] if fitted else NoiseModel(average=list(average) or [1.0], noise=self.noise)


def load_model(path: Path) -> Model:
    """The model in a file. Raises ScenarioError with one line a mistake."""
    return read_file(Model, path, _MAX_FILE_BYTES)


def model_file_text(model: Model) -> str:
    """The model as the text of its file."""
    return model.model_dump_json(indent=1) + "\n"
