"""Oscillations, a kernel at a time, against sums written out, a filter run through, and drawn noise."""

from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kernels import DT, new_fdi

from beaver_ftc.diagnosis.detection import tones, whitening
from beaver_ftc.diagnosis.detection.tones import TONE_MEMORY_S

CHANCE, PACE, V = 1e-11, 15.0, 45.0
LEVEL = sqrt(-2.0 * np.log(CHANCE))


@pytest.fixture
def rng():
    return np.random.default_rng(11)


@pytest.fixture
def view(rng):
    view = new_fdi()["statistical"]["views"][0]
    block = view["block"]
    (
        block["n"],
        block["n_Z"],
        block["a"],
        block["noise_share"],
    ) = 1, 3, 1.0, 0.5
    block["S_inv"][0, 0], block["K_x"][0, 0], block["K_d"][0, 0] = 4.0, 0.3, 0.8
    block["tol"][:3], block["eta"] = rng.uniform(0.1, 0.2, 3), 0.05
    return view


@pytest.fixture
def tone_test_config():
    tone_test_config = new_fdi()["statistical"]["tone_test_config"]
    tones.configure_tones(tone_test_config, CHANCE, V, PACE, DT)
    return tone_test_config


@pytest.mark.parametrize(("K_x", "K_d", "keep"), [(0.3, 0.8, 1.0), (0.05, 0.02, 1.0), (0.2, 0.5, 0.95)])
@pytest.mark.parametrize("frequency_rad_s", [1.0, 5.0, 13.0])
def test_the_filter_lets_pass_of_a_tone_what_it_does_when_run(view, K_x, K_d, keep, frequency_rad_s):
    block = view["block"]
    block["K_x"][0, 0], block["K_d"][0, 0], block["a"] = K_x, K_d, keep
    out, response = np.zeros(2), []
    for k in range(6000):
        whitening.whiten_step(
            block, block["state"], np.array([np.cos(frequency_rad_s * k * DT), 0.0]), DT, out
        )
        response.append(out[0])
    angles = frequency_rad_s * DT * np.arange(3000, 6000)
    shares, *_ = np.linalg.lstsq(
        np.stack([np.cos(angles), np.sin(angles)], axis=-1), response[3000:], rcond=None
    )
    amplitude = np.hypot(*shares)
    angle = frequency_rad_s * DT
    found = tones.tone_gain(K_x, K_d, keep, np.exp(1j * angle), DT)
    assert found == pytest.approx(amplitude, rel=1e-9)


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


@pytest.mark.parametrize("frequency_rad_s", [1.0, 3.9, 9.6, 13.0])
def test_a_tone_is_heard_on_the_grid_and_between(view, tone_test_config, frequency_rad_s):
    view["block"]["eta"] = 0.0
    samples = 0.5 * 0.8 * np.cos(frequency_rad_s * DT * np.arange(1000) + 1.0)  # 0.8 standard deviations
    for sample in samples:
        view["block"]["g"][0] = sample
        tones.update_tones(view["tones"], view["block"], tone_test_config, LEVEL, True, DT)
    whole = (
        0.8 / 2.0 * TONE_MEMORY_S / DT / sqrt(0.5 * 0.5 * TONE_MEMORY_S / DT)
    )  # amplitude over its deviation
    assert 0.6 * whole < view["tones"]["score"] < 1.1 * whole


@given(st.lists(st.tuples(st.booleans(), st.floats(0.0, 0.2)), min_size=16, max_size=16))
def test_an_error_within_its_bound_is_never_heard_whatever_frames_count(frames):
    """Sums written out over the frames that count: the bound is summed as the evidence is."""
    stat = new_fdi()["statistical"]
    view, config = stat["views"][0], stat["tone_test_config"]
    block, found = view["block"], view["tones"]
    tones.configure_tones(config, CHANCE, V, PACE, DT)
    block["n"], block["a"], block["S_inv"][0, 0] = 1, 1.0, 4.0
    for inside, bound in frames:
        block["g"][0] = block["eta"][0] = bound
        tones.update_tones(found, block, config, LEVEL, inside, DT)
    ages = (len(frames) - 1) // config["stride"] - np.arange(len(frames)) // config["stride"]
    sizes = [
        2.0 * bound * inside * config["a"] ** age for (inside, bound), age in zip(frames, ages, strict=True)
    ]
    gain = [tones.tone_gain(0.0, 0.0, 1.0, z, DT) for z in config["z"]]
    assert found["b_0"] == pytest.approx(np.sum(sizes) * np.array(gain), abs=1e-12)
    variance = sum(inside * config["a"] ** (2 * age) for (inside, _), age in zip(frames, ages, strict=True))
    assert found["D"] == pytest.approx(variance, abs=1e-12)
