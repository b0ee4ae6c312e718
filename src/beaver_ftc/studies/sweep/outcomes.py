"""The flights of a sweep as columns, and the groups of them that statistics are about."""

import shlex
from collections.abc import Callable, Iterator
from functools import cache, cached_property
from pathlib import Path
from typing import IO

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents.files import Document
from beaver_ftc.results.metrics import strikes_within
from beaver_ftc.scenario.sweeps import Sweep
from beaver_ftc.studies.sweep.one_flight import DEPARTED, FLOWN, flight_name, kind_of

NO_FAULT = "no fault"


class Flights:
    """Columns of a `results.parquet`, or of one in memory, as arrays (flights,), each read when asked for.

    Numbers have NaN for null, flags False, texts ''.
    """

    def __init__(self, file: Path | IO[bytes], sweep: Sweep) -> None:
        self._file, self.vary = file, sweep.file.vary
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
        return np.isin(self["status"], (FLOWN, DEPARTED))

    @cached_property
    def departed(self) -> np.ndarray:
        """Flights that lost the aircraft."""
        return self["status"] == DEPARTED

    @cached_property
    def false_alarms(self) -> tuple[int, float]:
        """How many there were, and in how many hours in which an alarm would have been a false one."""
        count = int((self["false_alarm"] & self.measured).sum())
        return count, float(np.nansum(self["fault_free_s"][self.measured])) / 3600

    @cached_property
    def faulted(self) -> np.ndarray:
        """Flights that can tell about detection: a fault came, and no alarm before it."""
        struck = strikes_within(self["fault.at_s"], self["flown_s"])
        return self.measured & struck & ~self["false_alarm"]

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

    def is_number(self, key: str) -> bool:
        """Whether a varied key is a number (and not a choice among names)."""
        return kind_of(self.vary[key]) == "float"


def _array(column) -> np.ndarray:
    import pyarrow as pa

    if pa.types.is_boolean(column.type):
        return column.fill_null(False).to_numpy(zero_copy_only=False)
    if pa.types.is_string(column.type):
        # each text once, however many flights
        coded = column.fill_null("").combine_chunks().dictionary_encode()
        return np.array(coded.dictionary.to_pylist(), dtype=object)[coded.indices.to_numpy()]
    return column.to_numpy()


@cache
def _label(kind: str, actuator: str, several_types: bool) -> str:
    if not kind:
        return NO_FAULT
    if not actuator:
        return kind
    return f"{actuator} {kind.replace('_', ' ')}" if several_types else actuator


BINS = 8
MOST_FLIGHTS = 4000  # of more, evenly spaced ones are taken: the ranking does not need them all
PERMUTATIONS = 199

Ranking = list[Document]


def rank(keys: dict[str, np.ndarray], outcome: np.ndarray) -> Ranking:
    """The keys by how much of the outcome they explain, most first.

    keys: name -> values (n,), numbers or texts; outcome (n,), infinite allowed. Each entry: `key`,
    `explained` (share of rank variance), `rank_correlation` (Spearman's, null for names), `p_value`.
    """
    chosen = np.arange(0, outcome.size, max(1, -(-outcome.size // MOST_FLIGHTS)))
    ranks = ranks_of(outcome[chosen])
    if ranks.size < 2 * BINS or ranks.min() == ranks.max():
        return []
    found = [_entry(key, values[chosen], ranks) for key, values in keys.items()]
    return sorted(found, key=lambda entry: (-entry["explained"], entry["key"]))


def ranks_of(values: np.ndarray) -> np.ndarray:
    """Ranks from 0, equal values sharing the mean of theirs."""
    from scipy.stats import rankdata

    return rankdata(values) - 1.0


def _entry(key: str, values: np.ndarray, ranks: np.ndarray) -> Document:
    groups = _groups(values)
    share = _explained(groups, ranks)
    generator = np.random.default_rng(0)
    by_chance = sum(_explained(groups, generator.permutation(ranks)) >= share for _ in range(PERMUTATIONS))
    return {
        "key": key,
        "explained": round(max(share, 0.0), 6),
        "rank_correlation": _spearman(values, ranks),
        "p_value": (1 + by_chance) / (1 + PERMUTATIONS),
    }


def _groups(values: np.ndarray) -> np.ndarray:
    """Group number of each value: its level, or its bin where there are many levels."""
    levels, group = np.unique(values, return_inverse=True)
    if values.dtype == object or levels.size <= BINS:
        return group
    return np.minimum(ranks_of(values) * BINS // values.size, BINS - 1).astype(int)


def _explained(groups: np.ndarray, ranks: np.ndarray) -> float:
    """1 - (SSW / (n - k)) / (SST / (n - 1))."""
    counts = np.bincount(groups)
    used = counts > 0
    means = np.bincount(groups, ranks)[used] / counts[used]
    total = ((ranks - ranks.mean()) ** 2).sum()
    between = (counts[used] * (means - ranks.mean()) ** 2).sum()
    n, k = ranks.size, int(used.sum())
    if k < 2 or n <= k:
        return 0.0
    return float(1.0 - (total - between) / (n - k) / (total / (n - 1)))


def _spearman(values: np.ndarray, ranks: np.ndarray) -> float | None:
    if values.dtype == object:
        return None
    own = ranks_of(values)
    if own.min() == own.max():
        return None
    return round(float(np.corrcoef(own, ranks)[0, 1]), 6)


OF_EACH_KIND = 3


def worst_flights(flights: Flights, sweep: Sweep, command: str) -> list[Document]:
    """A few flights of each bad kind, each once: `run`, `name`, `why` (all that is bad), `replay`."""
    whys: dict[int, list[str]] = {}
    for position, why in _candidates(flights):
        whys.setdefault(position, []).append(why)
    return [
        {
            "run": (run := flights["run"].item(position)),
            "name": flight_name(sweep, run),
            "why": why,
            "values": {key: flights[key].item(position) for key in flights.vary},
            "replay": f"{command} --replay {run}",
        }
        for position, why in whys.items()
    ]


def replay_command(source: str, out: Path, search: str | None = None) -> str:
    """The command line that replays a flight, but for its index."""
    words = ["beaver-ftc", "sweep", source]
    words += ["--search", search] if search else []
    words += ["--out", str(out)] if str(out) != "runs" else []
    return shlex.join(words)


def _candidates(flights: Flights) -> Iterator[tuple[int, str]]:
    """(position, what is bad about it), the worst kind first."""
    faulted, named, reason = flights.faulted, flights["isolation.fault"], flights["reason"]
    wrong = faulted & (named != "") & ~flights["isolation.correct"]
    yield from _first(~flights.measured, lambda i: f"{flights['status'][i]}: {reason[i]}")
    yield from _first(flights["false_alarm"] & flights.measured, lambda i: "false alarm")
    yield from _first(flights.departed, lambda i: f"departed: {reason[i]}")
    yield from _first(wrong, lambda i: f"named {named[i]}")
    yield from _first(faulted & ~flights.detected, lambda i: "fault not detected")
    delay = np.where(flights.detected, flights.detection_delay_s, -np.inf)
    yield from _largest(delay, lambda i: f"detected after {delay[i]:.3g} s")
    rms = flights.worst_rms_deg_s
    rms = np.where(faulted & np.isfinite(rms), rms, -np.inf)
    yield from _largest(rms, lambda i: f"tracking error {rms[i]:.3g} deg/s RMS")
    ratio = np.nan_to_num(flights["worst_residual_ratio"], nan=-np.inf)
    yield from _largest(ratio, lambda i: f"residual {ratio[i]:.4g} of its threshold without a fault")


def _first(which: np.ndarray, why: Callable[[int], str]) -> Iterator[tuple[int, str]]:
    return ((i, why(i)) for i in np.flatnonzero(which)[:OF_EACH_KIND].tolist())


def _largest(values: np.ndarray, why: Callable[[int], str]) -> Iterator[tuple[int, str]]:
    largest = np.argsort(-values, kind="stable")[:OF_EACH_KIND]
    for i in largest[np.isfinite(values[largest])].tolist():
        alike = int(np.isclose(values, values[i], rtol=1e-9, atol=0.0).sum())
        yield i, why(i) + (f", as in {alike - 1} more" if alike > 1 else "")
