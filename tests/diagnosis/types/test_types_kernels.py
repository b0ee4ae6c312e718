"""What each fault type makes of one frame, and how the types left become a verdict: by hand, case by case."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernels import new_fdi, on, put_on

from beaver_ftc.diagnosis import types
from beaver_ftc.diagnosis.types import examination, registry, release
from beaver_ftc.diagnosis.types.registry import N_TYPES, TYPES
from beaver_ftc.diagnosis.types.table import growing_bias, loss, oscillation, rate_limit
from fault_kinds import (
    BIAS,
    CONSTANT_LOSS,
    DOWN,
    FLOAT,
    GROWING_BIAS,
    OSCILLATORY,
    SLOW,
    STUCK,
    UP,
    VARYING_LOSS,
)

LOW, HIGH, DT = -0.4, 0.5, 0.02
ALL = set(range(N_TYPES))


def new_surface(left=ALL, low=-0.01, high=0.01, command=0.0, **fields):
    """(fdi, surface 0) with only these types left; low to high: where it was in the judged frame, rad."""
    fdi = new_fdi()
    config, fdi["types"]["frame_index"] = fdi["types"]["config"], 10
    config["single_instant"], config["half_frames"], config["n_substeps"] = 1, 20, 1
    config["frames_per_block"], config["block_duration_s"] = 1, DT
    surface = fdi["types"]["surface"][0]
    actuator = surface["actuator"]
    actuator["stop_lo"], actuator["stop_hi"], actuator["approaches"], actuator["steps"] = LOW, HIGH, 0.5, 0.1
    actuator["reach_lo"], actuator["reach_hi"] = LOW, HIGH
    examination.restart_surface(surface)
    surface["sets"]["low"][BIAS], surface["sets"]["high"][BIAS] = -np.inf, np.inf
    judged = surface["judged"]
    judged["lo"], judged["hi"], judged["u"] = low, high, command
    surface["sets"]["excluded"] = [kind not in left for kind in range(N_TYPES)]
    put_on(surface, **fields)
    return fdi, surface


def judged(judge, fdi, surface, kind, *given):
    """Take in what a type's row makes of the judged frame."""
    types.intersect_set(surface, kind, on(judge, fdi, surface, kind, *given))


@pytest.mark.parametrize(
    ("low", "high", "command", "expected"),
    [
        (0.05, 0.07, 0.1, (0.5, 0.7)), (-0.07, -0.05, -0.1, (0.5, 0.7)), (0.05, 0.3, 0.1, (0.5, 1.0)),
        (-0.02, 0.05, 0.1, (0.0, 0.5)), (0.11, 0.2, 0.1, None), (-0.05, -0.02, 0.1, None),
    ],
)  # fmt: skip
def test_a_constant_loss_keeps_the_shares_that_explain_the_frame(low, high, command, expected):
    fdi, surface = new_surface(low=low, high=high, command=command)
    judged(loss.consistent_interval, fdi, surface, CONSTANT_LOSS, 5)
    judged(loss.varying_interval, fdi, surface, VARYING_LOSS, 5)
    assert (
        surface["sets"]["excluded"][CONSTANT_LOSS]
        == surface["sets"]["excluded"][VARYING_LOSS]
        == (expected is None)
    )
    if expected:
        assert (
            surface["sets"]["low"][CONSTANT_LOSS],
            surface["sets"]["high"][CONSTANT_LOSS],
        ) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("offsets", "excluded"),
    [
        ([0.1, 0.2, 0.3], 0), ([-0.1, -0.2, -0.3], 0), ([0.1, 0.2, 0.17], 1), ([-0.1, -0.2, -0.17], 1),
        ([0.1, -0.1], 1), ([0.1, 0.085], 0), ([-0.1, -0.085], 0), ([0.005, -0.005], 0),
    ],
)  # fmt: skip
def test_a_growing_bias_keeps_its_sign_and_never_shrinks(offsets, excluded):
    """Each known to within 0.01."""
    fdi, surface = new_surface()
    for offset in offsets:
        surface["judged"]["lo"], surface["judged"]["hi"] = (
            offset - 0.01,
            offset + 0.01,
        )
        judged(growing_bias.consistent_interval, fdi, surface, GROWING_BIAS, 5)
    assert surface["sets"]["excluded"][GROWING_BIAS] == excluded


@pytest.mark.parametrize(
    ("places", "ran"),
    [
        # a runaway's least pace is 0.05 rad a frame here, so 0.09 is as fast; each place is known to 0.01
        ([0.0, 0.1, 0.2], [0, 0]), ([0.0, 0.1, 0.2, 0.31], [0, 1]), ([0.0, -0.1, -0.2, -0.31], [1, 0]),
        ([0.0, 0.1, None, 0.31], [0, 1]),  # a frame that says nothing of this surface takes its time as well
        ([0.0, "well", 0.31], [0, 0]), ([0.25, 0.34, 0.43, 0.5, 0.5], [0, 0]), ([0.15, 0.5], [0, 1]),
    ],
)  # fmt: skip
def test_a_growing_bias_is_as_fast_as_a_runaway_only_where_that_is_certain(places, ran):
    fdi, surface = new_surface(runaway=0.05 / DT)
    for place in places:
        on(growing_bias.see_frame, fdi, surface, GROWING_BIAS, 5, place == "well")
        if place not in (None, "well"):
            surface["judged"]["lo"], surface["judged"]["hi"] = (
                place - 0.01,
                min(place + 0.01, HIGH),
            )
            judged(
                growing_bias.consistent_interval,
                fdi,
                surface,
                GROWING_BIAS,
                5,
            )
    assert surface["growing_bias"]["has_run"].tolist() == ran


def slow_run(places, commands=(0.0, 0.0), whole=1, frames=None, slowest_step=0.0):
    fdi, surface = new_surface(slowest_step=slowest_step)
    surface["actuator"]["near"] = 2.0 * slowest_step
    fdi["types"]["config"]["single_instant"] = whole
    surface["commands"]["cmd_min"], surface["commands"]["cmd_max"] = commands[0], commands[1]
    for k, place in enumerate(places):
        surface["judged"]["lo"], surface["judged"]["hi"] = (
            place - 0.01,
            place + 0.01,
        )
        judged(
            rate_limit.consistent_interval,
            fdi,
            surface,
            SLOW,
            (frames or range(99))[k],
        )
    return surface["sets"]["excluded"][SLOW]


def test_a_slow_surface_never_moves_away_from_its_command():
    assert not slow_run([0.3, 0.25, 0.2])
    assert slow_run([0.2, 0.25])
    for side in (1, -1):
        assert not slow_run([side * 0.2, side * 0.215])  # within what is known of it
        assert not slow_run([side * 0.1, side * 0.12])  # the intervals touch
    assert slow_run([-0.2, -0.25])
    assert not slow_run([-0.3, -0.2])
    assert not slow_run([0.2, 0.25], commands=(0.0, 0.3))  # it was told to
    assert not slow_run([0.2, 0.25], frames=[3, 5])  # a frame between them is not known
    assert slow_run([0.25, 0.2, 0.23])
    assert not slow_run([0.2, -0.2, -0.15])


@pytest.mark.parametrize("side", [1, -1])
def test_a_slow_surface_that_stands_off_its_command_comes_nearer_by_its_least_rate(side):
    """0.02 rad is known of where it is: at 0.003 rad a frame that shows in the ninth frame."""
    still = [side * 0.3] * 9
    assert not slow_run(still[:8], slowest_step=0.003)
    assert slow_run(still, slowest_step=0.003)
    assert not slow_run(still)
    creeping = [side * (0.3 - 0.003 * k) for k in range(20)]
    assert not slow_run(creeping, slowest_step=0.003)
    assert slow_run(creeping, slowest_step=0.0045)
    arrived = [side * 0.02] * 40  # its lag takes half of what is left: a step's length off, it may stay
    assert not slow_run(arrived, slowest_step=0.01)


def swung(signs, half_frames=20):
    fdi, surface = new_surface()
    fdi["types"]["config"]["half_frames"] = half_frames
    for frame, sign in enumerate(signs):
        surface["judged"]["lo"], surface["judged"]["hi"] = (
            0.1 * sign - 0.02,
            0.1 * sign + 0.02,
        )
        on(oscillation.see_frame, fdi, surface, OSCILLATORY, frame, False)
        judged(
            oscillation.consistent_interval,
            fdi,
            surface,
            OSCILLATORY,
            frame,
        )
    return fdi, surface


def test_an_oscillation_is_counted_by_half_cycles():
    fdi, surface = swung([1] * 5 + [-1] * 5 + [1] * 5 + [-1])
    swing = surface["oscillatory"]
    assert swing["n_half"] == 3
    assert (swing["first_end"], swing["last_end"]) == (5, 15)
    assert registry.has_shown(OSCILLATORY, surface, OSCILLATORY)
    assert not registry.has_shown(OSCILLATORY, swung([1] * 5 + [-1] * 5 + [1])[1], OSCILLATORY)
    assert oscillation.estimate_frequency(fdi, 0, OSCILLATORY) == pytest.approx(2 * np.pi / (10 * DT))
    # the first half-cycle is cut off and does not count: ten frames, each 0.1 rad off; its first frame is
    # summed before the half-cycle before it is seen to have ended
    assert swing["square_past"] == pytest.approx(10 * 0.01)


@pytest.mark.parametrize(("length", "ways"), [(1, (0.0, 0.02, 0.1)), (5, (0.0, 0.0, 0.08))])
def test_a_runaway_has_gone_at_least_its_way(length, ways):
    fdi, surface = new_surface(k_first=3, first_lo=0.1, first_hi=0.2, runaway=1.0)
    fdi["types"]["config"]["frames_per_block"] = length

    def between(kind, frame):
        return registry.deflection_range(kind, fdi["types"]["config"], surface, kind, frame)

    for frame, way in zip((3, 4, 8), ways, strict=True):
        assert between(UP, frame) == pytest.approx((0.1 + way, HIGH))
        assert between(DOWN, frame) == pytest.approx((LOW, 0.2 - way))
    assert between(UP, 99) == (HIGH, HIGH)
    assert between(DOWN, 99) == (LOW, LOW)
    surface["evidence"]["k_first"] = -1
    assert between(UP, 9) == between(DOWN, 9) == (LOW, HIGH)


@pytest.mark.parametrize(
    ("kind", "inside", "outside"),
    [
        (STUCK, (0.1, 0.2), (0.31, 0.4)), (FLOAT, (-0.1, 0.1), (0.01, 0.1)),
        (UP, (0.1, 0.2), (0.0, 0.13)), (DOWN, (0.1, 0.2), (0.17, 0.3)),
    ],
)  # fmt: skip
def test_what_holds_a_surface_is_excluded_where_it_is_not(kind, inside, outside):
    for (low, high), excluded in ((inside, 0), (outside, 1)):
        fdi, surface = new_surface(low=low, high=high, k_first=3, first_lo=0.1, first_hi=0.2, runaway=1.0)
        surface["sets"]["low"][STUCK], surface["sets"]["high"][STUCK] = 0.05, 0.3
        on(examination.judge_types, fdi, surface, 5)
        assert surface["sets"]["excluded"][kind] == excluded
    if kind == STUCK:
        assert TYPES[kind].estimate_parameter(fdi, 0, kind) == pytest.approx(0.175)


@given(st.lists(st.floats(0.5, 2.0), min_size=1, max_size=9), st.floats(-0.4, 0.5), st.floats(-0.4, 0.5))
def test_what_a_frame_shows_of_a_return_is_weighted_by_the_effectiveness_then(G, held, order):
    """The innovation's own mean, sum G a / sum G, lies within the room; a return agrees with it."""
    G = np.array(G)
    fdi, surface = new_surface(low=-1.0, high=1.0)
    fdi["types"]["config"]["returns_lagged"], fdi["types"]["config"]["n_substeps"] = 1, G.size
    surface["commands"]["history"][1] = order
    release.set_return(surface["release"], release.LATER, STUCK, held, held)
    path = [held]
    for _ in range(G.size - 1):
        path.append(path[-1] + np.clip(0.5 * (order - path[-1]), -0.1, 0.1))
    shown = np.sum(G * path) / np.sum(G)
    surface["judged"]["kappa"] = 0.25 * (G.max() - G.min()) / G.mean()
    mean, _, room = on(release.simulate_return, fdi, surface, held, 1.0)
    assert abs(shown - mean) <= room + 1e-15
    judged = surface["judged"]
    judged["u"], judged["lo"], judged["hi"] = 9.0, shown - 1e-12, shown + 1e-12
    assert on(release.keep_returns, fdi, surface, STUCK)
