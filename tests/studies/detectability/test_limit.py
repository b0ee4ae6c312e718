"""The informed test: against one big Gaussian problem, and against counting."""

from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest

from beaver_ftc.diagnosis.informed_test import (
    UNEXPLAINED_MEMORY_S,
    WhiteningFilter,
    detection_probability,
    with_measured_gust,
)
from beaver_ftc.diagnosis.rivals.gust import VaneGust
from beaver_ftc.loop.loop import Loop
from beaver_ftc.studies.compare.replay import Recorder, record
from beaver_ftc.studies.detectability.grid import Block, Condition
from beaver_ftc.studies.detectability.schemes import deflections, loss, scenario_of, strikes_at_s

DT = 0.01
LIGHT = Condition("tactical-grade", "light")


@pytest.fixture(scope="module")
def context():
    return Loop(scenario_of(Block(LIGHT, 3.0, 1), 1.0), Recorder()).plugin_frame.detector.context


def covariance(context, n):
    """Of the measured rates of n frames, (3 n, 3 n), the first of them known as well as it is measured."""
    declared = context.declared
    k = np.arange(n)

    def process(sigma, time_s):
        return sigma**2 * np.exp(-np.abs(k[:, None] - k[None, :]) * DT / time_s)

    accelerations = np.zeros((3, n, 3, n))
    for j in range(3):
        gust = process(declared.gust_rad_s[j], declared.gust_time_s[j])
        effect = declared.gust_effect[:, j]
        accelerations += np.einsum("a,b,kl->akbl", effect, effect, gust)
        unexplained = process(context.constant_rad_s2[j] / np.sqrt(2.0), UNEXPLAINED_MEMORY_S)
        accelerations[j, :, j] += unexplained + declared.model_rad_s2[j] ** 2 * np.eye(n)
    summed = DT * np.tril(np.ones((n, n)), -1)
    rates = np.einsum("kl,albm,nm->akbn", summed, accelerations, summed, optimize=True)
    for i in range(3):
        gyro = declared.gyro_rad_s[i] ** 2 + 1e-10
        rates[i, :, i] += gyro * np.eye(n) + gyro  # noise, and where it began
    return rates.reshape(3 * n, 3 * n)


def stands_out(mean, C):
    """A known mean in Gaussian noise of covariance C: the square root of mean' C^-1 mean."""
    return np.sqrt(mean @ np.linalg.solve(C, mean))


@pytest.mark.parametrize("broken", range(3))
def test_without_a_gyro_as_with_all_readings_at_once(context, broken):
    """The attitude sums the rates; its noise and where it began are known as well as it is measured."""
    n, before = 60, 150
    N, declared = before + n, context.declared
    phi = np.cumsum(np.random.default_rng(6).normal(size=(n, 3)), axis=0) * [0.02, 0.01, 0.01]
    angle = declared.further_noise[:3] ** 2 + declared.further_resolution[:3] ** 2 / 12 + 1e-10
    rates = covariance(context, N).reshape(3, N, 3, N)
    true = rates - np.einsum("ij,kl,i->ikjl", np.eye(3), np.eye(N), declared.gyro_rad_s**2 + 1e-10)
    summed = DT * np.tril(np.ones((N, N)), -1)
    both = np.zeros((2, 3, N, 2, 3, N))
    both[0, :, :, 0] = rates
    both[0, :, :, 1] = np.einsum("ikjl,ml->ikjm", true, summed)
    both[1, :, :, 0] = np.einsum("mk,ikjl->imjl", summed, true)
    both[1, :, :, 1] = np.einsum("mk,ikjn->imjn", summed, both[0, :, :, 1])
    for i in range(3):
        both[1, i, :, 1, i] += angle[i] * (np.eye(N) + 1.0)
    mean = np.zeros((2, 3, N))
    mean[0, :, before:] = DT * np.cumsum(phi, axis=0).T
    mean[1] = mean[0] @ summed.T
    kept = [row for row in range(6) if row != broken]
    C = both.reshape(6, N, 6, N)[kept][:, :, kept].reshape(5 * N, -1)
    whitening = WhiteningFilter(context, broken)
    found = whitening.deflection_by_frame(phi)[-1]
    assert found == pytest.approx(stands_out(mean.reshape(6, N)[kept].ravel(), C), rel=0.01)
    assert np.array_equal(whitening.S, whitening.S.T)
    assert found < WhiteningFilter(context).deflection_by_frame(phi)[-1]


def test_beside_unknown_constants_as_in_the_whole_flight_at_once(context):
    """Constants are noise of covariance R diag(sigma^2) R', added to that of the rates."""
    n, sigma = 120, np.array([0.3, 0.5])
    rng = np.random.default_rng(5)
    phi = np.cumsum(rng.normal(size=(n, 3)), axis=0) * [0.02, 0.01, 0.01]
    phi[:60] = 0.0
    regressors = np.cumsum(rng.normal(size=(n, 3, 2)), axis=0) * 0.02
    regressors[..., 0] += phi  # so that it explains some of the fault
    before = 150  # what came before tells of the noise, and nothing of fault and constants
    late, R = np.zeros((3, before + n)), np.zeros((3, before + n, 2))
    late[:, before:] = DT * np.cumsum(phi, axis=0).T
    R[:, before:] = DT * np.cumsum(regressors, axis=0).transpose(1, 0, 2) * sigma
    R = R.reshape(-1, 2)
    whitening = WhiteningFilter(context)
    found = whitening.deflection_with_unknowns(phi, regressors, sigma)
    C = covariance(context, before + n) + R @ R.T
    assert found == pytest.approx(stands_out(late.ravel(), C), rel=0.01)
    assert found < 0.98 * whitening.deflection_by_frame(phi)[-1]
    nothing = whitening.deflection_with_unknowns(phi, regressors[..., :0], sigma[:0])
    assert nothing == pytest.approx(whitening.deflection_by_frame(phi)[-1])


def test_twice_the_fault_stands_out_twice_as_much_and_only_grows(context):
    phi = np.random.default_rng(0).normal(size=(50, 3))
    whitening = WhiteningFilter(context)
    d = whitening.deflection_by_frame(phi)
    assert whitening.deflection_by_frame(2.0 * phi) == pytest.approx(2.0 * d)
    assert (np.diff(d) >= 0.0).all()


def test_of_a_flight_it_takes_what_the_surface_gave(context):
    block = Block(LIGHT, 6.0, 2)
    at_s = strikes_at_s(block)
    recording = record(scenario_of(block, at_s + 1.0, [loss("elevator", 0.7, at_s)]))
    seen = [measured for measured, _ in recording.seen]
    effect = np.array([-0.7 * measured.contribution[:, 1] for measured in seen[round(at_s * 100) + 1 :]])
    # A test that knows the gusts that the vanes show:
    d = WhiteningFilter(VaneGust(recording.context).context).deflection_by_frame(effect)
    # 0.5 s after the begin of the loss, 1 s, and 5 s, which is beyond the end
    assert deflections(recording, "elevator", 0.7) == pytest.approx([d[49], d[-1], d[-1]])
    assert not effect[:, [0, 2]].any()


def test_chance_is_what_throwing_the_noise_counts():
    """The likelihood ratio of a known shift d is normal about d: counted at the level that noise exceeds so
    often."""
    rng = np.random.default_rng(1)
    per_h, within_s, d = 36.0, 5.0, 2.0
    level = np.quantile(rng.normal(size=400_000), 1.0 - per_h * within_s / 3600.0)
    counted = np.mean(d + rng.normal(size=400_000) > level)
    assert detection_probability(d, within_s, per_h) == pytest.approx(counted, abs=0.01)
    assert detection_probability(0.0, within_s, per_h) == pytest.approx(per_h * within_s / 3600.0)
    assert detection_probability(5.0, within_s, 0.0) == 0.0
    assert detection_probability(NormalDist().inv_cdf(1.0 - 0.05), within_s, per_h) == pytest.approx(0.5)
    assert detection_probability(0.3, 9000.0, 1.0) == pytest.approx(NormalDist().cdf(0.3))  # every other time


def test_a_test_that_is_shown_the_vanes_knows_all_of_a_gust_but_what_they_leave(context):
    """Of roll all is left, of pitch and yaw shares of the intensity; what vanes add is noise of the model."""
    noise = np.array([0.03, 0.05, 0.02])
    found = with_measured_gust(context, noise)
    declared = context.declared
    assert found.declared.gust_rad_s == pytest.approx(declared.gust_rad_s * np.sqrt([1.0, 0.003, 0.03]))
    assert found.declared.model_rad_s2 == pytest.approx(np.hypot(declared.model_rad_s2, noise))
    of_before = {"gust_rad_s": declared.gust_rad_s, "model_rad_s2": declared.model_rad_s2}
    assert replace(found.declared, **of_before) == declared
    assert replace(found, declared=declared) == context
    still = replace(context, declared=replace(declared, gust_rad_s=np.zeros(3)))
    assert with_measured_gust(still, noise) is still
