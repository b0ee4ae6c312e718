"""A short flight with all that is declared at once: what each source adds, and the documents made of it."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.log import StoredLog, read
from beaver_ftc.results.metrics import measure
from beaver_ftc.results.model import Metrics
from beaver_ftc.studies.mismatch import split, study, tables
from beaver_ftc.studies.mismatch.linear import analyse, linear_document
from beaver_ftc.studies.mismatch.models import LOGGED, States, true_moments
from beaver_ftc.studies.mismatch.sources import SOURCES, earth, earth_rotation, fault_effects, share
from beaver_ftc.studies.mismatch.split import ETA_BAR, TOTAL, UNEXPLAINED, Figures, Tally
from flying import Memory, fly, loss, scenario
from kept import in_short

FAULTS = [
    {"type": "bias", "actuator": "elevator", "bias_deg": 1, "at_s": 0.4, "end_s": 0.8},
    {"type": "stuck", "actuator": "elevator", "at_s": 1.0, "end_s": 1.3},
    loss(magnitude=0.3, at_s=0.6, profile="incipient", kappa_per_s=2.0), loss(magnitude=0.2, at_s=1.2),
    {"type": "float", "actuator": "rudder", "at_s": 0.9}, loss("rudder", 0.5, 0.5),
    {"type": "unanticipated", "Cm_alpha3": 5, "at_s": 0.7, "profile": "incipient", "kappa_per_s": 1},
]  # fmt: skip


@pytest.fixture(scope="module")
def case():
    return scenario(
        duration_s=1.6, rate_hz=50, substeps=2, faults=FAULTS, seed=3, sensors="tactical-grade",
        actuators={"bandwidth_rad_s": 20.0, "rate_limit_deg_s": 40.0, "elevator": {"travel_deg": [-8, 6]}},
        control={"law": "nominal"},
        uncertainty={
            "inertia_coupling": {"p": 0.2, "q": -0.2, "r": 0.1},
            "coefficients": {"Cm_alpha": 1.1, "Cl_p": 0.8},
            "sinusoid": {"r": {"amplitude_rad_s2": 0.02, "frequency_rad_s": 9}},
        },
        design_model={
            "engine_terms": False, "mass": 1.1, "inertia": {"Jxz": 2.0}, "frozen_alpha": True,
            "coefficients": {"Cn_r": 0.9, "Cm_dpt": 0.8},
        },
    )  # fmt: skip


@pytest.fixture(scope="module")
def flown(case):
    log = Memory()
    return fly(case, log), log


@pytest.fixture(scope="module")
def stretches(case, flown):
    _, log = flown
    columns = {name: log[name] for name in log.columns if name in LOGGED}
    return list(
        split.split(case, [{name: of[a:b] for name, of in columns.items()} for a, b in ((0, 33), (33, 80))])
    )


@pytest.fixture(scope="module")
def tally(case, stretches):
    return Tally.of(case, stretches)


def test_what_each_source_adds(stretches, changed):
    assert [stretch.t_s.size for stretch in stretches] == [32, 47, 1]
    assert max(np.abs(stretch.unexplained).max() for stretch in stretches) < 1e-9
    assert not changed([
        {
            **held(stretch.named),
            "parts": {name: held(parts) for name, parts in stretch.details.items()},
            **held({name: getattr(stretch, name) for name in ("place", "eta_bar", "t_s")}),
        }
        for stretch in stretches
    ])  # fmt: skip


def held(arrays):
    """In short, but for what rounding leaves."""
    return {name: in_short(of) for name, of in arrays.items() if UNEXPLAINED not in name}


def test_the_closure_is_the_largest_unexplained_of_any_axis(case, tally, flown):
    rest = Figures()
    rest.add(np.array([[0.2, 0.7, 0.3]]), np.ones((1, 3)))
    other = replace(tally, figures=tally.figures | {UNEXPLAINED: rest})
    assert study.document(case, other, measure(flown[0]))["closure"] == 0.7


def without_rest(document):
    """What rounding leaves is no number to hold."""
    assert 0.0 < document.pop("closure") < 1e-9
    for axis in document["axes"].values():
        assert axis.pop(UNEXPLAINED)["max"] < 1e-9
    return document


@pytest.fixture(scope="module")
def document(case, flown, tally):
    found = study.document(case, tally, measure(flown[0]))
    constant, later = {"p": 0.1, "q": 0.25, "r": 0.03}, {"detection_delay_s": 0.5, "guaranteed_delay_s": 0.7}
    declared = {"false_alarm": True, "detection_delay_s": None, "guaranteed_delay_s": None}
    return found | {
        "recommended": {"constant_rad_s2": constant, "runs": 2, "settled": True},
        "guarantee": {"declared": declared, "recommended": {"false_alarm": False, **later}},
        "linear": linear_document(analyse(scenario(initial={"airspeed_mps": 40.0}))),
    }


def test_the_document(case, flown, tally, changed):
    assert not changed(without_rest(study.document(case, tally, measure(flown[0]))))


def test_the_table_the_text_and_the_line_among_others(document, changed):
    rows = [row for row in study.csv_rows(document) if row["source"] != UNEXPLAINED]
    assert len(rows) == 3 * (len(SOURCES) + 1 + 7 + 3)
    assert not changed(
        {"first": rows[:2], "last": rows[-1], "numbers": in_short([list(row.values())[4:] for row in rows])}
    )
    assert not changed(study.entry(document), part="entry")
    text = [line for line in tables.mismatch_text(document, "out").splitlines() if UNEXPLAINED not in line]
    assert not changed(text, part="text")
    other = study.entry(document | {"scenario": "other", "dominant": None})
    assert not changed(
        tables.comparison_text([study.entry(document), other], document, "out").splitlines(), part="runs"
    )


def test_the_section_of_a_report(document, changed, tmp_path):
    assert tables.mismatch_section(tmp_path) == ""
    study.write_files(tmp_path, study._as_files(document, [{"a": 1}]))
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "mismatch-bound.png").write_bytes(b"bound")
    (tmp_path / "figures" / "mismatch-zeros.png").write_bytes(b"zeros")
    said = tables.mismatch_section(tmp_path).replace("<tr>", "\n<tr>").replace("<figure>", "\n<figure>")
    assert not changed([line for line in said.splitlines() if UNEXPLAINED not in line])
    assert (tmp_path / "mismatch.csv").read_text().split() == ["a", "1"]


def test_every_frame_is_written(case, flown, tally, tmp_path, monkeypatch, changed):
    """From the log's file, and as it is flown: the same tally, and all frames in their columns."""
    _, log = flown
    with split.ParquetLog(tmp_path / "log.parquet") as file:
        file.open(log.columns)
        file.write(log.rows)
    found = split.tally_of_log(case, tmp_path / "log.parquet", tmp_path / "frames.parquet")
    again, flight = split.tally_of_flight(case)
    for one in (found, again):
        assert one.frames == tally.frames == 80
        assert study.document(case, one, flight)["bound"] == study.document(case, tally, flight)["bound"]
        assert one.rms(TOTAL) == pytest.approx(tally.rms(TOTAL), rel=1e-12)
    frames = read(tmp_path / "frames.parquet")
    assert not changed(held(frames))
    assert StoredLog(tmp_path / "frames.parquet").row_count() == 80
    assert frames["q_eta_bar_rad_s2"] == pytest.approx(
        np.append(log["q_eta_bar_rad_s2"][1:], log["q_eta_bar_rad_s2"][-1])
    )
    assert ETA_BAR in split.NAMES


def test_an_incipient_fault_grows_from_its_frame_on():
    fault = SimpleNamespace(at_s=1.0, end_s=3.0, profile="incipient", kappa_per_s=0.5)
    t = np.array([0.99, 1.0, 2.0, 2.99, 3.0])
    assert share(fault, t) == pytest.approx([0.0, 0.0, 1 - np.exp(-0.5), 1 - np.exp(-0.995), 0.0])
    fault.profile = "abrupt"
    assert share(fault, t).tolist() == [0.0, 1.0, 1.0, 1.0, 0.0]
    fault.end_s = None
    assert share(fault, t).tolist() == [0.0, 1.0, 1.0, 1.0, 1.0]


def test_who_struck_last_has_the_surface_also_after_its_repair():
    """bias 1 to 4 s, jam 2 to 3 s, both of the elevator; the loss takes of what the one before has left."""
    bias = {"type": "bias", "actuator": "elevator", "bias_deg": 1, "at_s": 1.0, "end_s": 4.0}
    jam = {"type": "stuck", "actuator": "elevator", "at_s": 2.0, "end_s": 3.0}
    case = scenario(faults=[jam, bias, loss(magnitude=0.5, at_s=1.5), loss(magnitude=0.4, at_s=2.5)])
    t, none = np.arange(0.5, 6.0), np.zeros((6, 3))
    position, healthy = np.full((6, 4), 0.2), np.full((6, 4), 0.05)
    y = np.zeros((6, 5))
    states = States(t, none, none, none, y, y, position, position, position, none, none, t, t, none, none)
    G = np.zeros((6, 3, 4))
    G[:, 1, 1] = 10.0
    found = fault_effects(SimpleNamespace(scenario=case, design_model=None), states, G, healthy)
    assert {name: of[:, 1].tolist() for name, of in found.items()} == {
        "elevator loss of effectiveness at 1.5 s": pytest.approx([0.0, -1.0, -1.0, -1.0, -1.0, -1.0]),
        "elevator loss of effectiveness at 2.5 s": pytest.approx([0.0, 0.0, -0.4, -0.4, -0.4, -0.4]),
        "elevator bias at 1 s": pytest.approx([0.0, 1.5, 0.0, 1.5, 0.0, 0.0]),
        "elevator stuck at 2 s": pytest.approx([0.0, 0.0, 1.5, 0.0, 1.5, 1.5]),
    }
    assert not any(of[:, [0, 2]].any() for of in found.values())


def test_north_turns_the_earth_with_the_mean_radius():
    """A degree of latitude is R pi / 180 long, R the mean radius and the altitude the flight starts at."""
    case = scenario(initial={"altitude_m": 2000.0})
    truth, x = true_moments(case), np.array([[0.1, 0.5, -0.2]])
    for degrees in (0.0, 1.0, 20.0):
        north = np.array([np.radians(degrees) * (6371000.0 + 2000.0)])
        attitude = np.array([[0.3, -0.1, 1.0]])
        found = earth(
            SimpleNamespace(truth=truth, scenario=case),
            SimpleNamespace(north_m=north, x=x, attitude=attitude),
        )
        there = earth_rotation(truth.inertia, x, attitude, np.radians([45.0 + degrees]))
        assert found == pytest.approx(there, rel=1e-9)


def test_a_map_has_a_flight_for_each_place(monkeypatch, tmp_path, changed):
    asked = []

    def flies(case):
        asked.append((case.initial.airspeed_mps, case.initial.altitude_m, case.faults))
        if case.initial.airspeed_mps == 30.0:
            raise BadInput("no trim")
        found = Tally(np.full(3, 0.02), 0.1, frames=2)
        for i, name in enumerate(split.NAMES):
            found.figures[name] = split.Figures()
            found.figures[name].add((i + 1e-3 * np.arange(6.0)).reshape(2, 3), np.full((2, 3), 2.0 + i % 5))
        for i, bound in enumerate(found.bounds):
            bound.worst_ratio, bound.smallest_constant_rad_s2 = 0.1 * i + case.initial.altitude_m, 0.01 * i
        isolation = {"fault": None, "delay_s": None, "correct": None}
        return found, Metrics.of({"false_alarm": False, "detection": {}, "isolation": isolation})

    monkeypatch.setattr(study, "tally_of_flight", flies)
    monkeypatch.setattr(study, "AIRSPEEDS_MPS", study.AIRSPEEDS_MPS[:2])
    assert not changed(study.run_map(tmp_path, scenario(faults=[loss()]), report=False)[:12])
    assert asked == [(V, h, ()) for h in (0.0, 1000.0, 2000.0, 3000.0, 4000.0) for V in (30.0, 35.0)]
    assert {path.name for path in (tmp_path / "test-mismatch-map").iterdir()} >= {
        "mismatch.json",
        "mismatch.csv",
    }


@pytest.mark.parametrize(("frames", "rms"), [(0, 0.0), (1, 2.0), (4, 1.0)])
def test_the_rms_is_over_all_frames_and_of_none_nothing(frames, rms):
    tally = Tally(np.zeros(3), 0.1, frames=frames, figures={TOTAL: split.Figures()})
    tally.figures[TOTAL].square_sum = np.full(3, 4.0 if frames else 0.0)
    assert tally.rms(TOTAL).tolist() == [rms] * 3
    assert study._figures(tally.figures[TOTAL], tally, 0)["rms"] == rms
    assert study._figures(tally.figures[TOTAL], tally, 0)["share"] == (1.0 if frames else 0.0)


@pytest.mark.parametrize("report", [True, False])
def test_a_run_is_a_result_folder_with_the_mismatch_in_it(report, monkeypatch, tmp_path, document):
    """Pictures, and a report with a section of them, unless nobody wants them."""
    recommended = {key: document[key] for key in ("recommended", "guarantee")}
    registered = []
    monkeypatch.setattr(study, "recommended_for", lambda scenarios, kept: recommended)
    monkeypatch.setattr(study.charts, "figures", lambda folder, *of: {"mismatch-bound.png": b"drawn"})
    monkeypatch.setattr(study, "write_report_files", lambda folder, flown: registered.append(folder))
    monkeypatch.setattr(tables, "register_section", registered.append)
    case = scenario(duration_s=0.3)
    found, kept = study.run_mismatch(case, tmp_path, **({} if report else {"report": False}))
    folder = tmp_path / "test"
    assert kept.frames == found["frames"] == 30
    assert found["recommended"] == recommended["recommended"]
    assert (folder / "figures" / "mismatch-bound.png").exists() == report
    names = {
        "scenario.yaml",
        "metrics.json",
        "log.parquet",
        *(f"mismatch.{of}" for of in ("json", "csv", "parquet")),
    }
    assert {path.name for path in folder.iterdir()} == names | ({"figures"} if report else set())
    assert [one == tables.mismatch_section for one in registered] == ([True, False] if report else [])


@pytest.mark.parametrize("report", [True, False])
def test_runs_side_by_side_are_a_folder_of_their_own(report, tmp_path, document):
    folder = study.write_comparison(tmp_path, [study.entry(document)], {"recommended": {}}, report)
    assert folder == tmp_path / "mismatch-comparison"
    assert read_json(folder / "mismatch.json") == {"runs": [study.entry(document)], "recommended": {}}
    assert (folder / "figures" / "mismatch-comparison.png").exists() == report


def read_json(path):
    return json.loads(path.read_text())


def test_a_variant_is_named_after_both_and_the_declared_one_as_it_was():
    case = scenario()
    assert study.variant_of(case, "declared").name == "test"
    assert study.variant_of(case, "mass=1.1+linearised").name == "test-mass-1-1-linearised"
    long = case.model_copy(update={"name": "x" * 95})
    assert study.variant_of(long, "linearised").name == "x" * 95 + "-line"
    assert study.variant_of(case, "engine_terms=false").design_model.engine_terms is False
    for wrong in ("mass", "mass=[1]", "mass={"):
        with pytest.raises(BadInput, match=r"^--variant mass"):
            study.variant_of(case, wrong)
