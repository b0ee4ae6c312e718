"""Handling qualities: closed forms of made-up modes, the levels' edges, and the Beaver's own."""

import math

import numpy as np
import pytest

from beaver_ftc.loop.loop import fly
from beaver_ftc.plant.linear import LinearModel
from beaver_ftc.results.log import MemoryLog
from beaver_ftc.studies.handling import (
    LIMITS,
    WORSE,
    Limit,
    of_model,
    where_ended,
    where_trimmed,
)
from beaver_ftc.studies.linear_systems import CLASSICAL
from flying import scenario

G = 9.80665


def made_up(
    short=(3.0, 0.6),
    dutch=(1.2, 0.2),
    T_roll=0.5,
    spiral=-0.02,
    Z_alpha=-1.5,
    phugoid=(0.2, 0.1),
    coupled=0.0,
):
    """A linear aircraft with these modes, (frequency, damping) of three; coupled: imaginary part, rad/s."""
    omega, zeta = short
    A = np.zeros((8, 8))
    V, alpha, q, theta, beta, p, r, phi = range(8)
    omega_p, zeta_p = phugoid
    A[V, V], A[V, theta], A[theta, V] = -2 * zeta_p * omega_p, -omega_p, omega_p
    A[alpha, alpha], A[alpha, q] = Z_alpha, 1.0
    A[q, q] = -2 * zeta * omega - Z_alpha
    A[q, alpha] = Z_alpha * A[q, q] - omega**2
    omega, zeta = dutch
    A[beta, r], A[r, beta], A[r, r] = -1.0, omega**2, -2 * zeta * omega
    A[p, p], A[phi, phi] = -1.0 / T_roll, spiral
    if coupled:
        A[[p, phi], [p, phi]], A[p, phi], A[phi, p] = spiral, coupled, -coupled
    return LinearModel(A, np.zeros((8, 0)), CLASSICAL, ())


def test_the_quantities_of_made_up_modes():
    found = of_model(made_up(), 40.0, "trimmed")
    cap = 9.0 / (1.5 * 40.0 / G)
    expected = [0.6, cap, 0.2, 0.24, 1.2, 0.5, math.inf, 0.1, math.inf, math.inf]
    assert [each.value for each in found] == pytest.approx(expected, rel=1e-6)
    assert [each.level for each in found] == [1] * 10
    assert [(each.mode, each.quantity) for each in found] == [
        (limit.mode, limit.quantity) for limit in LIMITS
    ]


@pytest.mark.parametrize(
    ("changed", "row", "level"),
    [
        ({"short": (3.0, 0.14)}, 0, WORSE), ({"short": (5.0, 0.6)}, 1, 2), ({"dutch": (1.2, 0.01)}, 2, 3),
        ({"dutch": (0.5, 0.2)}, 3, 2), ({"dutch": (0.39, 0.9)}, 4, WORSE), ({"T_roll": 3.1}, 5, 3),
        ({"spiral": math.log(2) / 7}, 6, 3), ({"phugoid": (0.2, 0.03)}, 7, 2),
        ({"phugoid": (0.2, -math.log(2) / 0.2 / 54)}, 8, WORSE), ({"coupled": 0.9, "spiral": -0.2}, 9, 3),
        ({"coupled": 0.9, "spiral": -0.2}, 5, 1), ({"coupled": 0.9, "spiral": 0.1}, 6, 1),
    ],
)  # fmt: skip
def test_levels_as_the_specification_has_them(changed, row, level):
    assert of_model(made_up(**changed), 40.0, "trimmed")[row].level == level


def test_a_jam_leaves_other_modes_than_the_trim():
    flown = scenario(
        duration_s=2.0, faults=[{"actuator": "rudder", "type": "stuck", "position_deg": 3, "at_s": 0.2}]
    )
    log = MemoryLog()
    fly(flown, log)
    end = dict(zip(log.columns, log.rows[-1].tolist(), strict=True))
    before, after = where_trimmed(flown), where_ended(flown, end)
    assert {each.where for each in after} == {"at the end"}
    assert [each.value for each in before] != [each.value for each in after]
    assert after[0].value == pytest.approx(before[0].value, rel=0.2)  # short period: much the same
    at_trim = where_ended(flown, _as_row(flown))
    assert [each.value for each in at_trim] == pytest.approx([each.value for each in before], rel=1e-6)


def _as_row(flown):
    from beaver_ftc.plant.conditions import trim

    point = trim(flown)
    return {**point.as_dict(), **{f"{s}_effective_rad": angle for s, angle in point.surfaces_rad.items()}}


def test_a_margin_is_the_distance_from_the_nearer_limit_of_a_level():
    limit = Limit("mode", "quantity", "clause", ((2.0, 5.0), (1.0, 9.0)))
    assert [limit.margin(3.5, 1), limit.margin(3.5, 2), limit.margin(1.5, 1)] == [1.5, 2.5, -0.5]
