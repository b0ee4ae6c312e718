"""What a law finds of the one before it, when a diagnosis begins anew, and which changes are due: by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.control import row_of
from beaver_ftc.loop.assembly import Trim, assemble
from beaver_ftc.loop.changing import renews_diagnosis, take_law
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from flying import scenario

TRIM = Trim(np.zeros(3), np.array([0.1, 0.02, 45.0, 1036.0, 0.3]), np.zeros(4), np.zeros(4))
TRAVEL = np.array([[-0.5, -0.4, -0.3, -0.1], [0.5, 0.45, 0.35, 1.0]])
LEARNT, FHAT, INTEGRAL = (np.array(x) for x in ([0.3, -0.1, 0.2], [0.5, 0.25, -0.5], [1.0, -2.0, 4.0]))
DISTURBANCE = np.array([0.7, -0.6, 0.05])


def _frame(law, **control):
    given = Scenario.model_validate({"name": "x", "control": {"law": law, **control}})
    return assemble(given, TRIM, TRAVEL)[0]


def _taken(before, after, detected=1, **control):
    """The control record after a law has been changed in a flight that has learnt something."""
    frame, new = _frame(before, integral_per_s2=0.5), _frame(after, **control)["control"]
    feedback, observer = frame["control"]["published"], frame["control"]["rejecting"]["observer"]
    frame["control"]["surfaces"]["output"]["unknown"] = FHAT
    feedback["memory"]["integral"], observer["disturbance"] = INTEGRAL, DISTURBANCE
    feedback["config"]["Ki"], observer["begun"], observer["rate"] = 0.5, 1, [1.0, 2.0, 3.0]
    frame["fdi"]["verdict"]["detected"], frame["fdi"]["fdae"]["network"]["output"] = detected, LEARNT
    new["published"]["memory"]["integral"] = 99.0
    take_law(frame, new)
    return frame["control"]


UNEXPLAINED = FHAT - 0.5 * INTEGRAL


@pytest.mark.parametrize(
    ("before", "found"),
    [("nominal", UNEXPLAINED), ("adaptive", UNEXPLAINED), ("fault-tolerant", DISTURBANCE)],
)
def test_an_observer_begins_with_what_the_law_before_it_has_found(before, found):
    control = _taken(before, "fault-tolerant")
    observer = control["rejecting"]["observer"]
    assert control["config"]["law"] == row_of("fault-tolerant").place
    assert observer["disturbance"] == pytest.approx(found)
    assert (observer["begun"], observer["rate"].tolist()) == (1, [1.0, 2.0, 3.0])
    assert control["published"]["memory"]["integral"].tolist() == [99.0] * 3


@pytest.mark.parametrize(
    ("before", "after", "detected", "integral"),
    [
        # -Ki integral + what the law itself compensates is what was found
        ("fault-tolerant", "nominal", 1, -DISTURBANCE / 0.8),
        ("fault-tolerant", "oracle-published", 1, -DISTURBANCE / 0.8),
        ("fault-tolerant", "adaptive", 0, -DISTURBANCE / 0.8),
        ("fault-tolerant", "adaptive", 1, (LEARNT - DISTURBANCE) / 0.8),
        ("adaptive", "fault-tolerant-published", 1, (LEARNT - UNEXPLAINED) / 0.8),
    ],
)
def test_an_integrator_begins_where_the_demand_is(before, after, detected, integral):
    control = _taken(before, after, detected, integral_per_s2=0.8)
    assert control["published"]["memory"]["integral"] == pytest.approx(integral)


def _change(law=None, scheme=None, sensors=None, declared_sensors=None):
    return SimpleNamespace(law=law, scheme=scheme, sensors=sensors, declared_sensors=declared_sensors)


@pytest.mark.parametrize(
    ("change", "ideal", "ours", "renewed"),
    [
        (_change(law="lqr"), False, True, False), (_change(scheme="none"), True, False, True),
        (_change(declared_sensors="ideal"), True, False, True), (_change(sensors="ideal"), True, True, False),
        (_change(sensors="ideal"), False, True, True), (_change(sensors="ideal"), False, False, False),
    ],
)  # fmt: skip
def test_when_a_diagnosis_begins_anew(monkeypatch, change, ideal, ours, renewed):
    declared = SimpleNamespace(sensors=SimpleNamespace(is_ideal=ideal))
    monkeypatch.setattr(Declared, "of", lambda then: declared)
    then = SimpleNamespace(fdi=SimpleNamespace(is_ours=ours))
    assert renews_diagnosis(change, then) is renewed


def test_changes_are_due_at_their_frames():
    """Declared at 0.07 s, a rounding above frame 7, between two frames, and at the frame to fly."""
    due = [0.02, 0.07, 0.101, 0.3]
    flown = scenario(duration_s=1.0, changes=[{"at_s": at_s, "law": "nominal"} for at_s in due])
    sim = bf.Simulation(flown)
    changing = sim._loop.changing
    assert [stage.frame for stage in changing._coming] == [2, 7, 11, 30]
    assert [changing.next_change(k) for k in (0, 1, 2, 7, 29)] == [2, 2, 7, 11, 30]
    assert changing.next_change(30) > 10**6
    changing.plan(flown, 7)
    assert [stage.frame for stage in changing._coming] == [7, 11, 30]
    sim.step(frames=20)
    assert [noted["time_s"] for noted in changing.replaced] == pytest.approx([0.07, 0.11])
    assert [stage.frame for stage in changing._coming] == [30]
