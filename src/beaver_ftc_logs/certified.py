"""The certificate of a recorded flight that an aircraft's own model diagnosed.

A certificate refers to columns of residuals and bounds, which a recorded log does not have. So a log with the
columns of a simulated flight is written with the certificate. It has the first stretch with an alarm in a
credible row, or the first stretch of all if there is none.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from beaver_ftc_assurance.certificates import certified
from beaver_ftc_assurance.certificates import proved as by_frames
from beaver_ftc_logs.aircraft_inputs import LogInputs
from beaver_ftc_logs.log_rows import LogRows


def write_certificate_and_log(inputs: LogInputs, rows: LogRows, folder: Path) -> None:
    """Write certificate.json, and the log.parquet to which it refers, into a folder. Raises BadInput if the
    scheme of the diagnosis is not ours."""
    alarmed = (stretch for stretch in inputs.gap_free_stretches if rows.faulty[stretch[0] : stretch[1]].any())
    begin, end = next(alarmed, inputs.gap_free_stretches[0])
    arrays = [np.ascontiguousarray(array[begin:end]) for array in inputs.input_arrays]
    diagnosis = inputs.diagnosis

    def step() -> Iterator[int]:
        """Step the diagnosis through the stretch; yields the number of each frame."""
        for k, sample in enumerate(zip(*arrays, strict=True)):
            diagnosis.step(*sample)
            yield k

    diagnosis.reset()
    memory, scenario = diagnosis.inside()
    scenario = scenario.model_copy(update={"name": inputs.samples.name})
    proof = by_frames.proved(scenario, memory, step())
    document = certified.with_digest(proof.document | {"begins_s": float(inputs.samples.t_s[begin])})
    replace(proof, document=document).write(folder)
