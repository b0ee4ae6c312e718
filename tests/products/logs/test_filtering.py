"""What of a flight is adapted: its delay, its trim, its gain; bounded, and never by looking ahead."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc_logs.bank import build_bank
from beaver_ftc_logs.diagnose import diagnose
from beaver_ftc_logs.evidence import fault_evidence
from beaver_ftc_logs.flight_states import build_states
from beaver_ftc_logs.posterior import _with_command_delay, model_weights, run_flight
from beaver_ftc_logs.regression import innovations


@pytest.fixture(scope="module")
def healthy(sampled):
    return sampled(200.0, seed=31)


def delays_of(samples, model):
    """Which delay explains a flight best, by running each alone."""
    bank, delays_s = build_bank(model), model.settings.delays_s
    flights = [innovations(_with_command_delay(samples, d), model) for d in delays_s]
    return model_weights([run_flight(flight, model, bank)[1] for flight in flights], model.rate_hz)


@pytest.mark.parametrize(("command_delay_s", "which"), [(-0.04, 0), (0.0, 1), (0.04, 2)])
def test_the_delay_of_a_flight_is_found(healthy, wing_model, command_delay_s, which):
    at = np.arange(len(healthy.t_s)) + command_delay_s * wing_model.rate_hz
    columns = [np.interp(at, np.arange(len(at)), column) for column in healthy.commands.T]
    weights = delays_of(replace(healthy, commands=np.column_stack(columns)), wing_model)
    assert weights[:, -1].argmax() == which
    assert weights[which, -1] > 0.9


def test_a_shift_of_a_command_is_within_the_spread_of_the_trim(wing_model):
    """A shift of each group's command moves the trim along the response of the group."""
    settings = wing_model.settings
    expected = settings.trim_sd**2 * np.diag(np.diag(wing_model.noise))
    for shift in settings.trim_shift * np.array(wing_model.response).sum(axis=1):
        expected += np.outer(shift, shift)
    covariance = build_states(wing_model, wing_model.noise_of(())).initial_covariance
    np.testing.assert_allclose(covariance[:3, :3], expected, rtol=1e-9, atol=1e-15)


def test_a_fault_from_the_start_is_not_learnt_away(sampled, wing_model):
    """Weak from the first sample on, for five minutes: neither gain nor trim takes it over."""
    rows = diagnose(sampled(300.0, parts=((0, 300, 1.0, 0.5),), seed=33), wing_model)
    late = rows.t_s > 60.0
    assert rows.faulty[late].mean() > 0.95
    assert np.median(rows.effectiveness[late, 1]) == pytest.approx(0.5, abs=0.101)


def test_evidence_is_the_log_of_a_likelihood_ratio():
    """Two of three levels are faults; what a change at random brings is no evidence."""
    bank = SimpleNamespace(
        is_fault_hypothesis=np.array([False, True, True]), change_probability_per_sample=0.1,
        prior_probability=np.array([0.8, 0.15, 0.05]), transition_share=np.array([3.0, 1.0, 2.0]),
    )  # fmt: skip
    fault = np.array([0.3, 0.6, 0.45])
    posterior = np.column_stack([1 - fault, 0.25 * fault, 0.75 * fault])
    before = [0.2, 0.9 * 0.3 + 0.1 * 0.5, 0.9 * 0.6 + 0.1 * 0.5]
    expected = [np.log(p / (1 - p)) - np.log(q / (1 - q)) for p, q in zip(fault, before, strict=True)]
    assert fault_evidence(posterior, bank) == pytest.approx(expected)
    assert np.isfinite(fault_evidence(np.array([[0.0, 0.5, 0.5], [1.0, 0.0, 0.0]]), bank)).all()
