"""Diagnose a recorded flight with the design model of its aircraft: the diagnosis of the control loop, on the
measurements of the log.

If the aircraft is known, no model is identified. A scenario declares the errors. As long as they hold, the
log has the guarantees of the loop: no alarm in a healthy flight, no true fault excluded. There is no verdict
outside the aircraft's envelope, after a gap, and where a number is missing.
"""

from dataclasses import dataclass, field, replace
from itertools import combinations
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.diagnosis import Verdict
from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import findings, trust
from beaver_ftc_logs.diagnose import DiagnosisRows, reversed_command_error
from beaver_ftc_logs.recording import Floats, RecordedFlight
from beaver_ftc_logs.samples import Samples, convert_to_si, resample, values_and_mean_age_at
from beaver_ftc_logs.stepped import (
    ReplayedVerdicts,
    declared_error_sections,
    diagnosis_rows_from_replay,
    replay_samples,
)
from beaver_ftc_logs.vehicle import QuantityColumn, Vehicle

if TYPE_CHECKING:
    from beaver_ftc.loop import Diagnosis

Mask = NDArray[np.bool_]

_MAX_LOG_RATE_HZ, _MIN_LOG_RATE_HZ = 1000.0, 20.0
_MAX_RELATIVE_STEP_JITTER = 0.1
_MIN_STRETCH_SAMPLES = 50
_AIR_DENSITY_LIMITS_KG_M3 = (0.2, 1.6)
_MAX_COMMAND_TO_STOP_RATIO = 1.1
_UNANTICIPATED_FAULT_AT_START_WINDOW_S = 1.0
_ATTITUDE_ANGLE_NAMES = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class DiagnosedAircraft:
    """The aircraft whose flights are diagnosed, and the errors declared for it: arguments of `Diagnosis`."""

    aircraft: Aircraft
    declared_errors: Document = field(default_factory=dict)


def load_aircraft_and_declared_errors(aircraft_name: str, scenario: str | None = None) -> DiagnosedAircraft:
    """The aircraft with this name, and the errors that a scenario (file or name) declares; without a scenario
    the default ones. Raises BadInput if the scenario has another aircraft."""
    from beaver_ftc.aircraft import UnknownAircraft
    from beaver_ftc.scenario import find_aircraft, load_scenario

    try:
        aircraft = find_aircraft(aircraft_name, Path.cwd())
    except UnknownAircraft as error:
        raise BadInput(f"--aircraft: {error}") from None
    if scenario is None:
        return DiagnosedAircraft(aircraft)
    loaded_scenario = load_scenario(scenario)
    if loaded_scenario.fdi.sensor_monitor == "always":
        reason = "fdi.sensor_monitor: always wants accelerations, which a log has not, allowed: never"
        raise BadInput(f"--scenario {scenario}: {reason}")
    if loaded_scenario.fdi.scheme == "none":
        reason = "fdi.scheme is none, so no diagnosis would run, allowed: a scenario with a scheme"
        raise BadInput(f"--scenario {scenario}: {reason}")
    if loaded_scenario.airframe.name != aircraft.name:
        reason = f"flies {loaded_scenario.airframe.name}, allowed: a scenario of {aircraft.name}"
        raise BadInput(f"--scenario {scenario}: {reason}")
    return DiagnosedAircraft(loaded_scenario.airframe, declared_error_sections(loaded_scenario))


@dataclass(frozen=True)
class AircraftDiagnosisInputs:
    """A log as inputs of the diagnosis.

    rates_signals_commands_attitude: one array (n, ...) each, as `stepped.log_column_names_of_each_input`.
    mean_age_s_by_held_column: mean age of the values of each column that is held. has_missing_value (n,):
    rows in which an input is not a number. gap_free_stretches: first row and end of each stretch through
    which the diagnosis is stepped without a reset. full_deflection_rad (S,): what a command of 1 is in the
    log."""

    samples: Samples
    diagnosis: "Diagnosis"
    rate_hz: float
    rates_signals_commands_attitude: list[Floats]
    mean_age_s_by_held_column: dict[str, float]
    has_missing_value: Mask
    gap_free_stretches: list[tuple[int, int]]
    full_deflection_rad: Floats


def read_diagnosis_inputs(
    recording: RecordedFlight, vehicle: Vehicle, diagnosed_aircraft: DiagnosedAircraft
) -> AircraftDiagnosisInputs:
    """Read what the diagnosis is given. Raises BadInput for what the log lacks."""
    from beaver_ftc.loop import Diagnosis

    _check_log_has_inputs(recording, vehicle, diagnosed_aircraft.aircraft)
    samples = resample(
        recording,
        vehicle.model_copy(update={"max_rate_hz": _MAX_LOG_RATE_HZ, "reference_airspeed_mps": None}),
    )
    rate_hz = _log_rate_hz(samples)
    diagnosis = Diagnosis(diagnosed_aircraft.aircraft, rate_hz, **diagnosed_aircraft.declared_errors)
    needs_attitude = diagnosis.declared.air.moves
    rates_signals_commands_attitude, mean_age_s_by_held_column = _read_sample_inputs(
        samples, recording, vehicle, diagnosed_aircraft.aircraft, needs_attitude
    )
    _check_units_plausible(samples.name, rates_signals_commands_attitude, diagnosed_aircraft.aircraft)
    has_missing_value = np.asarray(~np.isfinite(np.hstack(rates_signals_commands_attitude)).all(axis=1))
    gap_free_stretches = _gap_free_stretches(samples, has_missing_value, rate_hz)
    if not gap_free_stretches:
        raise BadInput(
            f"{samples.name}: has no {_MIN_STRETCH_SAMPLES} samples in turn, evenly spaced and without a "
            "missing number, allowed: all signals logged at one rate of "
            f"{_MIN_LOG_RATE_HZ:g} to {_MAX_LOG_RATE_HZ:g} Hz"
        )
    surface_indices = _vehicle_surface_indices(vehicle, diagnosed_aircraft.aircraft)
    samples = replace(
        samples, commands=samples.commands[:, surface_indices], labels=samples.labels[:, surface_indices]
    )
    return AircraftDiagnosisInputs(
        samples,
        diagnosis,
        rate_hz,
        rates_signals_commands_attitude,
        mean_age_s_by_held_column,
        has_missing_value,
        gap_free_stretches,
        _full_deflection_rad(vehicle, diagnosed_aircraft.aircraft),
    )


def diagnose_with_aircraft_model(
    recording: RecordedFlight, vehicle: Vehicle, diagnosed_aircraft: DiagnosedAircraft
) -> tuple[Samples, DiagnosisRows, Document]:
    """The samples, the rows and the document of verdict.json. Raises BadInput for what the log lacks."""
    aircraft_inputs = read_diagnosis_inputs(recording, vehicle, diagnosed_aircraft)
    return aircraft_inputs.samples, *diagnose_aircraft_inputs(aircraft_inputs, diagnosed_aircraft)


def diagnose_aircraft_inputs(
    aircraft_inputs: AircraftDiagnosisInputs, diagnosed_aircraft: DiagnosedAircraft
) -> tuple[DiagnosisRows, Document]:
    """The rows and the document of verdict.json."""
    samples, aircraft = aircraft_inputs.samples, diagnosed_aircraft.aircraft
    replayed_flight_verdicts = _replay_flight(aircraft_inputs, aircraft)
    rows = _rows_of_replayed_flight(aircraft_inputs, aircraft, replayed_flight_verdicts)
    if rows.has_credible_alarm():
        _refuse_reversed_command_without_alarm(aircraft_inputs, aircraft, replayed_flight_verdicts, rows)
        _refuse_exchanged_commands_without_alarm(aircraft_inputs, aircraft, rows)
    return rows, _verdict_document(
        samples, rows, replayed_flight_verdicts, diagnosed_aircraft, aircraft_inputs.mean_age_s_by_held_column
    )


def _replay_flight(aircraft_inputs: AircraftDiagnosisInputs, aircraft: Aircraft) -> ReplayedVerdicts:
    """The verdicts of all samples. Raises BadInput if a command has the other sign in every part."""
    diagnosis = aircraft_inputs.diagnosis
    replayed_verdicts_by_stretch = []
    for begin, end in aircraft_inputs.gap_free_stretches:
        diagnosis.reset()
        replayed_verdicts_by_stretch.append(
            replay_samples(
                diagnosis,
                [array[begin:end] for array in aircraft_inputs.rates_signals_commands_attitude],
                aircraft_inputs.rate_hz,
            )
        )
    if not diagnosis.declared.air.moves:  # a law that answers gusts opposes what they turn
        _check_command_signs(aircraft_inputs.samples.name, aircraft, replayed_verdicts_by_stretch)
    return _join_stretch_verdicts(
        len(aircraft_inputs.samples.t_s),
        len(aircraft.surfaces),
        aircraft_inputs.gap_free_stretches,
        replayed_verdicts_by_stretch,
    )


def _rows_of_replayed_flight(
    aircraft_inputs: AircraftDiagnosisInputs, aircraft: Aircraft, replayed_flight_verdicts: ReplayedVerdicts
) -> DiagnosisRows:
    """The rows, without a verdict where the log is not credible."""
    t_s, gap_free_stretches = aircraft_inputs.samples.t_s, aircraft_inputs.gap_free_stretches
    rows = diagnosis_rows_from_replay(
        t_s, replayed_flight_verdicts, aircraft.surfaces, aircraft_inputs.diagnosis.config
    )
    rows_by_reason = _undiagnosable_rows_by_reason(
        aircraft_inputs.rates_signals_commands_attitude[1],
        aircraft,
        aircraft_inputs.has_missing_value,
        gap_free_stretches,
    ) | _rows_by_reason_after_unanticipated_start(t_s, gap_free_stretches, replayed_flight_verdicts)
    return rows.without_verdict(
        _drop_empty_add_doubtful_alarm_reason(gap_free_stretches, rows, rows_by_reason)
    )


def _refuse_reversed_command_without_alarm(
    aircraft_inputs: AircraftDiagnosisInputs,
    aircraft: Aircraft,
    replayed_flight_verdicts: ReplayedVerdicts,
    rows: DiagnosisRows,
) -> None:
    """Raise BadInput if the log has no alarm once the sign of a command is changed. With a fault the changed
    sign leaves a larger innovation, since no surface has a negative effectiveness."""
    for surface_index in np.flatnonzero(replayed_flight_verdicts.relative_command_gains < 0.0):
        rates, signals, commands, attitude = aircraft_inputs.rates_signals_commands_attitude
        signs = np.where(np.arange(len(aircraft.surfaces)) == surface_index, -1.0, 1.0)
        corrected_inputs = replace(
            aircraft_inputs, rates_signals_commands_attitude=[rates, signals, commands * signs, attitude]
        )
        corrected_rows = _rows_of_replayed_flight(
            corrected_inputs, aircraft, _replay_flight(corrected_inputs, aircraft)
        )
        if corrected_rows.are_healthy_where_credible_in(rows):
            raise reversed_command_error(
                aircraft_inputs.samples.name, aircraft.surfaces[surface_index], f"of {aircraft.name}"
            )


def _refuse_exchanged_commands_without_alarm(
    aircraft_inputs: AircraftDiagnosisInputs, aircraft: Aircraft, rows: DiagnosisRows
) -> None:
    """Raise BadInput if the log has no alarm once two commands are exchanged."""
    rates, signals, _, attitude = aircraft_inputs.rates_signals_commands_attitude
    for first, second in combinations(range(len(aircraft.surfaces)), 2):
        order = np.arange(len(aircraft.surfaces))
        order[[first, second]] = second, first
        exchanged_commands = aircraft_inputs.samples.commands[:, order] * aircraft_inputs.full_deflection_rad
        corrected_inputs = replace(
            aircraft_inputs, rates_signals_commands_attitude=[rates, signals, exchanged_commands, attitude]
        )
        if _raises_any_alarm(corrected_inputs):
            continue
        corrected_rows = _rows_of_replayed_flight(
            corrected_inputs, aircraft, _replay_flight(corrected_inputs, aircraft)
        )
        if corrected_rows.are_healthy_where_credible_in(rows):
            raise BadInput(
                f"{aircraft_inputs.samples.name}: if the commands of {aircraft.surfaces[first]} and "
                f"{aircraft.surfaces[second]} are exchanged, there is no alarm, allowed: commands as of "
                f"{aircraft.name}"
            )


def _raises_any_alarm(aircraft_inputs: AircraftDiagnosisInputs) -> bool:
    """Whether an alarm is raised in any stretch; nothing after it is replayed."""
    for begin, end in aircraft_inputs.gap_free_stretches:
        aircraft_inputs.diagnosis.reset()
        arrays = [
            np.ascontiguousarray(array[begin:end])
            for array in aircraft_inputs.rates_signals_commands_attitude
        ]
        if any(aircraft_inputs.diagnosis.step(*sample).detected for sample in zip(*arrays, strict=True)):
            return True
    return False


def _check_command_signs(
    flight_name: str, aircraft: Aircraft, replayed_verdicts_by_stretch: list[ReplayedVerdicts]
) -> None:
    """Raise BadInput if the rates respond to a command with the opposite sign in every part of a stretch."""
    for surface, gain_upper_bound in zip(
        aircraft.surfaces,
        np.min(
            [replayed.relative_command_gain_upper_bounds for replayed in replayed_verdicts_by_stretch], axis=0
        ),
        strict=True,
    ):
        if gain_upper_bound < trust.MAX_REVERSED_GAIN:
            reason = f"the rates answer the command of {surface} the other way round in all of it"
            raise BadInput(
                f"{flight_name}: {reason}, allowed: signs as of {aircraft.name}; does `scale: -1` fit?"
            )


def _check_log_has_inputs(recording: RecordedFlight, vehicle: Vehicle, aircraft: Aircraft) -> None:
    """Raise BadInput if the vehicle file or the log lacks an input of the aircraft's design model."""
    missing_surfaces = [name for name in aircraft.surfaces if name not in vehicle.surfaces]
    if missing_surfaces:
        reason = (
            f"surfaces: no {missing_surfaces[0]}, allowed: what the commands make of "
            f"{', '.join(aircraft.surfaces)}"
        )
        raise BadInput(f"vehicle {vehicle.name}: {reason}")
    if vehicle.airspeed is None:
        raise BadInput(f"vehicle {vehicle.name}: airspeed: is missing, allowed: its column, of true airspeed")
    flow_names = _flow_input_names(aircraft)
    for name in flow_names:
        if name not in vehicle.flow:
            reason = f"flow: no {name}, allowed: a column for each of {', '.join(flow_names)}"
            raise BadInput(f"vehicle {vehicle.name}: {reason}")
    for quantity_column in (vehicle.airspeed, *(vehicle.flow[name] for name in flow_names)):
        if quantity_column.column not in recording.columns:
            nearest_text = recording.nearest_column_names_text(quantity_column.column)
            reason = f"no column {quantity_column.column}, allowed: a log that has it; it has {nearest_text}"
            raise BadInput(f"{recording.name}: {reason}")


def _flow_input_names(aircraft: Aircraft) -> list[str]:
    return ["alpha_rad", "beta_rad", "qdyn_pa", *aircraft.signals]


def _vehicle_surface_indices(vehicle: Vehicle, aircraft: Aircraft) -> list[int]:
    """Place of each of the aircraft's surfaces among the vehicle's."""
    return [list(vehicle.surfaces).index(name) for name in aircraft.surfaces]


def _full_deflection_rad(vehicle: Vehicle, aircraft: Aircraft) -> Floats:
    return np.array([vehicle.full_deflection_rad.get(name, 1.0) for name in aircraft.surfaces])


def _log_rate_hz(samples: Samples) -> float:
    """Sample rate of the first samples, so that a log that was cut short has the same; four digits."""
    first_times_s = samples.t_s[:_MIN_STRETCH_SAMPLES]
    steps_s = np.diff(first_times_s)
    even_steps_s = steps_s[np.abs(steps_s / samples.dt_s - 1.0) < _MAX_RELATIVE_STEP_JITTER]
    rate_hz = float(f"{1.0 / (even_steps_s.mean() if len(even_steps_s) else samples.dt_s):.4g}")
    if not _MIN_LOG_RATE_HZ <= rate_hz <= _MAX_LOG_RATE_HZ:
        reason = f"an aircraft's model takes {_MIN_LOG_RATE_HZ:g} to {_MAX_LOG_RATE_HZ:g} Hz"
        raise BadInput(f"{samples.name}: is logged at {rate_hz:g} Hz, allowed: {reason}")
    return rate_hz


def _read_sample_inputs(
    samples: Samples, recording: RecordedFlight, vehicle: Vehicle, aircraft: Aircraft, needs_attitude: bool
) -> tuple[list[Floats], dict[str, float]]:
    """Rates, signals, commands and attitude at each sample, as `stepped.log_column_names_of_each_input`, and
    the mean age of the values of each held column, s. needs_attitude: if false, the attitude is zeros."""
    si_column_by_name = convert_to_si(recording, vehicle).columns
    mean_age_s_by_held_column = dict(samples.mean_age_s_by_held_column)

    def sample_values_and_store_age(quantity_column: QuantityColumn) -> Floats:
        values, mean_age_s = values_and_mean_age_at(
            si_column_by_name[quantity_column.column], samples.t_s, samples.dt_s
        )
        if mean_age_s is not None:
            mean_age_s_by_held_column[quantity_column.column] = mean_age_s
        return values

    alpha_rad, beta_rad, qdyn_pa, *signals_beyond_flow = (
        sample_values_and_store_age(vehicle.flow[name]) for name in _flow_input_names(aircraft)
    )
    assert vehicle.airspeed is not None  # as `_check_log_has_inputs` has seen
    signal_arrays = [
        alpha_rad,
        beta_rad,
        sample_values_and_store_age(vehicle.airspeed),
        qdyn_pa,
        *signals_beyond_flow,
    ]
    surface_indices = _vehicle_surface_indices(vehicle, aircraft)
    full_deflection_rad = _full_deflection_rad(vehicle, aircraft)
    attitude = np.zeros_like(samples.rates)
    if needs_attitude:
        for axis, angle_name in enumerate(_ATTITUDE_ANGLE_NAMES):
            quantity_column = getattr(vehicle.attitude, angle_name) if vehicle.attitude else None
            if quantity_column is None or quantity_column.column not in si_column_by_name:
                reason = "is missing, allowed: its column, where fdi.bounds declares turbulence"
                raise BadInput(f"{samples.name}: attitude.{angle_name}: {reason}")
            attitude[:, axis] = sample_values_and_store_age(quantity_column)
    return [
        samples.rates,
        np.column_stack(signal_arrays),
        samples.commands[:, surface_indices] * full_deflection_rad,
        attitude,
    ], mean_age_s_by_held_column


def _check_units_plausible(
    flight_name: str, rates_signals_commands_attitude: list[Floats], aircraft: Aircraft
) -> None:
    """Raise BadInput if the size of the flow or of the commands shows another unit."""
    signals, commands = rates_signals_commands_attitude[1], rates_signals_commands_attitude[2]
    for signal_index, name in enumerate(("alpha_rad", "beta_rad")):
        median_flow_angle_magnitude = _median_without_nan(np.abs(signals[:, signal_index]))
        if median_flow_angle_magnitude > 0.5 * pi:
            raise BadInput(
                f"{flight_name}: flow.{name} is {median_flow_angle_magnitude:.3g} in the middle, "
                "allowed: rad; `unit: deg`?"
            )
    is_flying = signals[:, 2] > 0.5 * aircraft.envelope.airspeed_mps[0]
    density_kg_m3 = 2.0 * signals[is_flying, 3] / signals[is_flying, 2] ** 2
    median_density_kg_m3 = _median_without_nan(density_kg_m3)
    if (
        density_kg_m3.size
        and not _AIR_DENSITY_LIMITS_KG_M3[0] < median_density_kg_m3 < _AIR_DENSITY_LIMITS_KG_M3[1]
    ):
        reason = f"airspeed and flow.qdyn_pa make a density of {median_density_kg_m3:.3g} kg/m3"
        allowed_text = "{:g} to {:g}".format(*_AIR_DENSITY_LIMITS_KG_M3)
        raise BadInput(f"{flight_name}: {reason}, allowed: {allowed_text}, true airspeed in m/s and Pa")
    for surface_index, surface in enumerate(aircraft.surfaces):
        travel = aircraft.travel[surface]
        max_deflection_rad = max(abs(travel.min_rad), abs(travel.max_rad))
        max_command_rad = np.nanmax(np.abs(commands[:, surface_index]), initial=0.0)
        if max_command_rad > _MAX_COMMAND_TO_STOP_RATIO * max_deflection_rad:
            reason = (
                f"the command of {surface} reaches {max_command_rad:.3g} rad, allowed: its stop, "
                f"{max_deflection_rad:.3g} rad"
            )
            raise BadInput(f"{flight_name}: {reason}; full_deflection_rad says what 1 is")


def _median_without_nan(values: Floats) -> float:
    """Median of the values that are numbers; nan if none is."""
    numbers = values[~np.isnan(values)]
    return float(np.median(numbers)) if numbers.size else float("nan")


def _gap_free_stretches(samples: Samples, has_missing_value: Mask, rate_hz: float) -> list[tuple[int, int]]:
    """First row and end of each stretch that is evenly spaced and has no missing number."""
    is_uneven_step = np.abs(np.diff(samples.t_s) * rate_hz - 1.0) > _MAX_RELATIVE_STEP_JITTER
    is_known = ~has_missing_value
    joins_next_row = is_known[1:] & is_known[:-1] & ~is_uneven_step
    stretch_edges = np.flatnonzero(np.diff(np.concatenate([[False], joins_next_row, [False]]).astype(int)))
    first_rows_and_last_rows_inclusive = zip(
        stretch_edges[::2].tolist(), stretch_edges[1::2].tolist(), strict=True
    )
    return [
        (first, last + 1)
        for first, last in first_rows_and_last_rows_inclusive
        if last + 1 - first >= _MIN_STRETCH_SAMPLES
    ]


def _join_stretch_verdicts(
    n_samples: int,
    n_surfaces: int,
    gap_free_stretches: list[tuple[int, int]],
    replayed_verdicts_by_stretch: list[ReplayedVerdicts],
) -> ReplayedVerdicts:
    """The diagnoses of the stretches as one of the flight. Rows between stretches have no alarm and bounds 0
    and 1."""
    verdicts = [Verdict()] * n_samples
    effectiveness_low = np.zeros((n_samples, n_surfaces))
    effectiveness_high = np.ones((n_samples, n_surfaces))
    least_gains, least_gain_upper_bounds = (
        np.min([getattr(replayed, name) for replayed in replayed_verdicts_by_stretch], axis=0)
        for name in ("relative_command_gains", "relative_command_gain_upper_bounds")
    )
    for (begin, end), replayed in zip(gap_free_stretches, replayed_verdicts_by_stretch, strict=True):
        verdicts[begin:end], effectiveness_low[begin:end], effectiveness_high[begin:end] = (
            replayed.verdicts,
            replayed.single_fault_effectiveness_low,
            replayed.single_fault_effectiveness_high,
        )
    return ReplayedVerdicts(
        verdicts, effectiveness_low, effectiveness_high, least_gains, least_gain_upper_bounds
    )


def _undiagnosable_rows_by_reason(
    signals: Floats, aircraft: Aircraft, has_missing_value: Mask, gap_free_stretches: list[tuple[int, int]]
) -> dict[str, Mask]:
    """For each reason the rows (n,) for which there is no verdict."""
    min_airspeed_mps, max_airspeed_mps = aircraft.envelope.airspeed_mps
    min_alpha_rad, max_alpha_rad = aircraft.alpha_rad
    is_outside_stretches = np.ones(len(signals), dtype=bool)
    for begin, end in gap_free_stretches:
        is_outside_stretches[begin:end] = False
    airspeed_mps, alpha_rad = signals[:, 2], signals[:, 0]
    return {
        "a number is missing": has_missing_value,
        "samples are not evenly spaced": is_outside_stretches & ~has_missing_value,
        f"airspeed is outside {min_airspeed_mps:g} to {max_airspeed_mps:g} m/s": (
            airspeed_mps < min_airspeed_mps
        )
        | (airspeed_mps > max_airspeed_mps),
        f"angle of attack is outside {min_alpha_rad:.3g} to {max_alpha_rad:.3g} rad": (
            alpha_rad < min_alpha_rad
        )
        | (alpha_rad > max_alpha_rad),
    }


def _rows_by_reason_after_unanticipated_start(
    t_s: Floats, gap_free_stretches: list[tuple[int, int]], replayed_flight_verdicts: ReplayedVerdicts
) -> dict[str, Mask]:
    """The rows (n,), with their reason, from the alarm on of stretches in which no fault explains the
    residuals within the first second."""
    is_after_unanticipated_fault_alarm = np.zeros(len(t_s), dtype=bool)
    for begin, end in gap_free_stretches:
        first_second_end_row = begin + int(
            np.searchsorted(t_s[begin:end], t_s[begin] + _UNANTICIPATED_FAULT_AT_START_WINDOW_S)
        )
        if any(
            verdict.isolated == "unanticipated"
            for verdict in replayed_flight_verdicts.verdicts[begin:first_second_end_row]
        ):
            first_alarm_row = next(
                k for k in range(begin, first_second_end_row) if replayed_flight_verdicts.verdicts[k].detected
            )
            is_after_unanticipated_fault_alarm[first_alarm_row:end] = True
    reason = (
        "no fault explains it from the first second on: another aircraft or loading, or undeclared errors"
    )
    return {reason: is_after_unanticipated_fault_alarm}


def _drop_empty_add_doubtful_alarm_reason(
    gap_free_stretches: list[tuple[int, int]], rows: DiagnosisRows, rows_by_reason: dict[str, Mask]
) -> dict[str, Mask]:
    """The reasons that have rows. If an alarm was raised in a row with a reason, the rest of its stretch gets
    a reason of its own."""
    has_reason = np.logical_or.reduce(list(rows_by_reason.values()))
    is_after_doubtful_alarm = np.zeros(len(rows.t_s), dtype=bool)
    for begin, end in gap_free_stretches:
        alarm_rows = begin + np.flatnonzero(rows.faulty[begin:end])
        if alarm_rows.size and has_reason[alarm_rows[0]]:
            is_after_doubtful_alarm[alarm_rows[0] : end] = True
    rows_by_reason = rows_by_reason | {
        "the alarm was raised where nothing can be said": is_after_doubtful_alarm & ~has_reason
    }
    return {
        reason: has_this_reason for reason, has_this_reason in rows_by_reason.items() if has_this_reason.any()
    }


def _verdict_document(
    samples: Samples,
    rows: DiagnosisRows,
    replayed_flight_verdicts: ReplayedVerdicts,
    diagnosed_aircraft: DiagnosedAircraft,
    mean_age_s_by_held_column: dict[str, float],
) -> Document:
    """The document of verdict.json."""
    surfaces = list(diagnosed_aircraft.aircraft.surfaces)
    alarm_rows = np.flatnonzero(rows.faulty)
    verdict_of_last_alarm_row = (
        replayed_flight_verdicts.verdicts[alarm_rows[-1]] if alarm_rows.size else Verdict()
    )
    alarm_rows_with_last_isolation = [
        k
        for k in alarm_rows.tolist()
        if replayed_flight_verdicts.verdicts[k].isolated == verdict_of_last_alarm_row.isolated
    ]
    held_column_notes = [
        f"{name} is held, {mean_age_s:.2g} s old on average: errors declared have to cover it"
        for name, mean_age_s in mean_age_s_by_held_column.items()
    ]
    return {
        "flight": samples.name,
        "aircraft": diagnosed_aircraft.aircraft.name,
        "declared": diagnosed_aircraft.declared_errors,
        "duration_s": float(samples.t_s[-1] - samples.t_s[0]),
        "recorded_s": len(samples.t_s) * samples.dt_s,
        "gaps": int(samples.stretch_number[-1]),
        "rate_hz": 1.0 / samples.dt_s,
        "faulty": bool(alarm_rows.size),
        "detection_s": float(samples.t_s[alarm_rows[0]]) if alarm_rows.size else None,
        "isolation_s": float(samples.t_s[alarm_rows_with_last_isolation[0]])
        if verdict_of_last_alarm_row.isolated
        else None,
        "isolated": verdict_of_last_alarm_row.isolated,
        "type": verdict_of_last_alarm_row.type,
        "estimate": verdict_of_last_alarm_row.estimate,
        "candidates": list(verdict_of_last_alarm_row.candidates),
        "credible": trust.credibility_entry(rows.not_credible_rows_by_reason, rows.credible),
        "events": findings.fault_events(rows, surfaces),
        "can_separate": _excluded_loss_sentences(rows, surfaces),
        "isolability": {"together": []},
        "notes": [*samples.notes, *held_column_notes],
    }


def _excluded_loss_sentences(rows: DiagnosisRows, surfaces: list[str]) -> list[str]:
    """One sentence for each surface: the loss of effectiveness that is excluded within a second in half of
    the healthy rows."""
    is_credible_without_alarm = (rows.faulty == 0) & (rows.credible == 1)
    if not is_credible_without_alarm.any():
        return []
    median_least_excluded_losses = 1.0 - np.median(rows.effectiveness_low[is_credible_without_alarm], axis=0)
    return [
        f"{name}: a loss of more than {100.0 * loss:.2g} % shows within a second in half of the flight."
        if loss < 1.0
        else f"{name}: in half of the flight not even a complete loss would show within a second."
        for name, loss in zip(surfaces, median_least_excluded_losses.tolist(), strict=True)
    ]


def as_text(verdict: Document) -> str:
    """The verdict in lines for people."""
    return f"{findings.as_text(verdict)}\n  report: {verdict['folder']}/report.html"
