"""One frame of the law and of the diagnosis' decision: what is called, in which order, and for whom."""

import numpy as np
import pytest

from beaver_ftc.control import accommodation, law, nominal
from beaver_ftc.control.laws.state import INDI, LQR, PUBLISHED, REJECTING
from beaver_ftc.control.rivals import compiled
from beaver_ftc.control.state import ADAPTIVE, FAULT_TOLERANT, NOMINAL, ORACLE
from beaver_ftc.control.supervisor import MODE_ADAPTIVE
from beaver_ftc.diagnosis import scheme
from beaver_ftc.diagnosis.state import LOSS, NOT_ISOLATED, WORST_CASE
from beaver_ftc.diagnosis.types.examine import FIXED, LAGS, LOSES, SHIFTED
from beaver_ftc.diagnosis.types.registry import BIAS, CONSTANT_LOSS, N_TYPES, STUCK
from beaver_ftc.loop.assembly import assemble
from beaver_ftc.scenario.schema import Scenario

TRAVEL_RAD = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])
AILERON, ELEVATOR, RUDDER, FLAP = range(4)
X = np.array([0.02, -0.01, 0.015])
G = np.array([[-9.0, 0.0, 0.6, 0.0], [0.0, -10.0, 0.0, 2.1], [-0.2, 0.0, -2.0, 0.0]])


def new_frame(law_name="adaptive", **fdi):
    keys = {"rate_hz": 100, "control": {"law": law_name}, "fdi": fdi}
    frame = assemble(Scenario.model_validate({"name": "x", **keys}), np.zeros(4), TRAVEL_RAD).view(
        np.recarray
    )[0]
    frame["measured"]["x"], frame["measured"]["y"][:5] = X, (0.1, 0.02, 45.0, 1036.0, 0.3)
    frame["belief"]["f"], frame["belief"]["G"], frame["control"]["trim"] = (0.3, -0.2, 0.1), G, 0.01
    return frame


def commanded(frame, mode=MODE_ADAPTIVE):
    control = frame["control"]
    law.command(control, frame["fdi"], frame["belief"], frame["measured"], faults(), mode, 1.0)
    return control


def faults(**fields):
    from beaver_ftc.control.oracle import true_faults_dtype

    record = np.zeros(1, true_faults_dtype(4)).view(np.recarray)[0]
    record["effectiveness"] = 1.0
    for name, value in fields.items():
        record[name] = value
    return record


@pytest.mark.parametrize("name", ["nominal", "adaptive", "fault-tolerant-published"])
def test_the_published_law_inverts_the_model_and_integrates(name):
    """G u = xm' + Kp (xm - x) + Ki int - f, the flap in trim; within the travel nothing is taken back."""
    frame = new_frame(name)
    control = frame["control"]
    control["governed_rate"], control["governed_acceleration"], control["integral"] = 0.01, 0.02, 0.003
    before = control["integral"].copy()
    commanded(frame)
    error = 0.01 - X
    wanted = 0.02 + control["Kp"] * error + control["Ki"] * before - frame["belief"]["f"]
    assert G @ control["command"] == pytest.approx(wanted)
    assert control["command"][FLAP] == pytest.approx(control["trim"][FLAP])
    assert control["integral"] == pytest.approx(before + control["dt"] * error)
    assert control["hold"] == pytest.approx(-frame["belief"]["f"])


def test_the_rejecting_law_has_no_integral_and_begins_with_what_is_measured():
    frame = new_frame("fault-tolerant")
    commanded(frame)
    control = frame["control"]
    assert control["rejection"]["begun"] == 1
    assert control["rejection"]["rate"] == pytest.approx(X)
    assert not control["integral"].any()
    assert control["hold"] == pytest.approx(-frame["belief"]["f"])


def believed(frame, surface, theta=-0.6, detected=1):
    """The isolated loss of a surface, by its estimator."""
    fdi = frame["fdi"]
    place = next(
        s for s in range(fdi["isolation"]["n"]) if fdi["isolation"]["estimator"][s]["surface"] == surface
    )
    fdi["verdict"]["detected"], fdi["verdict"]["isolated"] = detected, place
    fdi["isolation"]["estimator"][place]["theta"] = theta
    return fdi


def test_an_isolated_loss_scales_its_own_surface_alone():
    frame = new_frame("fault-tolerant-published")
    fdi = believed(frame, RUDDER)
    control = frame["control"]
    accommodation.accommodate(control, fdi, frame["belief"], frame["measured"], faults())
    assert control["target"] == pytest.approx([1.0, 1.0, 0.4, 1.0])
    assert control["effectiveness"][RUDDER] == pytest.approx(max(0.4, 1.0 - control["effectiveness_step"]))
    assert control["effectiveness"][AILERON] == 1.0
    assert not control["offset"].any()
    fdi["verdict"]["estimates"], fdi["verdict"]["effectiveness"] = 1, (0.9, 0.8, 0.7, 0.6)
    accommodation.accommodate(control, fdi, frame["belief"], frame["measured"], faults())
    assert control["target"] == pytest.approx([0.9, 0.8, 0.7, 0.6])


def test_the_oracle_knows_and_no_other_law_looks():
    true = faults(present=1, effectiveness=(0.5, 1, 1, 1), effective=0.1)
    for name, target in (("oracle-published", 0.5), ("fault-tolerant-published", 1.0)):
        frame = new_frame(name)
        frame["belief"]["u"] = 0.1
        control = frame["control"]
        accommodation.accommodate(control, frame["fdi"], frame["belief"], frame["measured"], true)
        assert control["target"][AILERON] == target
        assert control["offset"][AILERON] == pytest.approx(0.1 - 0.05 if target == 0.5 else 0.0)


@pytest.mark.parametrize("measure", [LOSES, FIXED, SHIFTED, LAGS])
def test_what_is_done_about_each_kind_of_fault(measure):
    frame = new_frame("fault-tolerant-published", fault_class="all")
    fdi, control = frame["fdi"], frame["control"]
    surface = fdi["types"]["surface"][RUDDER]
    kind = {LOSES: CONSTANT_LOSS, FIXED: STUCK, SHIFTED: BIAS, LAGS: BIAS}[measure]
    fdi["types"]["surface"]["measure"], surface["measure"] = -1, measure
    surface["type_excluded"] = [other != kind for other in range(N_TYPES)]
    surface["set_low"][kind], surface["set_high"][kind] = 0.1, 0.2
    surface["command"], surface["low"], surface["high"] = 0.05, 0.3, 0.34
    loss = fdi["layout"]["loss_of"][RUDDER]
    fdi["isolation"]["estimator"][int(loss)]["theta"] = -0.3
    accommodation.accommodate(control, fdi, frame["belief"], frame["measured"], faults())
    target = {LOSES: 0.7, FIXED: 0.0}.get(measure, 1.0)
    assert control["target"] == pytest.approx([1.0, 1.0, target, 1.0])
    offset = {FIXED: 0.15, SHIFTED: 0.15}.get(measure, 0.0)  # where it is jammed; how far it is off
    assert control["offset"][RUDDER] == pytest.approx(offset)
    assert control["lag"][RUDDER] == pytest.approx(0.27 if measure == LAGS else 0.0)
    assert control["hedging"] == (measure == LAGS)
    assert (control["effectiveness"][RUDDER] == 0.0) == (measure == FIXED)  # a jam bypasses the rate limit


@pytest.mark.parametrize(
    ("every_type", "detected", "isolated", "evidence", "name", "doubt"),
    [
        (1, 1, NOT_ISOLATED, 99, "adaptive", True), (0, 1, NOT_ISOLATED, 99, "adaptive", False),
        (1, 0, NOT_ISOLATED, 99, "adaptive", False), (1, 1, 2, 99, "adaptive", False),
        (1, 1, NOT_ISOLATED, 3, "adaptive", False), (1, 1, NOT_ISOLATED, 99, "nominal", False),
        (1, 1, NOT_ISOLATED, 99, "oracle-published", False), (1, 1, NOT_ISOLATED, 4, "adaptive", True),
    ],
)  # fmt: skip
def test_when_it_has_long_been_open_whether_elevator_or_flap(
    every_type, detected, isolated, evidence, name, doubt
):
    frame = new_frame(name)
    fdi = frame["fdi"]
    fdi["config"]["every_type"], fdi["types"]["config"]["patience"], fdi["types"]["surface"]["evidence"] = (
        every_type,
        4,
        0,
    )
    fdi["types"]["surface"]["evidence"][ELEVATOR] = evidence
    fdi["verdict"]["detected"], fdi["verdict"]["isolated"] = detected, isolated
    assert bool(law.in_doubt(frame["control"], fdi)) == doubt


def alarmed(known=0, speaks=0, score=2.0):
    frame = new_frame()
    fdi = frame["fdi"]
    fdi["verdict"]["detected"], fdi["config"]["authority"] = known, WORST_CASE
    fdi["watch"]["enabled"] = fdi["watch"]["alarmed"] = speaks
    fdi["bank"]["threshold"] = 0.1
    fdi["bank"]["residual"][0, 1] = 0.1 * score
    fdi["fdae"]["network"]["weights"], fdi["fdae"]["network"]["output"] = 1.0, 0.0
    fdi["isolation"]["estimator"]["xhat"] = 9.0
    scheme.decide(fdi, frame["measured"], 5.0)
    return fdi


def test_the_alarm_starts_the_estimators_once_and_the_network_answers():
    fdi = alarmed()
    first = int(fdi["isolation"]["n"])
    assert fdi["verdict"]["detected"] == 1
    assert fdi["isolation"]["estimator"]["xhat"][:first] == pytest.approx(np.tile(X, (first, 1)))
    assert fdi["fdae"]["network"]["output"].all()
    assert (alarmed(known=1)["isolation"]["estimator"]["xhat"][:first] == 9.0).all()
    quiet = alarmed(score=0.5)
    assert quiet["verdict"]["detected"] == 0
    assert not quiet["fdae"]["network"]["output"].any()
    silenced = alarmed(speaks=1)  # an instrument is broken: no surface is named
    assert silenced["verdict"]["detected"] == 0


def test_known_laws_are_those_of_the_page():
    uses = {
        name: int(new_frame(name)["control"]["law"]) for name in ("nominal", "adaptive", "oracle-published")
    }
    assert uses == {"nominal": NOMINAL, "adaptive": ADAPTIVE, "oracle-published": ORACLE}
    inner = {
        name: int(new_frame(name)["control"]["inner"])
        for name in ("fault-tolerant", "fault-tolerant-published")
    }
    assert inner == {"fault-tolerant": REJECTING, "fault-tolerant-published": PUBLISHED}
    assert int(new_frame("fault-tolerant")["control"]["law"]) == FAULT_TOLERANT
    assert LOSS == 0


@pytest.mark.parametrize(("name", "share"), [("nominal", 1.0), ("adaptive", 0.5)])
def test_all_but_the_nominal_law_reckon_with_what_is_believed_of_a_surface(name, share):
    frame = new_frame(name)
    control = frame["control"]
    control["effectiveness"][RUDDER], control["effectiveness_step"] = 0.5, 0.0
    commanded(frame)
    assert control["G"][:, RUDDER] == pytest.approx(share * G[:, RUDDER])
    assert control["G"][:, AILERON] == pytest.approx(G[:, AILERON])


def test_what_the_unknown_is_taken_for_is_taken_off_the_demand():
    control, f, fhat = new_frame()["control"], np.array([0.3, -0.2, 0.1]), np.array([0.05, 0.07, -0.09])
    control["governed_rate"], control["governed_acceleration"], control["integral"] = 0.01, 0.02, 0.003
    nominal.demand(control, X, f, fhat)
    wanted = 0.02 + control["Kp"] * (0.01 - X) + control["Ki"] * 0.003 - f - fhat
    assert control["demand"] == pytest.approx(wanted)


@pytest.mark.parametrize("inner", [INDI, LQR])
def test_a_compiled_rival_commands_by_itself(inner):
    """From what is measured and G, and nothing that the law of ours keeps is moved."""
    frame, alone = new_frame(), new_frame()
    for each in (frame, alone):
        control, rival = each["control"], each["control"]["rival"]
        control["inner"], control["model_rate"], control["model_acceleration"] = inner, 0.01, 0.02
        rival["K"], rival["B_inverse"], rival["A"] = 0.1, np.eye(3) * 0.2, np.eye(3)
        rival["Kp"], rival["Ki"], rival["keep"], rival["given"] = 2.0, 1.0, 0.5, 0.01
    commanded(frame)
    compiled.command(alone["control"], G, X)
    assert frame["control"]["command"].tolist() == alone["control"]["command"].tolist()
    assert (frame["control"]["command"] != 0.01).any()
    assert frame["control"]["hold"].tolist() == alone["control"]["hold"].tolist()
