"""Who was right, and who was first."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_live.page.game import EARLIEST_S, LATEST_S, NOTHING, OVER, Game, hidden_faults

NAMES = ("aileron", "elevator", NOTHING)
FAULT = {"type": "stuck", "actuator": "elevator"}


def a_round(yours=None, its=None, broken_s=10.0):
    """A settled round: (name, time) of both."""
    game = Game().next_round("second", 0.0, [], np.random.default_rng(1))
    for what, at_s in sorted([("you", yours), ("it", its)], key=lambda pair: pair[1][1] if pair[1] else 1e9):
        if broken_s is not None and game.broken_s is None and (at_s is None or at_s[1] >= broken_s):
            game.broke(FAULT, broken_s)
        if at_s is not None and what == "you":
            game.answer(at_s[0], NAMES, at_s[1])
        elif at_s is not None:
            game.named(*at_s)
    assert game.settle(5.0, 100.0)
    return game


@pytest.mark.parametrize(
    ("yours", "its", "winner"),
    [
        (("elevator", 11.0), ("elevator", 12.0), "you"),
        (("elevator", 13.0), ("elevator", 12.0), "detector"),
        (("aileron", 11.0), ("elevator", 12.0), "detector"),
        (("elevator", 13.0), ("aileron", 12.0), "you"),
        (("aileron", 11.0), ("unanticipated", 12.0), None),
        (("elevator", 11.0), None, "you"),
        (("elevator", 9.0), ("elevator", 12.0), "detector"),
        ((NOTHING, 11.0), None, None),
    ],
)
def test_the_first_right_answer_wins(yours, its, winner):
    game = a_round(yours, its)
    assert game.winner == winner
    assert game.score == [int(winner == "you"), int(winner == "detector")]
    assert game.phase == OVER


def test_nothing_of_the_fault_is_shown_before_the_end():
    game = Game().next_round("random", 0.0, [FAULT], np.random.default_rng(1))
    while not game.is_due(game.due_s):
        pass
    game.broke(FAULT, game.due_s)
    assert set(game.shown()) == {"phase", "mode", "answered", "score"}
    assert game.shown()["phase"] == "waiting"


def test_the_detector_is_waited_for_and_not_for_ever():
    game = Game().next_round("second", 0.0, [], np.random.default_rng(1))
    game.broke(FAULT, 10.0)
    game.answer("elevator", NAMES, 11.0)
    assert not game.settle(5.0, 15.9)
    assert game.settle(5.0, 16.0)


def test_the_hidden_fault_comes_within_its_times_and_is_not_always_the_same():
    rounds = [
        Game().next_round(
            "random", 100.0, hidden_faults(("aileron", "flap"), ("aileron",)), np.random.default_rng(seed)
        )
        for seed in range(60)
    ]
    assert all(100.0 + EARLIEST_S <= game.due_s <= 100.0 + LATEST_S for game in rounds)
    assert {game.fault["actuator"] for game in rounds} == {"aileron", "flap"}


def test_a_surface_that_stands_still_may_only_run_away():
    kinds = hidden_faults(("aileron", "flap"), ("aileron",))
    assert [kind["type"] for kind in kinds if kind["actuator"] == "flap"] == ["hardover"]


def test_an_answer_needs_a_round_and_a_known_name():
    with pytest.raises(BadInput, match="no round is on"):
        Game().answer("elevator", NAMES, 1.0)
    game = Game().next_round("second", 0.0, [], np.random.default_rng(1))
    with pytest.raises(BadInput, match="did you mean elevator"):
        game.answer("elevatr", NAMES, 1.0)


def test_what_is_shown_of_each_phase(changed):
    rng = np.random.default_rng(3)
    kinds = hidden_faults(("aileron", "elevator", "flap"), ("aileron", "elevator"))
    game = Game().next_round("random", 100.0, kinds, rng)
    seen = {"kinds": kinds, "idle": Game().shown(), "waiting": game.shown(), "due_s": game.due_s}
    assert (game.is_due(game.due_s), game.is_due(game.due_s - 1e-6)) == (True, False)
    game.broke(game.fault, game.due_s)
    assert not game.is_due(game.due_s + 1.0)
    game.named(game.fault["actuator"], game.due_s + 2.0)
    game.named("rudder", game.due_s + 3.0)  # the first name counts
    assert not game.settle(5.0, game.due_s + 3.0)  # you have not spoken
    game.answer(game.fault["actuator"], (game.fault["actuator"],), game.due_s + 2.5)
    seen["broken"] = game.shown()
    assert game.settle(5.0, game.due_s + 2.5)
    assert not game.settle(5.0, game.due_s + 2.5)
    seen["over"] = game.shown()
    seen["next"] = game.next_round("second", 150.0, kinds, rng).shown()
    assert not changed(seen)


def test_a_round_given_up_is_over_and_one_that_is_over_is_put_away():
    game = Game().next_round("second", 0.0, [], np.random.default_rng(1))
    assert (game.due_s, game.hidden) == (float("inf"), True)
    for phase in (OVER, "idle", "idle"):
        game.stop()
        assert (game.phase, game.hidden) == (phase, False)
    game.named("elevator", 1.0)
    assert game.detector is None


@pytest.mark.parametrize(
    ("yours", "its", "winner"),
    [
        (("elevator", 10.0), ("elevator", 10.0), "you"),
        (("elevator", 9.99), ("elevator", 10.0), "detector"),
        (("elevator", 12.0), ("elevator", 12.0), "you"),
    ],
)
def test_an_answer_in_the_very_frame_of_the_fault_is_right(yours, its, winner):
    game = Game(phase="broken", fault=FAULT, broken_s=10.0, yours=yours, detector=its)
    assert game.winner == winner
    assert game._delay_s(its) == its[1] - 10.0


def test_before_anything_broke_nobody_is_waited_for():
    game = Game().next_round("second", 0.0, [], np.random.default_rng(1))
    game.answer("nothing", NAMES, 1.0)
    assert game.settle(5.0, 1.0)
    assert (game.winner, game.score) == (None, [0, 0])


def test_the_first_answer_counts_and_a_second_does_not():
    game = Game(phase="waiting", due_s=10.0)
    game.broke({"type": "stuck", "actuator": "aileron"}, 10.0)
    game.answer("elevator", NAMES, 10.5)
    game.answer("aileron", NAMES, 11.25)
    assert game.yours == ("elevator", 10.5)
    game.named("aileron", 12.5)
    assert game.settle(5.0, 12.75)
    assert game.score == [0, 1]


@pytest.mark.parametrize(
    ("fault", "name", "winner"),
    [
        ({"type": "damage", "case": "left wingtip"}, "unanticipated", "detector"),
        ({"type": "damage", "case": "left wingtip"}, "elevator", None),
        ({"type": "stuck", "actuator": "elevator"}, "unanticipated", None),
        ({"type": "bias", "sensor": "q"}, "elevator", None),
    ],
)
def test_a_name_is_right_as_everywhere_else(fault, name, winner):
    game = Game(phase="broken", fault=fault, broken_s=10.0, yours=("nothing", 10.5), detector=(name, 11.0))
    assert game.winner == winner
