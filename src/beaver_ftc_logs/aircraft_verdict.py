"""The verdict on a recorded flight that the design model of its aircraft diagnosed."""

import numpy as np

from beaver_ftc.diagnosis import Verdict
from beaver_ftc.results import Document
from beaver_ftc_logs import findings
from beaver_ftc_logs.aircraft_inputs import LogInputs
from beaver_ftc_logs.log_rows import LogRows
from beaver_ftc_logs.stepped import Replayed, named_since


def verdict_document(
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
