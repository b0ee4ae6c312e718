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
