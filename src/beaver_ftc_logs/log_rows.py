"""The rows of a diagnosis: alarm, name, effectiveness with bounds, and which rows are credible."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import compress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.results import Document
from beaver_ftc_logs.recording import Floats, Ints, Mask, Reasons
from beaver_ftc_logs.runs import last_row_at
from beaver_ftc_logs.samples import Samples

Names = NDArray[np.object_]


@dataclass(frozen=True)
class LogRows:
    """The diagnosis of a flight, one row for each sample.

    t_s (n,). faulty (n,): 0 or 1. isolated_surfaces (n,): names joined by +, empty without an alarm.
    effectiveness of each surface, its bounds effectiveness_low and effectiveness_high (n, S).
    fault_probability (n,) of any surface. evidence_start_time_s (n,): time at which the evidence for a fault
    began to increase. doubtful_rows: for each reason the rows (n,) that are not credible.
    """

    t_s: Floats
    faulty: Ints
    isolated_surfaces: Names
    effectiveness: Floats
    effectiveness_low: Floats
    effectiveness_high: Floats
    fault_probability: Floats
    evidence_start_time_s: Floats
    doubtful_rows: Reasons = field(default_factory=dict)

    @cached_property
    def credible(self) -> Ints:
        """0 where a row is doubtful, else 1, (n,)."""
        is_doubtful = np.any([np.zeros(len(self.t_s)), *self.doubtful_rows.values()], axis=0)
        return np.where(is_doubtful, 0, 1)

    def table(self, surfaces: Iterable[str], with_probability: bool = False) -> Document:
        """The columns of diagnosis.parquet. Where there is no statement on the effectiveness of a surface,
        its bounds are 0 and 1.
        """
        columns: Document = {"t_s": self.t_s, "faulty": self.faulty}
        columns["named"] = self.isolated_surfaces.tolist()
        for i, surface in enumerate(surfaces):
            columns[f"{surface}_effectiveness"] = self.effectiveness[:, i]
            columns[f"{surface}_low"] = self.effectiveness_low[:, i]
            columns[f"{surface}_high"] = self.effectiveness_high[:, i]
        if with_probability:
            columns["fault_probability"] = self.fault_probability
        return columns | {"credible": self.credible}

    def has_credible_alarm(self) -> bool:
        """Whether an alarm is raised in a credible row."""
        return bool(((self.faulty == 1) & (self.credible == 1)).any())

    def clears_alarm(self, other: "LogRows") -> bool:
        """Whether these rows have no credible alarm, and each row that is credible in `other` is credible
        here too. other: rows of the same log with other columns.
        """
        return not self.has_credible_alarm() and bool((self.credible >= other.credible).all())

    @classmethod
    def of_names(cls, t_s: Floats, names: Names, a: Floats, low: Floats, high: Floats) -> "LogRows":
        """Rows of a diagnosis without probabilities: a row is faulty if it names a surface. a, low, high (n,
        S): effectiveness and its bounds.
        """
        faulty = (names != "").astype(np.int64)
        return cls(t_s, faulty, names, a, low, high, faulty.astype(float), t_s)

    def credibility(self) -> Document:
        """The entry of verdict.json with the share of credible rows, and the reasons for the others with
        their shares."""
        shares = {reason: float(rows.mean()) for reason, rows in self.doubtful_rows.items()}
        ordered = sorted(shares, key=lambda reason: -shares[reason])
        entries = [{"says": reason, "share": shares[reason]} for reason in ordered]
        return {"share": float(self.credible.mean()) if len(self.t_s) else 0.0, "reasons": entries}

    def _where(self, mask: Mask, **values: Any) -> "LogRows":
        """The rows with other values where a mask is true."""
        changed = {name: np.where(mask, value, getattr(self, name)) for name, value in values.items()}
        return replace(self, **changed)

    def without_estimate(self, removed: Mask) -> "LogRows":
        """The rows with effectiveness 1 and bounds 0 and 1 where removed, (n,) or (n, S), is true."""
        mask = removed if removed.ndim == 2 else removed[:, None]
        return self._where(mask, effectiveness=1.0, effectiveness_low=0.0, effectiveness_high=1.0)

    def without_verdict(self, reasons: Reasons) -> "LogRows":
        """The rows without alarm, name and bounds, and not credible, where the rows (n,) of a reason are
        true. A reason without any row is left out.
        """
        reasons = {reason: mask for reason, mask in reasons.items() if mask.any()}
        rows = replace(self, doubtful_rows=reasons)
        removed = rows.credible == 0
        rows = rows.without_estimate(removed)
        return rows._where(removed, faulty=0, isolated_surfaces="", fault_probability=0.0)


def join_names(flags: Mask, names: Sequence[str]) -> Names:
    """For each row of flags (n, K) the names of the true columns, joined by +, (n,)."""
    return np.array(["+".join(compress(names, row)) for row in flags], dtype=object)


def at_log_stamps(samples: Samples, rows: LogRows) -> LogRows:
    """The rows at the stamps of the log: each stamp has the last row up to it."""
    if np.array_equal(samples.log_stamps_s, rows.t_s):
        return rows
    last = last_row_at(rows.t_s, samples.log_stamps_s)
    names = set(LogRows.__dataclass_fields__) - {"doubtful_rows"}
    fields = {name: getattr(rows, name)[last] for name in names}
    reasons = {reason: mask[last] for reason, mask in rows.doubtful_rows.items()}
    return LogRows(**(fields | {"t_s": samples.log_stamps_s, "doubtful_rows": reasons}))
