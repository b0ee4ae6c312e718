"""From a scenario to what the derived gains are asked for."""

import numpy as np
import pytest

from beaver_ftc.control import laws, row_of, state
from beaver_ftc.control.laws import rejecting
from beaver_ftc.design.model import design_record
from beaver_ftc.diagnosis.model_prediction import prediction_dtype
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from law_records import fields, new_control
from telling import apart

Y = np.array([0.1, 0.02, 44.0, 1000.0, 0.3, 0.0, 0.0, 0.0])
SENSORS = {
    "p": {"noise_std_deg_s": 0.02, "delay_s": 0.02},
    "q": {"quantum_deg_s": 0.06, "noise_std_deg_s": 0.01, "bandwidth_rad_s": 50.0},
}


def laws_place(file):
    return list(state.FILES).index(file)


def given(control=None, **keys):
    scenario = {"name": "gains", "duration_s": 10, "rate_hz": 50, "sensors": SENSORS, **keys}
    return Scenario.model_validate(scenario | {"control": control or {}})


@pytest.fixture
def asked(monkeypatch):
    """What `gains.set_up` is asked for."""

    def ask(scenario, stand_in=3):
        found = {}
        monkeypatch.setattr(rejecting, "set_up", lambda config, **of: found.update(of))
        control = new_control(main=(0, 1, 2), stand_in=stand_in)
        prediction = np.zeros(1, prediction_dtype(4))[0]
        prediction["design"] = design_record()[0]
        prediction["actuators"]["approach"] = (0.2, 0.3, 0.4, 0.05)
        state.configure_law(control, prediction, Declared.of(scenario), Y)
        return found

    return ask


def test_a_laws_record_is_what_its_scenario_says_frame_by_frame():
    """At 50 Hz of three instants each; every number asked for is another, and so are those of the record."""
    control = {
        "law": "adaptive", "proportional_per_s": 3.1, "integral_per_s2": 0.7, "hand_over_s": 0.8,
        "reference_natural_frequency_rad_s": 9.0, "reference_damping": 0.6, "effectiveness_rate_per_s": 1.7,
        "least_effectiveness": 0.15,
    }  # fmt: skip
    probing = {"amplitude_deg": 4.0, "frequency_hz": 1.25, "duration_s": 2.4}
    travel = np.array([[-0.5, -0.4, -0.3, -0.1], [0.55, 0.45, 0.35, 1.0]])
    apart(travel=travel, control=[*control.values()][1:], probing=list(probing.values()))
    scenario = given(control, substeps=3, fdi={"fault_class": "all", "probing": probing})
    record = np.zeros(1, state.control_dtype(4))[0]
    state.configure(record, Declared.of(scenario), travel)
    state.configure_law(record, None, Declared.of(scenario), None)
    law, reach = fields(record["published"]), fields(record["layout"])
    assert (law["Kp"], law["Ki"]) == (3.1, 0.7)
    assert (reach["low"].tolist(), reach["high"].tolist()) == tuple(travel.tolist())
    assert (reach["main"].tolist(), reach["stand_in"], reach["general"]) == ([0, 1, 2], 3, 0)
    assert reach["is_backup"].tolist() == [0, 0, 0, 1]
    assert reach["authority"].tolist() == np.eye(3, 4).tolist()  # each leader has all about its axis
    assert record["config"].tolist() == (laws_place("published"), 1, 0, 0)
    surfaces, probe, model = (fields(record[stage]) for stage in ("surfaces", "probe", "reference"))
    assert fields(record["allocation"])["hand_over_step"] == pytest.approx(0.02 / 0.8)
    assert surfaces["effectiveness_step"] == pytest.approx(1.7 * 0.02)
    assert surfaces["least_effectiveness"] == 0.15
    assert probe["amplitude"] == pytest.approx(np.radians(4.0))
    assert probe["step"] == pytest.approx(2.0 * np.pi * 1.25 * 0.02)
    assert (probe["frames"], probe["from_s"], probe["to_s"]) == (120, -1.0, -1.0)
    A, B = laws.discretise(9.0, 0.6, 0.02)
    assert model["A"] == pytest.approx(np.array(A))
    assert model["B"] == pytest.approx(np.array(B))


INTEGRAL, UNKNOWN, LEARNT, FOUND = (
    np.array(of) for of in ((0.1, -0.2, 0.3), (1.0, 2.0, -3.0), (5.0, 6.0, 7.0), (0.4, -0.5, 0.8))
)


def flown_by(law):
    """What a law has in memory, no two numbers alike; Ki 2 and 4 1/s2."""
    control = new_control()
    row = row_of(law)
    control["config"] = row.place, row.uses_verdict, row.reallocates, row.informed
    for feedback, Ki in ((control["published"], 2.0), (control["zhang2005"]["feedback"], 4.0)):
        feedback["config"]["Ki"], feedback["memory"]["integral"] = Ki, INTEGRAL
    control["surfaces"]["output"]["unknown"], control["zhang2005"]["network"]["output"] = UNKNOWN, LEARNT
    observer = control["rejecting"]["observer"]
    observer["disturbance"], observer["rate"], observer["begun"] = FOUND, (0.01, 0.02, 0.03), 1
    control["compiled_rivals"]["memory"]["inherited"] = 3.0 * FOUND
    return control


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        ("nominal", UNKNOWN - 2.0 * INTEGRAL), ("fault-tolerant-published", UNKNOWN - 2.0 * INTEGRAL),
        ("zhang2005", LEARNT - 4.0 * INTEGRAL), ("fault-tolerant", FOUND), ("oracle", FOUND),
        ("lqr", 3.0 * FOUND), ("indi", 3.0 * FOUND),
    ],
)  # fmt: skip
def test_what_a_law_leaves_to_no_model_is_what_the_next_one_begins_with(law, expected):
    """Each after each: the integrators, the observer and what is only handed on."""
    before = flown_by(law)
    for then, begun in {
        "nominal": ("published", lambda of: -2.0 * of["memory"]["integral"]),  # no network explains it
        "adaptive": ("published", lambda of: 9.0 * LEARNT - 2.0 * of["memory"]["integral"]),
        "oracle-published": ("published", lambda of: -2.0 * of["memory"]["integral"]),
        "zhang2005": ("zhang2005", lambda of: -4.0 * of["feedback"]["memory"]["integral"]),
        "fault-tolerant": ("rejecting", lambda of: of["observer"]["disturbance"]),
        "lqr": ("compiled_rivals", lambda of: of["memory"]["inherited"]),
    }.items():
        new, (file, holds) = flown_by(then), begun
        new["rejecting"]["observer"]["rate"] = 9.0
        state.take_over(new, before, 9.0 * LEARNT)
        assert holds(new[file]) == pytest.approx(expected), then
        assert new["config"] == flown_by(then)["config"]
        own_rate = (0.01, 0.02, 0.03) if file == "rejecting" else (9.0, 9.0, 9.0)
        assert new["rejecting"]["observer"]["rate"].tolist() == [*own_rate]
        assert new["surfaces"]["output"]["unknown"].tolist() == UNKNOWN.tolist()
    assert before.tobytes() == flown_by(law).tobytes(), "the law before is left as it was"
