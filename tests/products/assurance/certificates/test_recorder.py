"""What certificates take of a flight is kept while it flies: nothing else flies, and no frame is mistaken."""

import beaver_ftc as bf
from beaver_ftc.loop.loop import Loop
from beaver_ftc.results.writer import run
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
