"""The flights of a sweep as columns, and the groups of them that statistics are about."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.scenario.sweep_schema import Variation
from beaver_ftc.studies.sweep.table import AXES, DEPARTED, FLOWN, kind_of

if TYPE_CHECKING:
    from beaver_ftc.scenario.sweep_loader import Sweep

NO_FAULT = "no fault"
_METRICS = (
    "run", "status", "reason", "frames", "flown_s", "fault_free_s", "false_alarm", "worst_residual_ratio",
    "passed", "fault.actuator", "fault.type", "fault.at_s",
    "detection.detected", "detection.delay_s", "detection.guaranteed_delay_s",
    "isolation.fault", "isolation.correct", "isolation.delay_s",
    *(f"tracking.{when}_fault_rms_deg_s.{axis}" for when in ("pre", "post") for axis in AXES),
)  # fmt: skip


@dataclass(frozen=True)
class Flights:
    """Columns of the results as arrays (flights,): numbers with NaN for null, flags False, texts ''."""

    columns: dict[str, np.ndarray]
    vary: dict[str, Variation]

    @classmethod
    def read(cls, path: Path, sweep: "Sweep") -> "Flights":
        """The columns of a `results.parquet` that statistics need."""
        from pyarrow.parquet import read_table

        columns = {
            name: _array(read_table(path, columns=[name]).column(0)) for name in (*_METRICS, *sweep.keys)
        }
        return cls(columns, dict(sweep.file.vary))

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __len__(self) -> int:
        return len(self["run"])

    @cached_property
    def measured(self) -> np.ndarray:
        """Flights that have metrics."""
        return np.isin(self["status"], (FLOWN, DEPARTED))

    @cached_property
    def departed(self) -> np.ndarray:
        """Flights that lost the aircraft."""
        return self["status"] == DEPARTED

    @cached_property
    def faulted(self) -> np.ndarray:
        """Flights that can tell about detection: a fault came, and no alarm before it."""
        there = self["fault.at_s"] < self["flown_s"]  # False where there is no fault
        return self.measured & there & ~self["false_alarm"]

    @cached_property
    def detected(self) -> np.ndarray:
        """Faulted flights whose fault raised the alarm."""
        return self.faulted & np.isfinite(self["detection.delay_s"])

    @cached_property
    def isolated(self) -> np.ndarray:
        """Faulted flights whose fault was named rightly."""
        return self.detected & self["isolation.correct"]

    @cached_property
    def detection_delay_s(self) -> np.ndarray:
        """From fault to alarm, infinite where there was none; meaningful where faulted."""
        return np.where(self.detected, self["detection.delay_s"], np.inf)

    @cached_property
    def isolation_delay_s(self) -> np.ndarray:
        """From fault to its right name, infinite where it never came; meaningful where faulted."""
        return np.where(self.isolated, self["isolation.delay_s"], np.inf)

    def post_fault_rms_deg_s(self, axis: str) -> np.ndarray:
        """Tracking error after the fault, infinite where the aircraft was lost; NaN without a fault."""
        rms = self[f"tracking.post_fault_rms_deg_s.{axis}"]
        return np.where(self.departed & self.faulted, np.inf, rms)

    def tracking_ratio(self, axis: str) -> np.ndarray:
        """Tracking error after the fault over before it."""
        before = self[f"tracking.pre_fault_rms_deg_s.{axis}"]
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.post_fault_rms_deg_s(axis) / before
        return np.where(before > 0, ratio, np.nan)

    @cached_property
    def worst_rms_deg_s(self) -> np.ndarray:
        """The largest tracking error after the fault over the three axes."""
        return np.max([self.post_fault_rms_deg_s(axis) for axis in AXES], axis=0)

    @cached_property
    def fault_labels(self) -> np.ndarray:
        """What broke in each flight, in words: the surface, with the type where there are several types."""
        kinds, actuators = self["fault.type"], self["fault.actuator"]
        several = len(set(kinds[kinds != ""])) > 1
        pairs = zip(kinds, actuators, strict=True)
        return np.array([_label(kind, actuator, several) for kind, actuator in pairs], dtype=object)

    def values(self, key: str) -> np.ndarray:
        """The values of a varied key."""
        return self[key]

    def is_number(self, key: str) -> bool:
        """Whether a varied key is a number (and not a choice among names)."""
        return kind_of(self.vary[key]) == "float"

    def numbers(self) -> Iterable[str]:
        """The varied keys that are numbers."""
        return (key for key in self.vary if self.is_number(key))


def _array(column) -> np.ndarray:
    import pyarrow as pa

    if pa.types.is_boolean(column.type):
        return column.fill_null(False).to_numpy(zero_copy_only=False)
    if pa.types.is_string(column.type):
        coded = (
            column.fill_null("").combine_chunks().dictionary_encode()
        )  # each text once, however many flights
        return np.array(coded.dictionary.to_pylist(), dtype=object)[coded.indices.to_numpy()]
    return column.to_numpy()


@cache
def _label(kind: str, actuator: str, several_types: bool) -> str:
    if not kind:
        return NO_FAULT
    if not actuator:
        return kind
    return f"{actuator} {kind.replace('_', ' ')}" if several_types else actuator
