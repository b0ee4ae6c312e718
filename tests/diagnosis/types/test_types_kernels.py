"""What each fault type makes of one frame, and how the types left become a verdict: by hand, case by case."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernels import new_fdi, on, put, put_on

from beaver_ftc.diagnosis import types
from beaver_ftc.diagnosis.model_prediction import prediction_dtype
from beaver_ftc.diagnosis.state import LATERAL_GROUP, PITCH_GROUP, layout_dtype
from beaver_ftc.diagnosis.types import registry
from beaver_ftc.diagnosis.types.registry import N_TYPES, TYPES
from beaver_ftc.diagnosis.types.table import commanded_surface, held_surface
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
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
    put(fdi, whole=1, half_frames=20, instants=1)
    (
        fdi["types"]["config"]["frames_per_block"],
        fdi["types"]["config"]["block_duration_s"],
        fdi["types"]["frame_index"],
    ) = (
        1,
        DT,
        10,
    )
    surface = fdi["types"]["surface"][0]
    (
        surface["actuator"]["stop_lo"],
        surface["actuator"]["stop_hi"],
        surface["actuator"]["approach_share"],
        surface["actuator"]["step"],
    ) = LOW, HIGH, 0.5, 0.1
    surface["actuator"]["reach_lo"], surface["actuator"]["reach_hi"] = (
        min(LOW, 0.0),
        max(HIGH, 0.0),
    )
    registry.restart_surface(surface)
    surface["sets"]["low"][BIAS], surface["sets"]["high"][BIAS] = -np.inf, np.inf
    (
        surface["judged"]["lo"],
        surface["judged"]["hi"],
        surface["judged"]["u"],
    ) = low, high, command
    surface["sets"]["excluded"] = [kind not in left for kind in range(N_TYPES)]
    put_on(surface, **fields)
    return fdi, surface


def judged(judge, fdi, surface, kind, *given):
    """Take in what a type's row makes of the judged frame."""
    types.intersect_set(surface, kind, on(judge, fdi, surface, kind, *given))


def restore_sets(surface):
    """Take in what a jam was before the earliest release still possible."""
    types.put_set(surface, STUCK, held_surface.stuck_after(surface, STUCK))


def test_what_is_known_of_a_surface_as_it_begins():
    _, surface = new_surface(left=())
    (
        surface["evidence"]["n_anomalous"],
        surface["evidence"]["n_rest"],
        surface["evidence"]["k_first"],
    ) = (
        3,
        4,
        5,
    )
    surface["last"]["lo"], surface["last"]["hi"] = 0.1, 0.2
    registry.restart_surface(surface)
    assert not surface["sets"]["excluded"].any()
    assert (
        surface["evidence"]["n_anomalous"],
        surface["evidence"]["n_rest"],
        surface["evidence"]["k_first"],
    ) == (0, 0, -1)
    assert (surface["last"]["lo"], surface["last"]["hi"]) == (
        LOW,
        HIGH,
    )
    assert (surface["sets"]["low"][STUCK], surface["sets"]["high"][STUCK]) == (LOW, HIGH)
    assert (
        surface["sets"]["low"][CONSTANT_LOSS],
        surface["sets"]["high"][CONSTANT_LOSS],
    ) == (
        0.0,
        1.0,
    )
    assert (surface["sets"]["low"][BIAS], surface["sets"]["high"][BIAS]) == (
        -np.inf,
        np.inf,
    )
    assert surface["rate_limit"]["k_last"] == -2
    assert surface["oscillatory"]["n_half"] == 0


@pytest.mark.parametrize(
    ("low", "high", "command", "expected"),
    [
        (0.05, 0.07, 0.1, (0.5, 0.7)), (-0.07, -0.05, -0.1, (0.5, 0.7)), (0.05, 0.3, 0.1, (0.5, 1.0)),
        (-0.02, 0.05, 0.1, (0.0, 0.5)), (0.11, 0.2, 0.1, None), (-0.05, -0.02, 0.1, None),
    ],
)  # fmt: skip
def test_a_constant_loss_keeps_the_shares_that_explain_the_frame(low, high, command, expected):
    fdi, surface = new_surface(low=low, high=high, command=command)
    judged(commanded_surface.loss_interval, fdi, surface, CONSTANT_LOSS, 5)
    judged(commanded_surface.varying_loss_set, fdi, surface, VARYING_LOSS, 5)
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


def test_over_a_block_in_which_the_command_swings_any_mean_may_be_a_varying_loss():
    for least, greatest, excluded in ((-0.1, 0.2, 0), (0.0, 0.2, 1), (-0.1, 0.0, 1)):
        fdi, surface = new_surface(low=0.11, high=0.2, command=0.1)
        fdi["types"]["config"]["frames_per_block"], surface["commands"]["u_min"][1] = 5, least
        surface["commands"]["u_max"][1] = greatest
        judged(commanded_surface.varying_loss_set, fdi, surface, VARYING_LOSS, 5)
        assert surface["sets"]["excluded"][VARYING_LOSS] == excluded


def test_sets_shrink_to_what_is_left_and_end_when_nothing_is():
    _, surface = new_surface()
    types.intersect_set(surface, STUCK, (-0.1, 0.2))
    types.intersect_set(surface, STUCK, (0.0, 0.9))
    assert (surface["sets"]["low"][STUCK], surface["sets"]["high"][STUCK]) == (0.0, 0.2)
    assert types.set_middle(surface, STUCK) == 0.1
    assert not surface["sets"]["excluded"][STUCK]
    types.intersect_set(surface, STUCK, (0.2, 0.9))  # one point is not nothing
    assert not surface["sets"]["excluded"][STUCK]
    types.intersect_set(surface, STUCK, (0.21, 0.9))
    assert surface["sets"]["excluded"][STUCK]


@pytest.mark.parametrize(
    ("interval", "stands"),
    [((0.15, 0.05), False), ((0.4, 0.5), False), (types.EMPTY_SET, True)],
    ids=["axes disagree", "elsewhere", "refuted otherwise"],
)
def test_a_surface_stands_nowhere_once_where_it_was_contradicts_itself(interval, stands):
    _, surface = new_surface()
    types.put_set(surface, STUCK, (0.0, 0.2))
    types.intersect_set(surface, STUCK, interval)
    assert surface["sets"]["excluded"][STUCK]
    for place in (-0.1, 0.02, 0.15, 0.19, 0.45):
        surface["judged"]["lo"], surface["judged"]["hi"] = (
            place - 1e-3,
            place + 1e-3,
        )
        assert registry.agrees_at_rest(surface) == (stands and 0.0 <= place <= 0.2), place


def test_an_offset_is_unlimited_at_a_stop():
    fdi, surface = new_surface(low=0.1, high=0.15, command=0.3)
    assert on(commanded_surface.bias_of_frame, fdi, surface, BIAS) == pytest.approx((-0.2, -0.15))
    surface["judged"]["hi"] = HIGH
    assert on(commanded_surface.bias_of_frame, fdi, surface, BIAS) == (pytest.approx(-0.2), np.inf)
    surface["judged"]["lo"] = LOW
    assert on(commanded_surface.bias_of_frame, fdi, surface, BIAS)[0] == -np.inf


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.09), (0.51, 0.6)])
def test_no_offset_takes_a_surface_beyond_its_stops(low, high):
    """A loss does, where neutral is out of reach."""
    fdi, surface = new_surface(low=low, high=high, command=0.2, stop_lo=0.1)
    for kind, judge in (
        (BIAS, commanded_surface.bias_of_frame),
        (GROWING_BIAS, commanded_surface.update_growing),
    ):
        judged(judge, fdi, surface, kind, 5)
        assert surface["sets"]["excluded"][kind]


@pytest.mark.parametrize("length", [1, 5])  # frames; one may have several instants
def test_within_what_is_seen_at_once_a_stop_may_have_been_met_at_its_furthest_order(length):
    fdi, surface = new_surface(low=0.2, high=0.25, command=0.1)
    fdi["types"]["config"]["frames_per_block"] = length
    surface["commands"]["u_min"][1], surface["commands"]["u_max"][1] = (
        -0.4,
        0.34,
    )
    # the lowest it was: 0.2 - (0.1 + 0.4) = -0.3; the highest: 0.25 + 0.24 = 0.49, below 0.5
    assert on(commanded_surface.bias_of_frame, fdi, surface, BIAS) == pytest.approx((0.1, 0.15))
    surface["commands"]["u_max"][1] = 0.36
    assert on(commanded_surface.bias_of_frame, fdi, surface, BIAS)[1] == np.inf
    surface["commands"]["u_min"][1] = -0.51
    assert on(commanded_surface.bias_of_frame, fdi, surface, BIAS)[0] == -np.inf


def test_a_bias_keeps_the_offsets_that_explain_every_frame():
    fdi, surface = new_surface(low=0.1, high=0.15, command=0.3)
    judged(commanded_surface.bias_of_frame, fdi, surface, BIAS, 5)
    (
        surface["judged"]["lo"],
        surface["judged"]["hi"],
        surface["judged"]["u"],
    ) = 0.23, 0.4, 0.4
    judged(commanded_surface.bias_of_frame, fdi, surface, BIAS, 6)
    assert (surface["sets"]["low"][BIAS], surface["sets"]["high"][BIAS]) == pytest.approx((-0.17, -0.15))
    surface["last"]["u"] = 0.05
    assert on(commanded_surface.bias_range, fdi, surface, BIAS) == pytest.approx((-0.12, -0.1))
    commands, surface["last"]["u"] = surface["commands"], -0.2
    commands["u_min"][0], commands["u_max"][0] = (
        -0.24,
        -0.1,
    )  # where it was meanwhile: to -0.41 and to -0.25
    assert on(commanded_surface.bias_range, fdi, surface, BIAS) == pytest.approx((LOW, -0.35))
    commands["u_min"][0] = commands["u_max"][0] = 0.0
    assert commanded_surface.bias_interval(fdi, 0, BIAS) == pytest.approx((-0.17, -0.15))
    assert types.middle_estimate(fdi, 0, BIAS) == pytest.approx(-0.16)
    surface["sets"]["high"][BIAS] = np.inf
    assert commanded_surface.bias_interval(fdi, 0, BIAS) is None


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
        judged(commanded_surface.update_growing, fdi, surface, GROWING_BIAS, 5)
    assert surface["sets"]["excluded"][GROWING_BIAS] == excluded


def test_at_a_stop_a_growing_bias_says_nothing():
    for low, high in ((0.45, 0.5), (-0.4, -0.35)):
        fdi, surface = new_surface(low=low, high=high)
        judged(commanded_surface.update_growing, fdi, surface, GROWING_BIAS, 5)
        assert surface["growing_bias"]["up"] == surface["growing_bias"]["down"] == 0.0


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
        on(commanded_surface.widen_offset, fdi, surface, GROWING_BIAS)
        if place == "well":
            on(commanded_surface.forget_growing, fdi, surface, GROWING_BIAS)
        elif place is not None:
            surface["judged"]["lo"], surface["judged"]["hi"] = (
                place - 0.01,
                min(place + 0.01, HIGH),
            )
            judged(
                commanded_surface.update_growing,
                fdi,
                surface,
                GROWING_BIAS,
                5,
            )
    assert surface["growing_bias"]["has_run"].tolist() == ran


def test_of_several_instants_a_mean_may_be_that_of_the_last():
    fdi, surface = new_surface(runaway=0.05 / DT)
    fdi["types"]["config"]["single_instant"] = 0
    for place, ran in ((0.0, 0), (0.19, 0), (0.31, 1)):  # beyond 0.01 + 3 * 0.09 after two frames
        on(commanded_surface.widen_offset, fdi, surface, GROWING_BIAS)
        surface["judged"]["lo"], surface["judged"]["hi"] = (
            place - 0.01,
            place + 0.01,
        )
        judged(commanded_surface.update_growing, fdi, surface, GROWING_BIAS, 5)
        assert surface["growing_bias"]["has_run"][1] == ran


def slow_run(places, commands=(0.0, 0.0), whole=1, frames=None, slowest_step=0.0):
    fdi, surface = new_surface(slowest_step=slowest_step)
    fdi["types"]["config"]["single_instant"] = whole
    surface["commands"]["cmd_min"], surface["commands"]["cmd_max"] = commands[0], commands[1]
    for k, place in enumerate(places):
        surface["judged"]["lo"], surface["judged"]["hi"] = (
            place - 0.01,
            place + 0.01,
        )
        judged(
            commanded_surface.update_creep,
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


def test_which_side_of_its_orders_a_surface_stands_on():
    fdi, surface = new_surface(low=0.1, high=0.2)
    commands = surface["commands"]
    for newest, whole in ((1, 0), (2, 1)):
        fdi["types"]["config"]["single_instant"] = whole
        for low, high, side in (
            (-0.1, 0.05, 1), (0.25, 0.3, -1), (0.05, 0.15, 0), (0.15, 0.3, 0), (-0.1, 0.1, 0), (0.2, 0.3, 0),
        ):  # fmt: skip
            commands["cmd_min"], commands["cmd_max"] = 9.0, -9.0
            commands["cmd_min"][newest], commands["cmd_max"][newest] = low, high
            commands["cmd_min"][2] = min(commands["cmd_min"][2], low)
            commands["cmd_max"][2] = max(commands["cmd_max"][2], high)
            assert on(commanded_surface.side_of_commands, fdi, surface) == side


def swung(signs, half_frames=20):
    fdi, surface = new_surface()
    fdi["types"]["config"]["half_frames"] = half_frames
    for frame, sign in enumerate(signs):
        fdi["types"]["frame_index"] = frame + 1
        surface["judged"]["lo"], surface["judged"]["hi"] = (
            0.1 * sign - 0.02,
            0.1 * sign + 0.02,
        )
        on(commanded_surface.add_square, fdi, surface, OSCILLATORY)
        judged(
            commanded_surface.update_swing,
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
    assert commanded_surface.swing_has_shown(surface)
    assert not commanded_surface.swing_has_shown(swung([1] * 5 + [-1] * 5 + [1])[1])
    assert commanded_surface.swing_frequency(fdi, 0, OSCILLATORY) == pytest.approx(2 * np.pi / (10 * DT))
    # the first half-cycle is cut off and does not count: ten frames, each 0.1 rad off; its first frame is
    # summed before the half-cycle before it is seen to have ended
    assert swing["square_past"] == pytest.approx(10 * 0.01)


def test_the_amplitude_is_that_of_the_mean_square():
    fdi, _ = swung([1] * 5 + [-1] * 5 + [1] * 5 + [-1])
    assert commanded_surface.swing_amplitude(fdi, 0, OSCILLATORY) == pytest.approx(np.sqrt(2.0 * 0.01))


def test_a_sign_that_stays_for_longer_than_the_slowest_half_cycle_is_none():
    assert not swung([1] * 21)[1]["sets"]["excluded"][OSCILLATORY]
    assert swung([1] * 22)[1]["sets"]["excluded"][OSCILLATORY]
    assert swung([-1] * 22)[1]["sets"]["excluded"][OSCILLATORY]
    assert not swung([1] * 15 + [0] + [1] * 15)[1]["sets"]["excluded"][OSCILLATORY]
    fdi, surface = swung([1] * 20)
    on(commanded_surface.restart_sign, fdi, surface, OSCILLATORY)
    assert surface["oscillatory"]["since"] == 20


@pytest.mark.parametrize(("length", "ways"), [(1, (0.0, 0.02, 0.1)), (5, (0.0, 0.0, 0.08))])
def test_a_runaway_has_gone_at_least_its_way(length, ways):
    fdi, surface = new_surface(
        k_first=3,
        first_lo=0.1,
        first_hi=0.2,
        runaway=1.0,
    )
    fdi["types"]["config"]["frames_per_block"] = length
    for frame, way in zip((3, 4, 8), ways, strict=True):
        assert on(held_surface.runaway_distance, fdi, surface, frame) == pytest.approx(way)
        assert on(held_surface.runaway_interval, fdi, surface, frame, 1)[0] == pytest.approx(0.1 + way)
        assert on(held_surface.runaway_interval, fdi, surface, frame, -1)[1] == pytest.approx(0.2 - way)
    assert on(held_surface.runaway_interval, fdi, surface, 99, 1) == (HIGH, HIGH)
    assert on(held_surface.runaway_interval, fdi, surface, 99, -1) == (LOW, LOW)
    surface["evidence"]["k_first"] = -1
    assert on(held_surface.runaway_interval, fdi, surface, 9, 1) == (LOW, HIGH)


@pytest.mark.parametrize(
    ("kind", "inside", "outside"),
    [
        (STUCK, (0.1, 0.2), (0.31, 0.4)), (FLOAT, (-0.1, 0.1), (0.01, 0.1)),
        (UP, (0.1, 0.2), (0.0, 0.13)), (DOWN, (0.1, 0.2), (0.17, 0.3)),
    ],
)  # fmt: skip
def test_what_holds_a_surface_is_excluded_where_it_is_not(kind, inside, outside):
    for (low, high), excluded in ((inside, 0), (outside, 1)):
        fdi, surface = new_surface(
            low=low,
            high=high,
            k_first=3,
            first_lo=0.1,
            first_hi=0.2,
        )
        surface["actuator"]["runaway"] = 1.0
        surface["sets"]["low"][STUCK], surface["sets"]["high"][STUCK] = 0.05, 0.3
        judged(TYPES[kind].consistent_interval, fdi, surface, kind, 5)
        assert surface["sets"]["excluded"][kind] == excluded
    if kind == STUCK:
        assert TYPES[kind].estimate_parameter(fdi, 0, kind) == pytest.approx(0.175)


@pytest.mark.parametrize(
    ("whole", "hides", "excluded"),
    [(1, (0, 0), 1), (0, (0, 0), 1), (1, (0, 1), 1), (0, (0, 1), 0), (0, (1, 0), 1)],
)
def test_at_a_stop_the_mean_of_a_quick_swing_keeps_its_sign(whole, hides, excluded):
    fdi, surface = new_surface(low=-0.2, high=-0.1, command=0.1)  # below its command all the time
    (
        fdi["types"]["config"]["single_instant"],
        surface["judged"]["hides"],
    ) = (
        whole,
        hides,
    )
    for frame in range(30):
        judged(
            commanded_surface.update_swing,
            fdi,
            surface,
            OSCILLATORY,
            frame,
        )
    assert surface["sets"]["excluded"][OSCILLATORY] == excluded


@pytest.mark.parametrize(("least", "greatest", "hides"), [
    (-0.3, 0.4, [0, 0]), (-0.31, 0.3, [1, 0]), (0.0, 0.41, [0, 1]), (-0.35, 0.45, [1, 1]), (LOW, LOW, [1, 0]),
])  # fmt: skip
def test_a_stop_hides_what_is_no_wider_than_the_interval_of_a_deflection(least, greatest, hides):
    _, surface = new_surface()
    surface["commands"]["u_min"][0], surface["commands"]["u_max"][0] = (
        least,
        greatest,
    )
    types.mark_stops(surface, 0.0999)
    assert surface["last"]["hides"].tolist() == hides


def test_a_jam_narrows_to_where_it_is_seen():
    fdi, surface = new_surface(low=0.1, high=0.2)
    judged(held_surface.update_stuck, fdi, surface, STUCK, 5)
    assert on(held_surface.stuck_range, fdi, surface, STUCK) == (0.1, 0.2)
    assert types.feasible_set(fdi, 0, STUCK) == (0.1, 0.2)


def test_where_types_have_a_surface():
    fdi, surface = new_surface(
        k_first=3,
        first_lo=0.1,
        first_hi=0.2,
        runaway=1.0,
        command=0.2,
    )
    surface["last"]["u"], surface["sets"]["low"][CONSTANT_LOSS] = (
        -0.2,
        0.25,
    )
    fdi["types"]["frame_index"] = 5
    assert on(commanded_surface.loss_range, fdi, surface, CONSTANT_LOSS) == pytest.approx((-0.2, -0.05))
    assert on(held_surface.float_range, fdi, surface, FLOAT) == (0.0, 0.0)
    surface["actuator"]["stop_lo"] = 0.1  # the lower stop is as near to neutral as it comes
    assert on(held_surface.float_range, fdi, surface, FLOAT) == (0.1, 0.1)
    assert held_surface.float_deflection(fdi, 0, FLOAT) == 0.1
    surface["actuator"]["stop_lo"] = LOW
    assert on(held_surface.range_up, fdi, surface, UP) == pytest.approx((0.14, HIGH))
    assert on(held_surface.range_down, fdi, surface, DOWN) == pytest.approx((LOW, 0.16))
    assert [TYPES[kind].estimate_parameter(fdi, 0, kind) for kind in (FLOAT, UP, DOWN)] == [
        0.0,
        HIGH,
        LOW,
    ]
    assert commanded_surface.theta_of_set(fdi, 0, CONSTANT_LOSS) == (-0.75, 0.0)


def released(low=0.2, high=0.3, order=0.0, judged=(-1.0, 1.0), instants=1, **fields):
    fdi, surface = new_surface(low=judged[0], high=judged[1], **fields)
    fdi["types"]["config"]["returns_lagged"], fdi["types"]["config"]["n_substeps"] = (
        1,
        instants,
    )
    surface["commands"]["history"][1] = order
    for which in (held_surface.EARLIER_SLOT, held_surface.LATER_SLOT):
        held_surface.clear_releases(surface, which, STUCK)
    surface["release"]["back_lo"][held_surface.LATER_SLOT, STUCK] = low
    surface["release"]["back_hi"][held_surface.LATER_SLOT, STUCK] = high
    return fdi, surface


@pytest.mark.parametrize("instants", [1, 3])
def test_a_return_goes_by_the_actuator(instants):
    """Half the way to the order an instant, 0.1 rad at most."""
    fdi, surface = released(instants=instants)
    place, path = 0.3, []
    for _ in range(instants):
        path.append(place)
        place -= min(0.5 * place, 0.1)
    assert on(held_surface.simulate_return, fdi, surface, 0.3) == pytest.approx((np.mean(path), place, 0.0))


@given(st.lists(st.floats(0.5, 2.0), min_size=1, max_size=9), st.floats(-0.4, 0.5), st.floats(-0.4, 0.5))
def test_what_a_frame_shows_of_a_return_is_weighted_by_the_effectiveness_then(G, held, order):
    """The innovation's own mean, sum G a / sum G, lies within the room; a return agrees with it."""
    G = np.array(G)
    fdi, surface = released(low=held, high=held, order=order, instants=G.size)
    path = [held]
    for _ in range(G.size - 1):
        path.append(path[-1] + np.clip(0.5 * (order - path[-1]), -0.1, 0.1))
    shown = np.sum(G * path) / np.sum(G)
    surface["judged"]["kappa"] = 0.25 * (G.max() - G.min()) / G.mean()
    mean, _, room = on(held_surface.simulate_return, fdi, surface, held)
    assert abs(shown - mean) <= room + 1e-15
    (
        surface["judged"]["u"],
        surface["judged"]["lo"],
        surface["judged"]["hi"],
    ) = (
        9.0,
        shown - 1e-12,
        shown + 1e-12,
    )
    assert on(held_surface.keep_returns, fdi, surface, STUCK)


def test_a_return_keeps_where_it_agrees_and_ends_where_it_does_not():
    fdi, surface = released(judged=(0.22, 0.28))
    assert on(held_surface.keep_returns, fdi, surface, STUCK)
    held = surface["release"]
    assert (held["back_lo"][1, STUCK], held["back_hi"][1, STUCK]) == pytest.approx((0.22, 0.28))
    for judged in ((0.31, 0.4), (0.1, 0.19)):
        fdi, surface = released(judged=judged)
        assert not on(held_surface.keep_returns, fdi, surface, STUCK)
        assert not held_surface.may_return(surface, held_surface.LATER_SLOT, STUCK)
    fdi, surface = released(low=0.1, high=0.1, judged=(0.0, 0.2), command=0.1)
    assert not on(
        held_surface.keep_returns, fdi, surface, STUCK
    )  # it is back: no release explains that anything is wrong


@pytest.mark.parametrize(("length", "instants"), [(1, 3), (3, 1)])
def test_a_return_has_the_room_that_an_uneven_effectiveness_gives_it(length, instants):
    """A fifth of its way, 0.1 rad in the two steps seen; above 0.2 + (0 + 0.05 + 0.1) / 3 and below."""
    for beyond, there in ((0.9, True), (1.1, False), (-0.9, True), (-1.1, False)):
        shown = 0.25 + beyond * 0.2 * 0.1
        fdi, surface = released(low=0.2, high=0.2, order=0.9, judged=(shown, shown), instants=instants)
        (
            fdi["types"]["config"]["frames_per_block"],
            surface["actuator"]["approach_share"],
            surface["actuator"]["step"],
        ) = (
            length,
            1.0,
            0.05,
        )
        surface["judged"]["kappa"] = 0.2
        assert on(held_surface.keep_returns, fdi, surface, STUCK) == there


def test_what_is_let_go_joins_the_later_releases_and_is_carried_on():
    fdi, surface = released(low=np.inf, high=-np.inf)
    held_surface.add_release(surface, STUCK, 0.2, 0.3)
    held_surface.add_release(surface, STUCK, 0.1, 0.15)
    held_surface.add_release(surface, STUCK, 0.5, 0.4)  # nowhere
    held = surface["release"]
    assert (held["back_lo"][1, STUCK], held["back_hi"][1, STUCK]) == (0.1, 0.3)
    held["released"][STUCK] = 1
    held_surface.add_release(surface, STUCK, -0.4, 0.5)
    assert (held["back_lo"][1, STUCK], held["back_hi"][1, STUCK]) == (0.1, 0.3)
    surface["judged"]["anomalous"] = 1
    on(held_surface.propagate_returns, fdi, surface, STUCK)
    assert (held["back_lo"][1, STUCK], held["back_hi"][1, STUCK]) == pytest.approx((0.05, 0.2))
    assert held["released"][STUCK] == 1
    surface["judged"]["anomalous"] = 0
    on(held_surface.propagate_returns, fdi, surface, STUCK)
    assert held["released"][STUCK] == 0


@pytest.mark.parametrize("returns_lagged", [0, 1])
def test_a_type_that_no_longer_holds_is_excluded_unless_a_return_explains_it(
    returns_lagged,
):
    fdi, surface = released(judged=(0.2, 0.3))
    fdi["types"]["config"]["returns_lagged"] = returns_lagged
    elsewhere = held_surface.IS_RETURNING if returns_lagged else held_surface.IS_REFUTED
    judged(held_surface.held_interval, fdi, surface, STUCK, -0.1, 0.1)
    assert surface["sets"]["excluded"][STUCK] == (not returns_lagged)
    assert surface["release"]["released"][STUCK] == returns_lagged
    fdi, surface = released(judged=(0.2, 0.3))
    fdi["types"]["config"]["returns_lagged"] = returns_lagged
    assert on(held_surface.judge_held, fdi, surface, STUCK, 0.3, 0.4) == held_surface.IS_HELD
    assert on(held_surface.judge_held, fdi, surface, STUCK, 0.1, 0.2) == held_surface.IS_HELD
    surface["release"]["released"][STUCK] = 1
    assert on(held_surface.judge_held, fdi, surface, STUCK, 0.1, 0.2) == elsewhere


def test_where_a_surface_was_as_the_judged_frame_began():
    fdi, surface = new_surface(low=0.1, high=0.2, low_before=0.3, high_before=0.4)
    assert on(held_surface.frame_start, fdi, surface) == (0.1, 0.2, 9)
    fdi["types"]["config"]["single_instant"] = 0
    assert on(held_surface.frame_start, fdi, surface) == (0.3, 0.4, 8)


@pytest.mark.parametrize("kind", [STUCK, FLOAT, UP, DOWN])
def test_from_where_each_type_lets_go(kind):
    fdi, surface = released(
        low=np.inf,
        high=-np.inf,
        judged=(-0.1, 0.2),
        k_first=7,
        first_lo=0.0,
    )
    surface["actuator"]["runaway"], surface["evidence"]["first_hi"] = 1.0, 0.1
    surface["sets"]["low"][STUCK], surface["sets"]["high"][STUCK] = 0.05, 0.3
    for which in (0, 1):
        held_surface.clear_releases(surface, which, kind)
    if kind == STUCK:
        (
            surface["release"]["back_lo"][held_surface.EARLIER_SLOT, STUCK],
            surface["release"]["back_hi"][held_surface.EARLIER_SLOT, STUCK],
        ) = 0.0, 0.1
    on(TYPES[kind].on_possible_release, fdi, surface, kind)
    held = surface["release"]
    expected = {STUCK: (0.05, 0.2), FLOAT: (0.0, 0.0), UP: (0.04, 0.2), DOWN: (-0.1, 0.06)}[kind]
    assert (held["back_lo"][1, kind], held["back_hi"][1, kind]) == pytest.approx(expected)


@pytest.mark.parametrize(("kind", "expected"), [(UP, (0.02, HIGH)), (DOWN, (LOW, 0.08))])
def test_within_a_frame_of_several_instants_a_runaway_may_be_let_go_further_on(kind, expected):
    fdi, surface = released(
        k_first=7,
        first_lo=0.0,
        first_hi=0.1,
        runaway=1.0,
    )
    (
        surface["earlier"]["lo"],
        surface["earlier"]["hi"],
        fdi["types"]["config"]["single_instant"],
    ) = -0.1, 0.2, 0
    for which in (0, 1):
        held_surface.clear_releases(surface, which, kind)
    on(TYPES[kind].on_possible_release, fdi, surface, kind)
    held = surface["release"]
    assert (held["back_lo"][1, kind], held["back_hi"][1, kind]) == pytest.approx(expected)


def within_block(commands, held=(0.2, 0.3), judged=(-1.0, 1.0)):
    """A block of frames in which the surface may be let go at any instant."""
    fdi, surface = released(low=np.inf, high=-np.inf, judged=judged, anomalous_then=1)
    fdi["types"]["config"]["frames_per_block"] = len(commands)
    surface["commands"]["history"][1, : len(commands)] = commands
    surface["release"]["held_lo"][STUCK], surface["release"]["held_hi"][STUCK] = held
    surface["judged"]["kappa"] = UNEVEN
    return fdi, surface


def way(start, commands):
    """Where the actuator brings a surface, from `start` on: half of what is left, 0.1 rad at most."""
    places = [start]
    for order in commands:
        places.append(places[-1] + np.clip(0.5 * (order - places[-1]), -0.1, 0.1))
    return np.array(places)


ORDERS, UNEVEN = (0.4, 0.05, 0.26, 0.5), 0.05


def test_let_go_at_any_instant_a_surface_lies_between_the_ways_that_stay_on_one_side():
    """The least and the greatest mean by all releases that hold at first, or come back to where they were."""
    fdi, surface = within_block(ORDERS)
    for start, side, extreme in ((0.2, -1, np.minimum), (0.3, 1, np.maximum)):
        place, path = start, []
        for order in ORDERS:
            path.append(place)
            place = extreme(way(place, [order])[1], start)
        room = UNEVEN * np.ptp(path)
        assert on(held_surface.simulate_return, fdi, surface, start, side) == pytest.approx(
            (np.mean(path), place, room)
        )
        for wait in range(len(ORDERS)):  # held so long, then let go
            mean = np.mean([*[start] * wait, *way(start, ORDERS[wait:-1])])
            assert -side * (mean - np.mean(path)) >= -1e-12


@pytest.mark.parametrize("end", ["low", "high"])
@pytest.mark.parametrize("inside", [True, False])
def test_a_release_within_the_block_explains_what_lies_between_with_some_room(end, inside):
    fdi, surface = within_block(ORDERS)
    start, side = (0.2, -1) if end == "low" else (0.3, 1)
    mean, _, room = on(held_surface.simulate_return, fdi, surface, start, side)
    assert room > 1e-3
    edge = mean + side * room
    beyond = edge - side * 1e-6 if inside else edge + side * 1e-6
    surface["judged"]["lo"], surface["judged"]["hi"] = (-1.0, beyond) if end == "low" else (beyond, 1.0)
    assert on(held_surface.release_explains, fdi, surface, STUCK) == inside
    assert on(held_surface.keep_returns, fdi, surface, STUCK) == inside
    held = surface["release"]["held_lo"][STUCK] <= surface["release"]["held_hi"][STUCK]
    assert held == inside, "what explains nothing is forgotten"
    fdi["types"]["config"]["frames_per_block"] = 1
    assert not on(held_surface.release_explains, fdi, surface, STUCK)


def test_what_is_held_nowhere_is_not_let_go_within():
    fdi, surface = within_block(ORDERS, held=(0.3, 0.2))
    assert not on(held_surface.release_explains, fdi, surface, STUCK)


@pytest.mark.parametrize("joined", [False, True])
def test_after_a_block_releases_within_it_join_the_later_ones(joined):
    fdi, surface = within_block(ORDERS)
    held = surface["release"]
    if joined:
        held["back_lo"][1, STUCK], held["back_hi"][1, STUCK] = 0.25, 0.251
    on(held_surface.propagate_returns, fdi, surface, STUCK)
    low, high = (on(held_surface.simulate_return, fdi, surface, *of)[1] for of in ((0.2, -1), (0.3, 1)))
    assert (held["back_lo"][1, STUCK], held["back_hi"][1, STUCK]) == pytest.approx((low, high))
    assert not held_surface.may_return(surface, held_surface.EARLIER_SLOT, STUCK)
    fdi["types"]["config"]["frames_per_block"], before = 1, held["back_hi"][1, STUCK].copy()
    held_surface.clear_releases(surface, held_surface.LATER_SLOT, STUCK)
    on(held_surface.propagate_returns, fdi, surface, STUCK)
    assert not held_surface.may_return(surface, held_surface.LATER_SLOT, STUCK), (
        "in one frame nothing is let go within"
    )
    assert before == pytest.approx(high)


@pytest.mark.parametrize("side", ["low", "high"])
@pytest.mark.parametrize("inside", [True, False])
def test_where_the_effectiveness_changes_a_return_has_a_share_of_its_way_as_room(side, inside):
    fdi, surface = released(low=0.2, high=0.3, command=-0.2)
    fdi["types"]["config"]["frames_per_block"], surface["commands"]["history"][1, :4] = 4, ORDERS
    held, start = surface["release"], 0.2 if side == "low" else 0.3
    surface["judged"]["kappa"], path = UNEVEN, way(start, ORDERS)
    mean = path[:-1].mean()
    assert on(held_surface.simulate_return, fdi, surface, start) == pytest.approx(
        (mean, path[-1], UNEVEN * np.ptp(path[:-1]))
    )
    room = max(UNEVEN * np.ptp(way(other, ORDERS)[:-1]) for other in (0.2, 0.3))
    sign = -1.0 if side == "low" else 1.0
    beyond = mean + sign * (room + (-1e-6 if inside else 1e-6))
    surface["judged"]["lo"], surface["judged"]["hi"] = (-1.0, beyond) if side == "low" else (beyond, 1.0)
    assert (
        on(
            held_surface.narrow_return,
            fdi,
            surface,
            held_surface.LATER_SLOT,
            STUCK,
        )
        == inside
    )
    if inside:  # nearly all that could have been let go is left out; but the ends may not pass
        assert held["back_lo"][1, STUCK] <= held["back_hi"][1, STUCK]
        kept = held["back_lo" if side == "low" else "back_hi"][1, STUCK]
        assert kept == pytest.approx(start)


def test_a_jam_let_go_without_an_earlier_release_is_the_earlier_one_then():
    fdi, surface = released(low=0.1, high=0.3, judged=(0.0, 0.25))
    surface["sets"]["low"][STUCK], surface["sets"]["high"][STUCK] = 0.15, 0.22
    on(held_surface.add_stuck_release, fdi, surface, STUCK)
    held = surface["release"]
    assert (held["back_lo"][0, STUCK], held["back_hi"][0, STUCK]) == (0.1, 0.3)
    assert (held["back_lo"][1, STUCK], held["back_hi"][1, STUCK]) == (0.15, 0.22)
    assert (held["held_lo"][STUCK], held["held_hi"][STUCK]) == (0.15, 0.22)


def test_a_jam_that_looks_healthy_is_what_it_was_before():
    _, surface = released(low=0.2, high=0.3, anomalous_then=0)
    surface["stuck"]["lo_before"], surface["stuck"]["hi_before"] = (
        (0.0, 0.1),
        (0.2, 0.4),
    )
    surface["sets"]["low"][STUCK], surface["sets"]["high"][STUCK] = 0.25, 0.26
    restore_sets(surface)
    assert (surface["sets"]["low"][STUCK], surface["sets"]["high"][STUCK]) == (0.1, 0.4)
    (
        surface["release"]["back_lo"][0, STUCK],
        surface["release"]["back_hi"][0, STUCK],
    ) = 0.1, 0.2
    restore_sets(surface)
    assert (surface["sets"]["low"][STUCK], surface["sets"]["high"][STUCK]) == (0.0, 0.2)


def test_a_frame_that_may_be_on_either_side_ends_no_half_cycle_and_begins_the_count_anew():
    fdi, surface = new_surface(low=-0.1, high=0.2)
    judged(commanded_surface.update_swing, fdi, surface, OSCILLATORY, 10)
    swing = surface["oscillatory"]
    assert (swing["sign"], swing["n_half"], swing["since"]) == (0, 0, 11)
    for low, high in ((0.0, 0.3), (-0.3, 0.0)):
        surface["judged"]["lo"], surface["judged"]["hi"] = (
            low,
            high,
        )
        judged(commanded_surface.update_swing, fdi, surface, OSCILLATORY, 10)
        assert swing["sign"] == 0, "on its command it is on no side of it"


NOISY, SLOWEST_RAD_S = {"bounds": {"sensors": {"q": {"noise_std_deg_s": 0.1}}}}, 1.7


@pytest.mark.parametrize(
    ("keys", "fdi", "frames"),
    [
        ({"rate_hz": 50, "substeps": 2}, {}, 1), ({"rate_hz": 100}, {"pairs": True}, 1),
        ({"rate_hz": 72, "substeps": 2}, {**NOISY, "fault_profile": "abrupt"}, 15),
        ({"rate_hz": 20}, NOISY, 4),
    ],
)  # fmt: skip
def test_all_that_types_are_set_up_with_by_scenario_surface_and_actuator(keys, fdi, frames):
    """Blocks of 0.2 s where gyros are noisy. Of stops beyond the neutral position 0 is within reach, too."""
    dt = 1.0 / keys["rate_hz"]
    instant_s = dt / keys.get("substeps", 1)
    slowest = {"slowest_oscillation_rad_s": SLOWEST_RAD_S, "slowest_rate_deg_s": 3.0}
    given = {
        "name": "x", **keys, "fdi": {"fault_class": "all", **slowest, **fdi},
        "actuators": {"elevator": {"rate_limit_deg_s": 90.0}, "rudder": {"rate_limit_deg_s": 2.5}},
    }  # fmt: skip
    types = np.zeros(1, registry.fault_types_dtype(4))[0]
    layout, prediction = np.zeros(1, layout_dtype(4))[0], np.zeros(1, prediction_dtype(4))[0]
    layout["group"] = LATERAL_GROUP, PITCH_GROUP, LATERAL_GROUP, PITCH_GROUP
    actuators = prediction["actuators"]
    actuators["real"], actuators["approach"] = 1, (0.2, 0.3, 0.4, 0.5)
    actuators["step"] = np.inf, np.radians(90.0) * instant_s, np.radians(2.5) * instant_s, np.inf
    travel = np.array([[0.05, -0.4, -0.3, -0.2], [0.5, 0.45, 0.35, -0.02]])
    registry.configure_types(types, layout, actuators, Declared.of(Scenario.model_validate(given)), travel)
    config, pairs = types["config"], fdi.get("pairs", False)
    found = {name: config[name].item() for name in config.dtype.names if np.any(config[name])}
    expected = {
        "frames_per_block": frames, "block_duration_s": frames * dt, "dt": dt,
        "half_frames": int(np.ceil(np.pi / SLOWEST_RAD_S / (frames * dt))),
        "n_substeps": keys.get("substeps", 1), "returns_lagged": 1,
    }  # fmt: skip
    expected |= {"single_instant": 1} if pairs else {}
    expected |= {"abrupt": 1} if fdi.get("fault_profile") else {}
    assert found == pytest.approx(expected)
    assert (types["pair"]["first_pitch"], types["pair"]["enabled"]) == (-1, pairs)
    surfaces = types["surface"]
    expected = {
        "stop_lo": travel[0], "stop_hi": travel[1], "reach_lo": [0.0, -0.4, -0.3, -0.2],
        "reach_hi": [0.5, 0.45, 0.35, 0.0], "approach_share": actuators["approach"],
        "step": actuators["step"],
        "runaway": [np.pi / 6.0, np.pi / 4.0, np.radians(1.25), np.pi / 6.0],
        "slow_step": np.radians([3.0, 3.0, 2.5, 3.0]) * instant_s,
    }  # fmt: skip
    assert set(surfaces["actuator"].dtype.names) == set(expected)
    for name, values in expected.items():
        assert surfaces["actuator"][name] == pytest.approx(np.array(values)), name
    assert surfaces["status"]["may_be_sole"].tolist() == ([0, 1, 0, 1] if pairs else [1] * 4)
    assert surfaces["accommodation"]["mode"].tolist() == surfaces["status"]["fault_type"].tolist() == [-1] * 4
