"""Diagnose a recorded flight with the design model of its aircraft: the diagnosis of the control loop runs on
the measurements of the log.

No model is identified. A scenario declares the errors. As long as they hold, the diagnosis has the guarantees
of the loop: no alarm in a healthy flight, no true fault excluded. There is no verdict outside the aircraft's
envelope, where a number is missing, or where samples are not evenly spaced.
"""

from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import numpy as np

from beaver_ftc.diagnosis import Verdict
from beaver_ftc.documents import BadInput
from beaver_ftc.loop import FLOW
from beaver_ftc.results import Document
from beaver_ftc_logs.aircraft_inputs import DiagnosedAircraft, LogInputs, read_inputs
from beaver_ftc_logs.aircraft_verdict import verdict_document
from beaver_ftc_logs.column_mistakes import MAX_REVERSED_GAIN
from beaver_ftc_logs.diagnose import reversed_command_error
from beaver_ftc_logs.log_rows import LogRows
from beaver_ftc_logs.recording import Floats, Mask, Reasons, RecordedFlight
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.stepped import Replayed, error_sections, replay_samples, rows_of_replay
from beaver_ftc_logs.vehicle import Vehicle

# If no fault explains an alarm in this first part of a stretch, the model or the declared errors are wrong.
_START_WINDOW_S = 1.0


def load_diagnosed(aircraft_name: str, scenario: str | None = None) -> DiagnosedAircraft:
    """The aircraft with this name, and the errors that a scenario (file or name) declares; without a scenario
    the default ones. Raises BadInput if there is no such aircraft, or if the scenario has another aircraft,
    no scheme, or the setting `sensor_monitor: always`."""
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
    reason = ""
    if fdi.sensor_monitor == "always":
        reason = "fdi.sensor_monitor: always wants accelerations, which a log has not, allowed: never"
    elif fdi.scheme == "none":
        reason = "fdi.scheme is none, so no diagnosis would run, allowed: a scenario with a scheme"
    elif flown != aircraft.name:
        reason = f"flies {flown}, allowed: a scenario of {aircraft.name}"
    if reason:
        raise BadInput(f"--scenario {scenario}: {reason}")
    return loaded.airframe, error_sections(loaded)


def diagnose_aircraft(
    log: RecordedFlight, vehicle: Vehicle, diagnosed: DiagnosedAircraft
) -> tuple[LogInputs, LogRows, Document]:
    """The inputs, the rows and the document of verdict.json. diagnosed: the aircraft and the declared errors.
    Raises BadInput for an input that the log lacks, and if an alarm vanishes once the sign of a command is
    changed or two commands are exchanged."""
    inputs = read_inputs(log, vehicle, diagnosed)
    replay = _replay(inputs)
    rows = _credible_rows(inputs, replay)
    if rows.has_credible_alarm():
        for corrected, error in _corrected_inputs(inputs, replay):
            if _credible_rows(corrected, _replay(corrected)).clears_alarm(rows):
                raise error
    return inputs, rows, verdict_document(inputs, rows, replay, diagnosed[1])


def _replay(inputs: LogInputs) -> Replayed:
    """The verdicts of all samples. Rows between stretches have no alarm and bounds 0 and 1. The gains and
    their upper bounds are the least of all stretches. Raises BadInput if, in still air, a command has the
    opposite effect."""
    replays = [replay_samples(inputs.diagnosis, arrays, inputs.rate_hz) for arrays in inputs.stretches()]
    upper = np.min([replay.command_gain_bounds for replay in replays], axis=0)
    if not inputs.diagnosis.declared.air.moves:  # a law that reacts to gusts commands against their effect
        _refuse_reversed(inputs, upper)
    n = len(inputs.samples.t_s)
    verdicts = [Verdict()] * n
    low = np.zeros((n, len(upper)))
    high = np.ones_like(low)
    for (begin, end), replay in zip(inputs.gap_free_stretches, replays, strict=True):
        verdicts[begin:end] = replay.verdicts
        low[begin:end] = replay.alone_low
        high[begin:end] = replay.alone_high
    gains = np.min([replay.command_gains for replay in replays], axis=0)
    return Replayed(verdicts, low, high, gains, upper)


def _refuse_reversed(inputs: LogInputs, upper: Floats) -> None:
    """Raise BadInput for a surface whose command certainly has the opposite effect. upper (S,): upper bounds
    of the gains, 1 in the aircraft's model."""
    name = inputs.aircraft.name
    for surface, bound in zip(inputs.aircraft.surfaces, upper, strict=True):
        if bound < MAX_REVERSED_GAIN:
            raise refusal(
                inputs.samples.name,
                f"the rates answer the command of {surface} the other way round in all of it",
                f"signs as of {name}; does `scale: -1` fit?",
            )


def _credible_rows(inputs: LogInputs, replay: Replayed) -> LogRows:
    """The rows, without a verdict where the log is not credible."""
    rows = rows_of_replay(inputs.samples.t_s, replay, inputs.aircraft.surfaces, inputs.diagnosis.config)
    return rows.without_verdict(_doubtful_rows(inputs, replay, rows))


def _corrected_inputs(inputs: LogInputs, replay: Replayed) -> Iterator[tuple[LogInputs, BadInput]]:
    """The inputs with one mistake in the commands mended, and the error for this mistake: the sign of a
    command with a negative gain, or two commands whose exchange clears every alarm. In a flight with a fault,
    a changed sign makes the innovation larger, since no surface has a negative effectiveness."""
    flight = inputs.samples.name
    aircraft = inputs.aircraft
    for s in np.flatnonzero(replay.command_gains < 0.0):
        commands = inputs.input_arrays.commands * np.where(np.arange(len(aircraft.surfaces)) == s, -1.0, 1.0)
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


def _doubtful_rows(inputs: LogInputs, replay: Replayed, rows: LogRows) -> Reasons:
    """Reason -> rows (n,) for which there is no verdict. If the alarm of a stretch was raised in such a row,
    all later rows of the stretch are without a verdict too."""
    aircraft = inputs.aircraft
    missing = inputs.has_missing_value
    low_mps, high_mps = aircraft.envelope.airspeed_mps
    low, high = aircraft.alpha_rad
    flow = dict(zip(FLOW, inputs.input_arrays.signals.T, strict=False))  # the aircraft's own signals follow
    alpha = flow["alpha_rad"]
    airspeed = flow["airspeed_mps"]
    outside = np.ones(len(alpha), dtype=bool)
    for begin, end in inputs.gap_free_stretches:
        outside[begin:end] = False
    cause = "another aircraft or loading, or undeclared errors"
    reasons = {
        "a number is missing": missing,
        "samples are not evenly spaced": outside & ~missing,
        f"airspeed is outside {low_mps:g} to {high_mps:g} m/s": (airspeed < low_mps) | (airspeed > high_mps),
        f"angle of attack is outside {low:.3g} to {high:.3g} rad": (alpha < low) | (alpha > high),
        f"no fault explains it from the first second on: {cause}": _unexplained_rows(inputs, replay),
    }
    has_reason = np.logical_or.reduce(list(reasons.values()))
    later_rows = np.zeros_like(outside)
    for begin, end in inputs.gap_free_stretches:
        alarms = begin + np.flatnonzero(rows.faulty[begin:end])
        if alarms.size and has_reason[alarms[0]]:
            later_rows[alarms[0] : end] = True
    return reasons | {"the alarm was raised where nothing can be said": later_rows & ~has_reason}


def _unexplained_rows(inputs: LogInputs, replay: Replayed) -> Mask:
    """Whether no fault type explains the innovation (n,): the rows from the alarm on in each stretch whose
    verdict is `unanticipated` within _START_WINDOW_S of its begin."""
    t_s = inputs.samples.t_s
    unexplained = np.zeros(len(t_s), dtype=bool)
    for begin, end in inputs.gap_free_stretches:
        n_first = int(np.searchsorted(t_s[begin:end], t_s[begin] + _START_WINDOW_S))
        first_verdicts = replay.verdicts[begin : begin + n_first]
        if any(verdict.isolated == "unanticipated" for verdict in first_verdicts):
            detected = [verdict.detected for verdict in first_verdicts]
            unexplained[begin + detected.index(True) : end] = True
    return unexplained
