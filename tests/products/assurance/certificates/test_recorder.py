"""What certificates take of a flight is kept while it flies: nothing else flies, and no frame is mistaken."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import beaver_ftc as bf
from beaver_ftc.loop.loop import Loop, fly
from beaver_ftc.results.log import MemoryLog
from beaver_ftc.results.writer import run
from beaver_ftc_assurance.certificates import certificate, tape
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


@given(st.lists(st.booleans(), min_size=1, max_size=40))
@settings(deadline=None)
def test_the_ring_holds_the_last_frames_before_the_alarm_and_what_follows_it(alarms):
    """Against a list of all that stood in the record, whatever the alarm does."""
    record, always, early = np.zeros(6, np.int64), np.array([0, 5]), np.array([2])
    kept, ring, at_alarm, state = np.zeros((60, 2)), np.zeros((4, 1)), np.zeros(6), np.array([0, -1, 0, 3, 4])
    kept, ring, at_alarm = (array.astype(np.int64) for array in (kept, ring, at_alarm))
    for k, alarmed in enumerate(alarms):
        record[:] = 10 * k, 0, 10 * k + 2, alarmed, 0, 10 * k + 5
        tape.keep_frame(record, always, early, kept, ring, at_alarm, state)
    last_clear = max((k for k, alarmed in enumerate(alarms) if not alarmed), default=-1)
    raised = last_clear + 1 if alarms[-1] else None
    assert state[0] == len(alarms)
    assert state[1] == (-1 if raised is None else raised)
    until = len(alarms) - 1 if raised is None else raised
    for k in range(max(until - 3, int(state[2])), until + 1):
        assert [*kept[k % 4]] == [10 * k, 10 * k + 5]
        assert ring[k % 4] == 10 * k + 2
    for k in range(until + 1, len(alarms)):
        assert [*kept[4 + k - until - 1]] == [10 * k, 10 * k + 5]
    if raised is not None:
        assert at_alarm[0] == 10 * raised


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


def test_of_chance_more_frames_before_the_alarm_are_kept():
    """An onset may be long before: of the worst case the frames are those that a filter remembers."""
    for fdi, before in (
        ({}, tape.FRAMES_BEFORE_ALARM),
        ({"statistical": {}}, tape.STATISTICAL_FRAMES_BEFORE_ALARM),
    ):
        scenario = bf.load({"name": "x", "fdi": fdi})
        recorder = tape.Recorder(scenario)
        recorder.begin(Loop(scenario).frames)
        assert recorder._ring.shape == (1 + before, len(recorder._early.words))
        assert len(recorder._kept) > len(recorder._ring)


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


def test_a_certificate_is_of_the_file_beside_the_log(tmp_path, monkeypatch):
    """Of an aircraft of one's own that file names a copy: its text is another than the scenario's own."""
    (tmp_path / "scenario.yaml").write_text("name: as it lies there\n", encoding="utf-8")
    asked = []
    monkeypatch.setattr(certificate, "StoredLog", lambda path: path)
    monkeypatch.setattr(certificate, "certificate", lambda *of: asked.append(of) or ({"a": 1}, {}))
    certificate.write("scenario", "recorder", tmp_path)
    assert asked == [("scenario", tmp_path / "log.parquet", "recorder", "name: as it lies there\n")]
    assert (tmp_path / "certificate.json").read_text() == '{"a":1}\n'


FLAGS = {  # by row; of three exclusions one stands from the first row on, and one is taken back
    "t_s": [0.0, 0.1, 0.2, 0.3, 0.4], "detected": [0, 1, 0, 1, 1], "fie_flap_excluded": [0, 0, 0, 0, 1],
    "fie_rudder_excluded": [1, 1, 1, 1, 0], "fie_elevator_excluded": [1, 1, 1, 1, 1],
    "flap_likelihood_share": [0.1, 0.2, 0.3, 0.4, 0.5], "p_measured_rad_s": [1.0, 2.0, 3.0, 4.0, 5.0],
    "q_cmd": [9.0] * 5,
}  # fmt: skip


def logged(columns):
    log = MemoryLog()
    log.open([*columns])
    for part in (slice(0, 2), slice(2, 5)):
        log.write(np.array([*columns.values()], float).T[part])
    return log


def test_a_certificate_is_of_the_events_that_stand_at_the_end(monkeypatch):
    asked, scenario = [], bf.load({"name": "x"})
    monkeypatch.setattr(
        certificate, "certificate_document", lambda *of: asked.append(of) or {"statements": ["said"]}
    )
    monkeypatch.setattr(certificate, "evidence_columns", lambda *of: ("columns", *of))
    recorder = SimpleNamespace(tape=lambda known, n: ("kept", known, n))
    events = {"detected": 3, "fie_flap_excluded": 4, "fie_elevator_excluded": 0}
    found = certificate.certificate(scenario, logged(FLAGS), recorder, "text")
    ((of, rows, of_events, tape_of_it, text),) = asked
    assert (of, of_events, text) == (scenario, events, "text")
    assert tape_of_it == ("kept", [3, 3, 4, 0], 5)
    taken = [name for name in FLAGS if name not in ("t_s", "q_cmd")]
    assert {name: values.tolist() for name, values in rows.items()} == {name: FLAGS[name] for name in taken}
    assert found == ({"statements": ["said"]}, ("columns", scenario, tape_of_it, ["said"]))
    monkeypatch.setattr(certificate, "tape_of_flight_again", lambda *of: ("again", *of[1:]))
    certificate.certificate(scenario, logged(FLAGS))
    assert asked[1][3:] == (("again", [3, 3, 4, 0], 5), None)
    quiet = {name: [0.0] * 5 for name in FLAGS}
    assert certificate.certificate(scenario, logged(quiet), recorder, "text")[1] == {}
    assert asked[2][2:] == ({}, None, "text")


def test_a_log_gets_columns_that_are_known_in_a_part_of_it():
    columns = {
        "part": certificate.PartialColumn(1, np.array([7.0, 8.0]), -1.0, 6.0),
        "late": certificate.PartialColumn(4, np.array([3.0, 4.0])),
        "whole": certificate.PartialColumn.constant(2.5),
    }
    whole = MemoryLog()
    certificate.copy_with_columns(logged(FLAGS), columns, whole)
    found = {name: np.concatenate([chunk[name] for chunk in whole.read_chunks()]) for name in whole.columns}
    expected = FLAGS | {
        "part": [-1.0, 7.0, 8.0, 6.0, 6.0], "late": [np.nan] * 4 + [3.0], "whole": [2.5] * 5,
    }  # fmt: skip
    assert list(found) == list(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)
