"""What the statement of a statistical alarm is made of, part by part, by numbers given by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.diagnosis.detection import LEVEL_NOISE_SHARE as NOISE
from beaver_ftc.diagnosis.detection import STEP_HYPOTHESIS
from beaver_ftc_assurance.certificates import chance
from telling import numbers

SURFACES, LOSS = ("left", "right", "flap"), STEP_HYPOTHESIS + 1


def hypothesis(score, kind=LOSS, surface=0, axis=0, may_raise_alarm=True):
    return SimpleNamespace(
        score_in_std=score, hypothesis_kind=kind, surface=surface, axis=axis, may_raise_alarm=may_raise_alarm
    )


def block(*hypotheses, slots=()):
    onsets = np.zeros((len(hypotheses), 4))
    for h, slot in enumerate(slots):
        onsets[h, slot] = 1.0
    return SimpleNamespace(hypotheses=hypotheses, hypothesis_tests_by_onset=SimpleNamespace(score=onsets))


BLOCKS = (
    block(hypothesis(6.0, surface=1), hypothesis(9.0, surface=2), slots=(1, 3)),
    block(
        hypothesis(7.0, STEP_HYPOTHESIS, axis=2), hypothesis(12.0, surface=2),
        hypothesis(50.0, may_raise_alarm=False), slots=(3, 2, 0),
    ),
    block(hypothesis(11.0, surface=2), slots=(1,)),
)  # fmt: skip


def test_the_largest_score_that_raises_alarms_is_that_of_its_block_hypothesis_and_onset():
    assert chance._largest_score(BLOCKS) == (1, 1, 2)
    assert chance._largest_score(BLOCKS[:1]) == (0, 1, 3)


def test_each_fault_has_the_largest_of_its_shares_of_the_alarm_level():
    diagnosis = SimpleNamespace(statistical_filters=BLOCKS, statistical_alarm_level=4.0)
    assert chance.likelihood_shares(diagnosis, SURFACES) == {
        "right_loss_likelihood_share": 1.5, "flap_loss_likelihood_share": 3.0,
        "r_step_likelihood_share": 1.75,
    }  # fmt: skip


def test_the_share_of_the_log_stands_beside_the_sides():
    found = chance.with_logged_share({"frame": 3, "sides": [[9.0], [4.5]]}, 2.5)
    assert found["sides"] == [[9.0, 2.5 * (1.0 + chance.LOGGED_SCORE_TOLERANCE)], [4.5, 2.0]]


@pytest.mark.parametrize("name", ["slope", "offset", "spread"])
@pytest.mark.parametrize(
    ("frame", "axis", "estimator", "excluded"),
    [(24, 0, 1, True), (25, 0, 1, False), (27, 2, 1, False), (28, 0, 1, True), (26, 1, 1, True),
     (26, 0, 0, True)],
)  # fmt: skip
def test_a_fault_that_moves_no_axis_of_the_alarm_is_excluded(name, frame, axis, estimator, excluded):
    """From the frame before the alarm's first, 26, to its last, 27, on p and r; the tape begins with 20."""
    effect = {each: np.zeros((10, 2, 3)) for each in ("slope", "offset", "spread")}
    effect[name][frame - 20, estimator, axis] = 0.1
    tape = SimpleNamespace(first=20, **effect)
    alarm = {"likelihood": "flap", "first": 26, "frame": 27, "axes": [0, 2]}
    assert chance.alarm_excludes(tape, 1, alarm) is excluded
    assert not chance.alarm_excludes(tape, 1, {"frame": 27})


@pytest.mark.parametrize(("sense", "calm", "evidence"), [
    ("either", -0.4, 7.0 - 1.7), ("less", -0.4, 7.0 - 0.4 - 1.7), ("less", 0.4, 7.0 - 1.7),
])  # fmt: skip
@pytest.mark.parametrize(("rooms", "by"), [
    ((0.1, 0.2), chance.LIMIT_BY_NOISE), ((8.0, 9.0), chance.LIMIT_BY_SWINGS),
    ((9.0, 8.0), chance.LIMIT_BY_CHANGE_RATE), ((8.0, 8.0), chance.LIMIT_BY_SWINGS),
])  # fmt: skip
def test_evidence_less_what_constants_can_add_is_held_against_noise_and_what_is_bounded(
    sense, calm, evidence, rooms, by
):
    """N = -7, D = 4 at a level of 3; two constants, of tolerance 0.5 and 0.2, with sums of -3 and 1."""
    said = {"level": 3.0, "sense": sense, "tolerance": [0.5, 0.2]}
    sums = chance._WhitenedSums(np.array([-7.0, 4.0, -3.0, 1.0]), None, calm, *rooms)
    limit = 6.0 if by == chance.LIMIT_BY_NOISE else 8.0 + 6.0 * NOISE
    assert chance._evidence_and_limit(said, sums) == (pytest.approx(evidence), pytest.approx(limit), by)
    of_more = sums._replace(totals=sums.totals * [-1.0, 1.0, 1.0, 1.0])
    opposite = 5.3 if sense == "either" else -7.0 - max(0.0, -calm) - 1.7
    assert chance._evidence_and_limit(said, of_more)[0] == pytest.approx(opposite)
    without = chance._evidence_and_limit(said, sums._replace(totals=np.array([-7.0, -1.0, -3.0, 1.0])))
    assert np.isnan(without[1])


FRAMES = [
    {"signature": [1.1, 1.2], "drift": [[2.1, 2.2], [2.2, 2.3]], "jitter": [0.3, 0.4], "keep": 0.9,
     "pace": 0.05, "air": [0.6, 0.7], "known": [[3.1, 3.2]], "foreseen": [4.1, 4.2], "bounded": [5.1, 5.2]},
    {"signature": [1.3, 1.4], "drift": [[2.4, 2.5], [2.5, 2.6]], "jitter": [0.5, 0.6], "keep": 0.8,
     "pace": 0.06, "air": [0.8, 0.9], "known": [[3.3, 3.4]], "foreseen": [4.3, 4.4], "bounded": [5.3, 5.4]},
]  # fmt: skip


def test_the_filter_is_given_each_field_of_a_frame_in_its_place():
    """Axes p and r; the frames end with rows 7 and 8 of the log."""
    innovation = numbers(10, 3)
    history = SimpleNamespace(dt=0.1, innovation=lambda rows: innovation[rows])
    said = {"frames": FRAMES, "axes": [0, 2], "tolerance": [0.5], "first": 7}
    found = chance._filter_inputs(said, history)
    for k, its in enumerate(FRAMES):
        np.testing.assert_allclose(found.inputs[k, 0], innovation[7 + k, [0, 2]] - its["air"])
        assert found.inputs[k, 1].tolist() == its["signature"]
        assert found.inputs[k, 2].tolist() == its["known"][0]
        assert not found.inputs[k, 3:].any()
        assert found.drift[k].tolist() == its["drift"]
        given = found.frame_parameters[k]
        np.testing.assert_allclose(given[chance.MODEL_NOISE_COLUMN], np.array(its["jitter"]) / 0.01)
        assert given[chance.CALM_PREDICTION_COLUMN].tolist() == its["foreseen"]
        assert given[chance.BOUNDED_ERROR_COLUMN].tolist() == its["bounded"]
        assert given[chance.DRIFT_COLUMN].tolist() == [its["keep"], its["pace"]]
    assert (found.inputs.shape, found.dt) == ((2, 3 + 4, 2), 0.1)
    bare = [{"signature": [1.0], "drift": [[2.0]]}]
    found = chance._filter_inputs({"frames": bare, "axes": [1], "tolerance": [], "first": 7}, history)
    assert found.inputs[0, :, 0].tolist() == [innovation[7, 1], 1.0, 0.0, 0.0]
    assert found.frame_parameters[0].tolist() == [[0.0, 0.0]] * 3 + [[1.0, 1e9]]


def test_many_constants_at_their_worst_are_one():
    """0.5, -0.2 and 0.1 of them: in the filter before the first frame, and in each frame."""
    said = {
        "tolerance": [0.5, 0.2, 0.1], "Y": [[7.0, None, 1.0, 2.0, 3.0], [8.0, None, 4.0, 5.0, 6.0]],
        "frames": [{"known": [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]}],
    }  # fmt: skip
    chance._merge_constants(said, np.array([0.5, -0.2, 0.1]))
    assert said["tolerance"] == [1.0]
    assert [row[:2] for row in said["Y"]] == [[7.0, None], [8.0, None]]
    assert [row[2] for row in said["Y"]] == pytest.approx([0.4, 1.6])
    assert said["frames"][0]["known"] == [pytest.approx([0.4, 0.8])]


def test_of_two_axes_the_one_that_a_fault_moves_counts_and_both_where_they_go_together():
    quiet = {name: np.zeros((3, 2, 2)) for name in ("P_xx", "P_xd", "P_dd", "Q_d")}
    moved = np.array([[0.0, 0.0], [0.0, 0.1], [0.0, 0.0]])
    assert chance._affected_axes(quiet, moved, 2) == [1]
    for name in quiet:
        together = {each: values.copy() for each, values in quiet.items()}
        together[name][1, 0, 1] = 0.2
        assert chance._affected_axes(together, moved, 2) == [0, 1]
        assert chance._affected_axes(together, moved[:, 1:], 1) == [0]
