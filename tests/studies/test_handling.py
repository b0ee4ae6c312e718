"""Handling qualities: closed forms of made-up modes, the levels' edges, and the Beaver's own."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.loop.loop import fly
from beaver_ftc.plant.linear import LinearModel
from beaver_ftc.results.log import MemoryLog
from beaver_ftc.studies import handling
from beaver_ftc.studies.handling import (
    LIMITS,
    WORSE,
    as_rows,
    as_text,
    of_model,
    over_airspeeds,
    where_ended,
    where_trimmed,
)
from beaver_ftc.studies.linear_systems import CLASSICAL
from flying import scenario
from telling import apart, numbers

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
        ({"short": (3.0, 0.29)}, 0, 2), ({"short": (3.0, 0.19)}, 0, 3), ({"short": (3.0, 0.14)}, 0, WORSE),
        ({"short": (5.0, 0.6)}, 1, 2), ({"short": (0.65, 0.6), "Z_alpha": -1.5}, 1, 2),
        ({"dutch": (1.2, 0.05)}, 2, 2), ({"dutch": (1.2, 0.01)}, 2, 3), ({"dutch": (1.2, -0.01)}, 2, WORSE),
        ({"dutch": (0.5, 0.2)}, 3, 2), ({"dutch": (0.39, 0.9)}, 4, WORSE),
        ({"T_roll": 1.5}, 5, 2), ({"T_roll": 3.1}, 5, 3), ({"T_roll": 11.0}, 5, WORSE),
        ({"spiral": math.log(2) / 19}, 6, 2), ({"spiral": math.log(2) / 7}, 6, 3),
        ({"spiral": math.log(2) / 3}, 6, WORSE),
        ({"phugoid": (0.2, 0.05)}, 7, 1), ({"phugoid": (0.2, 0.03)}, 7, 2), ({"phugoid": (0.2, -0.01)}, 7, 3),
        ({"phugoid": (0.2, -math.log(2) / 0.2 / 56)}, 8, 1),
        ({"phugoid": (0.2, -math.log(2) / 0.2 / 54)}, 8, WORSE),
        ({"coupled": 0.9, "spiral": -0.6}, 9, 1), ({"coupled": 0.9, "spiral": -0.4}, 9, 2),
        ({"coupled": 0.9, "spiral": -0.2}, 9, 3), ({"coupled": 0.9, "spiral": -0.1}, 9, WORSE),
        ({"coupled": 0.9, "spiral": -0.2}, 5, 1), ({"coupled": 0.9, "spiral": 0.1}, 6, 1),
    ],
)  # fmt: skip
def test_levels_as_the_specification_has_them(changed, row, level):
    assert of_model(made_up(**changed), 40.0, "trimmed")[row].level == level


def test_without_lift_by_the_angle_of_attack_nothing_is_too_slow():
    """CAP is frequency squared over load factor per angle: without a load factor there is no such limit."""
    for Z_alpha in (0.0, 0.3):
        assert of_model(made_up(Z_alpha=Z_alpha), 40.0, "trimmed")[1].value == math.inf


def test_the_margin_is_to_the_nearer_limit():
    damping, spiral = LIMITS[0], LIMITS[6]
    assert damping.margin(0.5, 1) == pytest.approx(0.2)
    assert damping.margin(1.9, 1) == pytest.approx(0.1)
    assert damping.margin(0.1, 2) == pytest.approx(-0.1)
    assert spiral.margin(math.inf, 1) == math.inf


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


def test_where_a_flight_ended_every_number_is_of_its_last_row(monkeypatch):
    """The engine's setting too, where the log has it; what cannot be linearised is said."""
    flown, seen = scenario(duration_s=2.0), []
    names = ["alpha_rad", "beta_rad", *(f"{axis}_rad_s" for axis in "pqr"), "phi_rad", "theta_rad", "psi_rad"]
    names += [f"{surface}_effective_rad" for surface in flown.airframe.surfaces]
    end = dict(zip(names, numbers(len(names), seed=3, size=0.02).tolist(), strict=True))
    end |= {"airspeed_mps": 43.0, "altitude_m": 1700.0, "manifold_pressure_inhg": 24.5}
    apart(end=list(end.values()))
    unknown = LinearModel(np.full((10, 10), np.nan), np.zeros((10, 4)), ("x",) * 10, ("u",) * 4)
    monkeypatch.setattr(handling, "differences", lambda plant, there: seen.append(there) or unknown)
    with pytest.raises(SimulationFailed, match="nothing can be linearised where it ended"):
        where_ended(flown, end)
    (there,) = seen
    assert {name: getattr(there, name) for name in names if hasattr(there, name)} == {
        name: end[name] for name in names if not name.endswith("_effective_rad")
    }
    assert (there.airspeed_mps, there.altitude_m) == (43.0, 1700.0)
    assert there.settings["manifold_pressure_inhg"] == 24.5
    surfaces = flown.airframe.surfaces
    assert dict(there.surfaces_rad) == {name: end[f"{name}_effective_rad"] for name in surfaces}


def _as_row(flown):
    from beaver_ftc.plant.conditions import trim

    point = trim(flown)
    return {**point.as_dict(), **{f"{s}_effective_rad": angle for s, angle in point.surfaces_rad.items()}}


def test_the_beaver_over_its_envelope_as_it_is_shown(changed):
    found = over_airspeeds(scenario())
    assert [each.airspeed_mps for each in found[:: len(LIMITS)]] == pytest.approx(
        [30, 36.25, 42.5, 48.75, 55]
    )
    assert not changed(as_text(found).splitlines(), "text")
    assert not changed(as_rows(found[: len(LIMITS)]))


@pytest.mark.parametrize("departure", [None, (1.5, "alpha_rad")])
def test_of_a_scenario_with_a_fault_the_end_of_its_flight_is_judged_too(monkeypatch, departure):
    """By the last row of its log; not of an aircraft that was lost. A healthy flight is not flown."""
    flown, ended = [], []

    def fly(given, log):
        flown.append(given)
        log.open(["a", "b"])
        log.write(np.array([[1.0, 2.0], [3.0, 4.0]]))
        log.close()
        return SimpleNamespace(departure=departure)

    monkeypatch.setattr("beaver_ftc.loop.loop.fly", fly)
    monkeypatch.setattr(handling, "where_trimmed", lambda of: [of.initial.airspeed_mps])
    monkeypatch.setattr(handling, "where_ended", lambda *given: ended.append(given) or ["at the end"])
    speeds_mps = pytest.approx([30.0, 36.25, 42.5, 48.75, 55.0])
    assert over_airspeeds(scenario()) == speeds_mps
    assert flown == []
    faulty = scenario(faults=[{"actuator": "rudder", "type": "float", "at_s": 1.0}])
    found = over_airspeeds(faulty)
    assert found[:5] == speeds_mps
    assert found[5:] == ([] if departure else ["at the end"])
    assert flown == [faulty]
    assert ended == ([] if departure else [(faulty, {"a": 3.0, "b": 4.0})])


def test_each_flight_condition_is_a_line_with_its_worst_level():
    """A level in words beside each number; of the last one that the flight ended there."""
    first = of_model(made_up(), 40.04, "trimmed")
    last = of_model(made_up(dutch=(1.2, -0.01), T_roll=1.5), 33.96, "at the end")
    quantities, units, one, two, empty, *clauses = as_text([*first, *last]).splitlines()
    assert [cell.strip() for cell in re.split("   *", quantities)][:3] == [
        "aircraft alone,", "short period", "short period"
    ]  # fmt: skip
    assert re.split("  +", units)[0] == "airspeed, m/s"
    assert re.split("  +", units)[-2:] == ["damping x frequency rad/s", "level"]
    assert re.split("  +", one) == [
        "40.0", "0.6 (1)", "1.47 (1)", "0.2 (1)", "0.24 (1)", "1.2 (1)", "0.5 (1)", "never (1)", "0.1 (1)",
        "never (1)", "never (1)", "1",
    ]  # fmt: skip
    cells = re.split("  +", two)
    assert (cells[0], cells[3], cells[6], cells[-1]) == ("34.0 at the end", "-0.01 (none)", "1.5 (2)", "none")
    assert empty == ""
    assert clauses == [
        "in brackets: level of MIL-F-8785C, class I, category B:",
        "3.2.2.1.2 table IV, 3.2.2.1.1 figure 2, 3.3.1.1 table VI, 3.3.1.2 table VII, 3.3.1.3 table VIII, "
        "3.2.1.2, 3.3.1.4",
    ]
    rows = as_rows([*first, *last])
    assert rows[16] == {
        "where": "at the end", "airspeed_mps": 33.96, "mode": "spiral", "quantity": "time to double",
        "value": None, "level": 1,
    }  # fmt: skip
    assert [row["level"] for row in rows[10:]] == [each.level for each in last]
