"""From a scenario to what the derived gains are asked for."""

import numpy as np
import pytest

from beaver_ftc.control import laws, state
from beaver_ftc.control.laws import rejecting
from beaver_ftc.control.laws.rejecting import N_POINTS
from beaver_ftc.design.model import AIRSPEED, QDYN, design_record, response
from beaver_ftc.diagnosis.model_prediction import prediction_dtype
from beaver_ftc.scenario.schema import Scenario
from law_records import fields, new_control
from telling import apart

Y = np.array([0.1, 0.02, 44.0, 1000.0, 0.3, 0.0, 0.0, 0.0])
SENSORS = {
    "p": {"noise_std_deg_s": 0.02, "delay_s": 0.02},
    "q": {"quantum_deg_s": 0.06, "noise_std_deg_s": 0.01, "bandwidth_rad_s": 50.0},
}


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
        state.configure_law(control, prediction, scenario, Y)
        return found

    return ask


def test_other_laws_ask_for_nothing(asked):
    assert asked(given({"law": "adaptive"})) == {}


def test_the_points_are_airspeeds_of_the_envelope_at_the_same_density(asked):
    scenario = given()
    found = asked(scenario)
    speeds = np.linspace(*scenario.airframe.envelope.airspeed_mps, N_POINTS)
    assert found["qdyn"] == pytest.approx(0.5 * (2.0 * 1000.0 / 44.0**2) * speeds**2)
    design = design_record().view(np.recarray)[0]
    for V, qdyn, at in zip(speeds, found["qdyn"], found["G"], strict=True):
        y, f, G = Y.copy(), np.zeros(3), np.zeros((3, 4))
        y[AIRSPEED], y[QDYN] = V, qdyn
        response(design, np.zeros(3), y, f, G)
        assert at == pytest.approx(G)


def test_frame_margins_and_carriers(asked):
    found = asked(given({"gain_margin_db": 7.0, "phase_margin_deg": 50.0}))
    assert found["dt_s"] == pytest.approx(0.02)
    assert found["substeps"] == given().substeps
    assert found["margin"] == (7.0, 50.0)
    assert found["approach"] == pytest.approx([0.2, 0.3, 0.4, 0.05])
    assert found["carriers"] == [(0, 0), (1, 1), (2, 2), (1, 3)]
    assert asked(given(), stand_in=-1)["carriers"] == [(0, 0), (1, 1), (2, 2)]
    assert asked(given(), stand_in=0)["carriers"][-1] == (1, 0)


def test_the_gyros_noise_has_its_steps_and_its_lag_is_kept_a_frame_at_a_time(asked):
    p, q, r = asked(given())["gyros"]
    assert (p.noise_rad_s, p.delay_s, p.keep) == pytest.approx((np.radians(0.02), 0.02, 0.0))
    assert q.noise_rad_s == pytest.approx(np.radians(np.sqrt(0.01**2 + 0.06**2 / 12.0)))
    assert (q.delay_s, q.keep) == pytest.approx((0.0, np.exp(-50.0 * 0.02)))
    assert (r.noise_rad_s, r.delay_s, r.keep) == (0.0, 0.0, 0.0)


def test_noise_may_take_its_share_of_the_rate_more_where_the_aircraft_damps_itself_more(asked):
    """The root of an axis' own damping over the largest; pi / 3 rad/s where no limit is declared."""
    actuators = {"elevator": {"rate_limit_deg_s": 30.0}}
    found = asked(given({"noise_share": 0.2}, actuators=actuators))
    design, damping, step = design_record().view(np.recarray)[0], [], 1e-5
    for i in range(3):
        f, G = np.zeros((2, 3)), np.zeros((3, 4))
        for k, side in enumerate((-step, step)):
            response(design, side * np.eye(3)[i], Y, f[k], G)
        damping.append((f[1] - f[0])[i] / (2.0 * step))
    shares = np.sqrt(np.abs(damping) / np.abs(damping).max())[[0, 1, 2, 1]]
    rates = np.array([np.pi / 3.0, np.radians(30.0), np.pi / 3.0, np.pi / 3.0])
    assert found["speed_rad_s"] == pytest.approx(0.2 * shares * rates, rel=1e-6)
    alone = asked(given({"noise_share": 0.2}, actuators=actuators), stand_in=-1)
    assert alone["speed_rad_s"][3] == pytest.approx(0.2 * np.pi / 3.0)


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
    state.configure(record, scenario, travel)
    state.configure_law(record, None, scenario, None)
    law, reach = fields(record["published"]), fields(record["layout"])
    assert (law["Kp"], law["Ki"]) == (3.1, 0.7)
    assert (reach["low"].tolist(), reach["high"].tolist()) == tuple(travel.tolist())
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
