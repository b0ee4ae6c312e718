"""The cells of a table that were read, and the remarks on them."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from beaver_ftc_logs.recording import Floats


@dataclass
class TableCells:
    """Cells that were read.

    numbers: name of a column -> its numbers, nan where there is none. n_rows, n_rows_before: number of these
    rows, and of rows of the table before them. text_cells: name of a column -> number of its cells of text,
    and row and text of the first one. broken_lines: the first letters of each line that was left out.
    """

    numbers: dict[str, Floats]
    n_rows: int
    n_rows_before: int = 0
    text_cells: dict[str, tuple[int, int, str]] = field(default_factory=dict)
    broken_lines: list[str] = field(default_factory=list)

    def select_rows(self, first: int, end_row: int | None = None, with_remarks: bool = False) -> "TableCells":
        """The rows from `first` to before `end_row`. with_remarks: keep the cells of text and the broken
        lines."""
        numbers = {name: values[first:end_row].copy() for name, values in self.numbers.items()}
        remarks = (self.text_cells, self.broken_lines) if with_remarks else ()
        return TableCells(
            numbers, len(range(self.n_rows)[first:end_row]), self.n_rows_before + first, *remarks
        )

    def notes(self) -> dict[str, str]:
        """For each column with numbers and cells of text, a line on the latter."""
        return {
            name: f"{name}: {'1 cell holds' if n == 1 else f'{n} cells hold'} no number, the first in row "
            f"{row}: {cell[:30]!r}"
            for name, (n, row, cell) in self.text_cells.items()
            if np.isfinite(self.numbers[name]).any()
        }


def join_blocks(blocks: Sequence[TableCells]) -> TableCells:
    """Successive blocks as one. The blocks lose their numbers, to save memory."""
    first = blocks[0]
    column_names = list(first.numbers)
    numbers = {name: np.concatenate([block.numbers.pop(name) for block in blocks]) for name in column_names}
    joined = TableCells(numbers, sum(block.n_rows for block in blocks), first.n_rows_before)
    for block in blocks:
        joined.broken_lines += block.broken_lines
        for name, (n_texts, row, cell) in block.text_cells.items():
            earlier = joined.text_cells.get(name, (0, row, cell))
            joined.text_cells[name] = (earlier[0] + n_texts, *earlier[1:])
    return joined
