"""Who was right, and who was first."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_live.page.game import EARLIEST_S, LATEST_S, NOTHING, OVER, Game, hidden_faults
from given import given

GIVEN = given(__file__)

NAMES = ("aileron", "elevator", NOTHING)
FAULT = {"type": "stuck", "actuator": "elevator"}


def a_round(yours, its):
    """A settled round: (name, time) of both."""
    game = Game().next_round("second", 0.0, [], np.random.default_rng(1))
    for what, at_s in sorted([("you", yours), ("it", its)], key=lambda pair: pair[1][1] if pair[1] else 1e9):
        if game.broken_s is None and (at_s is None or at_s[1] >= 10.0):
            game.broke(FAULT, 10.0)
        if at_s is not None and what == "you":
            game.answer(at_s[0], NAMES, at_s[1])
        elif at_s is not None:
            game.named(*at_s)
    assert game.settle(5.0, 100.0)
    return game


@pytest.mark.parametrize(
    ("yours", "its", "winner"),
    GIVEN["the first right answer wins"],
)
def test_the_first_right_answer_wins(yours, its, winner):
    game = a_round(yours, its)
    assert game.winner == winner
    assert game.score == [int(winner == "you"), int(winner == "detector")]
    assert game.phase == OVER


def test_the_hidden_fault_comes_within_its_times_and_is_not_always_the_same():
    rounds = [
        Game().next_round(
            "random", 100.0, hidden_faults(("aileron", "flap"), ("aileron",)), np.random.default_rng(seed)
        )
        for seed in range(60)
    ]
    assert all(100.0 + EARLIEST_S <= game.due_s <= 100.0 + LATEST_S for game in rounds)
    assert {game.fault["actuator"] for game in rounds} == {"aileron", "flap"}


def test_an_answer_needs_a_round_and_a_known_name():
    with pytest.raises(BadInput, match="no round is on"):
        Game().answer("elevator", NAMES, 1.0)
    game = Game().next_round("second", 0.0, [], np.random.default_rng(1))
    with pytest.raises(BadInput, match="did you mean elevator"):
        game.answer("elevatr", NAMES, 1.0)
