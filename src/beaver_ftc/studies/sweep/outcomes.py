"""The flights of a sweep as columns, and the groups of flights over which statistics are formed."""

from functools import cache, cached_property
from pathlib import Path
from typing import IO

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.results.judgement import strikes_within
from beaver_ftc.scenario.sweeps import Sweep
from beaver_ftc.studies.sweep.one_flight import DEPARTED, RESULTS, kind_of

NO_FAULT = "no fault"


class Flights:
    """Columns of a `results.parquet`, or of such a file in memory, as arrays (flights,). A column is read
    when it is used.

    A null is NaN in numbers, False in flags, and '' in texts. Groups are masks (flights,).
    """

    def __init__(self, file: Path | IO[bytes], sweep: Sweep) -> None:
        self._file = file
        self.vary = sweep.file.vary
        self._columns: dict[str, np.ndarray] = {}

    def __getitem__(self, name: str) -> np.ndarray:
        from pyarrow.parquet import read_table

        if name not in self._columns:
            self._columns[name] = _array(read_table(self._file, columns=[name]).column(0))
        return self._columns[name]

    def __len__(self) -> int:
        return len(self["run"])

    @cached_property
    def measured(self) -> np.ndarray:
        """Flights that have metrics."""
        return np.isin(self["status"], RESULTS)

    @cached_property
    def departed(self) -> np.ndarray:
        """Flights that lost the aircraft."""
        return self["status"] == DEPARTED

    @cached_property
    def false_alarms(self) -> tuple[int, float]:
        """Number of false alarms, and the hours in which an alarm would have been false."""
        count = int((self["false_alarm"] & self.measured).sum())
        return count, float(np.nansum(self["fault_free_s"][self.measured])) / 3600

    @cached_property
    def faulted(self) -> np.ndarray:
        """Flights with metrics whose first fault begins before the end, without an alarm before it."""
        has_fault = strikes_within(self["fault.at_s"], self["flown_s"])
        return self.measured & has_fault & ~self["false_alarm"]

    @cached_property
    def detected(self) -> np.ndarray:
        """Faulted flights with an alarm."""
        return self.faulted & np.isfinite(self["detection.delay_s"])

    @cached_property
    def isolated(self) -> np.ndarray:
        """Faulted flights whose fault is correctly named."""
        return self.detected & self["isolation.correct"]

    @cached_property
    def detection_delay_s(self) -> np.ndarray:
        """Time from the fault to the alarm, s; infinite without an alarm. Valid for faulted flights."""
        return np.where(self.detected, self["detection.delay_s"], np.inf)

    @cached_property
    def isolation_delay_s(self) -> np.ndarray:
        """Time from the fault to its right name, s; infinite without one. Valid for faulted flights."""
        return np.where(self.isolated, self["isolation.delay_s"], np.inf)

    def post_fault_rms_deg_s(self, axis: str) -> np.ndarray:
        """RMS tracking error after the fault, deg/s; infinite in a faulted flight that lost the aircraft, NaN
        without a fault."""
        rms = self[f"tracking.post_fault_rms_deg_s.{axis}"]
        return np.where(self.departed & self.faulted, np.inf, rms)

    def tracking_ratio(self, axis: str) -> np.ndarray:
        """RMS tracking error after the fault over that before it; NaN if the latter is 0 or missing."""
        healthy_rms_deg_s = self[f"tracking.pre_fault_rms_deg_s.{axis}"]
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.post_fault_rms_deg_s(axis) / healthy_rms_deg_s
        return np.where(healthy_rms_deg_s > 0, ratio, np.nan)

    @cached_property
    def worst_rms_deg_s(self) -> np.ndarray:
        """The largest RMS tracking error of the three axes after the fault, deg/s; NaN without a fault."""
        return np.max([self.post_fault_rms_deg_s(axis) for axis in AXES], axis=0)

    @cached_property
    def fault_labels(self) -> np.ndarray:
        """The first fault of each flight in words: the surface, with the type if the sweep has several types;
        the type of a fault without a surface."""
        kinds = self["fault.type"]
        actuators = self["fault.actuator"]
        several = len(set(kinds[kinds != ""])) > 1
        pairs = zip(kinds, actuators, strict=True)
        return np.array([_label(kind, actuator, several) for kind, actuator in pairs], dtype=object)

    @cached_property
    def by_fault(self) -> dict[str, np.ndarray]:
        """By label of each fault that strikes a faulted flight, the flights that have it."""
        labels = self.fault_labels
        return {label: labels == label for label in sorted(set(labels[self.faulted]))}

    def is_number(self, key: str) -> bool:
        """Whether a varied key is a number, not a choice of names."""
        return kind_of(self.vary[key]) == "float"


def _array(column) -> np.ndarray:
    """A column of a table as an array, its nulls as `Flights` says."""
    import pyarrow as pa

    if pa.types.is_boolean(column.type):
        return column.fill_null(False).to_numpy(zero_copy_only=False)
    if pa.types.is_string(column.type):
        # each text is one object, however many flights have it
        coded = column.fill_null("").combine_chunks().dictionary_encode()
        return np.array(coded.dictionary.to_pylist(), dtype=object)[coded.indices.to_numpy()]
    return column.to_numpy()


@cache
def _label(kind: str, actuator: str, several_types: bool) -> str:
    """A fault in words."""
    if not kind:
        return NO_FAULT
    if not actuator:
        return kind
    return f"{actuator} {kind.replace('_', ' ')}" if several_types else actuator
