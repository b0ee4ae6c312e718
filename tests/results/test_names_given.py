"""Names given in flight, held against the faults they name: early, late, one after the other, two at once."""

import pytest
from synthetic import Expect, Fault, Flight, Scenario

import beaver_ftc as bf
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.metrics import metrics
from beaver_ftc.results.model import Metrics
from beaver_ftc.results.verdict import verdict_text
from beaver_ftc.scenario.schema import Scenario as Given
from trainer import FOLDER

LOSS = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.5, "at_s": 4}
JAM = {"actuator": "rudder", "type": "stuck", "position_deg": 8, "at_s": 9}
RATES = {axis: [{"sine": {"amplitude_deg_s": 4, "frequency_hz": 0.3}}] for axis in "pqr"}
ALL = {"fault_class": "all"}
NOISY = {"bounds": {"sensors": "tactical-grade"}}
IN_TURN = (Fault(at_s=8.0), Fault(at_s=18.0, actuator="rudder", type="stuck"))


def isolation(*faults, expect=None, **found):
    """The section of a flight made by hand."""
    scenario = Scenario(faults=faults, expect=Expect(**(expect or {})))
    document = metrics(Flight(scenario=scenario, **found))
    return document["isolation"] | {"expectations": document["expectations"]}


@pytest.mark.parametrize(
    ("at_s", "named_s", "premature"), [(12.0, 11.99, True), (12.0, 12.0, False), (0.0, 0.0, False)]
)
def test_a_name_given_before_its_fault_is_premature_and_not_correct(at_s, named_s, premature):
    said = isolation(Fault(at_s=at_s), isolation_time_s=named_s)
    assert (said["premature"], said["correct"], said["type_correct"]) == (
        premature, not premature, not premature,
    )  # fmt: skip
    assert said["names"] == ([] if premature else ["elevator"])


EXPECTED = {
    "isolated_as": "elevator", "isolated_within_s": 99.0, "isolated_type": "loss_of_effectiveness",
    "candidate_type": "elevator",
}  # fmt: skip


@pytest.mark.parametrize("name", EXPECTED)
def test_a_premature_name_meets_no_expectation_and_the_reason_is_given(name):
    expect = {name: EXPECTED[name]}
    (met,) = isolation(Fault(), expect=expect, isolation_time_s=12.5)["expectations"]
    assert met["passed"]
    (missed,) = isolation(Fault(), expect=expect, isolation_time_s=3.0)["expectations"]
    assert not missed["passed"]
    assert missed["reason"] == "elevator was named at 3 s, before the fault began"


def test_nothing_named_and_no_fault_are_not_premature():
    assert isolation(Fault(), isolated=None, isolation_time_s=None)["premature"] is None
    said = isolation(isolation_time_s=3.0)
    assert (said["premature"], said["correct"]) == (False, False)
    of_type = [
        isolation(isolation_time_s=3.0, isolation_type=kind)["type_correct"] for kind in ("stuck", None)
    ]
    assert of_type == [False, None]


def test_a_name_is_held_against_the_fault_that_it_names():
    """The first fault is too small to be seen, the second one is named."""
    said = isolation(*IN_TURN, isolated="rudder", isolation_type="stuck", isolation_time_s=18.5)
    assert (said["correct"], said["type_correct"], said["delay_s"]) == (True, True, 0.5)
    early = isolation(*IN_TURN, isolated="rudder", isolation_type="stuck", isolation_time_s=9.0)
    assert (early["premature"], early["correct"]) == (True, False)


UNKNOWN = {"isolated": "unanticipated", "isolation_type": "unanticipated"}
GONE = ({"fault": "elevator", "from_s": 8.1, "to_s": 18.1},)


def test_two_surfaces_at_fault_are_outside_a_class_of_single_faults():
    said = isolation(*IN_TURN, **UNKNOWN, isolation_time_s=18.1, withdrawn=GONE)
    assert (said["correct"], said["type_correct"], said["premature"]) == (True, True, False)
    assert said["delay_s"] == pytest.approx(0.1)
    assert said["names"] == ["elevator", "unanticipated"]
    before = isolation(*IN_TURN, **UNKNOWN, isolation_time_s=10.0)
    assert before["correct"] is False
    twice = (Fault(at_s=8.0), Fault(at_s=18.0, type="stuck"))
    assert isolation(*twice, **UNKNOWN, isolation_time_s=18.1)["correct"] is False


@pytest.mark.parametrize(
    ("expected", "met"),
    [
        (("elevator", "unanticipated"), True),
        (("unanticipated", "elevator"), False),
        (("elevator",), False),
        (("elevator", "rudder"), False),
        ((), False),
    ],
)
def test_a_list_expects_every_name_in_the_order_of_the_faults(expected, met):
    expect = {"isolated_as": expected}
    (found,) = isolation(
        *IN_TURN, **UNKNOWN, isolation_time_s=18.1, withdrawn=GONE, expect=expect
    )["expectations"]  # fmt: skip
    assert (found["passed"], found["expected"]) == (met, list(expected))
    assert found["actual"] == ["elevator", "unanticipated"]


def test_of_two_at_once_the_order_is_that_of_the_faults_not_of_the_names():
    """And each name is listed once, a premature one not at all."""
    named = [
        {
            "isolated": surface, "isolation_type": None, "isolation_time_s": time_s, "candidates": [],
            "estimate": None,
        }
        for surface, time_s in (("rudder", 18.2), ("elevator", 20.0), ("flap", 2.0), (None, None))
    ]  # fmt: skip
    gone = ({"fault": "rudder", "from_s": 18.05, "to_s": 18.1},)
    said = isolation(*IN_TURN, faults=tuple(named), isolated="rudder", withdrawn=gone)
    assert said["names"] == ["elevator", "rudder"]


def test_a_name_that_was_withdrawn_is_the_reason():
    (missed,) = isolation(
        *IN_TURN, **UNKNOWN, isolation_time_s=18.1, withdrawn=GONE, expect={"isolated_as": "elevator"}
    )["expectations"]  # fmt: skip
    assert missed["reason"] == "elevator was named at 8.1 s, and the name withdrawn at 18.1 s"


@pytest.fixture(scope="module")
def early():
    """A model error that is not declared raises the alarm before the fault, and names its surface."""
    changes = {"duration_s": 13.0, "uncertainty.coefficients": {"Cm_alpha": 1.1}}
    return bf.fly(bf.load("elevator-partial-loss").with_(changes))


def test_in_flight_a_name_before_the_fault_is_not_correct(early):
    said = early.isolation
    assert (said.fault, said.premature, said.correct) == ("elevator", True, False)
    assert said.time_s < 12.0
    missed = {one.name: one.reason for one in early.expectations if not one.passed}
    assert missed["isolated_as"].startswith("elevator was named at")
    assert "PREMATURE at" in verdict_text(Metrics.of(early.metrics), "", colour=False)


def test_a_sweep_has_the_column(early):
    table = bf.sweep(early.scenario, vary={"duration_s": {"choice": [13.0]}}, runs=1, workers=1)
    assert table["isolation.premature"].tolist() == [True]
    assert table["isolation.correct"].tolist() == [False]


@pytest.fixture(scope="module")
def in_turn():
    """Elevator, later rudder, real instruments: what an engineer tries first."""
    return Given.model_validate({
        "name": "in-turn", "duration_s": 11, "reference": RATES, "faults": [LOSS, JAM],
        "sensors": "tactical-grade", "fdi": ALL | NOISY, "expect": {"isolated_as": ["elevator", "rudder"]},
    })  # fmt: skip


def test_what_two_faults_in_turn_come_to_is_said_before_and_after_the_flight(in_turn):
    (warning,) = in_turn.warnings()
    assert warning.startswith("faults: on several surfaces at once: the diagnosis looks for one, names the")
    flight = bf.fly(in_turn)
    assert flight.isolation.names == ("elevator", "unanticipated")
    assert flight.isolation.correct is True
    (hint,) = [said for said in flight.metrics["hints"] if "several surfaces" in said]
    assert "then says unanticipated; fdi.pairs, which looks for two, is not available with" in hint
    told = {"isolated_as": ["elevator", "unanticipated"]}
    again = bf.fly(in_turn.with_({"expect": told}))
    assert again.metrics["passed"]
    assert again.scenario.warnings() == ()


@pytest.mark.parametrize(
    "keys",
    [
        {"fdi": {}},
        {"fdi": ALL},
        {"fdi": ALL | {"bounds": {"sensors": {"q": {"bias_deg_s": 0.1}}}}},
        {"fdi": NOISY},
        {"fdi": ALL | {"bounds": {"sensors": {"q": {"scale_error": 0.01}}}}},
        {"fdi": {"scheme": "zhang2005"}},
        {"fdi": ALL, "changes": [{"at_s": 3, "declared_sensors": "tactical-grade"}]},
        {"fdi": ALL, "changes": [{"at_s": 3, "law": "nominal"}]},
        {"fdi": ALL | {"statistical": {}}},
        {"fdi": ALL, "aircraft": "beaver-split", "faults": [LOSS | {"actuator": "aileron_left"}, JAM]},
        {"fdi": ALL, "aircraft": "./trainer"},
    ],
)
def test_what_a_hint_proposes_can_be_flown(keys):
    given = {"name": "x", "duration_s": 10, "faults": [LOSS, JAM], **keys}
    scenario = Given.model_validate(given, context={"folder": FOLDER.parent})
    flight = bf.fly(scenario.with_({"duration_s": 9.5}))
    (hint,) = [said for said in flight.metrics["hints"] if "several surfaces" in said]
    proposed = scenario.with_({"fdi.fault_class": "all"}) if scenario.fdi.is_ours else scenario
    if "; set fdi" in hint:
        bf.fly(proposed.with_({"fdi.pairs": True, "duration_s": 9.5}))
    else:
        assert "fdi.pairs, which looks for two, is" in hint
        with pytest.raises(BadInput, match="pairs"):
            proposed.with_({"fdi.pairs": True})


def test_faults_that_are_on_no_surface_want_no_pairs():
    faults = [LOSS, {"type": "unanticipated", "at_s": 6}, {"sensor": "p", "type": "freeze", "at_s": 7}]
    scenario = Given.model_validate({"name": "x", "faults": faults, "fdi": ALL})
    assert not [said for said in scenario.warnings() if "several" in said]
