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
