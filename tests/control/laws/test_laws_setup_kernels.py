"""From a scenario to what the derived gains are asked for."""

import numpy as np
import pytest

from beaver_ftc.control import laws, state
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
