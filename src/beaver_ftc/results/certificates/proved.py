"""The certificate of frames that somebody else goes through: a log of others, a flight with a doublet.

They are gone through twice: for the log that proves it, then for what the log does not hold.
"""

from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.diagnosis.isolation import estimator_names
from beaver_ftc.results.certificates import certificate, chance, tape
from beaver_ftc.results.certificates.inequality import Document
from beaver_ftc.results.log import MemoryLog, ParquetLog
from beaver_ftc.scenario.schema import Scenario

Begin = Callable[[], tuple[np.ndarray, Iterator[int]]]


def proved(scenario: Scenario, begin: Begin) -> tuple[MemoryLog, Document]:
    """Log and certificate. begin: starts anew; returns the record (1,), of `frame_dtype`, and what goes on by
    a frame whenever it is asked. Raises BadInput where another scheme than ours diagnosed."""
    certificate.check_scheme(scenario)
    log = _log(*begin(), scenario)
    events, kept = certificate.events_of(log), None
    if events:
        known = [events["detected"], *events.values()]
        first, last = tape.span(scenario, known, len(log.rows))
        frames, flown = begin()
        after = (k for k in islice(flown, last) if k >= first)
        kept = tape.record(frames, after, scenario, known, last)
    return log, certificate.certificate_of(scenario, log, events, kept)


def write(log: MemoryLog, document: Document, folder: Path) -> None:
    """Write both into a folder."""
    with ParquetLog(folder / "log.parquet") as stored:
        stored.open(log.columns)
        stored.write(log.rows)
    (folder / certificate.FILE).write_text(certificate.as_text(document), encoding="utf-8")


def _log(frames: np.ndarray, flown: Iterable[int], scenario: Scenario) -> MemoryLog:
    """What the diagnosis makes of each frame, in the columns that a certificate takes."""
    frame, log, surfaces = frames[0], MemoryLog(), scenario.airframe.surfaces
    fdi, of_axes = frame["fdi"], ("measured_rad_s", "design_rad_s2", "eta_bar_rad_s2")
    estimators = fdi["isolation"]["estimator"][: int(fdi["isolation"]["n"])]
    names = estimator_names(scenario.fdi.fault_class, scenario.airframe)
    columns = ["t_s", *(f"{axis}_{what}" for what in of_axes for axis in AXES), "detected"]
    columns += [f"fie_{name}_excluded" for name in names]
    shares: dict[str, float] = {}
    rows = []
    for k in flown:
        of_frame = frame["measured"]["x"], frame["belief"]["means"]["acceleration"], fdi["bound"]["eta_bar"]
        if scenario.fdi.statistical:
            shares = dict(chance.shares(fdi["statistical"], surfaces))
        values = [fdi["verdict"]["detected"], *estimators["excluded"], *shares.values()]
        rows.append(np.concatenate([[k / scenario.rate_hz], *of_frame, values]))
    log.open([*columns, *shares])
    log.write(np.array(rows))
    return log
