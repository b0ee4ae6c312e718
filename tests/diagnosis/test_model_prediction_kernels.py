"""Means over a frame: what of them knows the readings of that frame."""

import numpy as np
import pytest

from beaver_ftc.diagnosis import model_prediction
from beaver_ftc.diagnosis.bounds import bound_dtype
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from telling import apart


@pytest.mark.parametrize("instants", [1, 3])
def test_what_is_foreseen_has_the_effectiveness_of_the_frame_before(instants):
    """A reading that is off changes the moment of a command now, and what is foreseen of it a frame later."""
    rng, n = np.random.default_rng(instants), 4
    prediction = np.zeros(1, model_prediction.prediction_dtype(n))[0]
    bound = np.zeros(1, bound_dtype(n))[0]
    prediction["w"] = 1.0 / instants
    G, u = rng.uniform(0.5, 2.0, (5, 3, n)), rng.uniform(-0.3, 0.3, (5, n))
    for k in range(5):
        prediction["sums"]["G"], prediction["sums"]["Gu"] = G[k], G[k] * u[k]
        model_prediction.fill_means(prediction, bound)
        model_prediction.fill_old_effects(prediction["means"])
        assert prediction["means"]["Gu"] == pytest.approx(G[k] * u[k])
        if k > 0:
            assert prediction["means"]["G_old"] == pytest.approx(G[k - 1])
            assert prediction["means"]["Gu_old"] == pytest.approx(G[k - 1] * u[k])


def test_actuators_are_believed_an_instant_at_a_time():
    """At 50 Hz of four instants: the share of the way and the longest way in 5 ms, each surface its own."""
    dynamics = {
        "aileron": {"bandwidth_rad_s": 20.0, "rate_limit_deg_s": 60.0}, "elevator": {"bandwidth_rad_s": 35.0},
        "rudder": {"rate_limit_deg_s": 40.0},
    }  # fmt: skip
    given = {"name": "x", "rate_hz": 50, "substeps": 4, "actuators": dynamics, "design_model": {"mass": 1.1}}
    scenario = Scenario.model_validate(given)
    travel = np.array([[-0.5, -0.4, -0.3, -0.1], [0.55, 0.45, 0.35, 1.0]])
    apart(travel=travel)
    record = np.zeros(1, model_prediction.prediction_dtype(4))[0]
    model_prediction.configure_prediction(record, Declared.of(scenario), travel)
    actuators = record["actuators"]
    assert (record["w"], bool(actuators["real"])) == (0.25, True)
    assert (actuators["low"].tolist(), actuators["high"].tolist()) == tuple(travel.tolist())
    assert actuators["approach"] == pytest.approx([1 - np.exp(-0.1), 1 - np.exp(-0.175), 1.0, 1.0])
    assert actuators["step"] == pytest.approx([np.radians(0.3), np.inf, np.radians(0.2), np.inf])
    ideal = np.zeros(1, model_prediction.prediction_dtype(4))[0]
    model_prediction.configure_prediction(ideal, Declared.of(Scenario(name="x")), travel)
    assert (ideal["w"], bool(ideal["actuators"]["real"])) == (1.0, False)
