"""From the types left to a verdict, and from frames to blocks: case by case, with the rule in the name."""

import numpy as np
import pytest
from kernels import new_fdi, on, put, put_on

from beaver_ftc.diagnosis import conclusion, types
from beaver_ftc.diagnosis.model_prediction import frame_means_dtype
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, ROLL, UNANTICIPATED, YAW
from beaver_ftc.diagnosis.types import (
    GIVE_UP,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    WAIT_FOR_SURFACE,
    pairs,
    registry,
    verdict,
)
from beaver_ftc.diagnosis.types.registry import N_TYPES
from beaver_ftc.diagnosis.types.verdict import (
    DEDUCED_FAULTY,
    DEDUCED_HEALTHY,
    NO_SURFACE,
    SEVERAL_SURFACES,
)
from fault_kinds import (
    BIAS,
    CONSTANT_LOSS,
    DOWN,
    FLOAT,
    GROWING_BIAS,
    OSCILLATORY,
    SLOW,
    STUCK,
    UP,
    VARYING_LOSS,
)

AILERON, ELEVATOR, RUDDER, FLAP = range(4)
PATIENCE, DT = 20, 0.02
ALL = tuple(range(N_TYPES))
COURSES = (VARYING_LOSS, OSCILLATORY, SLOW, GROWING_BIAS)


def leave(surface, *kinds):
    """Only these types are left of a surface."""
    surface["sets"]["excluded"] = [kind not in kinds for kind in range(N_TYPES)]


def new_case(**left):
    """Four surfaces, of which each has these types left: by default all; none: it cannot be at fault."""
    fdi = new_fdi()
    (
        fdi["types"]["config"]["half_frames"],
        fdi["types"]["config"]["single_instant"],
        fdi["config"]["diagnoses_all_types"],
        fdi["types"]["config"]["n_substeps"],
    ) = PATIENCE, 1, 1, 1
    fdi["isolation"]["config"]["n_estimators"] = 8
    fdi["types"]["config"]["frames_per_block"], fdi["types"]["config"]["block_duration_s"] = 1, DT
    layout = fdi["layout"]
    layout["loss"], layout["position"] = range(4), range(4, 8)
    layout["dominant_axis"], layout["main"] = (ROLL, PITCH, YAW, PITCH), (AILERON, ELEVATOR, RUDDER)
    layout["group"], layout["partner"] = (1, 0, 1, 0), (RUDDER, FLAP, AILERON, ELEVATOR)
    fdi["isolation"]["estimator"]["surface"][:8], fdi["isolation"]["estimator"]["hypothesis_kind"][:8] = (
        (0, 1, 2, 3) * 2,
        (0,) * 4 + (1,) * 4,
    )
    (
        fdi["types"]["surface"]["status"]["may_be_sole"],
        fdi["types"]["surface"]["evidence"]["n_anomalous"],
        fdi["types"]["surface"]["evidence"]["n_unhidden"],
    ) = 1, 99, 99
    fdi["types"]["surface"]["actuator"]["stop_lo"], fdi["types"]["surface"]["actuator"]["stop_hi"] = (
        -0.4,
        0.5,
    )
    (
        fdi["types"]["surface"]["actuator"]["reach_lo"],
        fdi["types"]["surface"]["actuator"]["reach_hi"],
    ) = (
        -0.4,
        0.5,
    )
    fdi["isolation"]["estimator"]["theta_min"][4:8], fdi["isolation"]["estimator"]["theta_max"][4:8] = (
        -0.4,
        0.5,
    )
    for s, name in enumerate(("aileron", "elevator", "rudder", "flap")):
        kinds = left.get(name, ALL)
        if kinds is None:
            fdi["types"]["surface"]["not_at_position"][s] = 1
        else:
            leave(fdi["types"]["surface"][s], *kinds)
    return fdi


def locate(fdi, s, innovation, bound, effect):
    """`observe_surface` for surface s, with its estimator and its axis."""
    fie = fdi["isolation"]["estimator"][fdi["layout"]["position"][s]]
    axis = fdi["layout"]["dominant_axis"][s]
    config, surface = fdi["types"]["config"], fdi["types"]["surface"][s]
    types.copy_observation(surface["earlier"], surface["judged"])
    types.copy_observation(surface["judged"], surface["last"])
    types.observe_surface(config, surface, fie, axis, innovation, bound, effect)


def one(*kinds, **fields):
    fdi = new_case(rudder=kinds)
    surface = fdi["types"]["surface"][RUDDER]
    put_on(surface, **fields)
    return fdi, surface


NOBODY_ELSE = {"aileron": None, "elevator": None, "flap": None}


@pytest.mark.parametrize(
    ("kinds", "constant", "explained"),
    [
        # whether a type explains the flight: before an oscillation has shown itself, and after
        ((), False, (False, False)),
        ((STUCK,), True, (True, True)),
        ((BIAS, OSCILLATORY), True, (True, True)),
        ((SLOW,), False, (True, True)),
        ((OSCILLATORY,), False, (False, True)),
        ((VARYING_LOSS, OSCILLATORY), False, (True, True)),
        ((GROWING_BIAS,), False, (True, True)),
        (ALL, True, (True, True)),
    ],
)
def test_questions_about_the_types_left(kinds, constant, explained):
    _, surface = one(*kinds)
    assert sum(map(bool, (verdict.type_remains(surface, kind) for kind in ALL))) == len(kinds)
    assert all(verdict.type_remains(surface, kind) for kind in kinds)
    assert bool(verdict.constant_remains(surface)) == constant
    assert bool(verdict.left(surface, verdict.ALL)) == (kinds != ())
    for k, half_cycles in enumerate((2, 3)):
        surface["oscillatory"]["n_half"] = half_cycles
        assert bool(verdict.explains_flight(surface)) == explained[k]


@pytest.mark.parametrize(
    ("kinds", "fixed", "one_type", "sole_shown"),
    [
        ((CONSTANT_LOSS,), 0, CONSTANT_LOSS, CONSTANT_LOSS),
        ((VARYING_LOSS,), 0, -1, CONSTANT_LOSS),
        ((VARYING_LOSS, BIAS), 0, BIAS, -1),
        ((STUCK,), 1, STUCK, STUCK),
        ((STUCK, BIAS), 0, -1, -1),
        ((STUCK, CONSTANT_LOSS), 0, -1, -1),
        ((STUCK, CONSTANT_LOSS, FLOAT), 1, -1, -1),
        ((UP, DOWN), 1, UP, UP),
        ((UP, DOWN, STUCK), 1, -1, -1),
        ((FLOAT,), 0, FLOAT, FLOAT),
        ((OSCILLATORY,), 0, -1, -1),
        ((SLOW, STUCK), 1, STUCK, -1),
    ],
)
def test_what_kind_of_fault_it_may_be(kinds, fixed, one_type, sole_shown):
    _, surface = one(*kinds)
    same_name = verdict.SAME_NAME[sole_shown] if sole_shown >= 0 else -1
    assert (verdict.choose_mode(surface) == GIVE_UP) == fixed
    assert max(verdict.sole(surface, verdict.CONSTANT), -1) == one_type
    found = verdict.sole_shown(surface, verdict.ALL)
    assert (verdict.SAME_NAME[found] if found >= 0 else -1) == same_name


def test_a_surface_is_possible_by_its_estimator_or_by_deduction():
    fdi = new_case(rudder=None)
    assert [bool(verdict.can_be_faulty(fdi["types"]["surface"][s])) for s in range(4)] == [
        True,
        True,
        False,
        True,
    ]
    fdi["types"]["surface"]["status"]["basis"] = (
        DEDUCED_HEALTHY,
        DEDUCED_FAULTY,
        DEDUCED_FAULTY,
        0,
    )
    assert [bool(verdict.can_be_faulty(fdi["types"]["surface"][s])) for s in range(4)] == [
        False,
        True,
        True,
        True,
    ]


def test_the_sole_surface_that_is_possible():
    assert on(verdict.sole_surface, new_case(), False) == SEVERAL_SURFACES
    assert on(verdict.sole_surface, new_case(**NOBODY_ELSE), False) == RUDDER
    assert on(verdict.sole_surface, new_case(rudder=None, **NOBODY_ELSE), False) == NO_SURFACE
    only = new_case(aileron=COURSES, elevator=COURSES, flap=COURSES, rudder=(STUCK,))
    assert on(verdict.sole_surface, only, True) == RUDDER
    assert on(verdict.sole_surface, only, False) == SEVERAL_SURFACES
    only["types"]["surface"]["status"]["may_be_sole"] = 0, 0, 0, 1
    assert on(verdict.sole_surface, only, False) == FLAP
    assert on(verdict.sole_surface, only, True) == NO_SURFACE


@pytest.mark.parametrize(
    ("evidence", "n_rest", "slow"), [(19, 0, True), (20, 0, False), (30, 11, True), (30, 10, False)]
)
def test_what_looks_like_a_jam_may_be_slow_until_it_has_stood_off_for_long(evidence, n_rest, slow):
    fdi, surface = one(STUCK, SLOW, evidence=evidence, n_rest=n_rest)
    assert bool(on(verdict.may_be_hidden, fdi, surface)) == slow
    assert not on(
        verdict.may_be_hidden,
        *one(STUCK, evidence=evidence, n_rest=n_rest),
    )
    assert not on(
        verdict.may_be_hidden,
        *one(SLOW, evidence=evidence, n_rest=n_rest),
    )


def looked_like_by(kind):
    """The constant types that are not named while `kind` is left."""
    constant = set(ALL) - set(COURSES)
    return {other for other in constant if verdict.can_be_another(one(other, kind)[1], other, True)}


def test_what_stands_still_may_be_slow_until_that_is_excluded():
    assert looked_like_by(SLOW) == {STUCK, FLOAT, UP, DOWN}
    assert not verdict.can_be_another(one(STUCK)[1], STUCK, True)
    assert on(verdict.type_on_surface, *one(STUCK)) == STUCK
    assert on(verdict.type_on_surface, *one(STUCK, SLOW)) == -1
    assert on(verdict.type_on_surface, *one(BIAS, SLOW)) == BIAS


def test_a_bias_that_grows_may_look_like_a_jam_or_a_loss():
    assert looked_like_by(GROWING_BIAS) == {CONSTANT_LOSS, STUCK, FLOAT, UP, DOWN}
    assert not verdict.can_be_another(one(STUCK)[1], STUCK, True)
    for direction, stop in ((UP, 1), (DOWN, 0)):  # what has run to the stop has not come there by and by
        _, surface = one(direction, GROWING_BIAS)
        surface["growing_bias"]["has_run"][stop] = 1
        assert not verdict.can_be_another(surface, direction, True)
        surface["growing_bias"]["has_run"][:] = 1 - surface["growing_bias"]["has_run"]
        assert verdict.can_be_another(surface, direction, True)
    assert not verdict.can_be_another(one(STUCK, SLOW)[1], STUCK, False)  # it follows the command
    assert verdict.can_be_another(one(STUCK, GROWING_BIAS)[1], STUCK, False)


@pytest.mark.parametrize(
    ("kinds", "evidence", "half_cycles", "found", "in_coarse_sets"),
    [
        ((STUCK,), PATIENCE, 0, STUCK, STUCK),
        ((STUCK,), PATIENCE - 1, 0, -1, -1),
        ((STUCK, OSCILLATORY), 2 * PATIENCE - 1, 0, -1, -1),
        ((STUCK, OSCILLATORY), 2 * PATIENCE, 0, STUCK, -1),
        ((STUCK, GROWING_BIAS), 99, 0, -1, -1),
        ((BIAS, GROWING_BIAS), 99, 0, BIAS, BIAS),
        ((STUCK, BIAS), 99, 0, -1, -1),
        ((VARYING_LOSS,), PATIENCE, 0, VARYING_LOSS, VARYING_LOSS),
        ((GROWING_BIAS,), PATIENCE, 0, GROWING_BIAS, GROWING_BIAS),
        ((SLOW,), PATIENCE, 0, SLOW, SLOW),
        ((VARYING_LOSS, SLOW), 99, 3, -1, -1),
        ((VARYING_LOSS, GROWING_BIAS), 99, 3, -1, -1),
        ((SLOW, GROWING_BIAS), 99, 3, -1, -1),
        ((SLOW, OSCILLATORY), 99, 3, -1, -1),
        ((VARYING_LOSS, OSCILLATORY), 2 * PATIENCE - 1, 0, -1, -1),
        ((VARYING_LOSS, OSCILLATORY), 2 * PATIENCE, 0, VARYING_LOSS, -1),
        ((GROWING_BIAS, OSCILLATORY), 2 * PATIENCE, 0, GROWING_BIAS, -1),
        ((OSCILLATORY,), PATIENCE, 3, OSCILLATORY, OSCILLATORY),
        ((OSCILLATORY,), 99, 2, -1, -1),
        ((), 99, 0, -1, -1),
    ],
)
def test_a_type_is_named_once_it_is_the_only_one(kinds, evidence, half_cycles, found, in_coarse_sets):
    """In sets that errors declared of our own make coarse, a constant proves nothing: one type of all."""
    fdi, surface = one(*kinds, evidence=evidence, n_unhidden=evidence)
    surface["oscillatory"]["n_half"] = half_cycles
    assert on(verdict.type_on_surface, fdi, surface) == found
    fdi["types"]["config"]["has_eG"] = 1
    assert on(verdict.type_on_surface, fdi, surface) == in_coarse_sets


@pytest.mark.parametrize("kind", [STUCK, VARYING_LOSS, GROWING_BIAS])
def test_what_a_stop_may_have_hidden_is_waited_for(kind):
    fdi, surface = one(kind, OSCILLATORY, evidence=99, n_unhidden=2 * PATIENCE - 1)
    assert on(verdict.type_on_surface, fdi, surface) == -1
    leave(surface, kind)  # an oscillation that has been excluded is not
    assert on(verdict.type_on_surface, fdi, surface) == kind


@pytest.mark.parametrize(
    ("kinds", "accommodation_mode"),
    [
        ((STUCK,), GIVE_UP), ((UP,), GIVE_UP), ((SLOW,), WAIT_FOR_SURFACE), ((OSCILLATORY,), SUBTRACT_OFFSET),
        ((SLOW, BIAS), SUBTRACT_OFFSET),
        ((CONSTANT_LOSS,), SCALE_COMMAND), ((VARYING_LOSS,), SCALE_COMMAND),
        ((CONSTANT_LOSS, BIAS), SUBTRACT_OFFSET),
        ((CONSTANT_LOSS, STUCK), SUBTRACT_OFFSET), ((VARYING_LOSS, SLOW), SCALE_COMMAND),
        ((BIAS,), SUBTRACT_OFFSET),
        ((GROWING_BIAS,), SUBTRACT_OFFSET), ((FLOAT, CONSTANT_LOSS), SCALE_COMMAND),
    ],
)  # fmt: skip
def test_what_is_done_about_a_surface(kinds, accommodation_mode):
    assert verdict.choose_mode(one(*kinds)[1]) == accommodation_mode


def test_the_surface_at_fault():
    assert on(verdict.find_surface, new_case()) == NOT_ISOLATED
    assert on(verdict.find_surface, new_case(**NOBODY_ELSE)) == RUDDER
    assert on(verdict.find_surface, new_case(rudder=None, **NOBODY_ELSE)) == UNANTICIPATED
    pitch = {"aileron": None, "rudder": None, "flap": None}
    assert on(verdict.find_surface, new_case(elevator=(STUCK,), **pitch)) == ELEVATOR
    assert on(verdict.find_surface, new_case(elevator=(OSCILLATORY,), **pitch)) == NOT_ISOLATED
    lateral = dict(NOBODY_ELSE)
    assert on(verdict.find_surface, new_case(rudder=(OSCILLATORY,), **lateral)) == RUDDER


@pytest.mark.parametrize(
    ("flap", "evidence", "has_eG", "not_at_position"),
    [
        ((), PATIENCE, 0, True), ((), PATIENCE - 1, 0, False), ((SLOW,), PATIENCE, 0, True),
        ((OSCILLATORY,), 2 * PATIENCE - 1, 0, False), ((OSCILLATORY,), 2 * PATIENCE, 0, True),
        ((VARYING_LOSS,), 2 * PATIENCE - 1, 0, False), ((VARYING_LOSS,), 2 * PATIENCE, 0, True),
        ((GROWING_BIAS,), 99, 0, False), ((SLOW,), 99, 1, False), ((), PATIENCE, 1, True),
        (None, PATIENCE, 0, True),
    ],
)  # fmt: skip
def test_of_elevator_and_flap_the_one_a_constant_explains(flap, evidence, has_eG, not_at_position):
    fdi = new_case(elevator=(STUCK,), aileron=None, rudder=None, flap=flap)
    (
        fdi["types"]["surface"]["evidence"]["n_anomalous"][ELEVATOR],
        fdi["types"]["config"]["has_eG"],
    ) = (
        evidence,
        has_eG,
    )
    fdi["types"]["surface"]["evidence"]["n_unhidden"][FLAP] = evidence
    assert bool(on(verdict.others_dismissed, fdi, ELEVATOR)) == not_at_position
    if flap is not None:
        assert on(verdict.find_surface, fdi) == (ELEVATOR if not_at_position else NOT_ISOLATED)
    fdi["types"]["surface"]["status"]["may_be_sole"][FLAP] = 0
    assert bool(on(verdict.others_dismissed, fdi, ELEVATOR)) == (evidence >= PATIENCE)


def conclude(fdi, kernel, *given, lead=()):
    """Hand a finding of the types to the conclusion."""
    conclusion.record_decision(fdi["verdict"], (*on(kernel, fdi, *given), *lead))


def take_lead(fdi, kernel, *given):
    """Keep a lead where the conclusion has it."""
    fdi["verdict"]["target"], fdi["verdict"]["accommodation_mode"] = on(kernel, fdi, *given)


def test_a_decision_notes_when_surface_and_type_became_certain():
    fdi = new_case(rudder=(STUCK,), **NOBODY_ELSE)
    fdi["verdict"]["isolated_estimator"], fdi["verdict"]["fault_type"] = NOT_ISOLATED, -1
    conclude(fdi, verdict.decide_single, 3.0)
    assert fdi["verdict"]["isolated_estimator"] == 4 + RUDDER  # its estimator of a position
    assert fdi["verdict"]["fault_type"] == STUCK
    assert (fdi["verdict"]["isolated_at_s"], fdi["verdict"]["typed_at_s"]) == (3.0, 3.0)
    leave(fdi["types"]["surface"][RUDDER], VARYING_LOSS)
    conclude(fdi, verdict.decide_single, 4.0)
    assert fdi["verdict"]["isolated_estimator"] == RUDDER  # its estimator of a loss
    assert (fdi["verdict"]["isolated_at_s"], fdi["verdict"]["typed_at_s"]) == (3.0, 4.0)
    conclude(fdi, verdict.decide_single, 5.0)
    assert (fdi["verdict"]["isolated_at_s"], fdi["verdict"]["typed_at_s"]) == (3.0, 4.0)
    fdi["types"]["surface"]["not_at_position"][RUDDER] = 1
    conclude(fdi, verdict.decide_single, 6.0)
    assert fdi["verdict"]["isolated_estimator"] == UNANTICIPATED
    assert (fdi["verdict"]["isolated_at_s"], fdi["verdict"]["typed_at_s"]) == (6.0, 6.0)
    assert fdi["verdict"]["fault_type"] == -1
    assert fdi["verdict"]["target"] == NO_SURFACE


def test_the_law_acts_on_the_likeliest_before_all_doubt_is_gone():
    fdi = new_case(**NOBODY_ELSE)
    fdi["verdict"]["isolated_estimator"] = NOT_ISOLATED
    assert on(verdict.presumed_surface, fdi, fdi["verdict"]["isolated_estimator"]) == RUDDER
    alone = _open(new_case(elevator=None, rudder=None, flap=None))
    assert on(verdict.presumed_surface, alone, NOT_ISOLATED) == AILERON
    assert on(verdict.presumed_surface, _open(new_case()), NOT_ISOLATED) == ELEVATOR
    assert on(verdict.presumed_surface, _open(new_case(elevator=None)), NOT_ISOLATED) == FLAP
    assert on(verdict.presumed_surface, _open(new_case(elevator=None, flap=None)), NOT_ISOLATED) == NO_SURFACE
    fdi["verdict"]["isolated_estimator"] = 4 + FLAP
    assert on(verdict.presumed_surface, fdi, fdi["verdict"]["isolated_estimator"]) == FLAP


def _open(fdi):
    fdi["verdict"]["isolated_estimator"] = NOT_ISOLATED
    return fdi


def test_the_lead_is_taken_on_one_surface_while_its_fault_shows():
    fdi = _open(new_case(rudder=(STUCK,), **NOBODY_ELSE))
    surface = fdi["types"]["surface"][RUDDER]
    (
        surface["sets"]["low"][STUCK],
        surface["sets"]["high"][STUCK],
        surface["last"]["u"],
    ) = (
        0.1,
        0.2,
        0.3,
    )
    surface["last"]["lo"], surface["last"]["hi"] = 0.1, 0.2
    fdi["types"]["surface"]["accommodation"]["mode"] = 3
    take_lead(fdi, verdict.decide_mode, fdi["verdict"]["isolated_estimator"])
    assert (fdi["verdict"]["target"], fdi["verdict"]["accommodation_mode"]) == (RUDDER, GIVE_UP)
    assert fdi["types"]["surface"]["accommodation"]["mode"].tolist() == [-1, -1, GIVE_UP, -1]
    surface["last"]["lo"], surface["last"]["hi"] = (
        0.25,
        0.35,
    )  # it follows its command again
    fdi["types"]["config"]["dt"] = 0.01
    for _ in range(19):
        take_lead(fdi, verdict.decide_mode, fdi["verdict"]["isolated_estimator"])
    assert fdi["verdict"]["target"] == RUDDER
    take_lead(fdi, verdict.decide_mode, fdi["verdict"]["isolated_estimator"])
    assert fdi["verdict"]["target"] == NO_SURFACE
    assert surface["accommodation"]["mode"] == -1
    surface["last"]["lo"] = 0.1
    take_lead(fdi, verdict.decide_mode, fdi["verdict"]["isolated_estimator"])
    assert (
        surface["accommodation"]["n_silent"],
        fdi["verdict"]["target"],
    ) == (
        0,
        RUDDER,
    )
    assert on(verdict.fault_shows, fdi, surface, SCALE_COMMAND, True)


@pytest.mark.parametrize("dt", [0.01, 0.002, 0.05])
def test_a_fault_that_has_gone_is_let_go_after_a_fifth_of_a_second_at_any_rate(dt):
    fdi, surface = one(STUCK, command=0.3, low=0.29, high=0.31, n_silent=0)
    fdi["types"]["config"]["dt"] = dt
    surface["sets"]["low"][STUCK], surface["sets"]["high"][STUCK] = 0.1, 0.2
    there = [bool(on(verdict.fault_shows, fdi, surface, GIVE_UP, True)) for _ in range(round(0.3 / dt))]
    assert there.index(False) + 1 == round(0.2 / dt)
    assert not any(there[there.index(False) :])


@pytest.mark.parametrize(
    ("kinds", "at_fault", "off"),
    [
        ((FLOAT, STUCK), True, -0.3), ((STUCK,), True, 0.15 - 0.3), ((STUCK, BIAS), True, -0.05),
        ((BIAS,), True, -0.05), ((SLOW,), True, 0.22 - 0.3), ((STUCK,), False, 0.22 - 0.3),
    ],
)  # fmt: skip
def test_how_far_a_surface_is_off(kinds, at_fault, off):
    _, surface = one(*kinds, command=0.3, low=0.2, high=0.24)
    surface["sets"]["low"][STUCK], surface["sets"]["high"][STUCK] = 0.1, 0.2
    surface["sets"]["low"][BIAS], surface["sets"]["high"][BIAS] = -0.1, 0.0
    assert verdict.deflection_error(surface, at_fault) == pytest.approx(off)
    if kinds == (BIAS,):
        surface["sets"]["low"][BIAS] = -np.inf
        assert verdict.deflection_error(surface, at_fault) == pytest.approx(0.22 - 0.3)


def test_what_a_surface_has_left():
    fdi, surface = one(CONSTANT_LOSS)
    fdi["isolation"]["estimator"]["theta"][RUDDER] = -0.1, -0.2, -0.3
    surface["sets"]["low"][CONSTANT_LOSS], surface["sets"]["high"][CONSTANT_LOSS] = 0.5, 0.6
    assert on(verdict.remaining_effectiveness, fdi, RUDDER) == pytest.approx(0.7)  # by its own axis, yaw
    fdi["types"]["pair"]["enabled"] = 1
    assert on(verdict.remaining_effectiveness, fdi, RUDDER) == pytest.approx(0.55)
    leave(surface, VARYING_LOSS)
    assert on(verdict.remaining_effectiveness, fdi, RUDDER) == pytest.approx(0.7)


# Examining frames.


def test_orders_are_kept_for_the_frames_before():
    fdi, means = new_case(), np.zeros(1, frame_means_dtype(4)).view(np.recarray)[0]
    for frame in ((0.1, 0.2), (0.3, -0.1), (0.9, 0.0)):
        for k, order in enumerate(frame):
            fdi["types"]["config"]["frames_per_block"], fdi["types"]["block"]["n_so_far"] = 2, k
            means["G_min"], means["G_max"] = -1.0 - order, 2.0 - k
            means["u_min"], means["u_max"] = order - 0.01, order + 0.02
            on(registry.record_commands, fdi, np.full(4, order), means)
    commands = fdi["types"]["surface"][0]["commands"]
    assert commands["history"][:, :2] == pytest.approx(
        np.array([[0.5, 0.0], [0.3, -0.1], [0.1, 0.2]])
    )  # within the travel
    assert commands["cmd_min"] == pytest.approx([0.0, -0.1, 0.1])
    assert commands["cmd_max"] == pytest.approx([0.5, 0.3, 0.2])
    assert (
        fdi["types"]["surface"][0]["commands"]["G_min"],
        fdi["types"]["surface"][0]["commands"]["G_max"],
    ) == (
        -1.9,
        2.0,
    )  # of the last block
    assert commands["u_min"] == pytest.approx([-0.01, -0.11])  # of a healthy one
    assert commands["u_max"] == pytest.approx([0.92, 0.32])


def test_what_the_effectiveness_varies_by_is_a_share_of_its_mean():
    fdi = new_case()
    effect, surface = (
        fdi["isolation"]["estimator"][4 + RUDDER]["effect"],
        fdi["types"]["surface"][RUDDER],
    )
    effect["regressor"], surface["last"]["kappa"] = (
        (0.5, 0.0, -2.0),
        0.07,
    )
    surface["commands"]["G_min"], surface["commands"]["G_max"] = (
        -2.1,
        -1.8,
    )
    locate(fdi, RUDDER, np.zeros(3), np.zeros(3), effect)
    assert (
        surface["last"]["kappa"],
        surface["judged"]["kappa"],
    ) == pytest.approx((0.25 * 0.3 / 2.0, 0.07))


def test_a_surface_is_where_the_innovation_puts_it():
    fdi = new_case()
    effect, surface = (
        fdi["isolation"]["estimator"][4 + RUDDER]["effect"],
        fdi["types"]["surface"][RUDDER],
    )
    effect["regressor"], effect["base"] = (
        (0.5, 0.0, -2.0),
        (-0.05, 0.0, 0.2),
    )  # commanded to 0.1
    (
        surface["last"]["lo"],
        surface["last"]["hi"],
        surface["last"]["u"],
    ) = 0.2, 0.3, 0.15
    surface["judged"]["lo"], surface["judged"]["hi"] = 0.4, 0.45
    # off by 0.2: 0.1 on roll, -0.4 on yaw, give or take
    locate(fdi, RUDDER, np.array([0.1, 0.0, -0.4]), np.array([0.005, 1.0, 0.1]), effect)
    assert surface["last"]["u"] == pytest.approx(0.1)
    assert (
        surface["last"]["lo"],
        surface["last"]["hi"],
    ) == pytest.approx((0.29, 0.31))  # roll says it to 0.005 / 0.5
    assert (
        surface["judged"]["lo"],
        surface["judged"]["hi"],
        surface["judged"]["u"],
    ) == (
        0.2,
        0.3,
        0.15,
    )
    assert (
        surface["earlier"]["lo"],
        surface["earlier"]["hi"],
    ) == (0.4, 0.45)
    fdi["types"]["config"]["frames_per_block"] = 4
    locate(fdi, RUDDER, np.array([0.1, 0.0, -0.4]), np.array([0.005, 1.0, 0.1]), effect)
    assert (
        surface["last"]["lo"],
        surface["last"]["hi"],
    ) == pytest.approx((0.25, 0.35))  # its own axis alone


def test_wrong_frames_are_remembered_for_two_more():
    fdi, bound = new_case(), np.full(3, 0.1)
    for innovation in (0.2, 0.05, 0.2):
        on(registry.observe_surfaces, fdi, np.array([0.0, innovation, 0.0]), bound)
    assert fdi["types"]["surface"]["last"]["anomalous"].tolist() == [1] * 4
    assert fdi["types"]["surface"]["judged"]["anomalous"].tolist() == [0] * 4
    assert fdi["types"]["surface"]["earlier"]["anomalous"].tolist() == [1] * 4


@pytest.mark.parametrize(
    ("whole", "anomalous", "judged"),
    [
        (0, (0, 1, 1), False), (0, (1, 1, 1), True), (0, (1, 1, 0), False), (0, (1, 0, 1), False),
        (1, (0, 1, 1), True), (1, (1, 1, 1), True), (1, (1, 1, 0), True), (1, (1, 0, 1), False),
    ],
)  # fmt: skip
def test_a_frame_next_to_a_healthy_one_is_judged_only_if_faults_begin_between_frames(
    whole, anomalous, judged
):
    fdi = new_case()
    fdi["types"]["config"]["single_instant"], fdi["types"]["frame_index"] = whole, 7
    surface = fdi["types"]["surface"][RUDDER]
    registry.restart_surface(surface)
    surface["evidence"]["n_anomalous"], surface["accommodation"]["mode"] = 5, -1
    (
        surface["earlier"]["anomalous"],
        surface["judged"]["anomalous"],
        surface["last"]["anomalous"],
    ) = anomalous
    surface["judged"]["lo"], surface["judged"]["hi"] = 0.1, 0.2
    on(registry.judge_frame, fdi)
    assert surface["evidence"]["n_anomalous"] == (6 if judged else 5)
    assert surface["evidence"]["k_first"] == (6 if judged else -1)
    assert (
        surface["evidence"]["first_lo"],
        surface["evidence"]["first_hi"],
    ) == ((0.1, 0.2) if judged else (0.0, 0.0))
    assert fdi["types"]["frame_index"] == 8
    assert surface["oscillatory"]["since"] == (6 if judged else 7)


def test_evidence_counts_for_a_swing_since_a_stop_could_last_hide_one():
    fdi = new_case()
    surface = fdi["types"]["surface"][RUDDER]
    registry.restart_surface(surface)
    counted = []
    for hides in ((0, 0), (0, 0), (0, 1), (0, 0), (1, 0), (0, 0), (0, 0), (0, 0)):
        (
            surface["judged"]["anomalous"],
            surface["judged"]["hides"],
        ) = 1, hides
        surface["judged"]["lo"], surface["judged"]["hi"] = (
            0.1,
            0.2,
        )
        on(registry.judge_frame, fdi)
        counted.append(int(surface["evidence"]["n_unhidden"]))
    assert counted == [1, 2, 0, 1, 0, 1, 2, 3]
    assert surface["evidence"]["n_anomalous"] == 8


def test_where_a_stop_is_follows_the_surface_by_a_frame():
    fdi = new_case()
    surface, effect = (
        fdi["types"]["surface"][RUDDER],
        fdi["isolation"]["estimator"][4 + RUDDER]["effect"],
    )
    effect["regressor"], effect["e"], bound = (
        (0.5, 0.0, -2.0),
        (9.0, 9.0, 0.02),
        np.array([9.0, 9.0, 0.08]),
    )
    for at, now in ((0.41, 1), (0.39, 0)):  # 2 (0.08 + 0.02) / 2 is 0.1 rad, the stop at 0.5
        surface["commands"]["u_max"][0], then = (
            at,
            surface["last"]["hides"].copy(),
        )
        locate(fdi, RUDDER, np.zeros(3), bound, effect)
        assert surface["last"]["hides"].tolist() == [0, now]
        assert surface["judged"]["hides"].tolist() == then.tolist()


def test_a_frame_that_puts_a_surface_nowhere_judges_nothing():
    fdi = new_case()
    surface = fdi["types"]["surface"][RUDDER]
    registry.restart_surface(surface)
    surface["judged"]["lo"], surface["judged"]["hi"] = 0.2, 0.1
    on(registry.judge_types, fdi, surface, 6)
    assert surface["evidence"]["k_first"] == -1


def n_rest(low=0.1, high=0.2, frames=1, **fields):
    fdi = new_case()
    surface = fdi["types"]["surface"][RUDDER]
    surface["sets"]["low"][STUCK], surface["sets"]["high"][STUCK] = 0.15, 0.3
    surface["judged"]["lo"], surface["judged"]["hi"] = low, high
    fdi["types"]["surface"]["evidence"]["n_anomalous"] = 0
    put(fdi, **fields)
    for _ in range(frames):
        on(registry.count_rest, fdi, RUDDER)
    return fdi, surface


def test_a_quiet_surface_given_up_does_not_swing():
    fdi, surface = n_rest()
    assert fdi["types"]["surface"]["evidence"]["n_anomalous"].tolist() == [1] * 4
    assert surface["evidence"]["n_rest"] == 1
    assert n_rest(low=0.31, high=0.4)[1]["evidence"]["n_rest"] == 0
    assert n_rest(low=0.0, high=0.14)[1]["evidence"]["n_rest"] == 0
    assert not n_rest(frames=PATIENCE)[1]["sets"]["excluded"][OSCILLATORY]
    assert n_rest(frames=PATIENCE + 1)[1]["sets"]["excluded"][OSCILLATORY]
    assert not n_rest(frames=PATIENCE + 1, has_eG=1)[1]["sets"]["excluded"][OSCILLATORY]
    fdi, surface = n_rest()
    fdi["types"]["surface"]["status"]["may_be_sole"] = 1, 1, 0, 1
    on(registry.count_rest, fdi, RUDDER)
    assert fdi["types"]["surface"]["evidence"]["n_anomalous"].tolist() == [
        1,
        1,
        2,
        1,
    ]  # of another one it says nothing then


@pytest.mark.parametrize("abrupt", [0, 1])
def test_a_surface_given_up_is_quiet_where_nothing_is_wrong_and_a_fault_stays(abrupt):
    fdi = new_case()
    (
        fdi["types"]["surface"]["accommodation"]["mode"],
        fdi["types"]["surface"]["sets"]["high"],
        fdi["types"]["config"]["abrupt"],
    ) = (
        -1,
        1.0,
        abrupt,
    )
    fdi["types"]["surface"][RUDDER]["accommodation"]["mode"] = GIVE_UP
    on(registry.judge_frame, fdi)
    assert fdi["types"]["surface"]["evidence"]["n_rest"].tolist() == [0, 0, abrupt, 0]


def test_a_block_is_the_mean_of_its_frames_with_the_noise_of_its_ends():
    rng, fdi, length = np.random.default_rng(6), new_case(), 4
    fdi["types"]["config"]["frames_per_block"], fdi["types"]["config"]["block_duration_s"] = (
        length,
        length * DT,
    )
    fdi["types"]["block"]["nu"], fdi["types"]["block"]["nu_bound"] = 9.0, 9.0
    innovation, eta = rng.normal(size=(length, 3)), rng.uniform(0.1, 0.2, (length, 3))
    noise = rng.uniform(0.01, 0.02, (length + 1, 3))
    Z, offset = rng.uniform(1, 2, (length, 8, 3)), rng.normal(size=(length, 8, 3))
    spread = rng.uniform(0, 0.1, (length, 8, 3))
    Z[:, :, YAW] += 5.0
    for k in range(length):
        fdi["bank"]["output"]["innovation"], fdi["bound"]["eta_bar"] = innovation[k], eta[k]
        fdi["bound"]["n_old"], fdi["bound"]["n_gyro"] = (
            noise[k],
            noise[k + 1],
        )
        fdi["isolation"]["estimator"]["effect"]["regressor"][:8] = Z[k]
        fdi["isolation"]["estimator"]["effect"]["base"][:8] = offset[k]
        fdi["isolation"]["estimator"]["effect"]["e"][:8] = spread[k]
        on(registry.extend_block, fdi)
        assert fdi["types"]["block"]["n_so_far"] == (k + 1) % length
        assert fdi["types"]["frame_index"] == (k + 1 == length)
    assert fdi["types"]["block"]["nu"] == pytest.approx(innovation.mean(axis=0))
    ends = (noise[0] + noise[-1]) / (length * DT)
    assert fdi["types"]["block"]["nu_bound"] == pytest.approx(eta.mean(axis=0) + ends)
    mean = fdi["isolation"]["estimator"][4 + RUDDER]["mean_effect"]
    assert mean["regressor"] == pytest.approx(Z[:, 4 + RUDDER].mean(axis=0))
    assert mean["base"] == pytest.approx(offset[:, 4 + RUDDER].mean(axis=0))
    assert mean["e"] == pytest.approx(spread[:, 4 + RUDDER].mean(axis=0))


# Two faults at once.


def test_alarms_are_noted_by_plane():
    for axis, planes in ((ROLL, [0, 1]), (PITCH, [1, 0]), (YAW, [0, 1])):
        fdi = new_case()
        fdi["bank"]["output"]["threshold"], fdi["bank"]["output"]["residual"][2, axis] = 0.1, -0.11
        on(pairs.latch_groups, fdi)
        assert fdi["types"]["pair"]["group_alarm"].tolist() == planes


def lateral(one_left=True, other_left=True, alarmed=1, **pair):
    """Who is named in roll and yaw: (aileron, rudder, whether the fault is outside the class)."""
    left = {"aileron": (BIAS,) if one_left else None, "rudder": (BIAS,) if other_left else None}
    fdi = new_case(**left)
    for s, kept in ((AILERON, one_left), (RUDDER, other_left)):
        if not kept:
            leave(fdi["types"]["surface"][s], BIAS)
    fdi["types"]["pair"]["group_alarm"] = 0, alarmed
    for name, value in pair.items():
        fdi["types"]["pair"][name] = value
    outside = on(pairs.isolate_lateral, fdi, 3.0)
    return [
        bool(fdi["types"]["surface"]["status"]["is_isolated"][AILERON]),
        bool(fdi["types"]["surface"]["status"]["is_isolated"][RUDDER]),
        bool(outside),
    ]


def test_who_is_named_in_roll_and_yaw():
    assert lateral() == [False, False, False]
    assert lateral(one_left=False) == [False, True, False]
    assert lateral(other_left=False) == [True, False, False]
    assert lateral(False, False) == [True, True, False]
    assert lateral(False, False, alarmed=0) == [False, False, False]
    assert lateral(False, False, lateral_outside=1) == [False, False, True]


def test_where_nothing_explains_both_the_fault_is_outside_the_class():
    for s in (AILERON, RUDDER):
        fdi = new_case(aileron=None, rudder=None)
        leave(fdi["types"]["surface"][AILERON], BIAS)
        leave(fdi["types"]["surface"][RUDDER], BIAS)
        fdi["types"]["pair"]["group_alarm"] = 0, 1
        leave(fdi["types"]["surface"][s])
        assert on(pairs.isolate_lateral, fdi, 3.0)
        leave(fdi["types"]["surface"][s], OSCILLATORY)  # it may swing yet
        assert not on(pairs.isolate_lateral, fdi, 3.0)
        assert not fdi["types"]["surface"]["status"]["is_isolated"].any()


def test_a_name_notes_when_it_was_given_and_when_its_type():
    surface = new_case()["types"]["surface"][RUDDER]
    surface["status"]["fault_type"] = -1
    pairs.update_status(surface, 1, STUCK, 3.0)
    assert (
        surface["status"]["is_isolated"],
        surface["status"]["fault_type"],
        surface["status"]["isolated_at_s"],
        surface["status"]["typed_at_s"],
    ) == (
        1,
        STUCK,
        3.0,
        3.0,
    )
    pairs.update_status(surface, 1, BIAS, 4.0)
    assert (surface["status"]["isolated_at_s"], surface["status"]["typed_at_s"]) == (3.0, 4.0)
    pairs.update_status(surface, 1, BIAS, 5.0)
    assert surface["status"]["typed_at_s"] == 4.0
    pairs.update_status(surface, 0, BIAS, 6.0)
    assert (
        surface["status"]["is_isolated"],
        surface["status"]["fault_type"],
        surface["status"]["typed_at_s"],
    ) == (
        0,
        -1,
        6.0,
    )


def test_a_surface_off_its_command_is_within_its_travel():
    surface = new_case()["types"]["surface"][RUDDER]
    surface["last"]["u"] = 0.1
    assert types.observe_error(surface, 0.2, 0.05)
    assert (
        surface["last"]["lo"],
        surface["last"]["hi"],
        surface["last"]["anomalous"],
    ) == (
        pytest.approx(0.25),
        pytest.approx(0.35),
        1,
    )
    assert types.observe_error(surface, 0.4, 0.05)
    assert surface["last"]["hi"] == 0.5
    assert not types.observe_error(surface, 0.5, 0.05)
    assert types.observe_error(surface, -0.49, 0.05)
    assert surface["last"]["lo"] == -0.4
    types.observe_error(surface, 0.04, 0.05)
    assert surface["last"]["anomalous"] == 0
    types.observe_error(surface, 0.05, 0.05)
    assert surface["last"]["anomalous"] == 0


def test_whereabouts_cover_every_constant_type_left():
    fdi, surface = one(STUCK, FLOAT, SLOW)
    surface["sets"]["low"][STUCK], surface["sets"]["high"][STUCK] = 0.1, 0.2
    assert on(pairs.constant_range, fdi, surface) == (0.0, 0.2)
    leave(surface, BIAS)
    surface["sets"]["low"][BIAS], surface["sets"]["high"][BIAS] = -np.inf, 0.0
    assert on(pairs.constant_range, fdi, surface) == (-0.4, 0.0)
    surface["sets"]["low"][BIAS], surface["sets"]["high"][BIAS] = 0.1, np.inf
    assert on(pairs.constant_range, fdi, surface) == (0.1, 0.5)


def test_beside_the_first_pitch_fault_the_second_is_where_the_rest_puts_it():
    fdi = new_case(elevator=(STUCK,))
    elevator, flap = fdi["types"]["surface"][ELEVATOR], fdi["types"]["surface"][FLAP]
    fdi["types"]["pair"]["first_pitch"], elevator["status"]["may_be_sole"] = ELEVATOR, 0
    (
        elevator["sets"]["low"][STUCK],
        elevator["sets"]["high"][STUCK],
        elevator["last"]["u"],
    ) = 0.1, 0.14, 0.0
    (
        fdi["isolation"]["estimator"]["effect"]["regressor"][4 + ELEVATOR, PITCH],
        fdi["isolation"]["estimator"]["effect"]["regressor"][4 + FLAP, PITCH],
    ) = (
        -10.0,
        2.0,
    )
    fdi["isolation"]["estimator"]["effect"]["e"][4 + ELEVATOR, PITCH] = 0.01
    fdi["isolation"]["estimator"]["effect"]["e"][4 + FLAP, PITCH] = 0.02
    (
        fdi["bound"]["nu_max"][PITCH],
        fdi["bank"]["output"]["innovation"][PITCH],
        flap["last"]["u"],
    ) = (
        0.03,
        -1.2 + 0.4,
        0.05,
    )
    on(pairs.observe_pitch, fdi)
    # the elevator's share is -10 * 0.12 give or take 0.2, the rest 0.4 give or take 0.26, over 2
    assert (
        flap["last"]["lo"],
        flap["last"]["hi"],
    ) == pytest.approx((0.05 + 0.2 - 0.13, 0.05 + 0.2 + 0.13))
    assert flap["last"]["anomalous"] == 1
    assert elevator["last"]["anomalous"] == 0
    assert (elevator["last"]["lo"], elevator["last"]["hi"]) == (
        0.1,
        0.14,
    )
    fdi["bank"]["output"]["innovation"][PITCH] = 9.0
    on(pairs.observe_pitch, fdi)
    assert flap["status"]["basis"] == DEDUCED_HEALTHY


@pytest.mark.parametrize(("innovation", "anomalous"), [(0.03, 0), (0.031, 1), (-0.031, 1)])
def test_before_that_pitch_shows_a_fault_or_not(innovation, anomalous):
    fdi = new_case()
    (
        fdi["types"]["pair"]["first_pitch"],
        fdi["bound"]["nu_max"],
        fdi["bank"]["output"]["innovation"],
    ) = (
        NO_SURFACE,
        0.03,
        innovation,
    )
    on(pairs.observe_pitch, fdi)
    assert fdi["types"]["surface"]["last"]["anomalous"].tolist() == [
        0,
        anomalous,
        0,
        anomalous,
    ]


def test_what_is_known_of_the_first_is_kept_once_it_has_settled():
    fdi = new_case(elevator=(STUCK,))
    elevator = fdi["types"]["surface"][ELEVATOR]
    fdi["types"]["pair"]["first_pitch"] = NO_SURFACE
    elevator["sets"]["low"][STUCK], elevator["sets"]["high"][STUCK] = 0.1, 0.14
    on(pairs.store_first, fdi, ELEVATOR)
    known = elevator["first_sets"]
    assert fdi["types"]["pair"]["first_pitch"] == ELEVATOR
    assert (known["low"][STUCK], known["high"][STUCK]) == (0.1, 0.14)
    assert known["excluded"].tolist() == [kind != STUCK for kind in range(N_TYPES)]
    elevator["sets"]["excluded"][STUCK], elevator["sets"]["low"][STUCK] = 1, 0.12
    for k in range(PATIENCE - 1):
        on(pairs.store_first, fdi, ELEVATOR)
        assert (known["low"][STUCK], fdi["types"]["pair"]["n_unstored"]) == (
            0.1,
            k + 1,
        )
    on(pairs.store_first, fdi, ELEVATOR)
    assert (known["low"][STUCK], fdi["types"]["pair"]["n_unstored"]) == (0.12, 0)


def test_a_second_begins_with_what_was_known_of_the_first():
    fdi = new_case(elevator=(), flap=(BIAS,))
    elevator, flap = fdi["types"]["surface"][ELEVATOR], fdi["types"]["surface"][FLAP]
    (
        fdi["types"]["pair"]["first_pitch"],
        elevator["first_sets"]["low"],
        elevator["first_sets"]["high"],
    ) = (
        ELEVATOR,
        0.1,
        0.14,
    )
    elevator["first_sets"]["excluded"] = [kind != STUCK for kind in range(N_TYPES)]
    for frame in ("last", "judged", "earlier"):
        fdi["types"]["surface"][frame]["anomalous"] = 1
    assert on(pairs.detect_second, fdi)
    assert verdict.sole(elevator, verdict.CONSTANT) == STUCK
    assert (elevator["sets"]["low"][STUCK], elevator["sets"]["high"][STUCK]) == (0.1, 0.14)
    assert not flap["sets"]["excluded"].any()
    for surface in (elevator, flap):
        assert (surface["status"]["may_be_sole"], surface["status"]["basis"]) == (
            0,
            DEDUCED_FAULTY,
        )
        assert (
            surface["last"]["anomalous"],
            surface["judged"]["anomalous"],
            surface["earlier"]["anomalous"],
        ) == (
            0,
            0,
            0,
        )
    assert fdi["types"]["surface"]["status"]["may_be_sole"][[AILERON, RUDDER]].tolist() == [1, 1]
    assert not on(pairs.detect_second, _first(new_case(elevator=(STUCK,)), ELEVATOR))
    assert not on(pairs.detect_second, _first(new_case(elevator=()), NO_SURFACE))


def _first(fdi, surface):
    fdi["types"]["pair"]["first_pitch"] = surface
    return fdi


@pytest.mark.parametrize(
    ("kinds", "evidence", "patient"),
    [
        ((STUCK,), PATIENCE, True), ((STUCK,), PATIENCE - 1, False),
        ((STUCK, OSCILLATORY), 2 * PATIENCE - 1, False), ((STUCK, OSCILLATORY), 2 * PATIENCE, True),
        ((STUCK, GROWING_BIAS), 99, False), ((STUCK, SLOW), 99, True),
    ],
)  # fmt: skip
def test_when_a_first_fault_in_pitch_is_known_well_enough(kinds, evidence, patient):
    assert (
        bool(
            on(
                pairs.dismiss_varying,
                *one(*kinds, evidence=evidence, n_unhidden=evidence),
            )
        )
        == patient
    )


def decided(alarmed=(1, 0), **left):
    fdi = new_case(**left)
    (
        fdi["types"]["pair"]["enabled"],
        fdi["types"]["pair"]["first_pitch"],
        fdi["types"]["pair"]["group_alarm"],
    ) = (
        1,
        NO_SURFACE,
        alarmed,
    )
    fdi["verdict"]["isolated_estimator"] = NOT_ISOLATED
    fdi["types"]["surface"]["status"]["fault_type"] = -1
    (
        fdi["types"]["surface"]["last"]["lo"],
        fdi["types"]["surface"]["last"]["hi"],
    ) = -0.4, 0.5
    return fdi


def test_one_fault_in_pitch_is_named_and_acted_upon():
    fdi = decided(elevator=(CONSTANT_LOSS,), flap=None)
    conclude(fdi, pairs.decide_pairs, 3.0)
    assert fdi["types"]["surface"]["status"]["is_isolated"].tolist() == [
        0,
        0,
        0,
        0,
    ]  # ailerons and rudder might be it as well
    fdi = decided(elevator=(CONSTANT_LOSS,), flap=None, aileron=None, rudder=None)
    conclude(fdi, pairs.decide_pairs, 3.0)
    assert fdi["types"]["surface"]["status"]["is_isolated"].tolist() == [0, 1, 0, 0]
    assert fdi["verdict"]["isolated_estimator"] == ELEVATOR
    assert (fdi["verdict"]["fault_type"], fdi["verdict"]["isolated_at_s"]) == (CONSTANT_LOSS, 3.0)
    assert (fdi["verdict"]["target"], fdi["verdict"]["accommodation_mode"]) == (
        ELEVATOR,
        SCALE_COMMAND,
    )
    assert fdi["types"]["surface"]["accommodation"]["mode"].tolist() == [-1, SCALE_COMMAND, -1, -1]
    assert fdi["types"]["pair"]["first_pitch"] == ELEVATOR


def test_without_an_alarm_in_pitch_nobody_is_named_there():
    fdi = decided(alarmed=(0, 1), elevator=(CONSTANT_LOSS,), flap=None, aileron=None, rudder=None)
    conclude(fdi, pairs.decide_pairs, 3.0)
    assert not fdi["types"]["surface"]["status"]["is_isolated"][ELEVATOR]
    assert not on(pairs.acts_on, fdi, ELEVATOR)


def test_the_likeliest_in_pitch_is_acted_upon_until_one_is_named():
    fdi = decided()
    assert [bool(on(pairs.acts_on, fdi, s)) for s in range(4)] == [
        False,
        True,
        False,
        False,
    ]
    only_flap = decided(aileron=None, rudder=None, elevator=COURSES)
    assert [bool(on(pairs.acts_on, only_flap, s)) for s in range(4)] == [
        False,
        False,
        False,
        True,
    ]
    assert not on(pairs.pitch_isolated, fdi)
    fdi["types"]["surface"]["status"]["is_isolated"] = 1, 0, 0, 1
    assert on(pairs.pitch_isolated, fdi)
    assert [bool(on(pairs.acts_on, fdi, s)) for s in range(4)] == [
        True,
        False,
        False,
        True,
    ]


def test_the_verdict_is_that_of_the_first_named():
    fdi = decided(aileron=None, rudder=None)
    fdi["types"]["surface"]["status"]["fault_type"][RUDDER] = STUCK
    (
        fdi["types"]["surface"]["status"]["typed_at_s"][RUDDER],
        fdi["types"]["surface"]["status"]["isolated_at_s"][RUDDER],
    ) = 2.0, 1.5
    conclude(fdi, pairs.first_finding, RUDDER, False, 3.0, lead=(NO_SURFACE, -1))
    found = fdi["verdict"]
    assert (found["isolated_estimator"], found["fault_type"], found["typed_at_s"]) == (
        4 + RUDDER,
        STUCK,
        2.0,
    )
    assert found["isolated_at_s"] == 1.5
    conclude(fdi, pairs.first_finding, NO_SURFACE, True, 4.0, lead=(NO_SURFACE, -1))
    assert (found["isolated_estimator"], found["fault_type"], found["isolated_at_s"]) == (
        UNANTICIPATED,
        -1,
        4.0,
    )
    conclude(fdi, pairs.first_finding, NO_SURFACE, True, 5.0, lead=(NO_SURFACE, -1))
    assert found["isolated_at_s"] == 4.0
    conclude(fdi, pairs.first_finding, NO_SURFACE, False, 6.0, lead=(NO_SURFACE, -1))
    assert (found["isolated_estimator"], found["isolated_at_s"]) == (NOT_ISOLATED, 6.0)


def acted(**left):
    """What the law does about each surface; each was seen where its type has it."""
    fdi = decided(**left)
    for surface in fdi["types"]["surface"]:
        surface["sets"]["low"], surface["sets"]["high"] = -0.1, 0.1
    return fdi


def test_the_law_acts_on_all_that_are_named_and_the_lead_is_the_first():
    fdi = acted(alarmed=(0, 1), aileron=(CONSTANT_LOSS,), rudder=(BIAS,), elevator=None, flap=None)
    fdi["types"]["surface"]["status"]["is_isolated"] = 1, 0, 1, 0
    take_lead(fdi, pairs.accommodate_pairs)
    assert fdi["types"]["surface"]["accommodation"]["mode"].tolist() == [
        SCALE_COMMAND,
        -1,
        SUBTRACT_OFFSET,
        -1,
    ]
    assert (fdi["verdict"]["target"], fdi["verdict"]["accommodation_mode"]) == (
        AILERON,
        SCALE_COMMAND,
    )


@pytest.mark.parametrize(
    ("kinds", "accommodation_mode", "lead"),
    [
        ((STUCK,), GIVE_UP, ELEVATOR),
        ((CONSTANT_LOSS,), SCALE_COMMAND, ELEVATOR),
        ((BIAS,), SUBTRACT_OFFSET, AILERON),
    ],
)
def test_an_elevator_that_is_replaced_comes_first(kinds, accommodation_mode, lead):
    fdi = acted(aileron=(CONSTANT_LOSS,), elevator=kinds, rudder=None, flap=None)
    fdi["types"]["surface"]["status"]["is_isolated"] = 1, 1, 0, 0
    take_lead(fdi, pairs.accommodate_pairs)
    assert fdi["types"]["surface"]["accommodation"]["mode"].tolist() == [
        SCALE_COMMAND,
        accommodation_mode,
        -1,
        -1,
    ]
    assert fdi["verdict"]["target"] == lead


def test_a_rudder_that_is_fixed_does_not_come_before_the_first():
    fdi = acted(aileron=(BIAS,), rudder=(STUCK,), elevator=None, flap=None)
    fdi["types"]["surface"]["status"]["is_isolated"] = 1, 0, 1, 0
    take_lead(fdi, pairs.accommodate_pairs)
    assert (fdi["verdict"]["target"], fdi["verdict"]["accommodation_mode"]) == (
        AILERON,
        SUBTRACT_OFFSET,
    )


def test_a_surface_acted_upon_that_cannot_be_at_fault_is_shifted_as_it_shows():
    fdi = acted(elevator=None, flap=None, aileron=None, rudder=None)
    leave(fdi["types"]["surface"][ELEVATOR], STUCK)
    take_lead(fdi, pairs.accommodate_pairs)
    assert fdi["types"]["surface"]["accommodation"]["mode"].tolist() == [-1, SUBTRACT_OFFSET, -1, -1]
    fdi["types"]["surface"]["status"]["is_isolated"][ELEVATOR] = 1
    take_lead(fdi, pairs.accommodate_pairs)
    assert fdi["types"]["surface"]["accommodation"]["mode"].tolist() == [-1, GIVE_UP, -1, -1]
    (
        fdi["types"]["surface"]["last"]["lo"],
        fdi["types"]["surface"]["last"]["hi"],
        fdi["types"]["surface"]["accommodation"]["n_silent"],
    ) = (
        0.3,
        0.4,
        99,
    )
    take_lead(fdi, pairs.accommodate_pairs)
    assert fdi["types"]["surface"]["accommodation"]["mode"].tolist() == [-1, -1, -1, -1]
    assert (fdi["verdict"]["target"], fdi["verdict"]["accommodation_mode"]) == (NO_SURFACE, -1)


@pytest.mark.parametrize("seed", range(3))
def test_two_equations_say_where_ailerons_and_rudder_were(seed):
    """The least and greatest solution over the corners of the room, by a linear solver."""
    rng, fdi = np.random.default_rng(seed), new_case()
    Z = np.array([[-9.0, 0.7], [-0.5, -4.0]]) + 0.1 * rng.normal(size=(2, 2))
    spread, room = rng.uniform(0.01, 0.02, (2, 2)), np.array([0.03, 0.02])
    off, command = rng.uniform(-0.05, 0.05, 2), np.array([0.02, -0.03])
    for k, s in enumerate((AILERON, RUDDER)):
        effect = fdi["isolation"]["estimator"][4 + s]["effect"]
        effect["regressor"][[ROLL, YAW]], effect["e"][[ROLL, YAW]] = Z[:, k], spread[:, k]
        fdi["types"]["surface"][s]["last"]["u"] = command[k]
    fdi["bank"]["output"]["innovation"][[ROLL, YAW]], fdi["bound"]["nu_max"][[ROLL, YAW]] = (
        Z @ off,
        room,
    )
    on(pairs.locate_lateral, fdi)
    slack = room + spread.sum(axis=1)
    corners = [np.linalg.solve(Z, Z @ off + slack * (a, b)) for a in (-1, 1) for b in (-1, 1)]
    least, greatest = np.min(corners, axis=0) + command, np.max(corners, axis=0) + command
    for k, s in enumerate((AILERON, RUDDER)):
        surface = fdi["types"]["surface"][s]
        assert (
            surface["last"]["lo"],
            surface["last"]["hi"],
        ) == pytest.approx((least[k], greatest[k]))
    assert not fdi["types"]["pair"]["lateral_outside"]
    fdi["bank"]["output"]["innovation"][YAW] = 9.0
    on(pairs.locate_lateral, fdi)
    assert fdi["types"]["pair"]["lateral_outside"]


def test_a_second_pitch_fault_is_named_once_it_shows():
    fdi = decided(elevator=(BIAS,), flap=(STUCK,), aileron=None, rudder=None)
    (
        fdi["types"]["pair"]["first_pitch"],
        fdi["types"]["surface"]["status"]["may_be_sole"],
    ) = (
        ELEVATOR,
        (1, 0, 1, 0),
    )
    fdi["types"]["surface"]["status"]["basis"] = 0, DEDUCED_FAULTY, 0, DEDUCED_FAULTY
    (
        fdi["types"]["surface"]["status"]["fault_type"][ELEVATOR],
        fdi["types"]["surface"]["evidence"]["n_anomalous"][FLAP],
    ) = BIAS, 0
    on(pairs.isolate_pitch, fdi, 4.0)
    assert fdi["types"]["surface"]["status"]["is_isolated"].tolist() == [0, 1, 0, 0]
    fdi["types"]["surface"]["evidence"]["n_anomalous"][FLAP] = 99
    on(pairs.isolate_pitch, fdi, 5.0)
    assert fdi["types"]["surface"]["status"]["is_isolated"].tolist() == [0, 1, 0, 1]
    assert fdi["types"]["surface"]["status"]["fault_type"].tolist()[1::2] == [BIAS, STUCK]
    fdi["types"]["surface"]["status"]["basis"][FLAP] = DEDUCED_HEALTHY
    on(pairs.isolate_pitch, fdi, 6.0)
    assert fdi["types"]["surface"]["status"]["is_isolated"].tolist() == [0, 0, 0, 0], "nothing explains it"


def test_the_first_named_is_the_one_the_verdict_is_about():
    fdi = decided(alarmed=(0, 1), aileron=(BIAS,), rudder=(BIAS,), elevator=None, flap=None)
    fdi["types"]["surface"]["not_at_position"][[AILERON, RUDDER]] = 1
    fdi["types"]["surface"]["status"]["is_isolated"], fdi["types"]["surface"]["status"]["isolated_at_s"] = (
        (1, 0, 1, 0),
        (2.0, 0.0, 1.0, 0.0),
    )
    conclude(fdi, pairs.decide_pairs, 3.0)
    assert fdi["verdict"]["isolated_at_s"] == 1.0
    assert fdi["isolation"]["estimator"]["surface"][fdi["verdict"]["isolated_estimator"]] == RUDDER


def test_the_first_surface_and_its_first_estimator_are_not_nobody():
    fdi = new_case(elevator=None, rudder=None, flap=None, aileron=(CONSTANT_LOSS,))
    fdi["verdict"]["isolated_estimator"], fdi["verdict"]["fault_type"] = NOT_ISOLATED, -1
    for t in (3.0, 4.0):
        conclude(fdi, verdict.decide_single, t)
        found = fdi["verdict"]
        assert (found["isolated_estimator"], found["fault_type"], found["target"]) == (
            AILERON,
            CONSTANT_LOSS,
            AILERON,
        )
        assert (found["isolated_at_s"], found["typed_at_s"], found["accommodation_mode"]) == (
            3.0,
            3.0,
            SCALE_COMMAND,
        )


def test_the_one_named_is_acted_upon_though_others_are_possible():
    fdi = new_case()
    fdi["verdict"]["isolated_estimator"] = 0  # the estimator of the aileron's loss
    assert on(verdict.presumed_surface, fdi, fdi["verdict"]["isolated_estimator"]) == AILERON
    fdi["verdict"]["isolated_estimator"] = NOT_ISOLATED
    assert on(verdict.presumed_surface, fdi, fdi["verdict"]["isolated_estimator"]) == ELEVATOR


def test_without_anybody_to_act_upon_there_is_no_lead():
    fdi = new_case(aileron=None, elevator=None, rudder=None, flap=None)
    fdi["verdict"]["isolated_estimator"] = UNANTICIPATED
    fdi["verdict"]["target"], fdi["verdict"]["accommodation_mode"] = 2, 2
    take_lead(fdi, verdict.decide_mode, fdi["verdict"]["isolated_estimator"])
    assert (fdi["verdict"]["target"], fdi["verdict"]["accommodation_mode"]) == (NO_SURFACE, -1)
    assert (fdi["types"]["surface"]["accommodation"]["mode"] == -1).all()


def test_the_first_surface_is_named_where_a_constant_explains_it_alone():
    fdi = new_case(aileron=(CONSTANT_LOSS,), elevator=(VARYING_LOSS,), rudder=None, flap=None)
    assert on(verdict.sole_surface, fdi, False) == SEVERAL_SURFACES
    assert on(verdict.find_surface, fdi) == AILERON


@pytest.mark.parametrize(("s", "outside"), [(AILERON, 0), (RUDDER, 1), (NO_SURFACE, 0), (NO_SURFACE, 1)])
def test_of_two_faults_the_verdict_is_on_the_first_named(s, outside):
    fdi = new_case()
    fdi["verdict"]["isolated_estimator"], fdi["verdict"]["fault_type"] = NOT_ISOLATED, -1
    surface = fdi["types"]["surface"][s]
    (
        surface["status"]["fault_type"],
        surface["status"]["typed_at_s"],
        surface["status"]["isolated_at_s"],
    ) = (
        STUCK,
        4.0,
        3.0,
    )
    conclude(fdi, pairs.first_finding, s, outside, 5.0, lead=(NO_SURFACE, -1))
    found = fdi["verdict"]
    if s < 0:
        assert (found["isolated_estimator"], found["fault_type"]) == (
            UNANTICIPATED if outside else NOT_ISOLATED,
            -1,
        )
    else:
        assert (found["isolated_estimator"], found["isolated_at_s"]) == (4 + s, 3.0)
        assert (found["fault_type"], found["typed_at_s"]) == (STUCK, 4.0)
