"""One frame of the law and of the diagnosis' decision: what is called, in which order, and for whom."""

import numpy as np
import pytest

from beaver_ftc.control import row_of
from beaver_ftc.control.accommodation import MODE_ADAPTIVE
from beaver_ftc.diagnosis.state import LOSS, NOT_ISOLATED
from beaver_ftc.diagnosis.types import GIVE_UP, SCALE_COMMAND, SUBTRACT_OFFSET, WAIT_FOR_SURFACE
from beaver_ftc.diagnosis.types.registry import N_TYPES
from beaver_ftc.loop import frame as whole
from beaver_ftc.loop.assembly import Trim, assemble
from beaver_ftc.scenario.schema import Scenario
from fault_kinds import BIAS, CONSTANT_LOSS, STUCK
from law_records import fields, put

TRAVEL_RAD = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])
AILERON, ELEVATOR, RUDDER, FLAP = range(4)
X = np.array([0.02, -0.01, 0.015])
TRIM = Trim(np.zeros(3), np.array([0.1, 0.02, 45.0, 1036.0, 0.3]), np.zeros(4), np.zeros(4))
G = np.array([[-9.0, 0.0, 0.6, 0.0], [0.0, -10.0, 0.0, 2.1], [-0.2, 0.0, -2.0, 0.0]])


def new_frame(law_name="adaptive", **fdi):
    keys = {"rate_hz": 100, "control": {"law": law_name}, "fdi": fdi}
    frame = assemble(Scenario.model_validate({"name": "x", **keys}), TRIM, TRAVEL_RAD).view(np.recarray)[0]
    frame["measured"]["x"], frame["measured"]["y"][:5] = X, (0.1, 0.02, 45.0, 1036.0, 0.3)
    frame["prediction"]["f"], frame["prediction"]["G"], frame["control"]["layout"]["trim"] = (
        (0.3, -0.2, 0.1),
        G,
        0.01,
    )
    return frame


def commanded(frame, mode=MODE_ADAPTIVE):
    frame["supervisor"]["mode"], frame["t"] = mode, 1.0
    whole.assess_faults(frame)
    whole.command(frame)
    return frame["control"]


def accommodated(frame, **faults):
    """What the law takes the surfaces for."""
    for name, value in ({"effectiveness": 1.0} | faults).items():
        frame["faults"][name] = value
    whole.assess_faults(frame)
    whole.accommodate(frame)
    return frame["control"]["surfaces"]["output"]


@pytest.mark.parametrize("name", ["nominal", "adaptive", "fault-tolerant-published"])
def test_the_published_law_inverts_the_model_and_integrates(name):
    """G u = xm' + Kp (xm - x) + Ki int - f, the flap in trim; within the travel nothing is taken back."""
    frame = new_frame(name)
    control = put(frame["control"], governed_rate=0.01, governed_acceleration=0.02)
    feedback, out, f = fields(control["published"]), control["allocation"]["output"], frame["prediction"]["f"]
    feedback["integral"] = 0.003
    before = feedback["integral"].copy()
    commanded(frame)
    error = 0.01 - X
    wanted = 0.02 + feedback["Kp"] * error + feedback["Ki"] * before - f
    assert G @ out["command"] == pytest.approx(wanted)
    assert out["command"][FLAP] == pytest.approx(control["layout"]["trim"][FLAP])
    assert feedback["integral"] == pytest.approx(before + control["reference"]["config"]["dt"] * error)
    assert control["axes"]["hold"] == pytest.approx(-f)


def believed(frame, surface, theta=-0.6, detected=1):
    """The isolated loss of a surface, by its estimator."""
    fdi = frame["fdi"]
    estimators = fdi["isolation"]["estimator"][: int(fdi["isolation"]["config"]["n_estimators"])]
    place = estimators["surface"].tolist().index(surface)
    fdi["verdict"]["detected"], fdi["verdict"]["isolated_estimator"] = detected, place
    fdi["isolation"]["estimator"][place]["theta"] = theta
    return fdi


def test_an_isolated_loss_scales_its_own_surface_alone():
    frame = new_frame("fault-tolerant-published")
    fdi = believed(frame, RUDDER)
    surfaces = accommodated(frame)
    assert surfaces["target"] == pytest.approx([1.0, 1.0, 0.4, 1.0])
    expected = max(0.4, 1.0 - frame["control"]["surfaces"]["config"]["effectiveness_step"])
    assert surfaces["effectiveness"][RUDDER] == pytest.approx(expected)
    assert surfaces["effectiveness"][AILERON] == 1.0
    assert not surfaces["offset"].any()
    fdi["verdict"]["has_effectiveness"], fdi["verdict"]["effectiveness"] = 1, (0.9, 0.8, 0.7, 0.6)
    assert accommodated(frame)["target"] == pytest.approx([0.9, 0.8, 0.7, 0.6])


def test_the_oracle_knows_and_no_other_law_looks():
    true = {"present": 1, "effectiveness": (0.5, 1, 1, 1), "effective": 0.1}
    for name, target in (("oracle-published", 0.5), ("fault-tolerant-published", 1.0)):
        frame = new_frame(name)
        frame["prediction"]["u"] = 0.1
        surfaces = accommodated(frame, **true)
        assert surfaces["target"][AILERON] == target
        assert surfaces["offset"][AILERON] == pytest.approx(0.1 - 0.05 if target == 0.5 else 0.0)


@pytest.mark.parametrize("measure", [SCALE_COMMAND, GIVE_UP, SUBTRACT_OFFSET, WAIT_FOR_SURFACE])
def test_what_is_done_about_each_kind_of_fault(measure):
    frame = new_frame("fault-tolerant-published", fault_class="all")
    fdi = frame["fdi"]
    surface = fdi["types"]["surface"][RUDDER]
    kind = {SCALE_COMMAND: CONSTANT_LOSS, GIVE_UP: STUCK, SUBTRACT_OFFSET: BIAS, WAIT_FOR_SURFACE: BIAS}[
        measure
    ]
    fdi["types"]["surface"]["accommodation"]["mode"], surface["accommodation"]["mode"] = -1, measure
    surface["sets"]["excluded"] = [other != kind for other in range(N_TYPES)]
    surface["sets"]["low"][kind], surface["sets"]["high"][kind] = 0.1, 0.2
    (
        surface["last"]["u"],
        surface["last"]["lo"],
        surface["last"]["hi"],
    ) = 0.05, 0.3, 0.34
    loss = fdi["layout"]["loss"][RUDDER]
    fdi["isolation"]["estimator"][int(loss)]["theta"] = -0.3
    surfaces = accommodated(frame)
    target = {SCALE_COMMAND: 0.7, GIVE_UP: 0.0}.get(measure, 1.0)
    assert surfaces["target"] == pytest.approx([1.0, 1.0, target, 1.0])
    offset = {GIVE_UP: 0.15, SUBTRACT_OFFSET: 0.15}.get(measure, 0.0)  # where it is jammed; how far it is off
    assert surfaces["offset"][RUDDER] == pytest.approx(offset)
    assert surfaces["lag"][RUDDER] == pytest.approx(0.27 if measure == WAIT_FOR_SURFACE else 0.0)
    assert surfaces["authority_lost"] == (measure == WAIT_FOR_SURFACE)
    assert (surfaces["effectiveness"][RUDDER] == 0.0) == (measure == GIVE_UP)  # a jam bypasses the rate limit


@pytest.mark.parametrize(
    ("diagnoses_all_types", "detected", "isolated", "evidence", "name", "doubt"),
    [
        (1, 1, NOT_ISOLATED, 99, "adaptive", True), (0, 1, NOT_ISOLATED, 99, "adaptive", False),
        (1, 0, NOT_ISOLATED, 99, "adaptive", False), (1, 1, 2, 99, "adaptive", False),
        (1, 1, NOT_ISOLATED, 3, "adaptive", False), (1, 1, NOT_ISOLATED, 99, "nominal", False),
        (1, 1, NOT_ISOLATED, 99, "oracle-published", False), (1, 1, NOT_ISOLATED, 4, "adaptive", True),
    ],
)  # fmt: skip
def test_when_it_has_long_been_open_whether_elevator_or_flap(
    diagnoses_all_types, detected, isolated, evidence, name, doubt
):
    frame = new_frame(name)
    fdi = frame["fdi"]
    types, fdi["config"]["diagnoses_all_types"] = fdi["types"], diagnoses_all_types
    types["config"]["half_frames"], types["surface"]["evidence"]["n_anomalous"] = 4, 0
    types["surface"]["evidence"]["n_anomalous"][ELEVATOR] = evidence
    fdi["verdict"]["detected"], fdi["verdict"]["isolated_estimator"] = detected, isolated
    frame["control"]["probe"]["config"]["frames"], frame["control"]["probe"]["memory"]["from_s"] = 8, -1.0
    commanded(frame)
    assert (frame["control"]["probe"]["memory"]["from_s"] == 1.0) == doubt


def test_known_laws_are_those_of_the_page():
    given = {
        "nominal": (0, 0, 0), "adaptive": (1, 0, 0), "fault-tolerant": (1, 1, 0),
        "oracle-published": (1, 1, 1),
    }  # fmt: skip
    for name, what in given.items():
        assert tuple(new_frame(name)["control"]["config"])[1:] == what
    files = {name: row_of(name).file for name in ("fault-tolerant", "fault-tolerant-published")}
    assert files == {"fault-tolerant": "rejecting", "fault-tolerant-published": "published"}
    assert LOSS == 0
