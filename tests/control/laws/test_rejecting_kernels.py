"""The kernels of the rejecting law, and of what it makes of a verdict, against the same in matrices."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.control import accommodation, law, reference_model
from beaver_ftc.control.laws import left, rejecting
from beaver_ftc.control.laws.state import REJECTING
from beaver_ftc.control.oracle import true_faults_dtype
from beaver_ftc.control.state import ADAPTIVE, FAULT_TOLERANT, NOMINAL, ORACLE, control_dtype
from beaver_ftc.control.supervisor import MODE_ADAPTIVE, MODE_NOMINAL, MODE_REALLOCATED
from beaver_ftc.diagnosis.state import NOT_ISOLATED
from beaver_ftc.diagnosis.types.examine import FIXED, LAGS, LOSES, SHIFTED
from beaver_ftc.loop.assembly import assemble
from flying import scenario

AILERON, ELEVATOR, RUDDER, FLAP = range(4)
DT = 0.01
TRAVEL = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])


def record(seed=0):
    """A control record with something in every place that the kernels look at."""
    rng, control = np.random.default_rng(seed), np.zeros(1, control_dtype(4))[0]
    control["main"], control["stand_in"], control["dt"] = [0, 1, 2], FLAP, DT
    control["low"], control["high"] = TRAVEL
    control["least_effectiveness"] = 0.1
    control["effectiveness"], control["offset"] = rng.uniform(0.2, 1.0, 4), rng.normal(0, 0.02, 4)
    control["model_A"], control["model_B"] = reference_model.discretise(10.0, 1.0, DT)
    for name in ("governed_rate", "governed_acceleration", "commanded_rate", "reference_scale"):
        control[name] = rng.normal(0, 0.1, 3)
    rejection = control["rejection"]
    rejection["qdyn"] = [500.0, 700.0, 1000.0, 1400.0, 2000.0]
    for name in ("Kp_at", "pull_at", "learn_at"):
        rejection[name] = rng.uniform(0.1, 5.0, (4, 5))
    for name in ("rate", "disturbance", "Kp", "pull", "learn"):
        rejection[name] = rng.normal(0, 0.3, 3)
    rejection["share"] = 0.4
    return control, rng


@pytest.mark.parametrize("lost", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("qdyn", [300.0, 500.0, 640.0, 700.0, 810.0, 1000.0, 1390.0, 1400.0, 1999.0, 2400.0])
def test_the_schedule_is_interpolated_and_held_beyond_its_ends(qdyn, lost):
    control, _ = record()
    rejection = control["rejection"]
    rejection["lost"] = lost
    rejecting.schedule(rejection, qdyn)
    for name in ("Kp", "pull", "learn"):
        table = rejection[f"{name}_at"]
        of = [np.interp(qdyn, rejection["qdyn"], row) for row in table]
        expected = [of[0], (1 - lost) * of[1] + lost * of[3], of[2]]
        assert rejection[name] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("given", [0.0, 0.25, 0.5, 1.0])
@pytest.mark.parametrize(("left", "lost"), [(1.0, 0.0), (0.6, 0.4), (0.1, 0.9), (0.09, 1.0), (0.0, 1.0)])
def test_the_stand_in_carries_what_is_lost_and_takes_it_over_smoothly(given, left, lost):
    control, _ = record()
    control["hand_over"] = given
    rejecting.hand_over(control, left)
    part = 1.0 if left == 0.0 else 3 * given**2 - 2 * given**3
    assert control["rejection"]["lost"] == pytest.approx(part * lost, abs=1e-15)


@pytest.mark.parametrize(
    ("surface", "believed", "kept"),
    [
        (AILERON, 0.3, 0.3), (RUDDER, 0.06, 0.1), (AILERON, 0.04, 0.04), (RUDDER, 0.8, 0.8),
        (AILERON, 0.05, 0.1), (ELEVATOR, 0.03, 0.03), (ELEVATOR, 0.06, 0.06), (FLAP, 0.06, 0.06),
    ],
)  # fmt: skip
def test_what_nothing_replaces_is_divided_by_no_less_than_the_law_may_or_given_up(surface, believed, kept):
    control, _ = record()
    control["target"][surface] = believed
    rejecting.hesitate(control, surface)
    assert control["target"][surface] == kept


class TestAbandon:
    def held(self, surface, frames, saturated=True, suspected=True):
        """(frames until it is given up or None, the record) of a surface at its stop."""
        control, _ = record()
        control["target"] = control["effectiveness"] = 1.0
        control["saturated"][surface] = saturated
        for k in range(frames):
            rejecting.abandon(control, surface, suspected)
            if control["rejection"]["abandoned"][surface]:
                return k + 1, control
        return None, control

    @pytest.mark.parametrize(("surface", "patience_s"), [(ELEVATOR, 0.5), (FLAP, 0.5), (RUDDER, 1.0)])
    def test_a_suspect_at_its_stop_is_given_up_in_time(self, surface, patience_s):
        frames, control = self.held(surface, 300)
        assert frames == pytest.approx(patience_s / DT, abs=2)
        assert control["target"][surface] == control["effectiveness"][surface] == 0.0
        assert control["rejection"]["at_stop_s"][surface] == 0.0
        assert control["rejection"]["abandoned"].sum() == 1

    def test_neither_a_healthy_one_nor_one_within_its_travel(self):
        assert self.held(RUDDER, 300, suspected=False)[0] is None
        none, control = self.held(RUDDER, 300, saturated=False)
        assert none is None
        assert control["target"][RUDDER] == 1.0

    def test_time_within_the_travel_counts_back_by_half_of_what_it_lasts(self):
        control, _ = record()
        control["saturated"][RUDDER] = 1
        for _ in range(60):
            rejecting.abandon(control, RUDDER, True)
        control["saturated"][RUDDER] = 0
        for _ in range(40):
            rejecting.abandon(control, RUDDER, True)
        assert control["rejection"]["at_stop_s"][RUDDER] == pytest.approx(0.6 - 0.5 * 0.4)

    @pytest.mark.parametrize(("surface", "again"), [(ELEVATOR, True), (RUDDER, False)])
    def test_only_what_is_replaced_is_tried_again(self, surface, again):
        _, control = self.held(surface, 300)
        control["saturated"][surface] = 0
        tried = None
        for k in range(2500):
            rejecting.abandon(control, surface, True)
            if not control["rejection"]["abandoned"][surface]:
                tried = k + 1
                break
        assert tried == (pytest.approx(20.0 / DT, abs=2) if again else None)
        if again:
            assert control["rejection"]["at_stop_s"][surface] == 0.0

    def test_a_suspicion_that_is_taken_back_frees_it(self):
        _, control = self.held(RUDDER, 300)
        rejecting.abandon(control, RUDDER, False)
        assert control["rejection"]["abandoned"][RUDDER] == 0
        assert control["rejection"]["at_stop_s"][RUDDER] == 0.0


@given(st.integers(0, 50))
def test_the_observer_is_that_of_its_equations(seed):
    control, rng = record(seed)
    x, design, Gu, G = (
        rng.normal(0, 0.1, 3),
        rng.normal(0, 1, 3),
        rng.normal(0, 1, (3, 4)),
        rng.normal(0, 5, (3, 4)),
    )
    rejection = control["rejection"]
    rejecting.observe(control, x, design, Gu, G)
    assert list(rejection["rate"]) == list(x), "it begins with what is measured"
    z, d = rejection["rate"].copy(), rejection["disturbance"].copy()
    x = x + 0.01
    rejecting.observe(control, x, design, Gu, G)
    z = z + DT * (design + Gu @ (control["effectiveness"] - 1.0) + G @ control["offset"] + d)
    assert rejection["disturbance"] == pytest.approx(d + rejection["learn"] * (x - z), abs=1e-12)
    assert rejection["rate"] == pytest.approx(z + rejection["pull"] * (x - z), abs=1e-12)


@given(st.integers(0, 50))
def test_the_demand_is_that_of_its_equation(seed):
    """demand = xm' + Kp (xm - x+) - f - d, xm and x+ when the command acts."""
    control, rng = record(seed)
    frames = assemble(scenario(), np.zeros(4), TRAVEL)
    belief, measured, rejection = frames[0]["belief"], frames[0]["measured"], control["rejection"]
    belief["f"], belief["G"], belief["u"] = (
        rng.normal(0, 1, 3),
        rng.normal(0, 5, (3, 4)),
        rng.normal(0, 0.1, 4),
    )
    measured["x"], measured["y"][3] = rng.normal(0, 0.1, 3), 900.0
    rejecting.demand(control, belief, measured)  # the first frame: the observer begins with x
    share, d, x = rejection["share"], rejection["disturbance"], measured["x"]
    now = belief["f"] + d + belief["G"] @ (control["effectiveness"] * belief["u"] + control["offset"])
    ahead = x + share * DT * now
    A, B = control["model_A"], control["model_B"]
    wanted = control["reference_scale"] * control["commanded_rate"]
    state = np.array([control["governed_rate"], control["governed_acceleration"]])
    first = A @ state + np.outer(B, wanted)
    second = A @ first + np.outer(B, wanted)
    target = (1 - share) * state[0] + share * first[0]
    after = (1 - share) * first[0] + share * second[0]
    hold = -belief["f"] - d
    assert control["hold"] == pytest.approx(hold, abs=1e-12)
    assert control["demand"] == pytest.approx(
        (after - target) / DT + rejection["Kp"] * (target - ahead) + hold, abs=1e-9
    )


def test_a_command_leads_a_lagging_actuator_within_the_travel():
    control, _ = record()
    control["command"] = [0.1, -0.1, 0.4, 0.5]
    control["rejection"]["lead"] = [3.0, 1.0, 4.0, 0.0]
    rejecting.hurry(control, np.array([0.05, -0.2, 0.3, 0.4]))
    assert control["command"] == pytest.approx([0.05 + 3 * 0.05, -0.1, 0.44, 0.5])


@pytest.mark.parametrize(
    ("mode", "every_type", "hedging", "left", "before", "after"),
    [
        (MODE_REALLOCATED, 0, 0, 0.6, 0.2, 0.3),
        (MODE_REALLOCATED, 0, 0, 0.6, 0.95, 1.0),
        (MODE_REALLOCATED, 0, 1, 0.2, 0.2, 0.8),
        (MODE_REALLOCATED, 1, 0, 0.05, 0.2, 0.95),
        (MODE_REALLOCATED, 0, 0, 0.05, 0.2, 0.3),
        (MODE_ADAPTIVE, 1, 0, 1.0, 0.25, 0.15),
        (MODE_NOMINAL, 1, 0, 1.0, 0.05, 0.0),
        (MODE_NOMINAL, 0, 0, 1.0, 0.25, 0.25),
    ],
)
def test_pitch_is_handed_over_by_steps_and_back(mode, every_type, hedging, left, before, after):
    control, _ = record()
    control["hand_over"], control["hand_over_step"], control["hedging"] = before, 0.1, hedging
    control["effectiveness"][ELEVATOR] = left
    law.advance_hand_over(control, every_type, mode)
    assert control["hand_over"] == pytest.approx(after)
    lost = 1.0 - left if left >= 0.1 else 1.0
    assert control["rejection"]["lost"] == pytest.approx((3 * after**2 - 2 * after**3) * lost)


def test_a_plug_ins_command_is_kept_within_the_travel_and_that_is_noted():
    control, _ = record()
    law.take_command(control, np.array([0.6, 0.1, -0.5, -0.1]))
    assert list(control["command"]) == [0.52, 0.1, -0.44, -0.1]
    assert list(control["saturated"]) == [1, 0, 1, 0]


class TestVerdict:
    """What the law takes each surface for."""

    @pytest.fixture
    def frame(self):
        frame = assemble(scenario(control={"law": "fault-tolerant-published"}), np.zeros(4), TRAVEL)[0]
        frame["control"]["trim"] = [0.01, -0.04, 0.02, 0.0]
        return frame

    def told(self, frame):
        faults = np.zeros(1, true_faults_dtype(4))[0]
        return frame["control"], frame["fdi"], frame["belief"], frame["measured"], faults

    def test_of_a_plug_ins_estimates_once_it_has_detected(self, frame):
        control, fdi, *rest = self.told(frame)
        fdi["verdict"]["estimates"], fdi["verdict"]["effectiveness"] = 1, [0.9, 0.4, 1.0, 0.7]
        fdi["verdict"]["isolated"] = NOT_ISOLATED
        accommodation.accommodate(control, fdi, *rest)
        assert list(control["target"]) == [1.0] * 4
        fdi["verdict"]["detected"] = 1
        accommodation.accommodate(control, fdi, *rest)
        assert list(control["target"]) == [0.9, 0.4, 1.0, 0.7]

    @pytest.mark.parametrize("effectiveness", [0.0, 0.6])
    def test_of_the_truth_for_the_oracle(self, frame, effectiveness):
        control, fdi, belief, measured, faults = self.told(frame)
        control["law"], faults["present"] = ORACLE, 1
        faults["effectiveness"], faults["effective"] = [1.0, effectiveness, 1.0, 1.0], [0.1, 0.2, 0.3, 0.4]
        faults["immovable"][FLAP] = 1
        belief["u"] = [0.1, 0.25, 0.3, 0.05]
        accommodation.accommodate(control, fdi, belief, measured, faults)
        assert control["target"] == pytest.approx([1.0, effectiveness, 1.0, 0.0])
        assert control["offset"] == pytest.approx([0.0, 0.2 - effectiveness * 0.25, 0.0, 0.4])

    def test_a_slow_surface_is_left_to_its_pace(self, frame):
        control, fdi, *_ = self.told(frame)
        surface = fdi["types"]["surface"][RUDDER]
        surface["measure"], surface["command"], surface["low"], surface["high"] = LAGS, 0.1, 0.02, 0.06
        accommodation.act_on_type(control, fdi, RUDDER)
        assert control["lag"] == pytest.approx([0, 0, 0.04 - 0.1, 0])
        assert control["hedging"] == 1

    @pytest.mark.parametrize(
        ("every_type", "measure", "target", "surface", "doubtful"),
        [
            (1, -1, 1.0, RUDDER, True), (1, LOSES, 1.0, RUDDER, False), (0, -1, 1.0, RUDDER, False),
            (0, -1, 0.05, RUDDER, True), (0, -1, 0.1, RUDDER, False), (0, -1, 1.0, ELEVATOR, True),
            (1, SHIFTED, 0.5, AILERON, False),
        ],
    )  # fmt: skip
    def test_what_may_be_of_no_use(self, frame, every_type, measure, target, surface, doubtful):
        control, fdi, *_ = self.told(frame)
        fdi["config"]["every_type"], fdi["types"]["surface"][surface]["measure"] = every_type, measure
        control["target"], control["least_effectiveness"] = 1.0, 0.1
        control["target"][surface] = target
        assert bool(accommodation.is_doubtful(control, fdi, surface)) is doubtful

    @pytest.mark.parametrize("why", ["truth", "abandoned", "fixed", None])
    def test_what_does_not_follow_is_commanded_to_its_trim(self, frame, why):
        control, fdi, _, _, faults = self.told(frame)
        control["command"], control["saturated"], control["effectiveness"] = 0.3, 1, 1.0
        control["law"] = ORACLE if why == "truth" else ADAPTIVE
        faults["immovable"][RUDDER] = 1  # which only the oracle may know
        control["rejection"]["abandoned"][RUDDER] = why == "abandoned"
        fdi["config"]["every_type"], fdi["types"]["surface"][RUDDER]["measure"] = 1, FIXED
        control["effectiveness"][RUDDER] = 0.0 if why == "fixed" else 0.5
        accommodation.give_up(control, fdi, faults)
        given_up = why is not None
        assert list(control["command"]) == [0.3, 0.3, 0.02 if given_up else 0.3, 0.3]
        assert list(control["saturated"]) == [1, 1, 0 if given_up else 1, 1]
        assert control["hedging"] == given_up

    @pytest.mark.parametrize("law_is", [NOMINAL, FAULT_TOLERANT])
    def test_the_unknown_is_for_the_observer_where_there_is_one(self, frame, law_is):
        control, fdi, *rest = self.told(frame)
        control["fhat"], control["inner"], control["law"] = 1.0, REJECTING, law_is
        accommodation.compensate(control, fdi, *rest)
        assert list(control["fhat"]) == [0.0] * 3


def test_a_command_to_an_actuator_that_does_not_lag_stays_to_the_last_digit():
    control, _ = record()
    control["command"] = -0.1
    control["rejection"]["lead"] = 1.0
    rejecting.hurry(control, np.array([-0.3, 0.7, 0.11, 0.33]))
    assert control["command"].tolist() == [-0.1] * 4


def test_a_surface_that_is_whole_is_not_asked_about():
    """What the observer has seen of it stays, for the day on which it is named."""
    control, _ = record()
    control["target"] = 1.0
    control["rejection"]["found"]["product"] = 3.0
    for s in (AILERON, RUDDER):
        rejecting.hesitate(control, s)
    assert control["rejection"]["found"]["product"].tolist() == [3.0] * 3
    assert not control["rejection"]["found"]["named"].any()


def test_only_the_main_surface_of_an_axis_is_seen_to_act():
    control, _ = record()
    found = control["rejection"]["found"]
    found["square"], found["product"] = 1.0, (-0.5, -1.0, -0.95)
    assert [bool(rejecting.acts(control, s)) for s in range(4)] == [True, False, False, False]
    found["product"] = -0.95, -1.0, -0.5
    assert [bool(rejecting.acts(control, s)) for s in range(4)] == [False, False, True, False]


def test_of_nothing_seen_the_verdict_is_believed():
    """An observer that has missed nothing yet says nothing about a surface."""
    control, _ = record()
    control["rejection"]["found"]["frames"] = 5.0
    assert left.left_of(control, 0, 0.4) == 0.4
