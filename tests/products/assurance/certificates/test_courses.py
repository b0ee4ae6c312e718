"""Exclusions by a course, rule by rule, on a surface seen by hand: which frames, compared with what."""

import numpy as np
import pytest

from beaver_ftc.diagnosis.readout import Actuator, TypesConfig
from beaver_ftc_assurance.certificates import courses
from beaver_ftc_assurance.certificates.courses import Found, Seen

NOTHING = -9.0


def seen(low, high, wrong=None, ordered=0.1, command=0.0):
    """A surface that roll alone sees, from the tenth frame on; its stops are 1 rad away."""
    n = len(low)
    least, most = np.full((n, 3), NOTHING), np.full((n, 3), -NOTHING)
    least[:, 0], most[:, 0] = low, high
    command, room = np.full(n, command), np.zeros((n, 2))
    return Seen(
        10, 1, least, most, command, np.tile(command[:, None], 3), room,
        np.ones(n, bool) if wrong is None else np.array(wrong, bool), np.full(n, ordered),
        np.array([-1.0, 1.0]), 2.0,
    )  # fmt: skip


ACTUATOR = Actuator(-1.0, 1.0, least_runaway_rad_s=2.0, slowest_step_rad=0.025, approach=0.5)
CONFIG = TypesConfig(
    single_instant=True, instants=2, returns=False, patience=2, block_frames=1, block_s=0.05, dt_s=0.5
)
RULES = {
    # What comes nearer by 0.05 rad a frame at least, and more slowly within 0.05 rad of what was ordered.
    "not nearer at once": (courses._slow, [0.2, 0.5], [0.3, 9.0], Found(
        range(2), 0, [(0.1, 0.0), (0.5, 0.0), (0.5, 0.3), (0.5, 0.15), (1.0, 0.0)],
        {"near": 0.15, "ordered": [0.1] * 2}, 0,
    )),
    "not nearer in time": (courses._slow, [0.2, 0.25, 0.28], [0.3, 9.0, 9.0], Found(
        range(3), 0, [(0.1, 0.0), (0.43, 0.0), (0.28, 0.25), (0.28, 0.15), (1.0, 0.0)],
        {"near": 0.15, "ordered": [0.1] * 3, "step": 0.05}, 0,
    )),
    "slowly nearer": (courses._slow, [0.0, 0.2, 0.16, 0.16], [9.0, 0.22, 0.22, 9.0], None),
    "two offsets": (courses._bias, [0.1, 0.4, 0.2], [0.5, 0.6, 0.3], Found(
        range(1, 2), 2, [(0.4, 0.3), (0.4, -1.0), (1.0, 0.3)], {"stops": [-1.0, 1.0]},
    )),
    "one offset": (courses._bias, [0.1, 0.4, 0.2], [0.5, 0.6, 0.4], None),
    "an offset that shrinks": (courses._growing, [0.4, 0.0], [9.0, 0.2], Found(
        range(1), 1, [(0.4, 0.0), (0.4, 0.2), (0.4, -1.0), (1.0, 0.2), (11.0, 10.0)], {"stops": [-1.0, 1.0]},
    )),
    "an offset that grows": (courses._growing, [0.0, 0.4], [0.2, 9.0], None),
    "behind its pace": (courses._runaway, [0.2] * 3, [9.0, 9.0, 0.35], Found(
        range(1), 2, [(1.0, 0.35), (12.0, 10.0), (0.4, 0.35)], {"stops": [1.0], "pace_rad_s": 2.0},
    )),
    "at its pace": (courses._runaway, [0.2] * 3, [9.0, 9.0, 0.41], None),
    "long on one side": (courses._swing, [0.1] * 4, [9.0] * 4, Found(
        range(4), None, [(3.0, np.pi), (0.1, 0.0), (0.4, 0.0)], {"slowest_rad_s": 2.0}, 0,
    )),
    "not so long": (courses._swing, [0.1] * 3, [9.0] * 3, None),
}  # fmt: skip


@pytest.mark.parametrize("name", RULES)
def test_a_rule_finds_the_frames_and_says_what_it_compares(name):
    rule, low, high, expected = RULES[name]
    found = [*rule(seen(low, high), ACTUATOR, CONFIG)]
    if expected is None:
        assert found == []
        return
    (found,) = found
    assert (found.run, found.beside, found.axis) == (expected.run, expected.beside, expected.axis)
    np.testing.assert_allclose(found.compared, expected.compared)
    assert found.said.keys() == expected.said.keys()
    for key, value in expected.said.items():
        assert found.said[key] == pytest.approx(value), key


@pytest.mark.parametrize("rule", courses.RULES.values())
def test_what_nothing_shows_excludes_nothing(rule):
    assert [*rule(seen([NOTHING] * 6, [-NOTHING] * 6), ACTUATOR, CONFIG)] == []
    hidden = seen([0.2, 0.5, 0.9, 0.5], [0.3, 0.6, 0.9, 0.2], wrong=[0] * 4)  # and health explains it all
    assert [*rule(hidden, ACTUATOR, CONFIG)] == []


def test_of_several_instants_a_runaway_is_held_against_the_frame_before():
    several = CONFIG._replace(single_instant=False)
    assert [*courses._runaway(seen([0.2] * 3, [9.0, 9.0, 0.35]), ACTUATOR, several)] == []
    (found,) = courses._runaway(seen([0.2] * 3, [9.0, 9.0, 0.25]), ACTUATOR, several)
    np.testing.assert_allclose(found.compared[-1], (0.3, 0.25))
