"""Reference signals against their definition by another road: areas, zero crossings, closed forms."""

from math import pi, radians

import numpy as np
import pytest

from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.scenario.schema import load_text
from beaver_ftc.scenario.signals import sample

FRAMES = np.arange(1000) / 100.0
FINE = np.linspace(0.0, 10.0, 100_001)


def q_deg_s(signals: str, t_s=FRAMES):
    reference = load_text(f"name: x\nreference: {{q: [{signals}]}}").reference
    return np.degrees(sample(reference, t_s)[:, 1])


def test_axes_are_separate_and_lists_are_summed():
    text = """
name: x
reference:
  p: [{step: {amplitude_deg_s: 1}}]
  r: [{step: {amplitude_deg_s: 2}}, {step: {amplitude_deg_s: 3, start_s: 5}}, {step: {amplitude_deg_s: -1}}]
"""
    rates = sample(load_text(text).reference, FRAMES)
    assert rates.shape == (1000, 3)
    assert rates[:, 0] == pytest.approx(radians(1))
    assert (rates[:, 1] == 0).all()
    assert rates[499, 2] == pytest.approx(radians(1))
    assert rates[500, 2] == pytest.approx(radians(4))


def test_sine_zero_crossings_peaks_and_power():
    wave = q_deg_s("{sine: {amplitude_deg_s: 3, frequency_hz: 0.5, start_s: 1}}", FINE)
    assert np.abs(wave[FINE < 1]).max() == 0
    assert q_deg_s(
        "{sine: {amplitude_deg_s: 3, frequency_hz: 0.5, start_s: 1}}", np.array([1.5, 2.5, 2.0])
    ) == (pytest.approx([3, -3, 0], abs=1e-12))
    whole_periods = wave[(FINE >= 2) & (FINE < 10)]
    assert np.mean(whole_periods**2) == pytest.approx(4.5, rel=1e-4)


def test_a_doublet_turns_back_what_it_turned():
    wave = q_deg_s("{doublet: {amplitude_deg_s: 2, start_s: 5, width_s: 2}}")
    assert np.sum(wave) == pytest.approx(0, abs=1e-9)
    assert np.sum(np.abs(wave)) * 0.01 == pytest.approx(8)
    assert wave[[499, 500, 699, 700, 899, 900]] == pytest.approx([0, 2, 2, -2, -2, 0])


def test_a_square_wave_is_its_fourier_series_sign():
    wave = q_deg_s("{square: {amplitude_deg_s: 2, frequency_hz: 0.4, phase_deg: 45}}")
    sine = np.sin(2 * pi * 0.4 * FRAMES + pi / 4)
    away_from_edges = np.abs(sine) > 1e-6
    assert wave[away_from_edges] == pytest.approx(2 * np.sign(sine[away_from_edges]))
    assert wave[0] == pytest.approx(2)


def test_a_ramp_has_its_slope_and_holds_its_end():
    wave = q_deg_s("{ramp: {amplitude_deg_s: 6, start_s: 2, end_s: 5}}", FINE)
    slope = np.gradient(wave, FINE)
    assert slope[(FINE > 2.01) & (FINE < 4.99)] == pytest.approx(2.0, abs=1e-6)
    assert np.abs(wave[FINE < 2]).max() == 0
    assert wave[FINE > 5] == pytest.approx(6)


def test_a_chirp_sweeps_its_frequency_in_a_straight_line():
    parameters = "amplitude_deg_s: 3, start_frequency_hz: 1, end_frequency_hz: 4, start_s: 1, end_s: 9"
    wave = q_deg_s(f"{{chirp: {{{parameters}}}}}", FINE)
    inside = (FINE > 1) & (FINE < 9)
    rising = np.flatnonzero((wave[:-1] <= 0) & (wave[1:] > 0) & inside[1:])
    # the n-th upward zero crossing is where t f0 + t^2 (f1 - f0)/2T = n
    n = np.arange(20)
    closed_form = 1 + (-1 + np.sqrt(1 + 4 * n * 3 / 16)) / (2 * 3 / 16)
    assert FINE[rising] == pytest.approx(closed_form, abs=2e-4)
    assert np.abs(wave[~inside]).max() == 0
    assert np.abs(wave).max() == pytest.approx(3, rel=1e-6)


def test_a_table_is_straight_lines_held_outside(tmp_path):
    (tmp_path / "ref.csv").write_text("t_s, p, rate_deg_s\n1,9,0\n3,9,4\n\n4,9,4\n")
    text = "name: x\nreference: {q: [{csv: {file: ref.csv}}]}"
    reference = load_text(text, folder=tmp_path).reference
    values = np.degrees(sample(reference, np.array([0.0, 1.0, 1.5, 2.0, 3.5, 9.0]))[:, 1])
    assert values == pytest.approx([0, 0, 1, 2, 4, 4])
    (tmp_path / "ref.csv").write_text("t_s,rate_deg_s," + 140_000 * "x")
    with pytest.raises(ScenarioError, match=r"ref.csv' line 1: field larger than field limit"):
        load_text(text, folder=tmp_path)


def test_a_phase_of_90_deg_is_a_cosine():
    wave = q_deg_s("{sine: {amplitude_deg_s: 2, frequency_hz: 0.3, phase_deg: 90}}")
    assert wave == pytest.approx(2 * np.cos(2 * pi * 0.3 * FRAMES), abs=1e-12)
