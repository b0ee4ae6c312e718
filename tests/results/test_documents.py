"""All that is written of flights made by hand: metrics, recordings, the data of a report, JUnit, words."""

import math

import pytest
from synthetic import LOSS, landed, scenario

from beaver_ftc.aircraft import load
from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.results import verdict
from beaver_ftc.results.exports import write_acmi
from beaver_ftc.results.flight import Flight as Opened
from beaver_ftc.results.junit import write_junit
from beaver_ftc.results.metrics import metrics
from beaver_ftc.results.model import Expectation, Judged, Metrics

SENSOR = {"sensor": "q", "type": "bias", "magnitude": 3.0, "at_s": 5.0}
JAM = {"type": "stuck", "actuator": "flap", "at_s": 20.0, "end_s": 25.0}
EXPECT = {
    "detected_within_s": 0.1, "isolated_as": "elevator", "no_departure": True,
    "arrives": {"altitude_m": 5.0, "in_envelope": True}, "post_fault_rms_deg_s": {"q": 0.5},
}  # fmt: skip
FLIGHTS = {
    "quiet": landed(
        scenario(), detection_time_s=None, detection_axis=None, guaranteed_delay_s=None,
        isolation_time_s=None, isolated=None, isolation_type=None, candidates=(), estimate=None,
        post_fault_rms_rad_s=None, supervisor=[(0.0, "nominal")], mode_changes=1, end=(45.5, 1830.0),
    ),
    "eventful": landed(
        scenario(LOSS, JAM, expect=EXPECT),
        mode_changes=9, exits=4, outside_s=2.25, envelope_exits=[(13.0, 14.5), (20.0, 30.0)],
        outside_at_end=True,
        end=(39.0, 1500.0), isolation_type="stuck", estimate=0.1, estimate_interval=(0.05, math.nan),
        frequency_rad_s=5.0, type_time_s=12.5, probing_s=(14.0, 18.5),
        engine_power={"from_s": 13.2, "in_charge_s": 0.9, "lowest_inhg": 20.04, "highest_inhg": 22.26},
        profile={
            "altitude_m": 3.0, "airspeed_mps": 1.5, "heading_deg": 0.1, "bank_deg": 0.2,
            "airspeed_limited_mps": 1.25, "airspeed_at_one_instant_mps": 4.5,
        },
        arrival={"altitude_m": -2.0, "airspeed_mps": None, "heading_deg": 0.05, "bank_deg": None},
        limits=({
            "limits": "bank_deg", "side": "at most", "value": 30.0, "in_force": True, "time_s": 20.0,
            "because": "stuck",
        },),
        authority={
            axis: {"given_share": 0.75, "beyond_s": beyond_s}
            for axis, beyond_s in zip("pqr", (0.2, 0.05, 0.0), strict=True)
        },
        saturation_s={"elevator": 1.25, "flap": 0.0},
        statistical={"time_s": 12.2, "alarm_level": 6.5, "closest_approach": 0.81},
        changes=({
            "time_s": 3.0, "law": "adaptive", "scheme": None, "sensors": {}, "detection_time_s": 2.0,
            "isolated": None,
        },),
        faults=({
            "isolated": "elevator", "isolation_type": "loss_of_effectiveness", "isolation_time_s": 12.5,
            "candidates": ["loss_of_effectiveness"], "estimate": -0.4,
        }, {
            "isolated": None, "isolation_type": None, "isolation_time_s": None,
            "candidates": ["flap", "rudder"],
        }),
        supervisor=[(0.0, "nominal"), (12.07, "adaptive"), (14.0, "reallocated")],
    ),
    "lost": landed(
        scenario(SENSOR, expect=EXPECT), frames=1450, departure=(14.5, "alpha_rad"),
        detection_axis=None, isolated="sensor q", isolation_type=None, estimate=None, candidates=(),
        detection_time_s=5.5, isolation_time_s=5.75, arrival={"altitude_m": 1.0},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_metrics_of_a_flight(name, changed):
    document = metrics(FLIGHTS[name])
    assert document.pop("versions").keys() == {"beaver-ftc", "jsbsim", "numpy", "numba", "python"}
    assert not changed(document)


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_words_of_a_flight(name, changed):
    opened = Opened(FLIGHTS[name].scenario, metrics(FLIGHTS[name]))
    assert not changed({
        "terminal": verdict.verdict_text(Metrics.of(opened.metrics), "runs/x").splitlines(),
        "outcome_class": verdict.outcome_class(Metrics.of(opened.metrics)),
        "repr": repr(opened).splitlines(), "html": opened._repr_html_(),
    })  # fmt: skip


MISSED = (
    Expectation("a", False, 1, None), Expectation("b", True, 1, 1), Expectation("c", False, "x" * 20_000, []),
)  # fmt: skip


def test_what_xml_cannot_hold_and_what_is_too_long(tmp_path):
    write_junit([Judged("two", expectations=MISSED, took_s=1.0)], tmp_path / "deep" / "junit.xml")
    text = (tmp_path / "deep" / "junit.xml").read_text(encoding="utf-8")
    assert text.startswith("<?xml version='1.0' encoding='utf-8'?>\n<testsuites")
    assert 9_900 < text.count("x") < 10_100
    assert 'tests="3" failures="2" errors="0"' in text
    write_junit([Judged("one\x07", error="cannot\x07 be\ntrimmed \ud800")], tmp_path / "junit.xml")
    text = (tmp_path / "junit.xml").read_text(encoding="utf-8")
    assert "cannot\\x07 be&#10;trimmed \\ud800" in text
    assert 'classname="one\\x07"' in text
    (tmp_path / "file").write_text("")
    with pytest.raises(SimulationFailed, match=r"cannot write .*junit.xml: "):
        write_junit([], tmp_path / "file" / "junit.xml")


def test_a_tacview_recording_has_25_frames_a_second(log_path, found, tmp_path):
    write_acmi(log_path, found, tmp_path / "flight.acmi", load())
    lines = (tmp_path / "flight.acmi").read_text(encoding="utf-8").splitlines()
    times = [float(line[1:]) for line in lines if line.startswith("#")]
    assert times == pytest.approx([k / 25.0 for k in range(len(times))])
    assert 29.9 < times[-1] < 30.0
    events = [line.rpartition("|")[2] for line in lines if "Event=Bookmark" in line]
    assert [event.split()[0] for event in events] == ["fault", "detection", "isolation"]
