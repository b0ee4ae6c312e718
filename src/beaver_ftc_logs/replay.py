"""Replay a log of `beaver-ftc run` through the diagnosis of its scenario, without JSBSim.

The log.parquet has the measured rates, the commands, and the true flow. If no other sensor than the gyros had
errors or failed, these were the inputs of the diagnosis in flight, and the verdicts are the same to the bit.
"""

from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.results import Document, Metrics, read_metrics
from beaver_ftc.scenario import TIME_TOLERANCE_S
from beaver_ftc.scenario.faults import of_a_sensor
from beaver_ftc_logs.readers.table import check_time, read_numbers
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.refusals import refusal


def is_log_of_run(path: Path) -> bool:
    """Whether a path is a log of `beaver-ftc run`, with its scenario in the same folder."""
    return path.name == "log.parquet" and path.with_name("scenario.yaml").is_file()


def replay_run_log(path: Path) -> tuple[Document, Document]:
    """Step the diagnosis through a log. Returns the columns of diagnosis.parquet by name, and the document of
    verdict.json. Raises BadInput if the log lacks an input of the diagnosis.
    """
    from beaver_ftc.loop import Diagnosis
    from beaver_ftc.scenario import load_scenario
    from beaver_ftc_logs import stepped

    scenario = load_scenario(path.with_name("scenario.yaml"))
    aircraft = scenario.airframe
    groups = [*stepped.input_columns(aircraft), ["altitude_m"]]
    names = ["t_s", *chain.from_iterable(groups)]
    log = read_numbers(path, [*names, "detected"])
    if missing := [name for name in names if name not in log]:
        raise refusal(path, f"no column {missing[0]}", "a log.parquet as `run` writes it")
    check_time(path, log["t_s"])
    diagnosis = Diagnosis(aircraft, scenario.rate_hz, **stepped.error_sections(scenario))
    arrays = [np.column_stack([log[name] for name in group]) for group in groups]
    replay = stepped.replay_samples(diagnosis, arrays, scenario.rate_hz)
    rows = stepped.rows_of_replay(log["t_s"], replay, aircraft.surfaces, scenario.fdi)
    return rows.table(aircraft.surfaces), _replay_verdict(path, scenario, log, replay.verdicts)


def _replay_verdict(path: Path, scenario: Any, log: dict[str, Floats], verdicts: list[Any]) -> Document:
    """The document of verdict.json: times of detection and isolation, whether they agree with metrics.json,
    and the number of rows whose alarm is not that of the log.
    """
    from beaver_ftc_logs.stepped import named_since

    t_s = log["t_s"]
    detected = [float(at_s) for at_s, verdict in zip(t_s, verdicts, strict=True) if verdict.detected]
    detection_s = detected[0] if detected else None
    isolation_s = named_since(t_s, verdicts)
    pairs = zip(log.get("detected", []), verdicts, strict=False)
    return {
        "flight": scenario.name,
        "replay": True,
        "duration_s": float(t_s[-1] - t_s[0]),
        "faulty": bool(detected),
        "credible": {"share": 1.0, "reasons": []},
        "detection_s": detection_s,
        "isolation_s": isolation_s,
        "isolated": verdicts[-1].isolated,
        "rows_that_differ": sum(bool(flag) != verdict.detected for flag, verdict in pairs),
        "left_out": _lacking_inputs(scenario),
        "as_flown": _is_as_flown(path, detection_s, isolation_s),
    }


def _lacking_inputs(scenario: Any) -> list[str]:
    """A line for each error or fault of a sensor that the diagnosis had in flight and the log lacks."""
    ideal = type(scenario.sensors)()
    flown = [scenario.sensors, *(change.sensors for change in scenario.changes if change.sensors)]
    errors = {name for sensors in flown for name, settings in sensors if settings != getattr(ideal, name)}
    broken = {fault.sensor for fault in scenario.faults if of_a_sensor(fault)}
    return [
        f"the {words} of {name}: the log has the true value"
        for words, names in (("declared errors", errors), ("fault", broken))
        for name, _ in scenario.sensors
        if name in names and name not in ("p", "q", "r")
    ]


def _is_as_flown(path: Path, *times_s: float | None) -> bool | None:
    """Whether the times of detection and isolation are those of metrics.json, which are rounded otherwise;
    None if there is no metrics.json beside the log. Raises BadInput if it cannot be read.
    """
    metrics_path = path.with_name("metrics.json")
    if not metrics_path.is_file():
        return None
    try:
        metrics = Metrics.of(read_metrics(metrics_path))
    except (OSError, ValueError):
        raise refusal(metrics_path, "cannot be read", "the metrics.json of the flight") from None
    flown_s = metrics.detection.time_s, metrics.isolation.time_s
    return all(
        flown is now if flown is None or now is None else abs(flown - now) < TIME_TOLERANCE_S
        for flown, now in zip(flown_s, times_s, strict=True)
    )


def as_text(verdict: Document) -> str:
    """The verdict of a replay as lines of text."""
    at_s = verdict["detection_s"]
    outcome = "nothing detected" if at_s is None else f"detected at {at_s:.2f} s"
    if verdict["isolated"]:
        outcome += f", {verdict['isolated']} isolated at {verdict['isolation_s']:.2f} s"
    texts = {True: "as flown", False: "not as flown", None: "nothing beside it to compare with"}
    lines = [f"{verdict['flight']}: {outcome}; {texts[verdict['as_flown']]}"]
    return "\n".join([*lines, *(f"  left out: {text}" for text in verdict["left_out"])])
