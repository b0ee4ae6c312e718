"""The certificate of a recorded flight that an aircraft's own model diagnosed.

A log of others says nothing of models and bounds. So what the diagnosis makes of each sample is written
beside the certificate, in the columns of a log of ours: of the first stretch with an alarm, from its first
sample on.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from beaver_ftc_assurance.certificates import certificate
from beaver_ftc_assurance.certificates import proved as by_frames
from beaver_ftc_logs.by_aircraft import Taken
from beaver_ftc_logs.diagnose import Rows


def write(taken: Taken, rows: Rows, folder: Path) -> None:
    """Write certificate.json, and log.parquet that proves it, into a folder. Raises BadInput where another
    scheme than ours diagnosed."""
    alarmed = (part for part in taken.parts if rows.faulty[part[0] : part[1]].any())
    start, end = next(alarmed, taken.parts[0])
    inputs = [np.ascontiguousarray(part[start:end]) for part in taken.inputs]
    diagnosis = taken.diagnosis

    def stepped() -> Iterator[int]:
        for k, sample in enumerate(zip(*inputs, strict=True)):
            diagnosis.step(*sample)
            yield k

    diagnosis.reset()
    frames, scenario = diagnosis.inside()
    named = scenario.model_copy(update={"name": taken.samples.name})
    log, document = by_frames.proved(named, frames, stepped())
    document = certificate.sealed(document | {"begins_s": float(taken.samples.t_s[start])})
    by_frames.write(named, log, document, folder)
