"""The derived gains: margins against closed forms and against a loop simulated in time."""

from math import asin, degrees, pi

import numpy as np
import pytest

from beaver_ftc.control.laws.gains import (
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


def simulated(loop, s, scale, frames, noise=None, seed=0):
    """Surface (times G) of the loop in time, its gain off by `scale`; from the law's equations as written."""
    dt, share = loop.dt_s, loop.share
    pull, learn = corrections(RATIO * s, dt)
    rng = np.random.default_rng(seed)
    x, rate, disturbance, position, before, command = 1e-3, 0.0, 0.0, 0.0, 0.0, 0.0
    positions = []
    for _ in range(frames):
        measured = x + (noise * rng.standard_normal() if noise else 0.0)
        rate += dt * (share * before + (1 - share) * position + disturbance)
        missed = measured - rate
        rate += pull * missed
        disturbance += learn * missed
        ahead = rate + share * dt * (position + disturbance)
        command = position + loop.lead * (-s * ahead - disturbance - position)
        before, position = position, position + loop.approach * (command - position)
        x += dt * scale * (share * before + (1 - share) * position)
        positions.append(position)
    return np.array(positions)


def test_margins_of_an_integrator_with_delay():
    """L = K dt z^-1 / (z - 1) turns by 180 deg where w dt = pi / 3 and |L| = K dt; and |L| = 1 at
    2 asin(K dt / 2)."""
    dt, K = 0.01, 30.0
    z = np.exp(1j * np.geomspace(0.1, 0.999 * pi / dt, 4000) * dt)
    upper, lower, phase = margins(K * dt / z / (z - 1.0))
    assert upper == pytest.approx(-20.0 * np.log10(K * dt), abs=0.01)
    assert lower == np.inf
    assert phase == pytest.approx(90.0 - 1.5 * degrees(2.0 * asin(K * dt / 2.0)), abs=0.1)


@LOOPS
def test_the_gain_margin_is_where_the_loop_in_time_begins_to_grow(loop):
    s = candidates(loop, 6.0, 45.0)[0][-1]
    upper, _, _ = margins(open_loop(loop, s, grid(loop)[1]))
    for factor, grows in ((0.97, False), (1.03, True)):
        swing = np.abs(simulated(loop, s, factor * 10.0 ** (upper / 20.0), 900))
        assert (swing[-100:].max() > swing[100:200].max()) == grows


@LOOPS
def test_the_margins_asked_for_are_left(loop):
    for asked in ((6.0, 45.0), (10.0, 50.0)):
        s = candidates(loop, *asked)[0][-1]
        upper, lower, phase = margins(open_loop(loop, s, grid(loop)[1]))
        assert min(upper, lower) >= asked[0]
        assert phase >= asked[1]


def test_a_delayed_gyro_costs_bandwidth():
    late = Loop(0.01, 1.0, 1.0, 1.0, delay_s=0.05)
    assert candidates(late, 6.0, 45.0)[0][-1] < 0.5 * candidates(IDEAL, 6.0, 45.0)[0][-1]


@LOOPS
def test_the_noise_speed_is_that_of_the_loop_in_time(loop):
    s, noise = 5.0, 1e-3
    omega, z = grid(loop)
    moved = np.diff(simulated(loop, s, 1.0, 20_000, noise)[1000:]) / loop.dt_s
    assert noise_speed(loop, s, z, omega) * noise == pytest.approx(moved.std(), rel=0.05)


def test_noise_limits_the_loop_where_the_surface_is_weak():
    noise, speed = 4e-4, 0.25
    strong, weak = (fastest(SERVO, (6.0, 45.0), noise, G, speed) for G in (-10.0, -3.0))
    assert weak < strong < 1.001 * candidates(SERVO, 6.0, 45.0)[0][-1]
    omega, z = grid(SERVO)
    assert noise_speed(SERVO, weak, z, omega) * noise / 3.0 == pytest.approx(speed, rel=0.05)


def test_a_lead_never_overshoots():
    for approach in (0.05, 0.2, 0.9, 1.0):
        assert 1.0 <= lead_of(approach) <= 1.0 / approach
