"""The model file: what `identify` has found about a vehicle, and what `diagnose` filters a flight with.

JSON; every key is checked when it is read, as in any other file a user names.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from beaver_ftc.documents import Conflict, Location, Number, Section, Whole, read_file, refuse
from beaver_ftc_logs.extremes import PeakTail
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.vehicle import Vehicle

_MAX_FILE_BYTES = 20_000_000

_MAX_COEF = 1e6  # of any coefficient: those of logs are below 100
_MAX_SURFACE_GROUPS = 24  # the filter tries all pairs
_MAX_CONDITION_NUMBER = 1e12  # of a covariance
# keys of `fitted` in files of release 1.0.0
_DEAD_KEYS = ("correlation", "scale", "minutes", "column_sd")

Coefficient = Annotated[Number, Field(ge=-_MAX_COEF, le=_MAX_COEF)]
CoefRow = list[Coefficient]
CoefRows = list[CoefRow]
ShareBelowOne = Annotated[Number, Field(ge=0, lt=1)]
OpenShare = Annotated[Number, Field(gt=0, lt=1)]
Share = Annotated[Number, Field(ge=0, le=1)]
Positive = Annotated[Number, Field(gt=0, le=_MAX_COEF)]
NonNegative = Annotated[Number, Field(ge=0, le=_MAX_COEF)]
AtLeastOne = Annotated[Number, Field(ge=1, le=_MAX_COEF)]


class FilterSettings(Section):
    """Prior settings of the filter."""

    effectiveness_changes_per_hour: Positive = Field(
        12.0, description="how often a surface changes its effectiveness", alias="changes_per_hour"
    )
    repair_share: Number = Field(0.1, ge=0, lt=1, description="share of the changes that restore health")
    likely_levels: dict[str, Annotated[list[ShareBelowOne], Field(max_length=100)]] = Field(
        default={}, description="likelier levels of effectiveness, by group", alias="levels"
    )
    likely_share: Share = Field(
        0.9, description="share of faults at the likelier levels", alias="level_share"
    )
    trim_sd: Positive = Field(0.5, description="free spread of the trim between flights, in residual sd")
    trim_command_shift_sd: NonNegative = Field(
        0.0, description="spread of the trim as a shift of each group's command", alias="trim_shift"
    )
    trim_step_sd: list[NonNegative] = Field(
        [3e-4] * 3,
        min_length=3,
        max_length=3,
        description="drift of the trim a sample, in residual sd",
        alias="trim_walk",
    )
    gain_sd: Number = Field(0.15, gt=0, lt=0.5, description="spread of the control gain")
    gain_return_time_s: Positive = Field(
        5e4, description="in which the control gain returns to the model's, s", alias="gain_time_s"
    )
    own_gain_spread: Number = Field(
        0.0, ge=0, lt=0.5, description="spread of each group's gain about the common", alias="own_gain_sd"
    )
    own_gain_return_s: Positive = Field(
        2000.0, description="in which that returns to the common gain, s", alias="own_gain_time_s"
    )
    quick_error_share: Share = Field(
        1.0,
        description="error of responses quicker than the fitted flights have, as a share of them",
        alias="quick_error",
    )
    max_trim_sd: Positive = Field(
        4.0, description="farthest the trim is adapted, in its spread", alias="trim_bound"
    )
    max_gain_sd: Positive = Field(
        3.0, description="farthest the gain is adapted, in its spread", alias="gain_bound"
    )
    command_delays_s: CoefRow = Field(
        [0.0],
        min_length=1,
        max_length=9,
        description="delays tried beside the model's, each under a sample",
        alias="delays_s",
    )
    jam_rate_offset_sd: Positive = Field(
        2.0, description="offset of the rates a sample by a stuck surface, in sd", alias="jam_sd"
    )
    effective_sample_share: Number = Field(
        1.0, gt=0, le=1, description="share of a white residual's information in this one", alias="power"
    )
    t_degrees_of_freedom: Number = Field(
        8.0,
        gt=2,
        le=_MAX_COEF,
        description="degrees of freedom of the residual's t distribution",
        alias="tail",
    )
    noise_scale_memory_s: Positive = Field(
        60.0, description="memory of the running scale of the residual, s", alias="noise_memory_s"
    )
    alarm_probability: OpenShare = Field(
        0.5, description="probability of a fault that raises the alarm", alias="alarm"
    )
    confirmation_s: NonNegative = Field(
        0.0, description="for how long the probability must stand, s", alias="hold_s"
    )
    false_alarms_per_hour: Number | None = Field(
        None, gt=0, le=_MAX_COEF, description="the rate that was asked for"
    )
    alarm_threshold: Number | None = Field(
        None,
        gt=0,
        le=_MAX_COEF,
        description="evidence for a fault that raises the alarm, instead of both: for that rate",
        alias="threshold",
    )
    name_evidence_ratio: AtLeastOne = Field(
        1.0, description="evidence for a name, over that for an alarm", alias="name_evidence"
    )
    rename_hold_s: NonNegative = Field(
        0.0, description="for how long another name stands before it counts, s", alias="rename_s"
    )
    one_faulty_group: bool = Field(
        False,
        description="whether one group alone is at fault: a name has every group that is not excluded",
        alias="one_group",
    )
    effectiveness_level_step: Number = Field(
        0.1, ge=0.01, le=0.5, description="step of the grid of effectiveness", alias="level_step"
    )
    credible_mass: OpenShare = Field(0.9, description="posterior mass inside the bounds", alias="bounds")


class FittedRanges(Section):
    """Ranges in which a model was fitted, and its errors on data that were not fitted: where it is
    credible."""

    command_ranges: CoefRows = Field(
        description="least and largest command of each surface, share of travel", alias="commands"
    )
    rate_ranges_rad_s: CoefRows = Field(description="least and largest p, q and r, rad/s", alias="rates")
    airspeed_range_mps: CoefRow | None = Field(
        default=None, description="least and largest airspeed, m/s", alias="airspeed"
    )
    rate_sd_rad_s: CoefRow = Field(
        default=[], description="standard deviation of p, q and r, rad/s", alias="spread"
    )
    tied_shares: CoefRow = Field(
        default=[],
        description="share of each group's effect that past, signals and other groups make up",
        alias="tied",
    )
    group_gain_sd: CoefRow = Field(
        default=[], description="standard error of each group's gain", alias="gain_sd"
    )
    longest_still_s: dict[str, Number] = Field(
        default={}, description="longest time each column stood still, s", alias="still_s"
    )
    misread_gain: NonNegative = Field(
        0.0,
        description="how much likelier at most a sample of a part not fitted was with its columns read "
        "wrongly, in natural logarithms",
        alias="misread",
    )
    unpowered_climb_mps: Number | None = Field(
        default=None, description="rate of the energy height as without power, m/s", alias="energy_climb"
    )
    alarm_peak_tail: PeakTail | None = Field(
        default=None, description="highest alarm statistic on parts not fitted", alias="tail"
    )

    @model_validator(mode="before")
    @classmethod
    def _drop_dead_keys(cls, data: object) -> object:
        """Model files of release 1.0.0 have keys that nothing reads any more."""
        if not isinstance(data, dict):
            return data
        return {key: value for key, value in data.items() if key not in _DEAD_KEYS}


class NoiseModel(Section):
    """The noise of some flights: another gyro, air or law colours what is not explained."""

    ma_coefficients: CoefRow = Field(
        min_length=1,
        max_length=1000,
        description="1, c1, ...: its moving average, newest first",
        alias="average",
    )
    residual_covariance: CoefRows = Field(
        description="covariance of the residual whitened by that, (3, 3), (rad/s)2", alias="noise"
    )
    ar_coefficients: CoefRows = Field(
        default=[],
        description="AR coefficients: the previous residuals predict the next, latest first, (3 L, 3)",
        alias="before",
    )
    covariance_inflation: AtLeastOne = Field(
        1.0,
        description="how many times as far, in squares, gains left out and other laws' differ",
        alias="wider",
    )
    misread_shares: list[ShareBelowOne] = Field(
        default=[],
        description="share of its effect by which the fit may misread each group in this noise",
        alias="misreads",
    )
    usual_quick_power: Number | None = Field(
        default=None,
        ge=0,
        le=_MAX_COEF,
        description="power of the quick part of the responses, in variances of the noise, that the fitted "
        "flights exceed in a tenth of their samples",
        alias="quick",
    )


class Model(Section):
    """How one vehicle's rates answer their own past and the commands, and how well that is known."""

    vehicle: Vehicle
    rate_hz: Number = Field(ge=0.1, le=1000)
    groups: list[Annotated[list[str], Field(min_length=1)]] = Field(
        min_length=1, max_length=_MAX_SURFACE_GROUPS, description="surfaces that move together when healthy"
    )
    n_rate_lags: Whole = Field(ge=1, le=50, alias="history")
    n_command_lags: Whole = Field(ge=1, le=50, alias="lags")
    intercept: CoefRow = Field(min_length=3, max_length=3)
    past_coefficients: CoefRows = Field(
        description="(3 history + regressor_columns x signal lags, 3)", alias="past"
    )
    command_response: list[CoefRows] = Field(
        description="(groups, lags, 3), a share of command to rad/s a sample", alias="response"
    )
    response_error: list[CoefRows] = Field(
        description="standard errors of `response`, colour included", alias="response_sd"
    )
    residual_covariance: CoefRows = Field(
        description="covariance of the residual, (3, 3), (rad/s)2", alias="noise"
    )
    noise_models: list[NoiseModel] = Field(
        default=[], description="noises that flights were seen to have, for `moving_air`", alias="colours"
    )
    settings: FilterSettings = FilterSettings()
    fitted_ranges: FittedRanges | None = Field(
        default=None, description="what it was fitted on; None: nothing is known", alias="fitted"
    )
    identification_results: dict[str, object] = Field(
        default={}, description="what it was found from, and how well", alias="identified"
    )

    @model_validator(mode="after")
    def _check_arrays(self) -> "Model":
        n_signals = len(self.vehicle.regressor_columns) * self.vehicle.n_signal_lags(self.n_rate_lags)
        n, n_past = len(self.past_coefficients), 3 * self.n_rate_lags + n_signals
        reason = f"has {n} rows, allowed: {n_past}, as `identify` writes them: identify it again"
        conflicts: list[Conflict] = [(("past",), reason)] * (n != n_past)
        conflicts += [*self._group_mistakes(), *self._shape_mistakes(n)]
        refuse(conflicts)  # before any of it is computed with
        refuse(self._covariance_mistakes())
        return self

    def _group_mistakes(self) -> Iterator[Conflict]:
        """Names that are no surface of the vehicle's, or are in two groups; levels of no group."""
        seen: set[str] = set()
        for i, group in enumerate(self.groups):
            for k, name in enumerate(group):
                if name not in self.vehicle.surfaces or name in seen:
                    reason = "is in two groups" if name in seen else "is no surface of the vehicle"
                    yield ("groups", i, k), f"{name!r:.60} {reason}, allowed: each surface once"
                seen.add(name)
        names = ["+".join(group) for group in self.groups]
        for name in self.settings.likely_levels:
            if name not in names:
                reason = f"{name!r:.60} is no group, allowed: {', '.join(names)}"
                yield ("settings", "levels", name), reason
        for k, delay_s in enumerate(self.settings.command_delays_s):
            if abs(delay_s) * self.rate_hz > 1.0 + 1e-9:
                yield ("settings", "delays_s", k), f"{delay_s:g} is too long, allowed: up to a sample, s"

    def _shape_mistakes(self, n_past: int) -> Iterator[Conflict]:
        """Arrays whose shape contradicts groups, lags and rates; empty ones of `fitted` are not checked."""
        G = len(self.groups)
        expected: list[tuple[Location, object, tuple[int, ...]]] = [
            (("past",), self.past_coefficients, (n_past, 3)),
            (("response",), self.command_response, (G, self.n_command_lags, 3)),
            (("response_sd",), self.response_error, (G, self.n_command_lags, 3)),
            (("noise",), self.residual_covariance, (3, 3)),
        ]
        for i, noise in enumerate(self.noise_models):
            at = ("colours", i)
            n_ar = -(-len(noise.ar_coefficients) // 3) * 3
            expected += [
                ((*at, "noise"), noise.residual_covariance, (3, 3)),
                ((*at, "before"), noise.ar_coefficients, (n_ar, 3)),
            ]
            if misreads := noise.misread_shares:
                expected += [((*at, "misreads"), misreads, (G,))]
            if noise.ma_coefficients[0] != 1.0:
                yield (*at, "average"), "does not begin with 1, allowed: 1, c1, ..."
        if (ranges := self.fitted_ranges) is not None:
            fitted: list[tuple[str, object, tuple[int, ...]]] = [
                ("commands", ranges.command_ranges, (len(ranges.command_ranges), 2)),
                ("rates", ranges.rate_ranges_rad_s, (3, 2)),
                ("airspeed", ranges.airspeed_range_mps, (2,)),
                ("spread", ranges.rate_sd_rad_s, (3,)),
                ("tied", ranges.tied_shares, (G,)),
                ("gain_sd", ranges.group_gain_sd, (G,)),
            ]  # fmt: skip
            expected += [(("fitted", key), array, shape) for key, array, shape in fitted if array]
        for key_path, array, shape in expected:
            if not _has_shape(array, shape):
                sizes = " x ".join(map(str, shape))
                yield key_path, f"has another shape, allowed: {sizes} numbers"

    def _covariance_mistakes(self) -> Iterator[Conflict]:
        """Covariances that are none, or that no arithmetic in 64 bits can invert; negative deviations."""
        covariances: list[tuple[Location, CoefRows]] = [(("noise",), self.residual_covariance)]
        covariances += [
            (("colours", i, "noise"), noise.residual_covariance) for i, noise in enumerate(self.noise_models)
        ]
        for key_path, rows in covariances:
            R = np.array(rows)
            if abs(R - R.T).max() > 1e-6 * abs(R).max():
                yield key_path, "is not symmetric, allowed: a covariance"
                continue
            smallest, *_, largest = np.linalg.eigvalsh(R)
            if smallest <= 0.0 or largest > _MAX_CONDITION_NUMBER * smallest:
                allowed = f"a covariance, conditioned to {_MAX_CONDITION_NUMBER:g}"
                yield key_path, f"is singular or nearly so, allowed: {allowed}"
        if np.min(self.response_error) < 0.0:
            yield ("response_sd",), "has a negative number, allowed: at least 0"
        ranges = self.fitted_ranges
        if ranges is not None and min((*ranges.group_gain_sd, *ranges.rate_sd_rad_s), default=0.0) < 0.0:
            yield ("fitted",), "gain_sd or spread has a negative number, allowed: at least 0"

    def with_single_noise(self, noise: NoiseModel) -> "Model":
        """The model with one of its noise models only."""
        return self.model_copy(update={"noise_models": [noise]})

    def with_noise_of(self, average: Sequence[float]) -> "Model":
        """The model with the noise fitted for flights of this moving average, times its `inflation_of`; the
        model itself where none was fitted.

        average: 1, c1, ..., the moving-average model of the residual's noise, newest first.
        """
        if self._noise_of(average) is None:
            return self
        R = self.inflation_of(average) * self.covariance_of_noise(average)
        return self.model_copy(update={"residual_covariance": R.tolist()})

    def covariance_of_noise(self, average: Sequence[float]) -> Floats:
        """Covariance (3, 3) of the noise fitted for flights of this moving average, (rad/s)2; that of all
        flights where none was fitted."""
        return np.array((self._noise_of(average) or self).residual_covariance)

    def _noises_of(self, average: Sequence[float]) -> list[NoiseModel]:
        return [noise for noise in self.noise_models if noise.ma_coefficients == list(average)]

    def _noise_of(self, average: Sequence[float]) -> NoiseModel | None:
        return next(iter(self._noises_of(average)), None)

    def inflation_of(self, average: Sequence[float]) -> float:
        """Factor on the covariance of the fitted noise, by which it covers parts that were not fitted."""
        noise = self._noise_of(average)
        return float(noise.covariance_inflation) if noise else 1.0

    def hidden_gain_error_sd(self, average: Sequence[float]) -> Floats:
        """By how much of its effect the fit may misread each group in the noise of this moving average, (G,);
        0 where that is not known."""
        errors = [noise.misread_shares for noise in self._noises_of(average) if noise.misread_shares]
        return np.array(errors[0]) if errors else np.zeros(len(self.groups))

    def usual_quick_power(self, average: Sequence[float]) -> float:
        """Power of the quick part of the responses that flights of this noise seldom exceed, in variances of
        the noise; infinite where that is not known."""
        powers = [
            noise.usual_quick_power
            for noise in self._noises_of(average)
            if noise.usual_quick_power is not None
        ]
        return powers[0] if powers else float("inf")

    def residual_ar_coefficients(self, average: Sequence[float]) -> Floats:
        """Autoregressive coefficients of the residual, (L, 3, 3), latest lag first; L is 0 if not fitted."""
        noises = self._noises_of(average)
        return np.reshape(np.array(noises[0].ar_coefficients if noises else []), (-1, 3, 3))

    def whitened_intercept(self, average: Sequence[float]) -> Floats:
        """The intercept less its prediction by `residual_ar_coefficients`, (3,)."""
        intercept = np.array(self.intercept)
        return np.asarray(intercept - intercept @ self.residual_ar_coefficients(average).sum(axis=0))

    def as_arrays(self) -> tuple[Floats, Floats, Floats, Floats]:
        """intercept (3,), past (m, 3), response (G, L, 3) and noise (3, 3) as arrays."""
        return (
            np.array(self.intercept),
            np.array(self.past_coefficients),
            np.array(self.command_response),
            np.array(self.residual_covariance),
        )


def _has_shape(lists: object, shape: tuple[int, ...]) -> bool:
    """Whether nested lists have these lengths, each."""
    if not shape:
        return not isinstance(lists, list)
    return (
        isinstance(lists, list)
        and len(lists) == shape[0]
        and all(_has_shape(element, shape[1:]) for element in lists)
    )


def load_model(path: Path) -> Model:
    """The model in a file. Raises ScenarioError with one line a mistake."""
    return read_file(Model, path, _MAX_FILE_BYTES)


def model_file_text(model: Model) -> str:
    """The model as the text of its file."""
    return model.model_dump_json(indent=1, by_alias=True) + "\n"
