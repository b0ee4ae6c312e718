"""What a law finds of the one before it, when a diagnosis begins anew, and which changes are due: by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.control import row_of
from beaver_ftc.design.model import N_Y
from beaver_ftc.loop import stream
from beaver_ftc.loop.assembly import Trim, assemble
from beaver_ftc.loop.changing import Changing, _check_delays, renews_diagnosis, take_diagnosis, take_law
from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.matrix.fault_matrix import trimmed_deg
from flying import loss, scenario
from telling import bits

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


def test_a_law_without_an_integrator_has_nothing_to_begin_with():
    taken = _taken("adaptive", "nominal", integral_per_s2=0.0)
    assert taken["published"]["memory"]["integral"].tolist() == [99.0] * 3


def test_a_rival_hands_on_what_the_law_before_it_has_found():
    """The regulator estimates nothing: the observer after it begins where the first one had ended."""
    frame = _frame("fault-tolerant")
    frame["control"]["rejecting"]["observer"]["disturbance"] = DISTURBANCE
    for law in ("lqr", "fault-tolerant"):
        take_law(frame, _frame(law)["control"])
    assert frame["control"]["rejecting"]["observer"]["disturbance"].tolist() == DISTURBANCE.tolist()


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


@pytest.mark.parametrize("lines", [512, 513])
def test_delays_that_just_fit_are_taken(lines):
    room = {"instruments": {"line": np.zeros(512)}}
    needed = {"instruments": {"length": np.array([500, lines - 500])}}
    if lines == 512:
        assert _check_delays(needed, room) is None
        return
    with pytest.raises(bf.BadInput, match="delays of 513 samples in all, allowed: 512 in this flight"):
        _check_delays(needed, room)


def test_a_diagnosis_begun_anew_keeps_what_healthy_flight_has_shown():
    frame, new = _frame("nominal"), _frame("nominal")
    (
        frame["fdi"]["bank"]["output"]["peak"],
        frame["fdi"]["statistical"]["alarm"]["peak"],
    ) = 0.5, 0.75
    for same in (True, False):
        (
            new["fdi"]["bank"]["output"]["peak"],
            new["fdi"]["sensor_monitor"]["memory"]["substep"],
        ) = 0.0, 3
        new["fdi"]["bank"]["config"]["n_filters"] = frame["fdi"]["bank"]["config"]["n_filters"] + (not same)
        then = frame.copy()
        take_diagnosis(then, new, 77)
        assert then["since"] == 77
        assert then["fdi"]["sensor_monitor"]["memory"]["substep"] == 0
        assert then["fdi"]["statistical"]["alarm"]["peak"] == 0.75
        assert set(then["fdi"]["bank"]["output"]["peak"]) == {0.5 if same else 0.0}


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


def test_what_is_noted_of_a_change():
    changes = [
        {"at_s": 0.1, "law": "nominal"}, {"at_s": 0.5, "scheme": "none"},
        {"at_s": 0.6, "sensors": {"q": {"bias_deg_s": 0.1}}, "law": "adaptive"},
    ]  # fmt: skip
    flight = bf.fly(scenario(duration_s=0.8, faults=[loss(at_s=0.2, magnitude=0.8)], changes=changes))
    first, second, third = flight.metrics["changes"]
    assert first == {"time_s": 0.1, "law": "nominal", "scheme": None, "sensors": False}
    assert second["detection_time_s"] < 0.5
    assert second["isolated"] == "elevator"
    assert third == {"time_s": 0.6, "law": "adaptive", "scheme": None, "sensors": True}


def test_a_plug_in_detectors_word_stands_while_another_law_takes_over():
    class Once:
        """Says its word in the tenth frame alone."""

        def reset(self, context):
            pass

        def step(self, measured, command):
            return bf.Verdict(True, "q", "elevator") if measured.t_s == pytest.approx(0.1) else said[-1]

    said = [bf.Verdict()]
    sim = bf.Simulation(scenario(duration_s=0.5), detector=Once())
    sim.step(frames=10)
    said.append(sim.verdict)
    assert sim.verdict.isolated == "elevator"
    sim.change({"law": "nominal"})
    sim._loop.changing.apply(sim.frames)
    assert sim.verdict.isolated == "elevator"
    assert isinstance(sim._loop.changing, Changing)


@pytest.mark.parametrize(
    ("what", "given", "fits"),
    [
        ("rates_rad_s", (1, 2, 3), True), ("rates_rad_s", (1, 2), False), ("rates_rad_s", range(N_Y), False),
        ("signals", (1, 2, 3), True), ("signals", range(N_Y), True), ("signals", range(4), False),
        ("signals", 3.0, False), ("signals", "abc", False), ("signals", (1, None, "x"), False),
    ],
)  # fmt: skip
def test_a_sample_fits_its_place_and_signals_that_of_the_loop_too(what, given, fits):
    place = np.full(3, 7.0)
    if fits:
        stream._put(what, np.array(given, float), place)
        assert place.tolist() == [float(x) for x in given][:3]
        return
    with pytest.raises(bf.BadInput, match=f"^{what}: .* does not fit, allowed: 3 numbers$"):
        stream._put(what, given, place)


def test_a_flight_tells_its_log_and_how_far_it_is():
    told = []
    sink = SimpleNamespace(
        open=lambda columns: told.append(len(columns)), write=lambda rows: told.append(rows.shape),
        close=lambda: told.append("closed"),
    )  # fmt: skip
    landing = fly(scenario(duration_s=0.1), sink, told.append)
    columns = len(landing.columns)
    assert told == [columns, (10, columns), 1.0, "closed"]
    assert fly(scenario(duration_s=0.1)).frames == 10


@pytest.mark.parametrize("law", ["oracle", "oracle-published"])
def test_a_law_in_its_own_place_goes_on_where_it_was(law):
    """Whatever a flight with the engine in charge of pitch changes in the law's record: of engine, reference,
    surfaces and command the one that takes over has it, but for what each frame makes anew."""
    stuck = {"type": "stuck", "at_s": 0.5}
    faults = [
        {"actuator": "elevator", "position_deg": trimmed_deg(45.0, "elevator") + 1.0, **stuck},
        {"actuator": "flap", "position_deg": 1.0, **stuck},
    ]
    given = scenario(duration_s=14.0, faults=faults, control={"law": law}, fdi={"fault_class": "all"})
    sim = bf.Simulation(given)
    while not sim.done:
        sim.step()
    frame = sim._loop.frames[0]
    before, layout = frame["control"].copy(), frame["control"]["layout"]
    power = before["power"]["output"]
    assert power["least"] < before["power"]["setpoint"]["base"] < power["greatest"]
    new = assemble(given, sim._loop.trimmed, np.array([layout["low"], layout["high"]]))[0]["control"]
    fresh = new.copy()
    take_law(frame, new)
    parts = [f"{stage}.{part}" for stage in STAGES for part in before[stage].dtype.names]
    seen = {
        part: [bits(_part(record, part)) for record in (before, fresh, frame["control"])] for part in parts
    }
    changed = {part for part, (then, begun, _) in seen.items() if then != begun}
    kept = {part for part in changed if seen[part][2] == seen[part][0]}
    assert changed - kept == {"reference.memory"}
    assert {"power.memory", "power.output", "reference.output", "surfaces.output"} <= kept
    assert all(seen[part][2] == seen[part][1] for part in parts if part.endswith("config"))


STAGES = ("reference", "surfaces", "allocation", "probe", "power")


def _part(control, part):
    """A stage's record by its dotted name."""
    stage, name = part.split(".")
    return control[stage][name]
