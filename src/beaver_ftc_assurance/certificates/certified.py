"""A certificate with its proof: the log, the columns that the log lacks, and the text of scenario.yaml."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from beaver_ftc.loop import LogSink
from beaver_ftc.results import Document, Log, ParquetLog
from beaver_ftc_assurance.certificates.check_certificate import digest

EvidenceColumns = dict[str, "PartialColumn"]  # name of a column of the log -> its values
FILE_NAME = "certificate.json"
LOG_NAME = "log.parquet"


def with_digest(document: Document) -> Document:
    """The document with its `digest`: the SHA-256 of its JSON text with sorted keys, without spaces, and with
    an empty `digest`.
    """
    return document | {"digest": digest(document)}


def as_text(document: Document) -> str:
    """The text of the file."""
    return json.dumps(document, separators=(",", ":")) + "\n"


@dataclass(frozen=True)
class Certified:
    """A certificate and its proof: the log, the columns that the log lacks, and the text of scenario.yaml."""

    document: Document
    log: Log
    columns: EvidenceColumns
    scenario: str

    def copy_log(self, to: LogSink) -> None:
        """Write the log with the additional columns to a sink."""
        to.open([*self.log.columns, *self.columns])
        first = 0
        for chunk in self.log.read_chunks():
            n = len(chunk["t_s"])
            further = (column.rows(first, n) for column in self.columns.values())
            to.write(np.column_stack([*chunk.values(), *further]))
            first += n

    def write(self, folder: Path) -> None:
        """Write certificate, log and scenario into a folder. A log that is there already stays if it lacks no
        column."""
        if self.columns or not (folder / LOG_NAME).exists():
            extended = folder / f".{LOG_NAME}"
            with ParquetLog(extended) as log:
                self.copy_log(log)
            extended.replace(folder / LOG_NAME)
        (folder / "scenario.yaml").write_text(self.scenario, encoding="utf-8")
        (folder / FILE_NAME).write_text(as_text(self.document), encoding="utf-8")


@dataclass(frozen=True)
class PartialColumn:
    """A column whose `values` begin with row `first`. The rows before have the first value, the rows after
    the values have the last one.
    """

    first: int
    values: np.ndarray

    def rows(self, start: int, n: int) -> np.ndarray:
        """The rows from `start` on, (n,)."""
        return self.values[np.clip(np.arange(start, start + n) - self.first, 0, len(self.values) - 1)]
