"""The derived gains: margins against closed forms and against a loop simulated in time."""

import numpy as np
import pytest
from scipy.optimize import brentq

from beaver_ftc.control.laws.loop_design import (
    RATIO,
    Loop,
    candidates,
    corrections,
    fastest,
    frequencies,
    lead_of,
    margins,
    noise_speed,
    open_loop,
)

IDEAL = Loop(0.01, 1.0, 1.0, 1.0)
SERVO = Loop(0.01, 1.0, 1.0 - np.exp(-0.2), lead_of(1.0 - np.exp(-0.2)))
SUBSTEPS = Loop(0.05, 0.2, 1.0, 1.0)
LOOPS = pytest.mark.parametrize("loop", [IDEAL, SERVO, SUBSTEPS], ids=["ideal", "servo", "substeps"])


def grid(loop):
    omega = frequencies(loop.dt_s)
    return omega, np.exp(1j * omega * loop.dt_s)


def simulated(loop, s, scale, frames):
    """Surface (times G) of the loop in time, its gain off by `scale`; from the law's equations as written."""
    dt, share = loop.dt_s, loop.share
    pull, learn = corrections(s, dt)
    x, rate, disturbance, position, before, command = 1e-3, 0.0, 0.0, 0.0, 0.0, 0.0
    positions = []
    for _ in range(frames):
        rate += dt * (share * before + (1 - share) * position + disturbance)
        missed = x - rate
        rate += pull * missed
        disturbance += learn * missed
        ahead = rate + share * dt * (position + disturbance)
        command = position + loop.lead * (-s * ahead - disturbance - position)
        before, position = position, position + loop.approach * (command - position)
        x += dt * scale * (share * before + (1 - share) * position)
        positions.append(position)
    return np.array(positions)


@LOOPS
def test_the_gain_margin_is_where_the_loop_in_time_begins_to_grow(loop):
    s = candidates(loop, 6.0, 45.0)[0][-1]
    upper, _, _ = margins(open_loop(loop, s, grid(loop)[1]))
    for factor, grows in ((0.97, False), (1.03, True)):
        swing = np.abs(simulated(loop, s, factor * 10.0 ** (upper / 20.0), 900))
        assert (swing[-100:].max() > swing[100:200].max()) == grows


def test_a_gyro_delays_by_its_delay_and_keeps_what_its_lag_keeps():
    """Against the recursion of the lag, run until it has settled."""
    dt, late, keep = IDEAL.dt_s, 3, 0.7
    gyro = Loop(dt, 1.0, 1.0, 1.0, late * dt, keep)
    for omega in (2.0, 20.0, 200.0):
        z = np.exp(1j * omega * dt)
        shown, moved = 0.0, z ** np.arange(-late, 400.0)
        for truth in moved[:400]:  # of `late` frames ago
            shown = keep * shown + (1.0 - keep) * truth
        expected = open_loop(IDEAL, 5.0, np.array([z]))[0] * shown / z**399
        assert open_loop(gyro, 5.0, np.array([z]))[0] == pytest.approx(expected, rel=1e-9)


def crossings(of, grid):
    """Roots of a function along the grid."""
    values = of(grid)
    at = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    return [brentq(of, grid[i], grid[i + 1], xtol=1e-12) for i in at]


@pytest.mark.parametrize("K", [0.2, 1.0, 30.0])
@pytest.mark.parametrize("integrators", [1, 2, 3])
def test_margins_of_integrators_with_lead_and_delay(integrators, K):
    """L = K (1 + s)^m exp(-tau s) / s^n, its phase m atan w - tau w - 90 n deg, whatever the turns."""
    n, m, tau = integrators, integrators - 1, 0.02
    omega = np.geomspace(0.01, 250.0, 40_000)

    def level(w):
        return 20.0 * np.log10(K * (1.0 + w * w) ** (m / 2) / w**n)

    def phase(w):
        return np.degrees(m * np.arctan(w) - tau * w) - 90.0 * n

    def past_half_a_turn(w):
        return phase(w) + 180.0

    def past_one_and_a_half(w):
        return phase(w) + 540.0

    turns = crossings(past_half_a_turn, omega) + crossings(past_one_and_a_half, omega)
    gains = [level(w) for w in turns]
    around = [abs((phase(w) + 180.0 + 180.0) % 360.0 - 180.0) for w in crossings(level, omega)]
    upper, lower, left = margins(K * (1.0 + 1j * omega) ** m * np.exp(-1j * omega * tau) / (1j * omega) ** n)
    assert upper == pytest.approx(min([-g for g in gains if g < 0.0], default=np.inf), abs=1e-3)
    assert lower == pytest.approx(min([g for g in gains if g > 0.0], default=np.inf), abs=1e-3)
    assert left == pytest.approx(min(around), abs=1e-2)


@pytest.mark.parametrize(("observer", "dt"), [(6.5, 0.01), (40.0, 0.05)])
def test_both_poles_of_the_observer_are_where_they_were_asked_for(observer, dt):
    """Of its errors in rate and disturbance from frame to frame, corrected by what it missed."""
    pull, learn = corrections(observer / RATIO, dt)
    ahead = np.array([[1.0, dt], [0.0, 1.0]])
    errors = (np.eye(2) - np.outer([pull, learn], [1.0, 0.0])) @ ahead
    pole = np.exp(-observer * dt)
    assert np.trace(errors) == pytest.approx(2.0 * pole)
    assert np.linalg.det(errors) == pytest.approx(pole**2)


@pytest.mark.parametrize("asked", [(6.0, -np.inf), (-np.inf, 45.0)])
def test_each_margin_bounds_the_loop_with_its_reserve(asked):
    s = candidates(SERVO, *asked)[0]
    finer = candidates(SERVO, asked[0] + 0.5, asked[1] + 2.0)[0]
    assert 3 < len(finer) <= len(s) < 40
    z = grid(SERVO)[1]
    ahead = np.geomspace(0.5, 0.5 / 0.015, 40)[len(s)]
    for value, within in ((s[-1], True), (ahead, False)):
        upper, lower, phase = margins(open_loop(SERVO, value, z))
        assert (min(upper, lower) >= asked[0] + 0.5 and phase >= asked[1] + 2.0) == within


def test_noise_limits_the_loop_where_the_surface_is_weak():
    noise, speed = 4e-4, 0.25
    strong, weak = (fastest(SERVO, (6.0, 45.0), noise, G, speed) for G in (-10.0, -3.0))
    assert weak < strong < 1.001 * candidates(SERVO, 6.0, 45.0)[0][-1]
    omega, z = grid(SERVO)
    assert noise_speed(SERVO, weak, z, omega) * noise / 3.0 == pytest.approx(speed, rel=0.05)
