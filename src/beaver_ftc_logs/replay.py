"""A flight of our own once more through the diagnosis that flew it: its log.parquet, without JSBSim.

What the log has are the measured rates, the commands and the flow as the aircraft had it: where no errors of
the flow sensors were declared, that is what the diagnosis was given, and the verdicts are the same to the
bit.
"""

import json
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc.scenario import TIME_TOLERANCE_S
from beaver_ftc_logs.readers.table import check_time, read_numbers
from beaver_ftc_logs.recording import Floats


def is_own_log(path: Path) -> bool:
    """Whether a path is the log of one of our runs, with its scenario beside it."""
    return path.name == "log.parquet" and path.with_name("scenario.yaml").is_file()


def replay(path: Path) -> tuple[dict[str, Any], Document]:
    """Step the diagnosis through a log: columns of diagnosis.parquet by name, and the document of
    verdict.json. Raises BadInput where the flight's diagnosis was none of ours."""
    from beaver_ftc.loop import Diagnosis
    from beaver_ftc.scenario import load_scenario
    from beaver_ftc_logs import stepped

    scenario = load_scenario(path.with_name("scenario.yaml"))
    aircraft = scenario.airframe
    inputs = [*stepped.inputs_of(aircraft), ["altitude_m"]]
    log = _columns_of(path, ["t_s", *chain.from_iterable(inputs)])
    diagnosis = Diagnosis(aircraft, scenario.rate_hz, **stepped.declared_of(scenario))
    given = [np.column_stack([log[name] for name in names]) for names in inputs]
    found = stepped.step_through(diagnosis, given, scenario.rate_hz)
    rows = stepped.rows_of(log["t_s"], found, aircraft.surfaces, scenario.fdi)
    return columns(rows, aircraft.surfaces), _verdict(path, scenario, log, found.verdicts)


def _columns_of(path: Path, names: list[str]) -> dict[str, Floats]:
    """These columns of a log, and what it says of its own detection if it does."""
    log = read_numbers(path, [*names, "detected"])
    missing = [name for name in names if name not in log]
    if missing:
        raise BadInput(f"{path}: no column {missing[0]}, allowed: a log.parquet as `run` writes it")
    check_time(path, log["t_s"])
    return log


def columns(rows: Any, surfaces: Sequence[str]) -> dict[str, Any]:
    """The columns of diagnosis.parquet. Where the diagnosis says nothing of a surface's effectiveness, its
    bounds are 0 and 1."""
    found: dict[str, Any] = {"t_s": rows.t_s, "faulty": rows.faulty, "named": rows.named.tolist()}
    for i, surface in enumerate(surfaces):
        found[f"{surface}_effectiveness"] = rows.estimate[:, i]
        found[f"{surface}_low"], found[f"{surface}_high"] = rows.low[:, i], rows.high[:, i]
    return found | {"credible": rows.credible}


def _verdict(path: Path, scenario: Any, log: dict[str, Floats], verdicts: list[Any]) -> Document:
    """When what was found, and whether the flight's own record says the same."""
    t_s = log["t_s"]
    detected = [float(t) for t, one in zip(t_s, verdicts, strict=True) if one.detected]
    isolation_s, name = _named(t_s, verdicts)
    logged = zip(log.get("detected", []), verdicts, strict=False)
    found: Document = {
        "flight": scenario.name,
        "replay": True,
        "duration_s": float(t_s[-1] - t_s[0]),
        "faulty": bool(detected),
        "credible": {"share": 1.0, "reasons": []},
        "detection_s": detected[0] if detected else None,
        "isolation_s": isolation_s,
        "isolated": name,
        "rows_that_differ": sum(bool(flag) != one.detected for flag, one in logged),
        "left_out": _left_out(scenario),
    }
    return found | {"as_flown": _as_flown(path, found)}


def _named(t_s: Floats, verdicts: list[Any]) -> tuple[float | None, str | None]:
    """Since when what is named at last has been named: what was withdrawn before does not count."""
    since_s, name = None, None
    for t, one in zip(t_s, verdicts, strict=True):
        if one.isolated != name:
            since_s, name = float(t) if one.isolated else None, one.isolated
    return since_s, name


def _left_out(scenario: Any) -> list[str]:
    """What the diagnosis was given in flight and the log does not have."""
    ideal = type(scenario.sensors)()
    flawed = [name for name, value in scenario.sensors if value != getattr(ideal, name)]
    flow = [name for name in flawed if name not in ("p", "q", "r")]
    return [f"the declared errors of {name}: the log has the true value" for name in flow]


def _as_flown(path: Path, found: Document) -> bool | None:
    """Whether detection and isolation are those of metrics.json; None where there is none beside the log."""
    beside = path.with_name("metrics.json")
    if not beside.is_file():
        return None
    metrics = json.loads(beside.read_text(encoding="utf-8"))
    flown = metrics["detection"]["time_s"], metrics["isolation"]["time_s"]
    return all(map(_is_same_time, flown, (found["detection_s"], found["isolation_s"])))


def _is_same_time(flown: float | None, found: float | None) -> bool:
    """The log's times are rounded otherwise than those of metrics.json."""
    if flown is None or found is None:
        return flown is found
    return abs(flown - found) < TIME_TOLERANCE_S


def as_text(found: Document) -> str:
    """The verdict of a replay in lines for people."""
    what = "nothing detected" if found["detection_s"] is None else f"detected at {found['detection_s']:.2f} s"
    if found["isolated"]:
        what += f", {found['isolated']} isolated at {found['isolation_s']:.2f} s"
    same = {True: "as flown", False: "not as flown", None: "nothing beside it to compare with"}
    lines = [f"{found['flight']}: {what}; {same[found['as_flown']]}"]
    return "\n".join([*lines, *(f"  left out: {one}" for one in found["left_out"])])
