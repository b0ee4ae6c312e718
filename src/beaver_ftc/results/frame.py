"""Tables of a flight as pandas has them; units are in the columns' names and in `attrs`."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.results.log import Log, MemoryLog
from beaver_ftc.results.metrics import Document

if TYPE_CHECKING:
    from pandas import DataFrame

_UNITS = (  # ending of a column's name, unit; the longest endings first
    ("_rad_s2", "rad/s2"), ("_deg_s", "deg/s"), ("_rad_s", "rad/s"), ("_per_s", "1/s"), ("_rad", "rad"),
    ("_deg", "deg"), ("_mps", "m/s"), ("_inhg", "inHg"), ("_pa", "Pa"), ("_hz", "Hz"), ("_m", "m"),
    ("_s", "s"),
)  # fmt: skip


def units(columns: Iterable[str]) -> dict[str, str]:
    """The unit of each column, read off its name or the section's it is in; "1" for a pure number."""
    return {column: _unit(column.split(".")) for column in columns}


def _unit(parts: Sequence[str]) -> str:
    named = (unit for part in reversed(parts) for ending, unit in _UNITS if part.endswith(ending))
    return next(named, "1")


def log_frame(log: Log, metrics: Document) -> "DataFrame":
    """The log as a DataFrame, float64, with scenario, seed, verdict and units in `attrs`."""
    from pandas import DataFrame

    if isinstance(log, MemoryLog):
        table = DataFrame(np.asfortranarray(log.rows), columns=list(log.columns), copy=False)
    else:
        chunks = list(log.read_chunks())
        table = DataFrame({name: np.concatenate([chunk[name] for chunk in chunks]) for name in log.columns})
    table.attrs = {
        "scenario": metrics["scenario"], "seed": metrics["seed"], "verdict": _said(metrics),
        "units": units(log.columns),
    }  # fmt: skip
    return table


def _said(metrics: Document) -> dict[str, Any]:
    detection, isolation = metrics["detection"], metrics["isolation"]
    return {
        "passed": metrics["passed"], "false_alarm": metrics["false_alarm"],
        "detected": detection["detected"], "detection_delay_s": detection["delay_s"],
        "isolated": isolation["fault"], "type": isolation["type"], "isolation_delay_s": isolation["delay_s"],
        "departed": metrics["departure"] is not None,
    }  # fmt: skip
