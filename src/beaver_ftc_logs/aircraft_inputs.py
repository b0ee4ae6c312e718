"""A log as inputs of the diagnosis of an aircraft, and the stretches that the diagnosis can step through."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import pi
from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.documents import BadInput
from beaver_ftc.loop import FLOW, Diagnosis
from beaver_ftc.results import Document
from beaver_ftc_logs.recording import Column, Floats, Mask, RecordedFlight, largest_magnitude
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.runs import Runs, true_runs
from beaver_ftc_logs.samples import Samples, convert_to_si, resample
from beaver_ftc_logs.time_base import sample_column
from beaver_ftc_logs.usable_columns import named_angles
from beaver_ftc_logs.vehicle import Vehicle

_MAX_HZ = 1000.0  # largest sample rate of a log
_MIN_HZ = 20.0  # least sample rate: a longer frame is too long for the aircraft's model
_STEP_JITTER = 0.1  # if a step differs from the usual one by a larger share, samples are not evenly spaced
_MIN_SAMPLES = 50  # least number of samples in a stretch
_DENSITIES_KG_M3 = (0.2, 1.6)  # range of the density of air at any height: a value outside shows another unit
_STOP_RATIO = 1.1  # a command that exceeds its stop by more is in another unit
# The aircraft whose flights are diagnosed, and the errors declared for it: arguments of `Diagnosis`.
DiagnosedAircraft = tuple[Aircraft, Document]


class InputArrays(NamedTuple):
    """The inputs of the diagnosis at each of n samples.

    rates (n, 3): measured p, q, r, rad/s. signals (n, ...): those of FLOW, then those of the aircraft's
    design model. commands (n, S), rad. attitude (n, 3): roll, pitch, yaw, rad; 0 if no turbulence is
    declared.
    """

    rates: Floats
    signals: Floats
    commands: Floats
    attitude: Floats


@dataclass(frozen=True)
class LogInputs:
    """A log as inputs of the diagnosis of an aircraft.

    held_age_s: mean age of the values of each column that is held. full_deflection_rad (S,): deflection of
    each surface for the command 1 in the log.
    """

    samples: Samples
    aircraft: Aircraft
    diagnosis: Diagnosis
    rate_hz: float
    input_arrays: InputArrays
    held_age_s: dict[str, float]
    full_deflection_rad: Floats

    @cached_property
    def has_missing_value(self) -> Mask:
        """Rows in which an input is not a number, (n,)."""
        return np.asarray(~np.isfinite(np.hstack(self.input_arrays)).all(axis=1))

    @cached_property
    def gap_free_stretches(self) -> Runs:
        """First row and end of each stretch through which the diagnosis is stepped without a reset: at least
        _MIN_SAMPLES, evenly spaced, and without a missing number."""
        uneven = np.abs(np.diff(self.samples.t_s) * self.rate_hz - 1.0) > _STEP_JITTER
        joins = ~(self.has_missing_value[1:] | self.has_missing_value[:-1] | uneven)
        return [(begin, end + 1) for begin, end in true_runs(joins) if end + 1 - begin >= _MIN_SAMPLES]

    def with_commands(self, commands: Floats) -> "LogInputs":
        """The inputs with other commands, rad."""
        return replace(self, input_arrays=self.input_arrays._replace(commands=commands))

    def stretches(self) -> Iterator[list[Floats]]:
        """The arrays of each stretch. Before each stretch, the diagnosis is reset."""
        for begin, end in self.gap_free_stretches:
            self.diagnosis.reset()
            yield [np.ascontiguousarray(array[begin:end]) for array in self.input_arrays]

    def raises_any_alarm(self) -> bool:
        """Whether an alarm is raised in any stretch. The replay ends with the first alarm."""
        steps = (zip(*arrays, strict=True) for arrays in self.stretches())
        return any(self.diagnosis.step(*sample).detected for stretch in steps for sample in stretch)


def read_inputs(log: RecordedFlight, vehicle: Vehicle, diagnosed: DiagnosedAircraft) -> LogInputs:
    """The inputs of the diagnosis from a log. diagnosed: the aircraft and the declared errors. Raises
    BadInput if the vehicle file or the log lacks an input, if the size of one shows another unit, or if no
    stretch is long enough."""
    aircraft, declared_errors = diagnosed
    flow_columns = _flow_columns(log, vehicle, aircraft)
    changes = {"max_rate_hz": _MAX_HZ, "reference_airspeed_mps": None}
    samples = resample(log, vehicle.model_copy(update=changes))
    rate_hz = _log_rate_hz(samples)
    diagnosis = Diagnosis(aircraft, rate_hz, **declared_errors)
    columns = convert_to_si(log, vehicle).columns
    ages = dict(samples.held_age_s)

    def sampled_at(name: str) -> Floats:
        """A column at the samples; if it is held, its mean age is added to `ages`."""
        values, age_s = sample_column(columns[name], samples.t_s, samples.dt_s)
        if age_s is not None:
            ages[name] = age_s
        return values

    flow = {name: sampled_at(column) for name, column in flow_columns.items()}
    places = [list(vehicle.surfaces).index(name) for name in aircraft.surfaces]
    full_rad = np.array([vehicle.full_deflection_rad.get(name, 1.0) for name in aircraft.surfaces])
    samples = replace(samples, commands=samples.commands[:, places], labels=samples.labels[:, places])
    commands = samples.commands * full_rad
    attitude = np.zeros_like(samples.rates)
    if diagnosis.declared.air.moves:
        angles = _attitude_columns(samples.name, columns, vehicle)
        attitude = np.column_stack([sampled_at(name) for name in angles])
    _check_plausible(samples.name, flow, commands, aircraft)
    arrays = InputArrays(samples.rates, np.column_stack(list(flow.values())), commands, attitude)
    inputs = LogInputs(samples, aircraft, diagnosis, rate_hz, arrays, ages, full_rad)
    if not inputs.gap_free_stretches:
        raise refusal(
            samples.name,
            f"has no {_MIN_SAMPLES} samples in turn, evenly spaced and without a missing number",
            f"all signals logged at one rate of {_MIN_HZ:g} to {_MAX_HZ:g} Hz",
        )
    return inputs


def _flow_columns(log: RecordedFlight, vehicle: Vehicle, aircraft: Aircraft) -> dict[str, str]:
    """The column of each signal of FLOW and of the aircraft's design model, in their order in the inputs of
    the diagnosis. Raises BadInput if the vehicle file or the log lacks one, or if the file lacks a
    surface."""
    missing = [name for name in aircraft.surfaces if name not in vehicle.surfaces]
    if missing:
        raise refusal(
            f"vehicle {vehicle.name}",
            f"surfaces: no {missing[0]}",
            f"what the commands make of {', '.join(aircraft.surfaces)}",
        )
    if vehicle.airspeed is None:
        raise refusal(f"vehicle {vehicle.name}", "airspeed: is missing", "its column, of true airspeed")
    signals = (*FLOW, *aircraft.signals)
    names = [name for name in signals if name != "airspeed_mps"]
    for name in names:
        if name not in vehicle.flow:
            reason = f"flow: no {name}, allowed: a column for each of {', '.join(names)}"
            raise BadInput(f"vehicle {vehicle.name}: {reason}")
    columns = {"airspeed_mps": vehicle.airspeed.column}
    columns |= {name: vehicle.flow[name].column for name in names}
    log.check_has(list(columns.values()))
    return {name: columns[name] for name in signals}


def _attitude_columns(flight: str, columns: dict[str, Column], vehicle: Vehicle) -> Iterator[str]:
    """The columns of the attitude angles. Raises BadInput for one that is missing."""
    for name, angle in zip(("roll", "pitch", "yaw"), named_angles(columns, vehicle), strict=True):
        if angle is None:
            reason = "is missing, allowed: its column, where fdi.bounds declares turbulence"
            raise BadInput(f"{flight}: attitude.{name}: {reason}")
        yield angle[0]


def _log_rate_hz(samples: Samples) -> float:
    """Sample rate, Hz, to four digits, of the first _MIN_SAMPLES samples, so that a log that was cut short
    has the same rate. Raises BadInput if it is not from _MIN_HZ to _MAX_HZ."""
    steps_s = np.diff(samples.t_s[:_MIN_SAMPLES])
    even_s = steps_s[np.abs(steps_s / samples.dt_s - 1.0) < _STEP_JITTER]
    rate_hz = float(f"{1.0 / (even_s.mean() if len(even_s) else samples.dt_s):.4g}")
    if not _MIN_HZ <= rate_hz <= _MAX_HZ:
        raise refusal(
            samples.name,
            f"is logged at {rate_hz:g} Hz",
            f"an aircraft's model takes {_MIN_HZ:g} to {_MAX_HZ:g} Hz",
        )
    return rate_hz


def _check_plausible(flight: str, flow: Mapping[str, Floats], commands: Floats, aircraft: Aircraft) -> None:
    """Raise BadInput if the size of the flow or of the commands shows another unit."""
    for name in ("alpha_rad", "beta_rad"):
        median = _median_without_nan(np.abs(flow[name]))
        if median > 0.5 * pi:
            raise refusal(flight, f"flow.{name} is {median:.3g} in the middle", "rad; `unit: deg`?")
    airspeed = flow["airspeed_mps"]
    qdyn = flow["qdyn_pa"]
    flies = airspeed > 0.5 * aircraft.envelope.airspeed_mps[0]
    rho = _median_without_nan(2.0 * qdyn[flies] / airspeed[flies] ** 2)
    if rho <= _DENSITIES_KG_M3[0] or rho >= _DENSITIES_KG_M3[1]:
        allowed = "{:g} to {:g}".format(*_DENSITIES_KG_M3)
        raise refusal(
            flight,
            f"airspeed and flow.qdyn_pa make a density of {rho:.3g} kg/m3",
            f"{allowed}, true airspeed in m/s and Pa",
        )
    for surface, command in zip(aircraft.surfaces, commands.T, strict=True):
        travel = aircraft.travel[surface]
        stop_rad = max(abs(travel.min_rad), abs(travel.max_rad))
        max_rad = largest_magnitude(command)
        if max_rad > _STOP_RATIO * stop_rad:
            allowed = f"its stop, {stop_rad:.3g} rad"
            raise refusal(
                flight,
                f"the command of {surface} reaches {max_rad:.3g} rad",
                f"{allowed}; full_deflection_rad says what 1 is",
            )


def _median_without_nan(values: Floats) -> float:
    """Median of the values that are numbers; nan if none is."""
    numbers = values[~np.isnan(values)]
    return float(np.median(numbers)) if numbers.size else float("nan")
