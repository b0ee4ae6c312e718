"""Columns that are not what the model's were: signs and units that no effectiveness explains."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.diagnose import diagnose
from beaver_ftc.flights.samples import load_flights
from beaver_ftc.flights.trust import check_columns
from flights import synthetic


@pytest.fixture(scope="module")
def flown(wing, wing_folder):
    columns = synthetic.fly(120.0, seed=41)
    return load_flights([synthetic.write_csv(wing_folder / "columns.csv", columns)], wing)[0]


def other_commands(samples, signs):
    return replace(samples, commands=samples.commands * np.array(signs))


@pytest.mark.parametrize(("signs", "name"), [((-1, 1), "right"), ((1, -1), "left"), ((-1, -1), "right")])
def test_a_command_of_the_other_sign_is_refused(flown, wing_model, signs, name):
    with pytest.raises(BadInput, match=f"answer the command of {name} the other way round"):
        diagnose(other_commands(flown, signs), wing_model)


def test_in_moving_air_a_law_that_answers_gusts_is_not_taken_for_another_sign(flown, wing_model):
    """Then the command opposes what the air turns, in all of a correct log."""
    opposed = other_commands(flown, (-1, 1))
    with pytest.raises(BadInput, match="the other way round"):
        check_columns(opposed, wing_model)
    assert check_columns(opposed, wing_model.model_copy(update={"colours": ["any"]})) is None


def test_a_sign_that_turns_about_in_flight_is_no_column(flown, wing_model):
    """What is reversed from the middle on is no mistake of the file: nothing is believed from there on."""
    signs = np.where(flown.t_s < 60.0, 1.0, -1.0)[:, None]
    rows = diagnose(replace(flown, commands=flown.commands * signs), wing_model)
    assert rows.credible[rows.t_s < 60.0].mean() > 0.9
    assert rows.credible[rows.t_s > 90.0].mean() < 0.1


def test_one_rate_in_another_unit_is_refused(flown, wing_model):
    with pytest.raises(BadInput, match="columns, signs and units as in the flights of the model"):
        diagnose(replace(flown, rates=flown.rates * np.array([57.3, 1.0, 1.0])), wing_model)


def test_a_surface_lost_from_the_first_second_is_none_of_that(wing, wing_folder, wing_model):
    columns = synthetic.fly(120.0, parts=((0, 120, 1.0, 0.0),), seed=42)
    samples = load_flights([synthetic.write_csv(wing_folder / "lost.csv", columns)], wing)[0]
    rows = diagnose(samples, wing_model)
    assert rows.faulty[rows.t_s > 30.0].mean() > 0.9
