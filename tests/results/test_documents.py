"""All that is written of flights made by hand: metrics, recordings, the data of a report, JUnit, words."""

import base64
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic import Expect, Fault, Flight, Scenario

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.results import verdict
from beaver_ftc.results.exports import RECORDING_FILE_OF_KIND, write_acmi, write_recording
from beaver_ftc.results.flight import Flight as Opened
from beaver_ftc.results.junit import write_junit
from beaver_ftc.results.log import ParquetLog
from beaver_ftc.results.metrics import as_json, measure, metrics
from beaver_ftc.results.model import Expectation, Judged, Metrics
from beaver_ftc.results.report import render
from beaver_ftc.results.style import MODE_COLOURS
from kept import in_short

SENSOR = SimpleNamespace(
    sensor="q", type="bias", at_s=5.0, end_s=None, profile="abrupt",
    model_dump=lambda exclude, exclude_none: {"magnitude": 3.0},
)  # fmt: skip
EXPECT = Expect(
    detected_within_s=0.1, isolated_as="elevator", no_departure=True,
    arrives={"altitude_m": 5.0, "in_envelope": True}, post_fault_rms_deg_s={"q": 0.5},
)  # fmt: skip
FLIGHTS = {
    "quiet": Flight(
        scenario=Scenario(faults=()), detection_time_s=None, detection_axis=None, guaranteed_delay_s=None,
        isolation_time_s=None, isolated=None, isolation_type=None, candidates=(), estimate=None,
        post_fault_rms_rad_s=None, supervisor=[(0.0, "nominal")], mode_changes=1, end=(45.5, 1830.0),
    ),
    "eventful": Flight(
        scenario=Scenario(
            faults=(Fault(), Fault(at_s=20.0, actuator="flap", type="stuck", end_s=25.0)), expect=EXPECT
        ),
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
    "lost": Flight(
        scenario=Scenario(faults=(SENSOR,), expect=EXPECT), frames=1450, departure=(14.5, "alpha_rad"),
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


FRAMES, HZ = 6, 50.0
ANGLES, ROOM = (
    ("phi_rad", "theta_rad", "psi_rad", "alpha_rad", "beta_rad"),
    ("north_m", "east_m", "altitude_m"),
)
TRAVEL_RAD = {"elevator": 0.4, "flap": 1.0}
LOGGED = (
    "t_s", *ROOM, *ANGLES, "airspeed_mps", "qdyn_pa", "flap_pos_rad", *(f"{a}_measured_rad_s" for a in "pqr"),
    *(f"{s}_cmd_rad" for s in TRAVEL_RAD),
)  # fmt: skip


def _written(path, frames=FRAMES, hz=HZ, group=4):
    rows = np.outer(np.arange(frames), np.linspace(0.01, 0.2, len(LOGGED))) + np.arange(len(LOGGED)) / 100
    rows[:, 0] = np.arange(frames) / hz
    with ParquetLog(path, group) as log:
        log.open(LOGGED)
        log.write(rows)
    return path


@pytest.mark.parametrize("kind", RECORDING_FILE_OF_KIND)
def test_a_recording_and_its_vehicle_file(kind, tmp_path, changed):
    write_recording(_written(tmp_path / "log.parquet"), TRAVEL_RAD, kind, tmp_path)
    content = (tmp_path / RECORDING_FILE_OF_KIND[kind]).read_bytes()
    said = content.decode().splitlines() if kind == "table" else base64.b64encode(content).decode()
    assert not changed({"file": said, "vehicle": (tmp_path / "vehicle.yaml").read_text().splitlines()})


@pytest.mark.parametrize(
    ("hz", "frames", "every"),
    [(25.0, 6, 1), (26.0, 6, 2), (100.0, 9, 4), (75.0, 12, 3), (10.0, 3, 1), (50.0, 1, 1)],
)
def test_a_tacview_recording_has_25_frames_a_second_at_most(tmp_path, hz, frames, every):
    path = _written(tmp_path / "log.parquet", frames, hz)
    write_acmi(path, measure(FLIGHTS["quiet"]), tmp_path / "flight.acmi")
    lines = (tmp_path / "flight.acmi").read_text().splitlines()
    shown = [line for line in lines if line.startswith("#")]
    assert shown == [f"#{i / hz:.3f}" for i in range(0, frames, every)]


def _folder(path, flight, group=1000):
    path.mkdir()
    columns = [
        name for name in flight.columns if not name.startswith(("fie_rudder", "fie_aileron", "aileron"))
    ]
    t_s = np.arange(flight.frames) / flight.scenario.rate_hz
    with ParquetLog(path / "log.parquet", group) as log:
        log.open(columns)
        log.write(np.column_stack([t_s, *(np.sin(t_s + i) for i in range(1, len(columns)))]))
    (path / "metrics.json").write_text(as_json(metrics(flight)))
    (path / "scenario.yaml").write_text("description: By hand.\n")
    return path


def _unpacked(data):
    """The data of a page, its curves in short."""
    for run in data["runs"]:
        for level in run["levels"]:
            for name, text in level.items():
                kind = "<f8" if name == "t_s" else "<f4"
                numbers = np.frombuffer(base64.b64decode(text), kind)
                level[name] = [float(f"{n:.4g}") for n in in_short(numbers)]
            level_names = ["t_s", "q_rad_s", "mode", "psi_rad", "q_ratio"]
            level.update({"columns": sorted(level), **{name: level[name] for name in level_names}})
            for name in set(level) - {*level_names, "columns"}:
                del level[name]
    return data


def _data_of(html):
    return json.loads(html.partition('id="data">')[2].partition("</script>")[0])


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    runs = tmp_path_factory.mktemp("runs")
    short = Flight(scenario=Scenario(rate_hz=10.0), frames=200)
    none = Flight(scenario=Scenario(rate_hz=10.0, faults=()), frames=0, detection_time_s=None,
                  isolation_time_s=None, isolated=None)  # fmt: skip
    return [_folder(runs / "short", short), _folder(runs / "none", none)]


def test_the_data_of_a_report(folders, changed):
    data = _unpacked(_data_of(render(folders, ["one", "two"])))
    assert data["modes"] == [list(pair) for pair in MODE_COLOURS.items()]
    assert not changed(data["runs"], part="runs")
    views = [view | {"panels": view["panels"][:2]} for view in data["views"] if view["name"] != "states"]
    assert not changed({"views": views, "looks": sorted(data["looks"])}, part="views")


def test_the_page_of_a_report(folders, changed):
    html = render(folders)
    words = html.partition("</style>")[2].partition('<script type="application/json"')[0]
    assert not changed([line.strip() for line in words.splitlines() if line.strip() and "jsbsim" not in line])


MISSED = (
    Expectation("a", False, 1, None), Expectation("b", True, 1, 1), Expectation("c", False, "x" * 20_000, []),
)  # fmt: skip


def test_what_xml_cannot_hold_and_what_is_too_long(tmp_path):
    write_junit([Judged("two", expectations=MISSED, took_s=1.0)], tmp_path / "deep" / "junit.xml")
    text = (tmp_path / "deep" / "junit.xml").read_text(encoding="utf-8")
    assert text.startswith("<?xml version='1.0' encoding='utf-8'?>\n<testsuites")
    assert 9_900 < text.count("x") < 10_100
    assert 'tests="3" failures="2" errors="0"' in text
    write_junit([Judged("one", error="cannot\x07 be\ntrimmed \ud800")], tmp_path / "junit.xml")
    assert "cannot\\x07 be&#10;trimmed \\ud800" in (tmp_path / "junit.xml").read_text(encoding="utf-8")
    (tmp_path / "file").write_text("")
    with pytest.raises(SimulationFailed, match=r"cannot write .*junit.xml: "):
        write_junit([], tmp_path / "file" / "junit.xml")
