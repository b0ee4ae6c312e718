"""What bounded uncertainty can add to the sums of an oscillation, by trying."""

from math import pi

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from beaver_ftc.diagnosis.detection import tones


@given(st.lists(st.floats(0.0, 1.0), min_size=4, max_size=40), st.floats(0.1, 3.0))
def test_what_a_bound_that_changes_lets_be_heard_is_within_the_room(bounds, angle):
    """By trying every phase: sum of bound |cos|, beside its size and what beats at twice the frequency. Its
    harmonics reckoned as a third of that may be more of a bound of few spikes."""
    bounds = np.repeat(bounds, 8)
    k = angle / 8.0 * np.arange(len(bounds))
    phases = np.linspace(0.0, pi, 61)[:, None]
    most = np.max(np.abs(np.cos(k + phases)) @ bounds)
    beats = [abs(np.exp(1j * n * k) @ bounds) for n in (2, 4, 6, 8)]
    room = 2.0 / pi * (bounds.sum() + 2.0 / 3.0 * beats[0] + max(beats) / 3.0)
    assert most <= room * (1.0 + 1e-9) + 1e-12


@settings(deadline=None)
@given(st.lists(st.floats(-1.0, 1.0), min_size=8, max_size=8), st.floats(0.05, 8.0))
def test_no_periodic_uncertainty_of_that_pace_is_heard_louder(steps, x):
    phase = np.arange(400) * 2.0 * pi / 400
    slope = np.repeat(steps, 50) / x
    wave = (
        np.cumsum(slope - slope.mean()) * 2.0 * pi / 400 / 2.0
    )  # slopes within 1 / x, whatever the mean was
    wave -= 0.5 * (wave.max() + wave.min())
    wave /= max(1.0, np.abs(wave).max())
    most = tones.max_tone_mean(np.array([x]), 1.0)[0]
    assert abs(np.mean(np.exp(1j * phase) * wave)) <= most * (1.0 + 1e-3)
