"""Columns that are not what the model's were: signs and units that no effectiveness explains."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.column_mistakes import refuse_columns
from beaver_ftc_logs.diagnose import diagnose
from beaver_ftc_logs.model import FittedRanges
from beaver_ftc_logs.trust import central_ranges
from products.logs import small


@pytest.fixture(scope="module")
def flown(sampled):
    return sampled(120.0, seed=41)


def other_commands(samples, signs):
    return replace(samples, commands=samples.commands * np.array(signs))


@pytest.mark.parametrize(("signs", "name"), [((-1, 1), "right"), ((1, -1), "left"), ((-1, -1), "right")])
def test_a_command_of_the_other_sign_is_refused(flown, wing_model, signs, name):
    with pytest.raises(BadInput, match=f"answer the command of {name} the other way round"):
        diagnose(other_commands(flown, signs), wing_model)


def test_a_sign_that_turns_about_in_flight_is_no_column(flown, wing_model):
    """What is reversed from the middle on is no mistake of the file: nothing is believed from there on."""
    signs = np.where(flown.t_s < 60.0, 1.0, -1.0)[:, None]
    rows = diagnose(replace(flown, commands=flown.commands * signs), wing_model)
    assert rows.credible[rows.t_s < 60.0].mean() > 0.9
    assert rows.credible[rows.t_s > 90.0].mean() < 0.1


@pytest.fixture(scope="module")
def n_signal_lags():
    """A model whose rates feel a signal, with what it was fitted on, and a flight by it."""
    past = [*small.model(small.TAIL).past[:-1], [0.3, 0.2, -0.1]]
    model = small.model(small.TAIL, past=past)
    flight = small.flight(model, n=1200, seed=7)
    known = FittedRanges(commands=central_ranges(flight.commands), rates=central_ranges(flight.rates))
    return model.model_copy(update={"fitted": known}), flight


def test_a_signal_of_the_other_sign_is_refused(n_signal_lags):
    model, flight = n_signal_lags
    assert refuse_columns(flight, model) is None
    with pytest.raises(BadInput, match=r"times as likely with `scale: -1` on airspeed_m_s"):
        refuse_columns(replace(flight, signals=-flight.signals), model)


def test_a_rate_of_the_other_sign_is_refused_by_what_it_does_to_the_others(n_signal_lags):
    """A lost surface changes nothing of it."""
    model, _ = n_signal_lags
    lost = small.flight(model, n=1200, seed=8, lost=((1, 0, 1200, 0.0),))
    assert refuse_columns(lost, model) is None
    past = np.array(model.past)
    past[:3] += np.array([[0.0, 0.2, 0.0], [0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])
    coupled = model.model_copy(update={"past": past.tolist()})
    idle = coupled.model_copy(update={"response": np.zeros_like(model.response).tolist()})
    flight = small.flight(idle, n=6000, seed=9)
    assert refuse_columns(flight, coupled) is None
    with pytest.raises(BadInput, match=r"times as likely with `scale: -1` on r_rad_s"):
        refuse_columns(replace(flight, rates=flight.rates * np.array([1.0, 1.0, -1.0])), coupled)
