"""Exclusions by a course, rule by rule, on a surface seen by hand: which frames, compared with what."""

from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.diagnosis.readout import Actuator, FaultTypesConfig
from beaver_ftc.diagnosis.types.registry import DESCRIPTIONS_IN_TYPE_ORDER, N_TYPES, TYPES
from beaver_ftc_assurance.certificates import check_certificate, courses, kinds
from beaver_ftc_assurance.certificates.courses import Exclusion, SurfaceBounds
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
    approach_share=0.5,
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


@pytest.mark.parametrize("rule", courses.RULES.values())
def test_what_nothing_shows_excludes_nothing(rule):
    assert [*rule(seen([NOTHING] * 6, [-NOTHING] * 6), ACTUATOR, CONFIG)] == []
    hidden = seen([0.2, 0.5, 0.9, 0.5], [0.3, 0.6, 0.9, 0.2], wrong=[0] * 4)  # and health explains it all
    assert [*rule(hidden, ACTUATOR, CONFIG)] == []


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
