"""A log sink that keeps a flight in memory, as columns."""

from collections.abc import Sequence

import numpy as np


class Columns(dict[str, np.ndarray]):
    """Name -> values (frames,) once the flight is over. names: the columns to keep; without any, all."""

    def __init__(self, *names: str) -> None:
        super().__init__()
        self._wanted = names

    def open(self, columns: Sequence[str]) -> None:
        """A flight begins, with these columns in its rows."""
        names = list(columns)
        self._names = self._wanted or tuple(names)
        self._places = [names.index(name) for name in self._names]
        self._chunks: list[np.ndarray] = []

    def write(self, rows: np.ndarray) -> None:
        """Take in rows (n, columns)."""
        self._chunks.append(rows[:, self._places])  # a copy: the rows' memory is used again

    def close(self) -> None:
        """The flight is over."""
        self.update(zip(self._names, np.ascontiguousarray(np.concatenate(self._chunks).T), strict=True))

    def read(self, *names: str) -> np.ndarray:
        """Some columns side by side, (frames, names)."""
        return np.column_stack([self[name] for name in names])

    def since(self, from_s: float) -> dict[str, np.ndarray]:
        """Every column from an instant on."""
        late = self["t_s"] >= from_s
        return {name: column[late] for name, column in self.items()}
