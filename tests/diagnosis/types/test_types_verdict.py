"""From the types left to a verdict, and from frames to blocks: case by case, with the rule in the name."""

import numpy as np
import pytest
from kernels import new_fdi, on, put_on

from beaver_ftc.diagnosis import assessment
from beaver_ftc.diagnosis.state import PITCH, ROLL, YAW
from beaver_ftc.diagnosis.types import (
    GIVE_UP,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    WAIT_FOR_SURFACE,
    examination,
    modes,
    pairs,
    remaining,
    verdict,
)
from beaver_ftc.diagnosis.types.registry import CONSTANT, N_TYPES, SAME_NAME
from beaver_ftc.diagnosis.types.verdict import (
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
    types, isolation, layout = fdi["types"], fdi["isolation"], fdi["layout"]
    config, surfaces, estimators = types["config"], types["surface"], isolation["estimator"][:8]
    config["half_frames"], config["single_instant"], config["n_substeps"] = PATIENCE, 1, 1
    config["frames_per_block"], config["block_duration_s"] = 1, DT
    fdi["config"]["diagnoses_all_types"], isolation["config"]["n_estimators"] = 1, 8
    layout["loss"], layout["position"] = range(4), range(4, 8)
    layout["dominant_axis"], layout["main"] = (ROLL, PITCH, YAW, PITCH), (AILERON, ELEVATOR, RUDDER)
    layout["group"], layout["partner"] = (1, 0, 1, 0), (RUDDER, FLAP, AILERON, ELEVATOR)
    estimators["surface"], estimators["hypothesis_kind"] = (0, 1, 2, 3) * 2, (0,) * 4 + (1,) * 4
    estimators["theta_min"][4:], estimators["theta_max"][4:] = -0.4, 0.5
    surfaces["status"]["may_be_sole"] = 1
    surfaces["evidence"]["n_anomalous"] = surfaces["evidence"]["n_unhidden"] = 99
    for end, stop in (("lo", -0.4), ("hi", 0.5)):
        surfaces["actuator"][f"stop_{end}"] = surfaces["actuator"][f"reach_{end}"] = stop
    for s, name in enumerate(("aileron", "elevator", "rudder", "flap")):
        kinds = left.get(name, ALL)
        if kinds is None:
            fdi["types"]["surface"]["not_at_position"][s] = 1
        else:
            leave(fdi["types"]["surface"][s], *kinds)
    return fdi


def one(*kinds, **fields):
    fdi = new_case(rudder=kinds)
    surface = fdi["types"]["surface"][RUDDER]
    put_on(surface, **fields)
    return fdi, surface


NOBODY_ELSE = {"aileron": None, "elevator": None, "flap": None}


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
    same_name = SAME_NAME[sole_shown] if sole_shown >= 0 else -1
    assert (modes.choose_mode(surface) == GIVE_UP) == fixed
    assert max(remaining.sole_type(surface, CONSTANT), -1) == one_type
    found = remaining.sole_shown_type(surface, remaining.ALL)
    assert (SAME_NAME[found] if found >= 0 else -1) == same_name


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
    assert bool(on(remaining.may_be_hidden, fdi, surface)) == slow


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
        ((SLOW, GROWING_BIAS), 99, 3, -1, -1),
        ((SLOW, OSCILLATORY), 99, 3, -1, -1),
        ((VARYING_LOSS, OSCILLATORY), 2 * PATIENCE, 0, VARYING_LOSS, -1),
        ((OSCILLATORY,), PATIENCE, 3, OSCILLATORY, OSCILLATORY),
        ((OSCILLATORY,), 99, 2, -1, -1),
        ((), 99, 0, -1, -1),
    ],
)
def test_a_type_is_named_once_it_is_the_only_one(kinds, evidence, half_cycles, found, in_coarse_sets):
    """In sets that errors declared of our own make coarse, a constant proves nothing: one type of all."""
    fdi, surface = one(*kinds, evidence=evidence, n_unhidden=evidence)
    surface["oscillatory"]["n_half"] = half_cycles
    assert on(remaining.type_on_surface, fdi, surface) == found
    fdi["types"]["config"]["has_eG"] = 1
    assert on(remaining.type_on_surface, fdi, surface) == in_coarse_sets


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
    assert modes.choose_mode(one(*kinds)[1]) == accommodation_mode


def test_without_a_sensor_offsets_stay_that_stay_by_themselves():
    surfaces = new_case(aileron=(STUCK,), elevator=(BIAS,), rudder=(OSCILLATORY,), flap=(SLOW,))["types"]
    out = np.zeros(1, assessment.assessment_dtype(4)).view(np.recarray)[0]
    out["accommodation_mode"] = GIVE_UP, SUBTRACT_OFFSET, SUBTRACT_OFFSET, WAIT_FOR_SURFACE
    out["offset"] = out["lag"] = 0.1
    assessment.hold_assessment(out, surfaces)
    assert (out["offset"].tolist(), out["lag"].any()) == ([0.1, 0.1, 0.0, 0.0], False)


# Examining frames.


@pytest.mark.parametrize("resting", [AILERON, FLAP])
def test_a_rest_does_not_count_where_a_stop_may_hide_a_swing(resting):
    fdi = new_case()
    surfaces = fdi["types"]["surface"]
    fdi["types"]["config"]["abrupt"] = 1
    surfaces["accommodation"]["mode"][resting] = GIVE_UP
    surfaces["judged"]["hides"][ELEVATOR] = 1
    on(examination.judge_frame, fdi)
    assert not surfaces["evidence"]["n_unhidden"][ELEVATOR]


# Two faults at once.


@pytest.mark.parametrize("seed", range(3))
def test_two_equations_say_where_ailerons_and_rudder_were(seed):
    """The least and greatest solution over the corners of the room, by a linear solver."""
    rng, fdi = np.random.default_rng(seed), new_case()
    Z = np.array([[-9.0, 0.7], [-0.5, -4.0]]) + 0.1 * rng.normal(size=(2, 2))
    spread, room = rng.uniform(0.01, 0.02, (2, 2)), np.array([0.03, 0.02])
    off, command = rng.uniform(-0.05, 0.05, 2), np.array([0.02, -0.03])
    for k, s in enumerate((AILERON, RUDDER)):
        effect = fdi["isolation"]["estimator"][4 + s]["effect"]
        effect["Z"][[ROLL, YAW]], effect["r"][[ROLL, YAW]] = Z[:, k], spread[:, k]
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


def test_of_two_surfaces_found_in_one_frame_the_verdict_has_the_first():
    fdi = new_case(aileron=(STUCK,), rudder=(STUCK,))
    fdi["types"]["surface"]["not_at_position"][[AILERON, RUDDER]] = 1
    pair = fdi["types"]["pair"]
    pair["group_alarm"][pairs.LATERAL_GROUP], pair["first_pitch"] = 1, NO_SURFACE
    found = on(pairs.decide_pairs, fdi, fdi["verdict"], 3.0)
    assert found == (fdi["layout"]["position"][AILERON], 3.0, STUCK, 3.0)
    assert fdi["types"]["surface"]["status"]["is_isolated"][RUDDER]
