"""A flight of our own once more through the diagnosis that flew it: its log.parquet, without JSBSim.

What the log has are the measured rates, the commands and the flow as the aircraft had it: where no errors of
the flow sensors were declared, that is what the diagnosis was given, and the verdicts are the same to the
bit.
"""

import json
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.readers.table import check_time, read_numbers
from beaver_ftc.flights.recording import Floats

Document = dict[str, Any]

_FLOW = ("alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa")
_UNKNOWN = "unknown"


def is_own_log(path: Path) -> bool:
    """Whether a path is the log of one of our runs, with its scenario beside it."""
    return path.name == "log.parquet" and path.with_name("scenario.yaml").is_file()


def replay(path: Path) -> tuple[dict[str, Any], Document]:
    """Step the diagnosis through a log: columns of diagnosis.parquet by name, and the document of
    verdict.json. Raises BadInput where the flight's diagnosis was none of ours."""
    from beaver_ftc.loop.stream import Diagnosis
    from beaver_ftc.scenario.loader import load_scenario

    scenario = load_scenario(path.with_name("scenario.yaml"))
    aircraft = scenario.airframe
    inputs = _inputs(aircraft)
    log = _columns_of(path, ["t_s", *chain.from_iterable(inputs)])
    keys = scenario.model_dump(mode="json", exclude_unset=True)
    others = {key: keys[key] for key in ("actuators", "design_model") if key in keys}
    diagnosis = Diagnosis(aircraft, scenario.rate_hz, keys.get("fdi"), **others)
    given = [np.ascontiguousarray(np.column_stack([log[name] for name in names])) for names in inputs]
    verdicts = [diagnosis.step(*frame) for frame in zip(*given, strict=True)]
    columns = _columns(log["t_s"], verdicts, list(aircraft.surfaces))
    return columns, _verdict(path, scenario, log, verdicts)


def _inputs(aircraft: Any) -> tuple[list[str], ...]:
    """Columns of what the diagnosis is given at each frame: rates, signals, commands, attitude."""
    return (
        [f"{axis}_measured_rad_s" for axis in "pqr"],
        [*_FLOW, *aircraft.signals],
        [f"{name}_cmd_rad" for name in aircraft.surfaces],
        ["phi_rad", "theta_rad", "psi_rad"],
    )


def _columns_of(path: Path, names: list[str]) -> dict[str, Floats]:
    """These columns of a log, and what it says of its own detection if it does."""
    log = read_numbers(path, [*names, "detected"])
    missing = [name for name in names if name not in log]
    if missing:
        raise BadInput(f"{path}: no column {missing[0]}, allowed: a log.parquet as `run` writes it")
    check_time(path, log["t_s"])
    return log


def _columns(t_s: Floats, verdicts: list[Any], surfaces: list[str]) -> dict[str, Any]:
    """The columns of diagnosis.parquet. Where the diagnosis says nothing of a surface's effectiveness, its
    bounds are 0 and 1."""
    suspected = np.array([verdict.detected for verdict in verdicts])
    named = [_name(verdict, surfaces) for verdict in verdicts]
    columns: dict[str, Any] = {"t_s": t_s, "faulty": suspected.astype(np.int64), "named": named}
    for surface in surfaces:
        left = np.array([_effectiveness(verdict, surface) for verdict in verdicts])
        columns[f"{surface}_effectiveness"] = left
        columns[f"{surface}_low"] = np.where(suspected, 0.0, left)
        columns[f"{surface}_high"] = np.ones(len(left))
    columns["credible"] = np.ones(len(t_s), dtype=np.int64)  # the model is the one that the flight declares
    return columns


def _name(verdict: Any, surfaces: list[str]) -> str:
    if not verdict.detected:
        return ""
    return str(verdict.isolated) if verdict.isolated in surfaces else _UNKNOWN


def _effectiveness(verdict: Any, surface: str) -> float:
    lost = verdict.isolated == surface and verdict.type in (None, "loss_of_effectiveness")
    return 1.0 + float(verdict.estimate) if lost and verdict.estimate is not None else 1.0


def _verdict(path: Path, scenario: Any, log: dict[str, Floats], verdicts: list[Any]) -> Document:
    """When what was found, and whether the flight's own record says the same."""
    t_s = log["t_s"]
    detected = [float(t) for t, one in zip(t_s, verdicts, strict=True) if one.detected]
    isolated = [(float(t), one.isolated) for t, one in zip(t_s, verdicts, strict=True) if one.isolated]
    isolation_s, name = isolated[0] if isolated else (None, None)
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
    same = metrics["detection"]["time_s"] == found["detection_s"]
    return bool(same and metrics["isolation"]["time_s"] == found["isolation_s"])


def as_text(found: Document) -> str:
    """The verdict of a replay in lines for people."""
    what = "nothing detected" if found["detection_s"] is None else f"detected at {found['detection_s']:.2f} s"
    if found["isolated"]:
        what += f", {found['isolated']} isolated at {found['isolation_s']:.2f} s"
    same = {True: "as flown", False: "not as flown", None: "nothing beside it to compare with"}
    lines = [f"{found['flight']}: {what}; {same[found['as_flown']]}"]
    return "\n".join([*lines, *(f"  left out: {one}" for one in found["left_out"])])
