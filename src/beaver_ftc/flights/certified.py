"""The certificate of a recorded flight that an aircraft's own model diagnosed.

A log of others says nothing of models and bounds. So what the diagnosis makes of each sample is written
beside the certificate, in the columns of a log of ours: of the first stretch with an alarm, from its first
sample on.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.diagnosis.isolation import estimator_names
from beaver_ftc.flights.by_aircraft import Taken
from beaver_ftc.flights.diagnose import Rows
from beaver_ftc.loop.stream import Diagnosis
from beaver_ftc.results.certificates import certificate, chance, tape
from beaver_ftc.results.log import MemoryLog, ParquetLog
from beaver_ftc.scenario.schema import Scenario


def write(taken: Taken, rows: Rows, folder: Path) -> None:
    """Write certificate.json, and log.parquet that proves it, into a folder. Raises BadInput where another
    scheme than ours diagnosed."""
    alarmed = (part for part in taken.parts if rows.faulty[part[0] : part[1]].any())
    begin, end = next(alarmed, taken.parts[0])
    inputs = [np.ascontiguousarray(part[begin:end]) for part in taken.inputs]
    frames, scenario = taken.diagnosis.inside()
    certificate.check_scheme(scenario)
    scenario = scenario.model_copy(update={"name": taken.samples.name})
    log = _log(taken.diagnosis, inputs, scenario)
    events, kept = certificate.events_of(log), None
    if events:
        taken.diagnosis.reset()
        frames, _ = taken.diagnosis.inside()
        _, last = span = tape.span(scenario, [*events.values()], len(log.rows))
        stepped = _stepped(taken.diagnosis, inputs, last)
        after = (k for k in stepped if k >= span[0])
        kept = tape.record(frames, after, scenario, [events["detected"], *events.values()], last)
    document = certificate.certificate_of(scenario, log, events, kept)
    with ParquetLog(folder / "log.parquet") as stored:
        stored.open(log.columns)
        stored.write(log.rows)
    text = certificate.as_text(certificate.sealed(document | {"begins_s": float(taken.samples.t_s[begin])}))
    (folder / certificate.FILE).write_text(text, encoding="utf-8")


def _stepped(diagnosis: Diagnosis, inputs: Sequence[np.ndarray], end: int) -> Iterator[int]:
    """Step through the samples before `end`; yields after each."""
    for k, sample in enumerate(zip(*(part[:end] for part in inputs), strict=True)):
        diagnosis.step(*sample)
        yield k


def _log(diagnosis: Diagnosis, inputs: Sequence[np.ndarray], scenario: Scenario) -> MemoryLog:
    """What the diagnosis makes of each sample, in the columns that a certificate takes."""
    diagnosis.reset()
    frame, log, aircraft = diagnosis.inside()[0][0], MemoryLog(), scenario.airframe
    fdi, of_axes = frame["fdi"], ("measured_rad_s", "design_rad_s2", "eta_bar_rad_s2")
    estimators = fdi["isolation"]["estimator"][: int(fdi["isolation"]["n"])]
    names = estimator_names(scenario.fdi.fault_class, aircraft)
    columns = ["t_s", *(f"{axis}_{what}" for what in of_axes for axis in AXES), "detected"]
    columns += [f"fie_{name}_excluded" for name in names]
    shares: dict[str, float] = {}
    rows = []
    for _ in _stepped(diagnosis, inputs, len(inputs[0])):
        of_frame = frame["measured"]["x"], frame["belief"]["means"]["acceleration"], fdi["bound"]["eta_bar"]
        if scenario.fdi.statistical:
            shares = dict(chance.shares(fdi["statistical"], aircraft.surfaces))
        values = [fdi["verdict"]["detected"], *estimators["excluded"], *shares.values()]
        rows.append(np.concatenate([[diagnosis.t_s], *of_frame, values]))
    log.open([*columns, *shares])
    log.write(np.array(rows))
    return log
