"""Every frame's mismatch and its sources as a parquet file, for whoever wants to look closer."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from beaver_ftc.results.log import ParquetLog
from beaver_ftc.studies.mismatch.sources import SOURCES
from beaver_ftc.studies.mismatch.split import UNEXPLAINED, Stretch
from beaver_ftc.studies.mismatch.states import AXES
from beaver_ftc.studies.mismatch.tally import TOTAL

ETA_BAR = "eta_bar"
NAMES = (TOTAL, *SOURCES, UNEXPLAINED, ETA_BAR)


def column(axis: str, name: str) -> str:
    """The column of one axis and source."""
    return f"{axis}_{name}_rad_s2"


COLUMNS = ("t_s", *(column(axis, name) for axis in AXES for name in NAMES))


def written(stretches: Iterable[Stretch], path: Path) -> Iterator[Stretch]:
    """Pass the stretches on, writing each to the file at `path` on the way."""
    with ParquetLog(path) as log:
        log.open(COLUMNS)
        for stretch in stretches:
            log.write(table(stretch))
            yield stretch


def table(stretch: Stretch) -> np.ndarray:
    """The stretch as rows (n, COLUMNS)."""
    found = {
        TOTAL: stretch.total,
        **stretch.contributions,
        UNEXPLAINED: stretch.unexplained,
        ETA_BAR: stretch.eta_bar,
    }
    values = np.stack([found[name] for name in NAMES], axis=-1)  # (n, axis, name)
    return np.column_stack([stretch.t_s, values.reshape(len(values), -1)])
