"""From a scenario to what the derived gains are asked for."""

import numpy as np
import pytest

from beaver_ftc.control import laws, row_of, state
from beaver_ftc.control.laws import rejecting, zhang2005
from beaver_ftc.control.laws.rejecting import N_POINTS
from beaver_ftc.design.model import AIRSPEED, QDYN, design_record, response
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


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({}, {}), ({"projection": 0}, {"least": -np.inf, "most": np.inf, "w_max": np.inf}),
        ({"network": 0}, {"networks": 0}), ({"adaptation": 0}, {"adapts": 0}),
        ({"hand_over": 0}, {"reallocates": 0}),
    ],
)  # fmt: skip
def test_every_option_of_the_published_law_is_in_its_record(options, expected):
    """Of surfaces that lead the axes in no order, with stops that are not symmetric."""
    chosen = {"network_gain": 70.0, "network_limit_rad_s2": 8.0, "parametric_gain": 30.0, "rate_weight": 5.0}
    keys = {"law": "zhang2005", "proportional_per_s": 3.1, "integral_per_s2": 0.7,
            "least_effectiveness": 0.15, "options": chosen | options}  # fmt: skip
    control = new_control(main=(2, 0, 1))
    control["config"] = 9, 1, 1, 0
    control["layout"]["low"], control["layout"]["high"] = (-0.5, -0.4, -0.3, -0.1), (0.55, 0.45, 0.35, 1.0)
    zhang2005.configure(control["zhang2005"], control, None, given(keys), None)
    law, network = control["zhang2005"]["config"], control["zhang2005"]["network"]["config"]
    feedback = control["zhang2005"]["feedback"]["config"]
    found = {name: law[name].item() for name in law.dtype.names} | {
        "Kp": feedback["Kp"], "Ki": feedback["Ki"], "network_gain": network["gain"],
        "w_max": network["w_max"], "reallocates": control["config"]["reallocates"],
        "uses_verdict": control["config"]["uses_verdict"],
    }  # fmt: skip
    usual = {
        "adapts": 1, "networks": 1, "gain": 30.0, "integral_weight": 3.1 / (5.0 * 0.7 + 1.0), "least": 0.15,
        "most": 1.0, "Kp": 3.1, "Ki": 0.7, "network_gain": 70.0, "w_max": 8.0, "reallocates": 1,
        "uses_verdict": 1,
    }  # fmt: skip
    assert found == pytest.approx(usual | expected)
    assert network["c0"][:, 2].tolist() == [-0.3, -0.5, -0.4]
    assert network["dc"][:, 2] == pytest.approx([0.325, 0.525, 0.425])


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


def test_without_an_integral_nothing_is_handed_to_it():
    before, new = flown_by("fault-tolerant"), flown_by("nominal")
    new["published"]["config"]["Ki"] = 0.0
    state.take_over(new, before, LEARNT)
    assert new["published"]["memory"]["integral"].tolist() == INTEGRAL.tolist()
