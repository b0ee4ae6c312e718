"""A short flight with all that is declared at once: what each source adds, and the documents made of it."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.results.metrics import measure
from beaver_ftc.studies.mismatch import split, study, tables
from beaver_ftc.studies.mismatch.linear import analyse, linear_document
from beaver_ftc.studies.mismatch.models import LOGGED, States
from beaver_ftc.studies.mismatch.sources import SOURCES, fault_effects
from beaver_ftc.studies.mismatch.split import UNEXPLAINED, Figures, Tally
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


@pytest.mark.parametrize("report", [True, False])
def test_runs_side_by_side_are_a_folder_of_their_own(report, tmp_path, document):
    folder = study.write_comparison(tmp_path, [study.entry(document)], {"recommended": {}}, report)
    assert folder == tmp_path / "mismatch-comparison"
    assert read_json(folder / "mismatch.json") == {"runs": [study.entry(document)], "recommended": {}}
    assert (folder / "figures" / "mismatch-comparison.png").exists() == report


def read_json(path):
    return json.loads(path.read_text())
