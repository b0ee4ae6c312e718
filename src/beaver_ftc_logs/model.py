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

_MAX_COEFFICIENT = 1e6  # of any coefficient: those of logs are below 100
_MAX_SURFACE_GROUPS = 24  # the filter tries all pairs
_MAX_CONDITION_NUMBER = 1e12  # of a covariance

Coefficient = Annotated[Number, Field(ge=-_MAX_COEFFICIENT, le=_MAX_COEFFICIENT)]
Row = list[Coefficient]
Matrix = list[Row]
Share = Annotated[Number, Field(ge=0, lt=1)]


class FilterSettings(Section):
    """Prior settings of the filter."""

    changes_per_hour: Number = Field(
        12.0, gt=0, le=_MAX_COEFFICIENT, description="how often a surface changes its effectiveness"
    )
    repair_share: Number = Field(0.1, ge=0, lt=1, description="share of the changes that restore health")
    levels: dict[str, Annotated[list[Share], Field(max_length=100)]] = Field(
        default={}, description="likelier levels of effectiveness, by group"
    )
    level_share: Number = Field(0.9, ge=0, le=1, description="share of faults at the likelier levels")
    trim_sd: Number = Field(
        0.5, gt=0, le=_MAX_COEFFICIENT, description="free spread of the trim between flights, in residual sd"
    )
    trim_shift: Number = Field(
        0.0, ge=0, le=_MAX_COEFFICIENT, description="spread of the trim as a shift of each group's command"
    )
    trim_walk: list[Annotated[Number, Field(ge=0, le=_MAX_COEFFICIENT)]] = Field(
        [3e-4] * 3, min_length=3, max_length=3, description="drift of the trim a sample, in residual sd"
    )
    gain_sd: Number = Field(0.15, gt=0, lt=0.5, description="spread of the control gain")
    gain_time_s: Number = Field(
        5e4, gt=0, le=_MAX_COEFFICIENT, description="in which the control gain returns to the model's, s"
    )
    own_gain_sd: Number = Field(0.0, ge=0, lt=0.5, description="spread of each group's gain about the common")
    own_gain_time_s: Number = Field(
        2000.0, gt=0, le=_MAX_COEFFICIENT, description="in which that returns to the common gain, s"
    )
    trim_bound: Number = Field(
        4.0, gt=0, le=_MAX_COEFFICIENT, description="farthest the trim is adapted, in its spread"
    )
    gain_bound: Number = Field(
        3.0, gt=0, le=_MAX_COEFFICIENT, description="farthest the gain is adapted, in its spread"
    )
    delays_s: Row = Field(
        [0.0], min_length=1, max_length=9, description="delays tried beside the model's, each under a sample"
    )
    jam_sd: Number = Field(
        2.0, gt=0, le=_MAX_COEFFICIENT, description="offset of the rates a sample by a stuck surface, in sd"
    )
    power: Number = Field(1.0, gt=0, le=1, description="share of a white residual's information in this one")
    tail: Number = Field(
        8.0, gt=2, le=_MAX_COEFFICIENT, description="degrees of freedom of the residual's t distribution"
    )
    noise_memory_s: Number = Field(
        60.0, gt=0, le=_MAX_COEFFICIENT, description="memory of the running scale of the residual, s"
    )
    alarm: Number = Field(0.5, gt=0, lt=1, description="probability of a fault that raises the alarm")
    hold_s: Number = Field(
        0.0, ge=0, le=_MAX_COEFFICIENT, description="for how long the probability must stand, s"
    )
    false_alarms_per_hour: Number | None = Field(
        None, gt=0, le=_MAX_COEFFICIENT, description="the rate that was asked for"
    )
    threshold: Number | None = Field(
        None,
        gt=0,
        le=_MAX_COEFFICIENT,
        description="evidence for a fault that raises the alarm, instead of both: for that rate",
    )
    name_evidence: Number = Field(
        1.0, ge=1, le=_MAX_COEFFICIENT, description="evidence for a name, over that for an alarm"
    )
    rename_s: Number = Field(
        0.0, ge=0, le=_MAX_COEFFICIENT, description="for how long another name stands before it counts, s"
    )
    one_group: bool = Field(False, description="whether a name is of the likeliest group alone")
    level_step: Number = Field(0.1, ge=0.01, le=0.5, description="step of the grid of effectiveness")
    bounds: Number = Field(0.9, gt=0, lt=1, description="posterior mass inside the bounds")


class FittedRanges(Section):
    """Ranges in which a model was fitted, and its errors on data that were not fitted: where it is
    credible."""

    commands: Matrix = Field(description="least and largest command of each surface, share of travel")
    rates: Matrix = Field(description="least and largest p, q and r, rad/s")
    airspeed: Row | None = Field(default=None, description="least and largest airspeed, m/s")
    spread: Row = Field(default=[], description="standard deviation of p, q and r, rad/s")
    correlation: Matrix = Field(default=[], description="correlation of the groups' commands")
    tied: Row = Field(
        default=[], description="share of each group's effect that past, signals and other groups make up"
    )
    gain_sd: Row = Field(default=[], description="standard error of each group's gain")
    column_sd: dict[str, Annotated[Number, Field(ge=0, le=_MAX_COEFFICIENT)]] = Field(
        default={}, description="standard error of the gain of what the rates answer to each rate and signal"
    )
    still_s: dict[str, Number] = Field(default={}, description="longest time each column stood still, s")
    scale: Number = Field(
        1.0, gt=0, le=_MAX_COEFFICIENT, description="largest scale of the noise on parts not fitted"
    )
    misread: Number = Field(
        0.0,
        ge=0,
        le=_MAX_COEFFICIENT,
        description="how much likelier at most a sample of a part not fitted was with its columns read "
        "wrongly, in natural logarithms",
    )
    energy_climb: Number | None = Field(
        default=None, description="rate of the energy height as without power, m/s"
    )
    minutes: Number = Field(0.0, ge=0, le=1e9, description="what was fitted, min")
    tail: PeakTail | None = Field(default=None, description="highest alarm statistic on parts not fitted")


class NoiseModel(Section):
    """The noise of some flights: another gyro, air or law colours what is not explained."""

    average: Row = Field(
        min_length=1, max_length=1000, description="1, c1, ...: its moving average, newest first"
    )
    noise: Matrix = Field(description="covariance of the residual whitened by that, (3, 3), (rad/s)2")
    before: Matrix = Field(
        default=[],
        description="AR coefficients: the previous residuals predict the next, latest first, (3 L, 3)",
    )
    wider: Number = Field(
        1.0,
        ge=1,
        le=_MAX_COEFFICIENT,
        description="how many times as far, in squares, gains left out and other laws' differ",
    )


class Model(Section):
    """How one vehicle's rates answer their own past and the commands, and how well that is known."""

    vehicle: Vehicle
    rate_hz: Number = Field(ge=0.1, le=1000)
    groups: list[Annotated[list[str], Field(min_length=1)]] = Field(
        min_length=1, max_length=_MAX_SURFACE_GROUPS, description="surfaces that move together when healthy"
    )
    history: Whole = Field(ge=1, le=50)
    lags: Whole = Field(ge=1, le=50)
    intercept: Row = Field(min_length=3, max_length=3)
    past: Matrix = Field(description="(3 history + signal_regressor_names x signal lags, 3)")
    response: list[Matrix] = Field(description="(groups, lags, 3), a share of command to rad/s a sample")
    response_sd: list[Matrix] = Field(description="standard errors of `response`, colour included")
    noise: Matrix = Field(description="covariance of the residual, (3, 3), (rad/s)2")
    colours: list[NoiseModel] = Field(
        default=[], description="noises that flights were seen to have, for `moving_air`"
    )
    settings: FilterSettings = FilterSettings()
    fitted: FittedRanges | None = Field(
        default=None, description="what it was fitted on; None: nothing is known"
    )
    identified: dict[str, object] = Field(default={}, description="what it was found from, and how well")

    @model_validator(mode="after")
    def _check_consistent(self) -> "Model":
        rows = 3 * self.history + len(self.vehicle.signal_regressor_names) * self.vehicle.n_signal_lags(
            self.history
        )
        says = f"has {len(self.past)} rows, allowed: {rows}, as `identify` writes them: identify it again"
        conflicts: list[Conflict] = [(("past",), says)] * (len(self.past) != rows)
        conflicts += [*self._group_conflicts(), *self._shape_conflicts(len(self.past))]
        refuse(conflicts)  # before any of it is computed with
        refuse(self._noise_conflicts())
        return self

    def _group_conflicts(self) -> Iterator[Conflict]:
        """Names that are no surface of the vehicle's, or are in two groups; levels of no group."""
        seen: set[str] = set()
        for i, group in enumerate(self.groups):
            for k, name in enumerate(group):
                if name not in self.vehicle.surfaces or name in seen:
                    what = "is in two groups" if name in seen else "is no surface of the vehicle"
                    yield ("groups", i, k), f"{name!r:.60} {what}, allowed: each surface once"
                seen.add(name)
        known = ["+".join(group) for group in self.groups]
        for name in self.settings.levels:
            if name not in known:
                says = f"{name!r:.60} is no group, allowed: {', '.join(known)}"
                yield ("settings", "levels", name), says
        for k, delay_s in enumerate(self.settings.delays_s):
            if abs(delay_s) * self.rate_hz > 1.0 + 1e-9:
                yield ("settings", "delays_s", k), f"{delay_s:g} is too long, allowed: up to a sample, s"

    def _shape_conflicts(self, rows: int) -> Iterator[Conflict]:
        """Arrays whose shape contradicts groups, lags and rates; empty ones of `fitted` are not checked."""
        count = len(self.groups)
        shapes: list[tuple[Location, object, tuple[int, ...]]] = [
            (("past",), self.past, (rows, 3)),
            (("response",), self.response, (count, self.lags, 3)),
            (("response_sd",), self.response_sd, (count, self.lags, 3)),
            (("noise",), self.noise, (3, 3)),
        ]
        for i, colour in enumerate(self.colours):
            at = ("colours", i)
            lengths = -(-len(colour.before) // 3) * 3
            shapes += [((*at, "noise"), colour.noise, (3, 3)), ((*at, "before"), colour.before, (lengths, 3))]
            if colour.average[0] != 1.0:
                yield (*at, "average"), "does not begin with 1, allowed: 1, c1, ..."
        if (fitted := self.fitted) is not None:
            optional: list[tuple[str, object, tuple[int, ...]]] = [
                ("commands", fitted.commands, (len(fitted.commands), 2)), ("rates", fitted.rates, (3, 2)),
                ("airspeed", fitted.airspeed, (2,)), ("spread", fitted.spread, (3,)),
                ("correlation", fitted.correlation, (count, count)), ("tied", fitted.tied, (count,)),
                ("gain_sd", fitted.gain_sd, (count,)),
            ]  # fmt: skip
            shapes += [(("fitted", key), given, shape) for key, given, shape in optional if given]
        for where, given, shape in shapes:
            if not _has_shape(given, shape):
                size = " x ".join(map(str, shape))
                yield where, f"has another shape, allowed: {size} numbers"

    def _noise_conflicts(self) -> Iterator[Conflict]:
        """Covariances that are none, or that no arithmetic in 64 bits can invert; negative deviations."""
        noises: list[tuple[Location, Matrix]] = [(("noise",), self.noise)]
        noises += [(("colours", i, "noise"), colour.noise) for i, colour in enumerate(self.colours)]
        for where, given in noises:
            noise = np.array(given)
            if abs(noise - noise.T).max() > 1e-6 * abs(noise).max():
                yield where, "is not symmetric, allowed: a covariance"
                continue
            least, *_, largest = np.linalg.eigvalsh(noise)
            if least <= 0.0 or largest > _MAX_CONDITION_NUMBER * least:
                yield (
                    where,
                    "is singular or nearly so, allowed: a covariance, conditioned to "
                    f"{_MAX_CONDITION_NUMBER:g}",
                )
        if np.min(self.response_sd) < 0.0:
            yield ("response_sd",), "has a negative number, allowed: at least 0"
        fitted = self.fitted
        if fitted is not None and any(value < 0.0 for value in (*fitted.gain_sd, *fitted.spread)):
            yield ("fitted",), "gain_sd or spread has a negative number, allowed: at least 0"

    def with_single_noise_model(self, colour: NoiseModel) -> "Model":
        """The model with one colour of its noise only."""
        return self.model_copy(update={"colours": [colour]})

    def with_noise_model(self, average: Sequence[float]) -> "Model":
        """The model with the noise fitted for flights of this moving average, times its `noise_inflation`;
        the model itself where none was fitted.

        average: 1, c1, ..., the moving-average model of the residual's noise, newest first.
        """
        known = [np.array(one.noise) for one in self.colours if one.average == list(average)]
        if not known:
            return self
        return self.model_copy(update={"noise": (self.noise_inflation(average) * known[0]).tolist()})

    def noise_inflation(self, average: Sequence[float]) -> float:
        """Factor on the covariance of the fitted noise, by which it covers parts that were not fitted."""
        return next((float(one.wider) for one in self.colours if one.average == list(average)), 1.0)

    def noise_predictor(self, average: Sequence[float]) -> Floats:
        """Autoregressive coefficients of the residual, (L, 3, 3), latest lag first; L is 0 if not fitted."""
        known = [one.before for one in self.colours if one.average == list(average)]
        return np.reshape(np.array(known[0] if known else []), (-1, 3, 3))

    def whitened_intercept(self, average: Sequence[float]) -> Floats:
        """The intercept less its prediction by `noise_predictor`, (3,)."""
        constant = np.array(self.intercept)
        return np.asarray(constant - constant @ self.noise_predictor(average).sum(axis=0))

    def coefficient_arrays(self) -> tuple[Floats, Floats, Floats, Floats]:
        """intercept (3,), past (m, 3), response (G, L, 3) and noise (3, 3) as arrays."""
        return np.array(self.intercept), np.array(self.past), np.array(self.response), np.array(self.noise)


def _has_shape(given: object, shape: tuple[int, ...]) -> bool:
    """Whether nested lists have these lengths, each."""
    if not shape:
        return not isinstance(given, list)
    return (
        isinstance(given, list)
        and len(given) == shape[0]
        and all(_has_shape(one, shape[1:]) for one in given)
    )


def load_model(path: Path) -> Model:
    """The model in a file. Raises ScenarioError with one line a mistake."""
    return read_file(Model, path, _MAX_FILE_BYTES)


def as_text(model: Model) -> str:
    """The model as the text of its file."""
    return model.model_dump_json(indent=1) + "\n"
