"""A CSV or Parquet table with a time column `t_s`: one row a sample, one column a quantity."""

from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.recording import Column, Floats, Recording

TIME = "t_s"


def read(path: Path) -> Recording:
    """The flight in a table. Columns and cells that hold no number are nan."""
    table = read_numbers(path)
    if TIME not in table:
        raise BadInput(f"{path}: no column {TIME}, allowed: a table with {TIME} in seconds")
    t_s = table.pop(TIME)
    check_time(path, t_s)
    return Recording(path.stem, {name: Column(t_s, values) for name, values in table.items()})


def read_numbers(path: Path) -> dict[str, Floats]:
    """The columns of a table, nan where there is no number. Raises BadInput where it is no table."""
    import pyarrow as pa

    try:
        table = _open(path)
    except (pa.ArrowException, OSError, ValueError) as error:
        says = " ".join(str(error).split())[:200]
        raise BadInput(f"{path}: is no table that can be read ({says}), allowed: CSV or Parquet") from None
    return {name: _numbers(table[name]) for name in table.column_names}


def check_time(path: Path, t_s: Floats) -> None:
    """Raise BadInput unless the stamps are finite and increase."""
    if len(t_s) < 2:
        raise BadInput(f"{path}: has {len(t_s)} rows, allowed: at least 2")
    wrong = np.flatnonzero(~np.isfinite(t_s) | (np.diff(t_s, prepend=-np.inf) <= 0))
    if wrong.size:
        row = int(wrong[0]) + 1
        raise BadInput(f"{path}: {TIME}: row {row}: time does not increase, allowed: increasing seconds")


def _open(path: Path) -> Any:
    if path.suffix.lower() == ".parquet":
        from pyarrow import parquet

        return parquet.read_table(path)
    from pyarrow import csv

    return csv.read_csv(path)


def _numbers(column: Any) -> Floats:
    import pyarrow as pa

    if not (pa.types.is_integer(column.type) or pa.types.is_floating(column.type)):
        return np.full(len(column), np.nan)
    return np.asarray(column.to_numpy(), dtype=float)
