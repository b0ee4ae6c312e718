"""What certificates take of a flight is kept while it flies: nothing else flies, and no frame is mistaken."""

import numpy as np

import beaver_ftc as bf
from beaver_ftc.loop.loop import Loop, fly
from beaver_ftc.results.log import MemoryLog
from beaver_ftc.results.writer import run
from beaver_ftc_assurance.certificates import tape
from beaver_ftc_assurance.certificates.certificate import as_text
from flying import SINES

JAM = {"type": "stuck", "actuator": "aileron", "position_deg": 5, "at_s": 1.0}
FLIGHT = {
    "name": "test",
    "duration_s": 14.0,
    "reference": SINES,
    "faults": [JAM],
    "fdi": {"fault_class": "all"},
}


def test_what_is_kept_is_what_the_log_has_to_the_last_frame_of_a_long_flight():
    """More frames after the alarm than there was room for at first."""
    log, recorder = MemoryLog(), tape.Recorder(scenario := bf.load(FLIGHT))
    fly(scenario, log, watch=recorder.watch)
    rows = dict(zip(log.columns, log.rows.T, strict=True))
    alarm = int(np.argmax(rows["detected"] > 0))
    kept = recorder.tape([alarm, len(log.rows) - 1], len(log.rows))
    assert (kept.first, kept.end) == (alarm - tape.FRAMES_BEFORE_ALARM, len(log.rows))
    assert kept.frames > tape.FRAMES_BEFORE_ALARM + 1024
    assert recorder.tape([alarm - 9], len(log.rows)).first == kept.first  # what was before is overwritten
    here = slice(kept.first, kept.end)
    for i, axis in enumerate("pqr"):
        assert np.array_equal(kept.x[:, i], rows[f"{axis}_measured_rad_s"][here])
        assert np.array_equal(kept.eta_bar[:, i], rows[f"{axis}_eta_bar_rad_s2"][here])
    assert kept.alarm.k == alarm + 1


def test_a_run_with_a_certificate_flies_once_and_writes_what_another_flight_would(tmp_path, monkeypatch):
    flights, begin = [], Loop.__init__

    def counted(self, *args, **kwargs):
        flights.append(self)
        begin(self, *args, **kwargs)

    monkeypatch.setattr(Loop, "__init__", counted)
    scenario = bf.load(FLIGHT | {"duration_s": 3.0})
    run(scenario, tmp_path, report=False, certified=True)
    assert len(flights) == 1
    assert (tmp_path / "test/certificate.json").read_text() == as_text(bf.fly(scenario).certificate())
