"""Diagnose a recorded flight with the design model of its aircraft: the diagnosis of the control loop, on the
measurements of the log.

If the aircraft is known, no model is identified. A scenario declares the errors. As long as they hold, the
log has the guarantees of the loop: no alarm in a healthy flight, no true fault excluded. There is no verdict
outside the aircraft's envelope, after a gap, and where a number is missing.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from math import pi
from pathlib import Path

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.diagnosis import Verdict
from beaver_ftc.documents import BadInput
from beaver_ftc.loop import FLOW, Diagnosis
from beaver_ftc.results import Document
from beaver_ftc_logs import findings
from beaver_ftc_logs.column_mistakes import MAX_REVERSED_GAIN
from beaver_ftc_logs.diagnose import LogRows, reversed_command_error
from beaver_ftc_logs.recording import Column, Floats, Mask, Reasons, RecordedFlight, largest_magnitude
from beaver_ftc_logs.runs import Runs, true_runs
from beaver_ftc_logs.samples import Samples, convert_to_si, named_angles, resample
from beaver_ftc_logs.stepped import Replayed, error_sections, named_since, replay_samples, rows_of_replay
from beaver_ftc_logs.time_base import sample_column
from beaver_ftc_logs.vehicle import Vehicle

_MAX_HZ = 1000.0
_MIN_HZ = 20.0
_STEP_JITTER = 0.1
_MIN_SAMPLES = 50
_DENSITIES_KG_M3 = (0.2, 1.6)
_STOP_RATIO = 1.1
_START_WINDOW_S = 1.0
_ATTITUDE_ANGLE_NAMES = ("roll", "pitch", "yaw")


# The aircraft whose flights are diagnosed, and the errors declared for it: arguments of `Diagnosis`.
DiagnosedAircraft = tuple[Aircraft, Document]


def load_diagnosed(aircraft_name: str, scenario: str | None = None) -> DiagnosedAircraft:
    """The aircraft with this name, and the errors that a scenario (file or name) declares; without a scenario
    the default ones. Raises BadInput if the scenario has another aircraft."""
    from beaver_ftc.aircraft import UnknownAircraft
    from beaver_ftc.scenario import find_aircraft, load_scenario

    try:
        aircraft = find_aircraft(aircraft_name, Path.cwd())
    except UnknownAircraft as error:
        raise BadInput(f"--aircraft: {error}") from None
    if scenario is None:
        return aircraft, {}
    loaded = load_scenario(scenario)
    flown = loaded.airframe.name
    fdi = loaded.fdi
    refusals = (
        (
            fdi.sensor_monitor == "always",
            "fdi.sensor_monitor: always wants accelerations, which a log has not, allowed: never",
        ),
        (
            fdi.scheme == "none",
            "fdi.scheme is none, so no diagnosis would run, allowed: a scenario with a scheme",
        ),
        (flown != aircraft.name, f"flies {flown}, allowed: a scenario of {aircraft.name}"),
    )
    for applies, reason in refusals:
        if applies:
            raise BadInput(f"--scenario {scenario}: {reason}")
    return loaded.airframe, error_sections(loaded)


@dataclass(frozen=True)
class LogInputs:
    """A log as inputs of the diagnosis of an aircraft.

    input_arrays: one array (n, ...) each, as `stepped.input_columns`. held_age_s: mean age of the values of
    each column that is held. full_deflection_rad (S,): what a command of 1 is in the log."""

    samples: Samples
    aircraft: Aircraft
    diagnosis: Diagnosis
    rate_hz: float
    input_arrays: list[Floats]
    held_age_s: dict[str, float]
    full_deflection_rad: Floats

    @cached_property
    def has_missing_value(self) -> Mask:
        """Rows in which an input is not a number, (n,)."""
        return np.asarray(~np.isfinite(np.hstack(self.input_arrays)).all(axis=1))

    @cached_property
    def gap_free_stretches(self) -> Runs:
        """First row and end of each stretch through which the diagnosis is stepped without a reset: evenly
        spaced, and without a missing number."""
        uneven = np.abs(np.diff(self.samples.t_s) * self.rate_hz - 1.0) > _STEP_JITTER
        joins = ~(self.has_missing_value[1:] | self.has_missing_value[:-1] | uneven)
        return [(begin, end + 1) for begin, end in true_runs(joins) if end + 1 - begin >= _MIN_SAMPLES]

    def with_commands(self, commands: Floats) -> "LogInputs":
        """The inputs with other commands, rad."""
        rates, signals, _, attitude = self.input_arrays
        return replace(self, input_arrays=[rates, signals, commands, attitude])

    def stretches(self) -> Iterator[list[Floats]]:
        """The arrays of each stretch, each after a reset of the diagnosis."""
        for begin, end in self.gap_free_stretches:
            self.diagnosis.reset()
            yield [np.ascontiguousarray(array[begin:end]) for array in self.input_arrays]

    def raises_any_alarm(self) -> bool:
        """Whether an alarm is raised in any stretch; nothing after it is replayed."""
        steps = (zip(*arrays, strict=True) for arrays in self.stretches())
        return any(self.diagnosis.step(*sample).detected for stretch in steps for sample in stretch)

    def replay(self) -> Replayed:
        """The verdicts of all samples. Rows between stretches have no alarm and bounds 0 and 1. Raises
        BadInput if a command has the other sign in every part of a stretch."""
        replays = [replay_samples(self.diagnosis, arrays, self.rate_hz) for arrays in self.stretches()]
        gains = np.min([replay.command_gains for replay in replays], axis=0)
        upper = np.min([replay.command_gain_bounds for replay in replays], axis=0)
        if not self.diagnosis.declared.air.moves:  # a law that answers gusts opposes what they turn
            for surface, bound in zip(self.aircraft.surfaces, upper, strict=True):
                if bound < MAX_REVERSED_GAIN:
                    reason = f"the rates answer the command of {surface} the other way round in all of it"
                    allowed = f"signs as of {self.aircraft.name}; does `scale: -1` fit?"
                    raise BadInput(f"{self.samples.name}: {reason}, allowed: {allowed}")
        n = len(self.samples.t_s)
        verdicts = [Verdict()] * n
        low = np.zeros((n, len(gains)))
        high = np.ones((n, len(gains)))
        for (begin, end), replay in zip(self.gap_free_stretches, replays, strict=True):
            verdicts[begin:end] = replay.verdicts
            low[begin:end] = replay.alone_low
            high[begin:end] = replay.alone_high
        return Replayed(verdicts, low, high, gains, upper)

    def rows(self, replay: Replayed) -> LogRows:
        """The rows, without a verdict where the log is not credible."""
        rows = rows_of_replay(self.samples.t_s, replay, self.aircraft.surfaces, self.diagnosis.config)
        return rows.without_verdict(_doubtful_rows(self, replay, rows))


def _read_inputs(log: RecordedFlight, vehicle: Vehicle, given: DiagnosedAircraft) -> LogInputs:
    """Read what the diagnosis is given. Raises BadInput for what the log lacks."""
    aircraft, declared_errors = given
    flow_columns = _flow_columns(log, vehicle, aircraft)
    changes = {"max_rate_hz": _MAX_HZ, "reference_airspeed_mps": None}
    samples = resample(log, vehicle.model_copy(update=changes))
    rate_hz = _log_rate_hz(samples)
    diagnosis = Diagnosis(aircraft, rate_hz, **declared_errors)
    columns = convert_to_si(log, vehicle).columns
    ages = dict(samples.held_age_s)

    def sampled_at(name: str) -> Floats:
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
    arrays = [samples.rates, np.column_stack(list(flow.values())), commands, attitude]
    inputs = LogInputs(samples, aircraft, diagnosis, rate_hz, arrays, ages, full_rad)
    if not inputs.gap_free_stretches:
        raise BadInput(
            f"{samples.name}: has no {_MIN_SAMPLES} samples in turn, evenly spaced and without a missing "
            f"number, allowed: all signals logged at one rate of {_MIN_HZ:g} to {_MAX_HZ:g} Hz"
        )
    return inputs


def diagnose_aircraft(
    log: RecordedFlight, vehicle: Vehicle, given: DiagnosedAircraft
) -> tuple[LogInputs, LogRows, Document]:
    """The inputs, the rows and the document of verdict.json. Raises BadInput for what the log lacks, and if
    it has no alarm once the sign of a command is changed, or two commands are exchanged."""
    inputs = _read_inputs(log, vehicle, given)
    replay = inputs.replay()
    rows = inputs.rows(replay)
    if rows.has_credible_alarm():
        for corrected, error in _corrected_inputs(inputs, replay):
            if corrected.rows(corrected.replay()).clears_alarm(rows):
                raise error
    return inputs, rows, _verdict_document(inputs, rows, replay, given[1])


def _corrected_inputs(inputs: LogInputs, replay: Replayed) -> Iterator[tuple[LogInputs, BadInput]]:
    """The inputs with one mistake in the commands mended, and the error that says so. With a fault a changed
    sign leaves a larger innovation, since no surface has a negative effectiveness."""
    flight = inputs.samples.name
    aircraft = inputs.aircraft
    for s in np.flatnonzero(replay.command_gains < 0.0):
        commands = inputs.input_arrays[2] * np.where(np.arange(len(aircraft.surfaces)) == s, -1.0, 1.0)
        error = reversed_command_error(flight, aircraft.surfaces[s], f"of {aircraft.name}")
        yield inputs.with_commands(commands), error
    for first, second in combinations(range(len(aircraft.surfaces)), 2):
        order = np.arange(len(aircraft.surfaces))
        order[[first, second]] = second, first
        corrected = inputs.with_commands(inputs.samples.commands[:, order] * inputs.full_deflection_rad)
        if not corrected.raises_any_alarm():
            pair = f"{aircraft.surfaces[first]} and {aircraft.surfaces[second]}"
            reason = f"if the commands of {pair} are exchanged, there is no alarm"
            yield corrected, BadInput(f"{flight}: {reason}, allowed: commands as of {aircraft.name}")


def _flow_columns(log: RecordedFlight, vehicle: Vehicle, aircraft: Aircraft) -> dict[str, str]:
    """The column of each signal of the aircraft's design model, in their order in the inputs of the
    diagnosis. Raises BadInput if the vehicle file or the log lacks one."""
    missing = [name for name in aircraft.surfaces if name not in vehicle.surfaces]
    if missing:
        allowed = f"what the commands make of {', '.join(aircraft.surfaces)}"
        raise BadInput(f"vehicle {vehicle.name}: surfaces: no {missing[0]}, allowed: {allowed}")
    if vehicle.airspeed is None:
        raise BadInput(f"vehicle {vehicle.name}: airspeed: is missing, allowed: its column, of true airspeed")
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
    for name, angle in zip(_ATTITUDE_ANGLE_NAMES, named_angles(columns, vehicle), strict=True):
        if angle is None:
            reason = "is missing, allowed: its column, where fdi.bounds declares turbulence"
            raise BadInput(f"{flight}: attitude.{name}: {reason}")
        yield angle[0]


def _log_rate_hz(samples: Samples) -> float:
    """Sample rate of the first samples, so that a log that was cut short has the same; four digits."""
    steps_s = np.diff(samples.t_s[:_MIN_SAMPLES])
    even_s = steps_s[np.abs(steps_s / samples.dt_s - 1.0) < _STEP_JITTER]
    rate_hz = float(f"{1.0 / (even_s.mean() if len(even_s) else samples.dt_s):.4g}")
    if not _MIN_HZ <= rate_hz <= _MAX_HZ:
        reason = f"an aircraft's model takes {_MIN_HZ:g} to {_MAX_HZ:g} Hz"
        raise BadInput(f"{samples.name}: is logged at {rate_hz:g} Hz, allowed: {reason}")
    return rate_hz


def _check_plausible(flight: str, flow: Mapping[str, Floats], commands: Floats, aircraft: Aircraft) -> None:
    """Raise BadInput if the size of the flow or of the commands shows another unit."""
    for name in ("alpha_rad", "beta_rad"):
        median = _median_without_nan(np.abs(flow[name]))
        if median > 0.5 * pi:
            raise BadInput(f"{flight}: flow.{name} is {median:.3g} in the middle, allowed: rad; `unit: deg`?")
    airspeed = flow["airspeed_mps"]
    qdyn = flow["qdyn_pa"]
    flies = airspeed > 0.5 * aircraft.envelope.airspeed_mps[0]
    rho = _median_without_nan(2.0 * qdyn[flies] / airspeed[flies] ** 2)
    if rho <= _DENSITIES_KG_M3[0] or rho >= _DENSITIES_KG_M3[1]:
        reason = f"airspeed and flow.qdyn_pa make a density of {rho:.3g} kg/m3"
        allowed = "{:g} to {:g}".format(*_DENSITIES_KG_M3)
        raise BadInput(f"{flight}: {reason}, allowed: {allowed}, true airspeed in m/s and Pa")
    for surface, command in zip(aircraft.surfaces, commands.T, strict=True):
        travel = aircraft.travel[surface]
        stop_rad = max(abs(travel.min_rad), abs(travel.max_rad))
        max_rad = largest_magnitude(command)
        if max_rad > _STOP_RATIO * stop_rad:
            reason = f"the command of {surface} reaches {max_rad:.3g} rad"
            allowed = f"its stop, {stop_rad:.3g} rad"
            raise BadInput(f"{flight}: {reason}, allowed: {allowed}; full_deflection_rad says what 1 is")


def _median_without_nan(values: Floats) -> float:
    """Median of the values that are numbers; nan if none is."""
    numbers = values[~np.isnan(values)]
    return float(np.median(numbers)) if numbers.size else float("nan")


def _doubtful_rows(inputs: LogInputs, replay: Replayed, rows: LogRows) -> Reasons:
    """For each reason the rows (n,) for which there is no verdict."""
    aircraft = inputs.aircraft
    missing = inputs.has_missing_value
    (low_mps, high_mps) = aircraft.envelope.airspeed_mps
    (low, high) = aircraft.alpha_rad
    flow = dict(zip(FLOW, inputs.input_arrays[1].T, strict=False))  # the aircraft's own signals follow
    alpha = flow["alpha_rad"]
    airspeed = flow["airspeed_mps"]
    unexplained = np.zeros(len(alpha), dtype=bool)
    after = np.zeros_like(unexplained)
    outside = np.ones_like(unexplained)
    for begin, end in inputs.gap_free_stretches:
        outside[begin:end] = False
        t_s = rows.t_s[begin:end]
        first_verdicts = replay.verdicts[begin : begin + int(np.searchsorted(t_s, t_s[0] + _START_WINDOW_S))]
        if any(verdict.isolated == "unanticipated" for verdict in first_verdicts):
            detected = [verdict.detected for verdict in first_verdicts]
            unexplained[begin + detected.index(True) : end] = True
    cause = "another aircraft or loading, or undeclared errors"
    reasons = {
        "a number is missing": missing,
        "samples are not evenly spaced": outside & ~missing,
        f"airspeed is outside {low_mps:g} to {high_mps:g} m/s": (airspeed < low_mps) | (airspeed > high_mps),
        f"angle of attack is outside {low:.3g} to {high:.3g} rad": (alpha < low) | (alpha > high),
        f"no fault explains it from the first second on: {cause}": unexplained,
    }
    has_reason = np.logical_or.reduce(list(reasons.values()))
    for begin, end in inputs.gap_free_stretches:
        alarms = begin + np.flatnonzero(rows.faulty[begin:end])
        if alarms.size and has_reason[alarms[0]]:
            after[alarms[0] : end] = True
    return reasons | {"the alarm was raised where nothing can be said": after & ~has_reason}


def _verdict_document(
    inputs: LogInputs, rows: LogRows, replay: Replayed, declared_errors: Document
) -> Document:
    """The document of verdict.json."""
    samples = inputs.samples
    aircraft = inputs.aircraft
    surfaces = list(aircraft.surfaces)
    alarms = np.flatnonzero(rows.faulty).tolist()
    verdicts = [replay.verdicts[k] for k in alarms]
    last = verdicts[-1] if alarms else Verdict()
    held = [
        f"{name} is held, {age_s:.2g} s old on average: errors declared have to cover it"
        for name, age_s in inputs.held_age_s.items()
    ]
    return {
        "flight": samples.name,
        "aircraft": aircraft.name,
        "declared": declared_errors,
        **findings.span_entry(samples),
        "faulty": bool(alarms),
        "detection_s": float(samples.t_s[alarms[0]]) if alarms else None,
        "isolation_s": named_since(samples.t_s[alarms], verdicts),
        "isolated": last.isolated,
        "type": last.type,
        "estimate": last.estimate,
        "candidates": list(last.candidates),
        "credible": rows.credibility(),
        "events": findings.fault_events(rows, surfaces),
        "can_separate": _excluded_losses(rows, surfaces),
        "isolability": {"together": []},
        "notes": [*samples.notes, *held],
    }


def _excluded_losses(rows: LogRows, surfaces: list[str]) -> list[str]:
    """One sentence for each surface: the loss of effectiveness that is excluded within a second in half of
    the healthy rows."""
    quiet = (rows.faulty == 0) & (rows.credible == 1)
    if not quiet.any():
        return []
    losses = 1.0 - np.median(rows.effectiveness_low[quiet], axis=0)
    return [
        f"{name}: a loss of more than {100.0 * loss:.2g} % shows within a second in half of the flight."
        if loss < 0.995  # two digits are printed
        else f"{name}: in half of the flight not even a complete loss would show within a second."
        for name, loss in zip(surfaces, losses.tolist(), strict=True)
    ]
