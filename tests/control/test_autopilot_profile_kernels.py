"""The commanded profile a frame at a time, against where its legs lie."""

import numpy as np
import pytest

from beaver_ftc.control.autopilot_setup import AUTOPILOT
from beaver_ftc.control.profile import ALTITUDE, BANK, HEADING, SPEED, advance_commands

DT = 0.1
WHERE = np.array([1000.0, 45.0, 3.0, 0.1])


def new(**legs):
    """An autopilot with legs (at_s, value, speed) of channels named here."""
    pilot = np.zeros(1, AUTOPILOT).view(np.recarray)[0]
    pilot["dt"], pilot["changed_at_s"] = DT, -np.inf
    for name, given in legs.items():
        c = {"altitude": ALTITUDE, "speed": SPEED, "heading": HEADING, "bank": BANK}[name]
        pilot["n_legs"][c] = len(given)
        for j, (at_s, value, speed) in enumerate(given):
            pilot["leg_starts_at_s"][c, j], pilot["leg_value"][c, j], pilot["leg_max_rate"][c, j] = (
                at_s,
                value,
                speed,
            )
    return pilot


def test_a_channel_is_commanded_from_its_first_leg_on_and_begins_where_it_is():
    pilot = new(altitude=[(0.5, 1003.0, 2.0)])
    advance_commands(pilot, WHERE, 0.5 - 1e-6)
    assert not pilot["is_commanded"].any()
    advance_commands(pilot, WHERE, 0.5 - 1e-10)  # a frame's time is k / rate in floating point
    assert pilot["is_commanded"].tolist() == [1, 0, 0, 0]
    assert pilot["goal"][ALTITUDE] == 1003.0
    assert pilot["command"][ALTITUDE] == pytest.approx(1000.2)
    assert pilot["command_rate"][ALTITUDE] == pytest.approx(2.0)
    assert pilot["changed_at_s"][ALTITUDE] == pytest.approx(0.5)
    assert pilot["next_leg_index"].tolist() == [1, 0, 0, 0]


@pytest.mark.parametrize("value", [1000.3, 999.7])
def test_it_moves_at_its_pace_and_stops_where_it_should(value):
    pilot = new(altitude=[(0.0, value, 2.0)])
    way = []
    for k in range(4):
        advance_commands(pilot, WHERE, k * DT)
        way.append((float(pilot["command"][ALTITUDE]), float(pilot["command_rate"][ALTITUDE])))
    sign = np.sign(value - 1000.0)
    assert np.array(way) == pytest.approx(
        np.array([(1000 + 0.2 * sign, 2 * sign), (value, sign), (value, 0), (value, 0)]), abs=1e-9
    )


def test_what_is_held_stays_where_it_was_and_a_leg_without_a_pace_is_there_at_once():
    pilot = new(bank=[(0.0, np.nan, np.inf), (1.0, 0.4, np.inf)])
    advance_commands(pilot, WHERE, 0.0)
    assert (pilot["command"][BANK], pilot["command_rate"][BANK]) == (0.1, 0.0)
    assert pilot["changed_at_s"][BANK] == -np.inf
    advance_commands(pilot, WHERE + 1.0, 1.0)
    assert (pilot["command"][BANK], pilot["command_rate"][BANK]) == (pytest.approx(0.4), 0.0)
    assert pilot["changed_at_s"][BANK] == 1.0


def test_a_heading_is_turned_to_the_short_way_from_what_is_commanded():
    pilot = new(heading=[(0.0, -3.0, 0.5), (0.2, 3.0, np.inf)])
    advance_commands(pilot, WHERE, 0.0)
    assert pilot["goal"][HEADING] == pytest.approx(2.0 * np.pi - 3.0)
    assert pilot["command"][HEADING] == pytest.approx(3.05)
    advance_commands(pilot, -WHERE, 0.1)  # wherever the aircraft is
    advance_commands(pilot, -WHERE, 0.2)
    assert pilot["command"][HEADING] == pytest.approx(3.0)
