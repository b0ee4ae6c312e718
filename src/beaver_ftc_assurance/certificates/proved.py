"""Certificates of frames that other code advances, i.e. of a recorded log or of a flight with a doublet; and
of a finished flight, which is flown again.
"""

from collections.abc import Iterable
from math import nan

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.diagnosis import estimator_names
from beaver_ftc.loop import FrameReadout
from beaver_ftc.results import Columns, Log, MemoryLog, Proof
from beaver_ftc.scenario import Scenario
from beaver_ftc_assurance.certificates import chance
from beaver_ftc_assurance.certificates.certificate import MEASURED_MODEL_BOUND, certificate, check_scheme
from beaver_ftc_assurance.certificates.certified import Certified
from beaver_ftc_assurance.certificates.tape import Recorder


def proved(scenario: Scenario, frames: np.ndarray, flown: Iterable[int]) -> Certified:
    """The certificate of frames. frames: the record (1,) of `frame_dtype`. flown: yields the number of each
    frame once the record holds it. Raises BadInput if the scheme is not ours.
    """
    check_scheme(scenario)
    recorder = Recorder(scenario)
    recorder.begin(frames)
    log = _log(frames, flown, scenario, recorder)
    recorder.land()
    return certificate(scenario, log, recorder)


def proof(scenario: Scenario, log: Log) -> Proof:
    """The certificate of a flight with a log; the flight is flown again. Raises BadInput if the scheme is not
    ours."""
    certified = certificate(scenario, log)
    columns = Columns()
    certified.copy_log(columns)
    columns.close()
    return Proof(certified.document, dict(columns), certified.scenario)


def _log(frames: np.ndarray, flown: Iterable[int], scenario: Scenario, recorder: Recorder) -> MemoryLog:
    """A log of all frames, with the columns that a certificate needs. Advances the frames and records them.
    further: column -> value of the last frame."""
    log = MemoryLog()
    surfaces = scenario.airframe.surfaces
    names = estimator_names(scenario.fdi.fault_class, scenario.airframe)
    columns = ["t_s", *(f"{axis}_{end}" for end in MEASURED_MODEL_BOUND for axis in AXES), "detected"]
    columns += [f"fie_{name}_excluded" for name in names]
    further: dict[str, float] = {}
    rows = []
    for k in flown:
        recorder.keep()
        frame = FrameReadout(frames[0])
        diagnosis = frame.diagnosis
        vectors = frame.rates_rad_s, frame.model_rad_s2, diagnosis.declared_bounds.eta_bar_rad_s2
        if scenario.fdi.statistical:
            further = chance.likelihood_shares(diagnosis, surfaces)
        monitor = diagnosis.sensor_monitor
        if monitor.enabled:
            further |= {"watch_share": monitor.top_ratio, "watch_test": monitor.worst_test_index}
            further["watch_missing"] = float(next(iter(frame.missing_sensors), nan))
        # The order of the columns.
        numbers = [frame.alarmed, *diagnosis.is_estimator_excluded, *further.values()]
        rows.append(np.concatenate([[k / scenario.rate_hz], *vectors, numbers]))
    log.open([*columns, *further])
    log.write(np.array(rows))
    return log
