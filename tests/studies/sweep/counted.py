"""A table of a dozen flights, small enough to count by hand."""

from pathlib import Path

from beaver_ftc.aircraft import load
from beaver_ftc.scenario.sweeps import load_sweep_text
from beaver_ftc.studies.sweep.one_flight import columns_of, schema_of, table_of
from beaver_ftc.studies.sweep.outcomes import Flights
from beaver_ftc.studies.sweep.store import write_tables

SWEEP = """\
name: counted
base: elevator-partial-loss
runs: 12
vary:
  faults[0].magnitude: {uniform: [0.1, 1]}
"""
NOTHING = dict.fromkeys(columns_of(load().surfaces))


def row(run, status="flown", **metrics):
    base = {
        "frames": 3000, "flown_s": 30.0, "fault_free_s": 12.0, "fault.actuator": "elevator",
        "fault.type": "loss_of_effectiveness", "fault.at_s": 12.0, "detection.detected": False,
        "false_alarm": False, "worst_residual_ratio": 0.5, "passed": True,
        "tracking.pre_fault_rms_deg_s.q": 0.1, "tracking.post_fault_rms_deg_s.q": 0.2,
    }  # fmt: skip
    values = {"faults[0].magnitude": (run + 1) / 12}
    return {"run": run, **values, "seed": run, "status": status, "reason": None, **NOTHING, **base, **metrics}


def detected(run, delay_s, name="elevator", **metrics):
    found = {"detection.detected": True, "detection.time_s": 12 + delay_s, "detection.delay_s": delay_s}
    if name:
        found |= {
            "isolation.fault": name, "isolation.correct": name == metrics.get("fault.actuator", "elevator"),
            "isolation.delay_s": delay_s + 0.1, "isolation.isolated": True,
        }  # fmt: skip
    return row(run, **(found | metrics))


ROWS = [
    detected(0, 0.1), detected(1, 0.2), detected(2, 0.3, **{"detection.guaranteed_delay_s": 0.25}),
    detected(3, 0.4, "aileron"), detected(4, 0.5, None),
    detected(5, 0.6, **{"detection.guaranteed_delay_s": 0.7}),
    row(6), row(7),
    row(8, **{"false_alarm": True, "detection.detected": True, "detection.time_s": 3.0, "fault_free_s": 3.0}),
    row(9, "departed", **{"reason": "alpha_rad at 20 s", "flown_s": 20.0, "passed": False}),
    {**row(10, "bad_input"), **NOTHING, "reason": "no trim"},
    row(11, **{"fault.actuator": None, "fault.type": None, "fault.at_s": None, "fault_free_s": 30.0}),
]  # fmt: skip


def flights_of(rows, folder: Path, text: str = SWEEP) -> Flights:
    sweep = load_sweep_text(text)
    schema = schema_of(sweep)
    with (folder / "results.parquet").open("wb") as file:
        write_tables(file, [table_of(sweep, schema, rows)], schema)
    return Flights(folder / "results.parquet", sweep)


VARIOUS = """\
name: various
description: every kind of key, every kind of end
base: elevator-partial-loss
runs: 60
seed: 5
vary:
  faults[0].magnitude: {loguniform: [0.05, 1]}
  initial.airspeed_mps: {linspace: [38, 52, 3]}
  sensors: {choice: [ideal, tactical-grade]}
  reference.p: {choice: [[], [{sine: {amplitude_deg_s: 3, frequency_hz: 0.25}}]]}
"""
_BIAS = {"fault.actuator": "rudder", "fault.type": "bias"}
_HEALTHY = {"fault.actuator": None, "fault.type": None, "fault.at_s": None, "fault_free_s": 30.0}
_REFERENCES = ([], [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.25}}])


def _varied(run):
    return {
        "faults[0].magnitude": 0.05 * 20 ** ((7 * run % 60) / 59),
        "sensors": ("ideal", "tactical-grade")[run % 2],
        "initial.airspeed_mps": 38.0 + 7 * (run // 3 % 3), "reference.p": _REFERENCES[run // 30],
    }  # fmt: skip


def _tracked(run):
    before, after = (f"tracking.{when}_fault_rms_deg_s" for when in ("pre", "post"))
    return {
        f"{before}.p": 0.1, f"{before}.r": 0.3, f"{after}.p": 0.2 + run / 50, f"{after}.r": 0.6 + run / 80,
        f"{after}.q": 0.2 + (13 * run % 60) / 40, "worst_residual_ratio": 0.3 + (11 * run % 60) / 100,
        "detection.guaranteed_delay_s": None if run % 2 else 0.5,
    }  # fmt: skip


def _of_various(run):
    varied = _varied(run)
    of, delay_s = (_BIAS if run % 3 == 2 else {}) | varied | _tracked(run), 3.0 / 150 ** ((7 * run % 60) / 59)
    name = {13: "flap", 15: "unanticipated", 17: None}.get(run % 20, of.get("fault.actuator", "elevator"))
    status, changes = {
        0: ("flown", {"false_alarm": True, "fault_free_s": 3.0, "detection.detected": True}),
        9: ("departed", {"reason": f"alpha_rad at {run} s", "flown_s": 20.0, "passed": False}),
        11: ("bad_input", {**NOTHING, "reason": "no trim"}) if run < 20
        else ("failed", {**NOTHING, "reason": f"diverged at {run} s"}),
        16: ("flown", _HEALTHY),
    }.get(run % 20, ("flown", {}))  # fmt: skip
    if run % 20 in (0, 5, 6, 9, 11, 14, 16):
        return row(run, status, **of | changes)
    return detected(run, 0.0 if name is None else delay_s, name, **of)


ROWS_OF_VARIOUS = [_of_various(run) for run in range(60)]
