"""Delays of a flight: what each makes of the commands, how they are weighed, and what all say together."""

import numpy as np
import pytest

from beaver_ftc_logs import filtering
from products.logs import small

DELAYS_S = [-0.03, 0.0, 0.04]
MODEL = small.model(
    settings={"delays_s": DELAYS_S, "level_step": 0.25, "trim_shift": 0.02, "own_gain_sd": 0.05}
)


@pytest.mark.parametrize(("delay_s", "share", "later"), [
    (0.03, 0.3, True), (-0.03, 0.3, False), (0.1, 1.0, True), (0.7, 1.0, True), (-0.2, 1.0, False),
])  # fmt: skip
def test_commands_that_act_sooner_or_later(delay_s, share, later):
    """So much of the command of the sample before, or of the one after; the ends repeated."""
    samples = small.flight(MODEL, 12)
    found = filtering._with_command_delay(samples, delay_s).commands
    at = np.clip(np.arange(12) + (-1 if later else 1), 0, 11)
    np.testing.assert_allclose(
        found, (1 - share) * samples.commands + share * samples.commands[at], atol=1e-15
    )


def test_delays_are_weighed_by_the_evidence_of_ten_minutes():
    """What was 600 s ago counts 1/e."""
    rng = np.random.default_rng(1)
    evidence = [0.1 * rng.standard_normal(2000) for _ in range(3)]
    found = filtering._model_weights(evidence, 2.0)
    for k in (0, 10, 1999):
        age_s = 0.5 * np.arange(k, -1, -1)
        total = np.array([(np.exp(-age_s / 600.0) * one[: k + 1]).sum() for one in evidence])
        np.testing.assert_allclose(found[:, k], np.exp(total) / np.exp(total).sum(), rtol=1e-9)
    huge = filtering._model_weights([1000.0 * np.ones(3), np.ones(3)], 2.0)
    np.testing.assert_allclose(huge, [[1.0] * 3, [0.0] * 3], atol=1e-12)
