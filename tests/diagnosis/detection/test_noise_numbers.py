"""The statistical detector's numbers one by one: from what is declared, by the formulas' own conditions."""

from dataclasses import replace
from math import pi, radians, sqrt

import numpy as np
import pytest
from innovations import LEVEL_FLIGHT, Detector, by_onset, gust_jitter

from beaver_ftc.aircraft import load
from beaver_ftc.design import Dryden, rotation_lengths
from beaver_ftc.design.fdc import MASS
from beaver_ftc.design.model import coefficient_slopes, design_record, inertia_coefficients, jacobian
from beaver_ftc.diagnosis import bounds as bound_kernels
from beaver_ftc.diagnosis import gusts
from beaver_ftc.diagnosis.bounds import inertia_bounds, map_dtype
from beaver_ftc.diagnosis.detection import statistical
from beaver_ftc.diagnosis.detection.likelihood import (
    GROWING_LOSS,
    LOSS_END,
    N_SLOTS,
)
from beaver_ftc.diagnosis.detection.statistical import statistical_dtype
from beaver_ftc.diagnosis.state import LOSS
from beaver_ftc.scenario.declared import Declared, SensorErrors
from beaver_ftc.scenario.diagnosis import Bounds
from beaver_ftc.scenario.schema import Scenario
from flying import declared_in

AIRCRAFT = load()
SPAN_M, CHORD_M = AIRCRAFT.geometry.span_m, AIRCRAFT.geometry.chord_m
_, Y, _ = LEVEL_FLIGHT
V, QDYN_PA = 45.0, 1036.0
GIVEN = {
    "name": "x",
    "rate_hz": 50,
    "fdi": {"statistical": {}, "bounds": {"sensors": "tactical-grade", "turbulence": "light"}},
}


@pytest.mark.parametrize("turbulence", ["light", "severe"])
def test_gusts_drift_as_the_specification_has_them(turbulence):
    """Intensity over V: of a first-order process twice its variance over its lag; of a lagged slope that of
    the velocity over (V lag)^2 [MIL-F-8785C]."""
    found = Dryden(turbulence).rotation_walk(SPAN_M)
    sigma_w = 0.3048 * {"light": 7.4, "severe": 23.6}[turbulence]
    L = 0.3048 * 1750.0
    rolling_lag_s = sqrt(L * SPAN_M) / (2.6 * V)
    rolling = 2.0 * Dryden(turbulence).rotation_limit_rad_s(SPAN_M) ** 2 / rolling_lag_s
    velocity = 3.0 * sigma_w**2 * V / L
    pitching, yawing = (velocity / (V * n * SPAN_M / (pi * V)) ** 2 for n in (4, 3))
    assert found * V == pytest.approx([rolling, pitching, yawing], rel=1e-9)


def test_a_swing_takes_half_the_level_where_gyros_are_noisy():
    """eta_bar omega sqrt(2 sqrt 2 / i w0), w0 = (i / n)^(1/4); so fast that it hardly grows beside a loss."""
    eta_bar, omega, noise, level, dt = 0.02, 500.0, 1e-3, 6.0, 1e-3
    i = statistical.derive_intensity(eta_bar, omega, noise, level, dt) * eta_bar**2
    ramp = 4.0 * (1.204 * eta_bar / level) ** 2 * omega
    walk = sqrt(i**2 - ramp**2)
    w0 = (walk / (noise**2 * dt)) ** 0.25
    assert eta_bar * omega * sqrt(2.0 * sqrt(2.0) / (walk * w0)) == pytest.approx(level / 2)


def returning(rapidity, moving=1, rolling=200.0, rate_hz=50.0):
    record = np.zeros(1, statistical_dtype())[0]
    record["noise"]["q"], record["test"]["alarm_level"] = (
        rapidity,
        6.0,
    )
    return statistical.derive_length(record, V, rate_hz, moving * rolling)


def test_a_drift_returns_so_soon_that_a_swing_takes_half_the_level():
    """eta_bar sqrt(T / 2 i) / tau over the longest window; no later than the rolling gust does."""
    rapidity, rate_hz = 3.0, 50.0
    tau = returning(rapidity, moving=0) / V
    longest_s = 2 ** (N_SLOTS - 1) / rate_hz
    assert sqrt(longest_s / (2.0 * rapidity)) / tau == pytest.approx(6.0 / 2)
    assert returning(rapidity, rolling=2.0) == 2.0
    assert returning(rapidity, rolling=1e6) == pytest.approx(tau * V)
    assert returning(0.0) == 200.0
    assert returning(0.0, moving=0) == 0.0


@pytest.fixture(scope="module")
def alone():
    return Detector(50.0, forgetting_time_s=4.0, bounds={"sensors": "tactical-grade", "turbulence": "light"})


def _tolerance(**bounds):
    design = design_record()[0]
    given = Bounds.model_validate(bounds)
    return bound_kernels.coefficient_bounds(declared_in(given, AIRCRAFT), design, MASS, Y, np.zeros(4))


SIZE = np.array([abs(term.value) for term in AIRCRAFT.moments])
AXIS = np.array([("Cl", "Cm", "Cn").index(term.coefficient) for term in AIRCRAFT.moments])
CONSTANT = np.array([term.is_constant for term in AIRCRAFT.moments])
SLOPES = np.abs(coefficient_slopes(design_record()[0], np.zeros(3), Y, np.zeros(4)))
RATES = {"p": "ph", "q": "qh", "r": "rh"}


def _power(*signals):
    return np.array([sum(power for name, power in term.of if name in signals) for term in AIRCRAFT.moments])


def test_airspeed_scales_what_rates_multiply():
    rates = _power(*RATES.values())
    assert _tolerance(sensors={"V": {"scale_error": 0.02}}) == pytest.approx(0.02 * rates * SIZE)


@pytest.mark.parametrize("vane", ["alpha", "beta"])
def test_a_vane_scales_its_terms(vane):
    assert _tolerance(sensors={vane: {"scale_error": 0.02}}) == pytest.approx(0.02 * _power(vane) * SIZE)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_gyro_scales_its_own_axis_once_and_its_terms_elsewhere(axis):
    gyro = "pqr"[axis]
    scaled = _tolerance(sensors={gyro: {"scale_error": 0.02}})
    assert scaled == pytest.approx(0.02 * np.where(axis == AXIS, 1.0, _power(RATES[gyro])) * SIZE)
    length = (SPAN_M / 2, CHORD_M, SPAN_M / 2)[axis]
    offset = _tolerance(sensors={gyro: {"bias_deg_s": 0.3}})
    slope = SLOPES[AXIS, 2 + axis] * length / V
    assert offset == pytest.approx(np.where(CONSTANT, radians(0.3) * slope, 0.0))


def test_inertia_scales_every_term_by_the_worst_of_its_own_axes():
    nominal = np.abs([inertia_coefficients(MASS)])[0]
    share = (inertia_bounds(0.05, MASS) / nominal)[[2, 7, 11]].max()
    assert _tolerance(inertia=0.05) == pytest.approx(share * SIZE)


NOISY = {
    "p": {"noise_std_deg_s": 0.05}, "q": {"noise_std_deg_s": 0.2}, "r": {"noise_std_deg_s": 0.1},
    "alpha": {"noise_std_deg": 0.1}, "beta": {"quantum_deg": 0.2}, "V": {"noise_std_mps": 0.3},
    "qdyn": {"noise_std_pa": 4.0},
}  # fmt: skip
UNEVEN = {"sensors": NOISY, "constant_rad_s2": {"p": 0.02, "q": 0.01, "r": 0.05}, "deflection_deg": 0.5}


def set_up(alone, given):
    """Configure a detector by what a scenario declares."""
    declared = replace(Declared.of(Scenario.model_validate(given)), aircraft=AIRCRAFT)
    design = alone.frames[0]["prediction"]["design"]
    statistical.configure_statistics(alone.fdi, declared, design, MASS, LEVEL_FLIGHT, 50.0)


def as_set_up(bounds):
    """The detector before it is made ready for its first frame."""
    alone = Detector(50.0)
    set_up(alone, {**GIVEN, "fdi": {"statistical": {}, "bounds": bounds}})
    return alone.detector


def test_the_noise_of_what_the_model_is_made_of_is_white():
    """Each instrument's, through the slopes of f + G u, by squares; beside it that of the gusts they see."""
    given = Bounds.model_validate(UNEVEN)
    _, G, f_x, f_y = jacobian(design_record()[0], *LEVEL_FLIGHT)
    names = ("p", "q", "r", "alpha", "beta", "V", "qdyn")
    slopes = [*f_x.T, *f_y.T[:4]]  # y: alpha, beta, airspeed, dynamic pressure first
    jitter = np.zeros(3)
    for name, slope in zip(names, slopes, strict=True):
        noise, _, quantum = getattr(given.sensors, name).noise_bias_quantum
        jitter += slope**2 * (noise**2 + quantum**2 / 12.0)
    still, gusty = as_set_up(UNEVEN), as_set_up({**UNEVEN, "turbulence": "light"})
    assert still["noise"]["Q"] == pytest.approx(jitter)
    seen = gust_jitter(given.sensors, design_record()[0], SPAN_M)
    assert gusty["noise"]["Q"] == pytest.approx(jitter + seen**2)
    assert still["noise"]["eta_u"] == pytest.approx(radians(0.5) * np.abs(G).sum(axis=1))


def test_a_sense_is_kept_for_every_onset(alone):
    """A loss is a loss from whichever onset: what takes away counts against it."""
    for block in alone.blocks:
        n = int(block["n_h"])
        kinds = block["hypothesis"]["kind"][:n]
        signs = [{LOSS: -1.0, GROWING_LOSS: -1.0, LOSS_END: 1.0}.get(int(kind), 0.0) for kind in kinds]
        sense = by_onset(block, "supporting_correlation_sign")
        assert (sense[:, :n] == signs).all()
        assert not sense[:, n:].any()


@pytest.mark.parametrize("known", [0, 1])
def test_where_forces_are_weighed_their_noise_is_in_the_gust_that_follows_from_them(known):
    """In the velocity followed sqrt(1.5^2 + 0.5^2) sigma dt a frame; in the forces' flow, over the slope."""
    sensors = Bounds.model_validate(
        {"sensors": {"ay": {"noise_std_mps2": 0.3}, "az": {"noise_std_mps2": 0.2}}}
    )
    statistical, design, dt = np.zeros(1, statistical_dtype())[0], design_record()[0], 0.02
    forces = statistical["forces"]
    statistical["gust"]["config"]["span"] = SPAN_M
    forces["in_use"], forces["component"]["var_acc"] = known, (0.3**2, 0.2**2)
    forces["component"]["vane"][:, 1] = -6.0, 50.0
    gusts.add_gust_noise(statistical, SensorErrors(sensors.sensors), design, *LEVEL_FLIGHT[1:], dt)
    airspeed = LEVEL_FLIGHT[1][2]
    walked = known * np.sqrt(1.5**2 + 0.5**2) * np.array([0.2, 0.3]) * dt / airspeed
    added = bound_kernels.gust_noise(walked, design, *LEVEL_FLIGHT[1:], SPAN_M)
    assert np.sqrt(statistical["noise"]["Q"]) == pytest.approx(added, rel=0.02)
    by_force = known * np.array([0.2 / 50.0, 0.3 / 6.0])
    expected = bound_kernels.gust_noise(by_force, design, *LEVEL_FLIGHT[1:], SPAN_M)
    assert forces["gust_noise"] == pytest.approx(expected)


def test_where_no_vane_shows_it_pitch_reckons_with_a_gust_no_weaker_at_any_frequency():
    """Dryden's vertical velocity, its slope lagged [MIL-F-8785C], beside the drift that stands for it."""
    lag_m, omega = float(rotation_lengths(SPAN_M)[1]), np.geomspace(1e-3, 1e3, 400)
    assert lag_m == pytest.approx(4.0 * SPAN_M / pi)
    sigma, L, tau = 0.3048 * 7.4, 0.3048 * 1750.0, lag_m / V
    x = (L * omega / V) ** 2
    velocity = sigma**2 * L / (pi * V) * (1.0 + 3.0 * x) / (1.0 + x) ** 2
    rotation = (omega / V) ** 2 * velocity / (1.0 + (tau * omega) ** 2)
    intensity = Dryden("light").rotation_walk(SPAN_M)[1] * V
    stands_for_it = intensity * tau**2 / pi / (1.0 + (tau * omega) ** 2)
    assert (rotation <= stands_for_it * (1.0 + 1e-9)).all()
    assert rotation[-1] == pytest.approx(stands_for_it[-1], rel=1e-4)


def test_an_error_crosses_its_bound_within_a_quarter_of_a_surfaces_travel():
    """An error that goes with a surface from one end of its bound to the other in that quarter, in any number
    of frames: the pace covers each step, and no frame more than the whole way."""
    record = np.zeros(1, statistical_dtype()).view(np.recarray)[0]
    error_map = np.zeros(1, map_dtype(3)).view(np.recarray)[0]
    error_map.stop_lo, error_map.stop_hi = (-0.3, -0.2, -0.4), (0.1, 0.2, 0.4)
    record.noise.rate0 = 0.02
    rng = np.random.default_rng(1)
    steps = rng.dirichlet(np.ones(20)) * 0.25
    for step, way in zip(steps, rng.permutation(3)[[0] * 20], strict=True):
        u = error_map.u_old.copy()
        u[way] += step * (error_map.stop_hi - error_map.stop_lo)[way]
        statistical.update_eta_rate(record.noise, record.block, error_map, u)
        assert [block.eta_rate for block in record.block] == pytest.approx([0.02 + 2.0 * step / 0.25] * 3)
    statistical.update_eta_rate(record.noise, record.block, error_map, error_map.u_old.copy())
    assert record.block[0].eta_rate == pytest.approx(0.02)
    statistical.update_eta_rate(record.noise, record.block, error_map, error_map.stop_lo.copy())
    assert record.block[0].eta_rate == 2.0
