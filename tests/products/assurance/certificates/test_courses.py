"""Exclusions by a course, rule by rule, on a surface seen by hand: which frames, compared with what."""

import copy
import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.diagnosis.readout import Actuator, FaultTypesConfig
from beaver_ftc.diagnosis.types import DeflectionRelation
from beaver_ftc.diagnosis.types.registry import DESCRIPTIONS_IN_TYPE_ORDER, N_TYPES, TYPES, type_index_of
from beaver_ftc_assurance.certificates import chance, check_certificate, courses, kinds
from beaver_ftc_assurance.certificates.courses import Exclusion, SurfaceBounds
from fault_kinds import STUCK, VARYING_LOSS
from telling import numbers

NOTHING = -9.0


def seen(low, high, wrong=None, ordered=0.1, command=0.0):
    """A surface that roll alone sees, from the tenth frame on; its stops are 1 rad away."""
    n = len(low)
    least, most = np.full((n, 3), NOTHING), np.full((n, 3), -NOTHING)
    least[:, 0], most[:, 0] = low, high
    command, room = np.full(n, command), np.zeros((n, 2))
    return SurfaceBounds(
        10, 1, least, most, command, np.tile(command[:, None], 3), room,
        np.ones(n, bool) if wrong is None else np.array(wrong, bool), np.full(n, ordered),
        np.array([-1.0, 1.0]), 2.0,
    )  # fmt: skip


ACTUATOR = Actuator(
    -1.0,
    1.0,
    min_runaway_rate_rad_s=2.0,
    slow_step_rad=0.025,
    lag_distance_rad=0.05,
)
CONFIG = FaultTypesConfig(
    single_instant=True,
    n_substeps=2,
    returns_lagged=False,
    half_blocks=2,
    frames_per_block=1,
    block_duration_s=0.05,
    dt_s=0.5,
)
RULES = {
    # What comes nearer by 0.05 rad a frame at least, and more slowly within 0.05 rad of what was ordered.
    "not nearer at once": (courses._exclude_rate_limit, [0.2, 0.5], [0.3, 9.0], Exclusion(
        range(2), 0, [(0.1, 0.0), (0.5, 0.0), (0.5, 0.3), (0.5, 0.15), (1.0, 0.0)],
        {"near": 0.15, "ordered": [0.1] * 2}, 0,
    )),
    "not nearer in time": (courses._exclude_rate_limit, [0.2, 0.25, 0.28], [0.3, 9.0, 9.0], Exclusion(
        range(3), 0, [(0.1, 0.0), (0.43, 0.0), (0.28, 0.25), (0.28, 0.15), (1.0, 0.0)],
        {"near": 0.15, "ordered": [0.1] * 3, "step": 0.05}, 0,
    )),
    "slowly nearer": (courses._exclude_rate_limit, [0.0, 0.2, 0.16, 0.16], [9.0, 0.22, 0.22, 9.0], None),
    "two offsets": (courses._exclude_offset, [0.1, 0.4, 0.2], [0.5, 0.6, 0.3], Exclusion(
        range(1, 2), 2, [(0.4, 0.3), (0.4, -1.0), (1.0, 0.3)], {"stops": [-1.0, 1.0]},
    )),
    "one offset": (courses._exclude_offset, [0.1, 0.4, 0.2], [0.5, 0.6, 0.4], None),
    "an offset that shrinks": (courses._exclude_growing_offset, [0.4, 0.0], [9.0, 0.2], Exclusion(
        range(1), 1, [(0.4, 0.0), (0.4, 0.2), (0.4, -1.0), (1.0, 0.2), (11.0, 10.0)], {"stops": [-1.0, 1.0]},
    )),
    "an offset that shrinks after one of the other sign": (
        courses._exclude_growing_offset, [-0.2, NOTHING, 0.4, NOTHING], [9.0, -0.3, 9.0, 0.2],
        Exclusion(range(2, 3), 3, [(0.4, 0.0), (0.4, 0.2), (0.4, -1.0), (1.0, 0.2), (13.0, 12.0)],
              {"stops": [-1.0, 1.0]}),
    ),
    "an offset that grows": (courses._exclude_growing_offset, [0.0, 0.4], [0.2, 9.0], None),
    "behind its pace": (courses._exclude_runaway, [0.2] * 3, [9.0, 9.0, 0.35], Exclusion(
        range(1), 2, [(1.0, 0.35), (12.0, 10.0), (0.4, 0.35)], {"stops": [1.0], "pace_rad_s": 2.0},
    )),
    "at its pace": (courses._exclude_runaway, [0.2] * 3, [9.0, 9.0, 0.41], None),
    "long on one side": (courses._exclude_oscillation, [0.1] * 4, [9.0] * 4, Exclusion(
        range(4), None, [(3.0, np.pi), (0.1, 0.0), (0.4, 0.0)], {"slowest_rad_s": 2.0}, 0,
    )),
    "not so long": (courses._exclude_oscillation, [0.1] * 3, [9.0] * 3, None),
}  # fmt: skip


@pytest.mark.parametrize("name", RULES)
def test_a_rule_finds_the_frames_and_says_what_it_compares(name):
    rule, low, high, expected = RULES[name]
    assert_found([*rule(seen(low, high), ACTUATOR, CONFIG)], expected)


def assert_found(found, expected):
    if expected is None:
        assert found == []
        return
    (found,) = found
    assert (found.lower_frames, found.upper_frame) == (expected.lower_frames, expected.upper_frame)
    assert found.axis == expected.axis
    np.testing.assert_allclose(found.pairs, expected.pairs)
    assert found.fields.keys() == expected.fields.keys()
    for key, value in expected.fields.items():
        assert found.fields[key] == pytest.approx(value), key


def unlike(lower, upper, **changes):
    """A surface that (frame, axis) bound from below and from above, from the tenth frame on; its commands, as
    each axis has them, their reach and its stops are unlike one another."""
    n = 1 + max(k for k, _ in (*lower, *upper))
    sides = np.full((n, 3), NOTHING), np.full((n, 3), -NOTHING)
    for side, values in zip(sides, (lower, upper), strict=True):
        for place, value in values.items():
            side[place] = value
    given = {
        "command": np.resize([0.02, 0.05, -0.03, 0.07, 0.01], n), "stops": np.array([-0.9, 1.3]),
        "axis_commands": np.resize([[0.02, 0.03, 0.04], [0.08, 0.06, 0.07], [-0.01, -0.02, -0.05]], (n, 3)),
        "command_range": np.resize([[0.01, 0.02], [0.03, 0.04], [0.05, 0.06]], (n, 2)),
        "is_unexplained": np.ones(n, bool), "max_order": np.resize([0.1, 0.13, 0.2, 0.16, 0.11], n),
    }  # fmt: skip
    return SurfaceBounds(10, 1, *sides, slowest_oscillation_rad_s=2.0, **(given | changes))


P, Q, R = 0, 1, 2
OFFSETS = (
    {(0, P): 0.1, (1, Q): 0.44, (1, R): 0.31, (2, R): 0.2},
    {(0, P): 0.5, (1, P): 0.8, (1, Q): 0.6, (2, Q): 0.33, (2, R): 0.35},
)
OFFSET_PAIRS = [(0.38, 0.35), (0.44, -0.87), (1.24, 0.33)]
RUNAWAY = {(0, R): 0.2, (1, R): 0.45, (2, Q): 0.3}, {(3, Q): 0.5}
UNLIKE = {
    "offsets as each axis has the command": (
        courses._exclude_offset, OFFSETS, {},
        Exclusion(range(1, 2), 2, OFFSET_PAIRS, {"stops": [-0.87, 1.24]}),
    ),
    "above the low stop": (
        courses._exclude_offset, OFFSETS, {"stops": np.array([0.4, 1.3])},
        Exclusion(range(1, 2), 2, [(0.38, 0.35), (0.44, 0.43), (1.24, 0.33)], {"stops": [0.43, 1.24]}),
    ),
    "at the low stop": (courses._exclude_offset, OFFSETS, {"stops": np.array([0.42, 1.3])}, None),
    "below the high stop": (
        courses._exclude_offset, OFFSETS, {"stops": np.array([-0.9, 0.4])},
        Exclusion(range(1, 2), 2, [(0.38, 0.35), (0.44, -0.87), (0.34, 0.33)], {"stops": [-0.87, 0.34]}),
    ),
    "at the high stop": (courses._exclude_offset, OFFSETS, {"stops": np.array([-0.9, 0.38])}, None),
    "an offset that shrinks": (
        courses._exclude_growing_offset, OFFSETS, {},
        Exclusion(range(1, 2), 2, [(0.38, 0.0), *OFFSET_PAIRS, (12.0, 11.0)], {"stops": [-0.87, 1.24]}),
    ),
    "behind the pace of the frame farthest ahead": (courses._exclude_runaway, RUNAWAY, {}, Exclusion(
        range(1, 2), 3, [(1.3, 0.5), (13.0, 11.0), (0.65, 0.5)], {"stops": [1.3], "pace_rad_s": 2.0},
    )),
    "which health explains": (
        courses._exclude_runaway, (RUNAWAY[0], {(3, Q): 0.45}),
        {"is_unexplained": np.array([1, 0, 1, 1], bool)},
        Exclusion(range(1), 3, [(1.3, 0.45), (13.0, 10.0), (0.5, 0.45)], {"stops": [1.3], "pace_rad_s": 2.0}),
    ),
    "at the high stop, whatever its pace": (
        courses._exclude_runaway, RUNAWAY, {"stops": np.array([-0.9, 0.5])}, None,
    ),
    "long on one side of a command that moves": (
        courses._exclude_oscillation,
        ({(0, R): 0.0, (1, R): 0.15, (2, R): 0.12, (3, R): 0.2, (4, R): 0.2}, {}), {},
        Exclusion(
            range(1, 5), None, [(3.0, np.pi), (0.1, 0.0), (0.57, 0.0)], {"slowest_rad_s": 2.0}, R,
        ),
    ),
    "not nearer to orders that move": (
        courses._exclude_rate_limit, ({(1, Q): 0.3, (2, Q): 0.4, (3, Q): 0.42, (4, Q): 0.41}, {(1, R): 0.5}),
        {}, Exclusion(
            range(1, 4), 1, [(0.17, 0.0), (0.63, 0.0), (0.42, 0.35), (0.42, 0.25), (1.0, 0.0)],
            {"near": 0.25, "ordered": [0.13, 0.2, 0.16], "step": 0.15}, Q,
        ),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", UNLIKE)
def test_a_rule_compares_what_each_frame_and_axis_says(name):
    rule, shown, changes, expected = UNLIKE[name]
    config = CONFIG._replace(frames_per_block=3)
    assert_found([*rule(unlike(*shown, **changes), ACTUATOR, config)], expected)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("instants", [1, 3])
def test_what_bounds_a_surface_is_turned_with_its_sign(monkeypatch, sign, instants):
    """From the alarm, frame 12, to the last frame but one, 14; surface 1 acts most on r."""
    frames, s = [12, 13, 14], 1
    low, high, offset, slope, orders_low, orders_high = (
        numbers(*shape, seed=seed)
        for seed, shape in enumerate([(3, 3), (3, 3), (6, 3), (6, 3), (6, 3, 3), (6, 3, 3)])
    )
    slope[:, 2] *= 5.0
    slope[3, 0] = 0.0
    command = -offset[2:5, 2] / slope[2:5, 2]
    least, most = (np.zeros((6, 3, 1)) for _ in range(2))
    least[2:5, s, 0] = command - np.array([0.01, -0.02, 0.03])
    most[2:5, s, 0] = command + np.array([0.04, 0.05, -0.06])
    asked = []
    monkeypatch.setattr(
        courses, "theta_bounds_by_frame", lambda held, of, rows: asked.append(list(rows)) or (low, high, None)
    )
    monkeypatch.setattr(
        courses, "is_unexplained_by_health", lambda of, rows: asked.append(list(rows)) or "not"
    )
    actuators = [
        None,
        SimpleNamespace(actuator=ACTUATOR._replace(travel_low_rad=-0.2, travel_high_rad=0.7)),
        None,
    ]
    flown = SimpleNamespace(
        first=10, end=16, command_low=orders_low, command_high=orders_high, least=least, greatest=most,
        last=SimpleNamespace(diagnosis=SimpleNamespace(surface_fault_types=actuators)),
    )  # fmt: skip
    held = courses.Hypothesis(10, offset, slope, np.zeros((6, 3)), -0.2, 0.7)
    found = courses._surface_bounds(
        flown, SimpleNamespace(instant_share=1.0 / instants), held, s, 12, sign, 2.5
    )
    assert asked == [frames, frames]
    assert (found.first_frame, found.sign, found.is_unexplained) == (12, sign, "not")
    assert found.slowest_oscillation_rad_s == 2.5
    assert found.stops.tolist() == ([-0.2, 0.7] if sign > 0 else [-0.7, 0.2])
    np.testing.assert_array_equal(found.lower, low if sign > 0 else -high)
    np.testing.assert_array_equal(found.upper, high if sign > 0 else -low)
    np.testing.assert_allclose(found.command, sign * command)
    reach = [[0.01, 0.04], [0.0, 0.05], [0.03, 0.0]] if instants > 1 else [[0.0, 0.0]] * 3
    np.testing.assert_allclose(found.command_range, np.array(reach)[:, ::sign], atol=1e-12)
    for k in range(3):
        for i in range(3):
            in_effect = 0.0 if (k, i) == (1, 0) else -sign * offset[k + 2, i] / slope[k + 2, i]
            assert found.axis_commands[k, i] == pytest.approx(in_effect)
        orders = orders_high if sign > 0 else -orders_low
        last, before = orders[k + 3, s, 2], orders[k + 3, s, 1]
        assert found.max_order[k] == (max(last, before) if instants > 1 else last)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_statement_has_the_effect_along_the_axis_that_bounds(sign):
    """Frame 1 from below by q, frame 3 from above by r; an oscillation goes by the distance alone."""
    offset, slope, spread = (numbers(6, 3, seed=seed) for seed in range(3))
    held = courses.Hypothesis(8, offset, slope, np.abs(spread), -0.2, 0.7)
    of = dataclasses.replace(unlike({(1, Q): 0.4, (1, R): 0.3}, {(3, P): 0.9, (3, R): 0.2}), sign=sign)
    pairs = [(0.4, 0.2), (0.7, 0.1)]
    found = courses._statement(Exclusion(range(1, 2), 3, pairs, {"stops": [0.3]}), of, held)
    assert (found["theta"], found["stops"]) == ("course", [0.3])
    assert found["sides"] == [[0.4, 0.7], [0.2, 0.1]]
    for said, side, k, axis in zip(found["bounds"], (1, -1), (1, 3), (Q, R), strict=True):
        row = k + 2  # of the hypothesis, which begins with frame 8
        along = side * sign * np.sign(slope[row, axis])
        assert said["d"] == [along * (i == axis) for i in range(3)]
        assert (said["first"], said["frame"]) == (10 + k, 10 + k)
        assert said["h"] == pytest.approx([along * offset[row, axis]])
        assert said["Z"] == pytest.approx([side * abs(slope[row, axis])])
        assert said["r"] == pytest.approx([abs(spread[row, axis])])
    swing = courses._statement(Exclusion(range(1, 3), None, pairs, {}, axis=P), of, held)
    (said,) = swing["bounds"]
    assert (said["first"], said["frame"], said["h"]) == (11, 12, [0.0, 0.0])
    assert np.abs(said["Z"]) == pytest.approx(np.abs(slope[3:5, P]))


@pytest.mark.parametrize("rule", courses.RULES.values())
def test_what_nothing_shows_excludes_nothing(rule):
    assert [*rule(seen([NOTHING] * 6, [-NOTHING] * 6), ACTUATOR, CONFIG)] == []
    hidden = seen([0.2, 0.5, 0.9, 0.5], [0.3, 0.6, 0.9, 0.2], wrong=[0] * 4)  # and health explains it all
    assert [*rule(hidden, ACTUATOR, CONFIG)] == []


def test_of_several_instants_a_runaway_is_held_against_the_frame_before():
    several = CONFIG._replace(single_instant=False)
    assert [*courses._exclude_runaway(seen([0.2] * 3, [9.0, 9.0, 0.35]), ACTUATOR, several)] == []
    (found,) = courses._exclude_runaway(seen([0.2] * 3, [9.0, 9.0, 0.25]), ACTUATOR, several)
    np.testing.assert_allclose(found.pairs[-1], (0.3, 0.25))


def tape(travel=(-0.2, 0.7), blocks=1):
    """Surface 1 of three, whose position is estimator 2: all that it adds, five frames from the tenth on."""
    offset, slope, spread = numbers(3, 5, 4, 3)
    actuator = Actuator(*travel, 0.1, 0.2, 0.3)
    diagnosis = SimpleNamespace(
        layout=SimpleNamespace(
            position_estimator_index_by_surface=(0, 2, 3), dominant_axis_by_surface=(0, 1, 2)
        ),
        estimators=[SimpleNamespace(active_axes=(e,)) for e in "abcd"],
        surface_fault_types=[None, SimpleNamespace(actuator=actuator), None],
        types_config=CONFIG._replace(frames_per_block=blocks),
    )
    return SimpleNamespace(
        first=10, offset=offset, slope=slope, spread=spread, alarm=SimpleNamespace(diagnosis=diagnosis)
    )


@pytest.mark.parametrize("kind", range(N_TYPES))
def test_the_checker_defines_every_type_as_its_row_does(kind):
    """It is written apart from the rows; of the types of the package it takes nothing from the log."""
    row, words, travel = TYPES[kind], DESCRIPTIONS_IN_TYPE_ORDER[kind], (-0.2, 0.7)
    if row.frames_test:
        assert check_certificate.COURSES[words] == (
            row.frames_test.replace(" ", "_"),
            row.stop_direction,
        )
        assert row.frames_test in courses.RULES
    else:
        expected = (
            row.deflection_relation.command_gain,
            row.deflection_relation.theta_is_share,
            row.has_constant_parameter,
        )
        assert check_certificate.RELATIONS[words](*travel) == (
            *expected,
            *row.deflection_relation.theta_span(*travel),
        )
    assert kinds.type_definition_columns(tape(), "aileron", 1, kind) == {}


@pytest.mark.parametrize(("course", "direction"), [("runaway", -1), ("growing offset", 0), ("", 0)])
def test_what_a_type_is_that_the_checker_does_not_define_stands_in_the_log(monkeypatch, course, direction):
    added = dataclasses.replace(
        TYPES[STUCK], name="creeps", frames_test=course, stop_direction=direction,
        deflection_relation=None
        if course
        else DeflectionRelation(-1.0, True, lambda low, high: (0.5 * low, high)),
    )  # fmt: skip
    monkeypatch.setattr(kinds, "TYPES", (added,))
    monkeypatch.setattr(kinds, "WORDS", ("creeps up",))
    found = kinds.type_definition_columns(tape(), "left flap", 1, 0)
    if course:
        assert found == {f"left_flap_creeps_up_course_{course.replace(' ', '_')}": direction}
        log = {name: np.array([value, np.nan, value]) for name, value in found.items()}
        read = check_certificate.course_of("left_flap creeps up", log)
        assert read == (course.replace(" ", "_"), direction)
        return
    log = {name: np.full(3, value) for name, value in found.items()}
    assert check_certificate.course_of("left_flap creeps up", log) is None
    read = check_certificate.relation_of("left_flap creeps up", log, -9.0, 9.0)
    assert read == (-1.0, 1.0, 1.0, pytest.approx(-0.1), 0.7)


@pytest.mark.parametrize("travel", [(-0.2, 0.7), (0.1, 0.7), (-0.7, -0.3)])
def test_what_a_fault_adds_to_the_innovation(travel):
    """Of u, in effect since the frame before, -offset; of a position, rad, the slope: from there the fault
    p = u + what the type says."""
    made = tape(travel)
    Gu, G, spread = -made.offset[:, 2], made.slope[:, 2], made.spread[:, 2]
    low, high = travel
    still, wide = min(abs(low), abs(high)) if low * high > 0 else 0.0, high - low
    still = still if low > 0 else -still
    expected = {  # offset, slope, least, most, one number
        "stuck": (-Gu, G, low, high, True), "float": (still * G - Gu, 0 * G, 0.0, 0.0, True),
        "bias": (0 * G, G, -wide, wide, True), "loss_of_effectiveness": (0 * G, Gu, -1.0, 0.0, True),
    }  # fmt: skip
    for kind, parts in [*expected.items(), (None, (0 * G, Gu, -1.0, 0.0, False))]:
        number = VARYING_LOSS if kind is None else type_index_of(kind)
        found = kinds.hypothesis_of_type(made, 1, number)
        for value, part in zip(
            (found.offset, found.slope, found.theta_low, found.theta_high), parts, strict=False
        ):
            np.testing.assert_allclose(value, part, err_msg=str(kind))
        assert (found.first_frame, found.theta_is_constant, found.only_where_shown, found.axes) == (
            10,
            parts[-1],
            parts[-1],
            ("c",),
        )
        np.testing.assert_array_equal(found.spread, spread)
    assert kinds.hypothesis_of_type(tape(travel, 2), 1, STUCK).axes == (1,)


def test_what_decides_nothing_is_left_out_of_the_variances(monkeypatch):
    """Evidence and limit, each linear in P and R: what moves neither by a 1e-7 of the limit goes, with what
    stands opposite, and what stays is untouched."""
    P, R = [[3.0, 4e-8, 6e-8], [4e-8, 0.5, 7.0], [6e-8, 7.0, 2e-8]], [9e-8, 4.0]
    weights = np.array([[1.0, 1.0, 1.0], [1.0, -1e-8, 0.0], [1.0, 0.0, 1.0]])
    said = {"P": copy.deepcopy(P), "R": list(R)}
    monkeypatch.setattr(chance, "_filter_inputs", lambda said, history: None)
    monkeypatch.setattr(chance, "_run_filter", lambda said, frames, P, R: (P, R))
    monkeypatch.setattr(
        chance,
        "_evidence_and_limit",
        lambda said, sums: (10 + (weights * sums[0]).sum(), 1.0 + sums[1][0] + 0 * sums[1][1], 0),
    )
    chance._remove_negligible_variances(said, None)
    assert said == {"P": [[3.0, None, 6e-8], [None, None, None], [6e-8, None, None]], "R": [None, None]}
    monkeypatch.setattr(
        chance,
        "_evidence_and_limit",
        lambda said, sums: (
            0.0,
            1.0 / sums[1].min(initial=0.5, where=sums[1] > 1) if sums[1].all() else math.nan,
            0,
        ),
    )
    said = {"P": P, "R": R}
    chance._remove_negligible_variances(said, None)
    assert said["R"] == R  # without it there is no covariance
