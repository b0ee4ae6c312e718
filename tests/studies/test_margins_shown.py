"""What the margins are worked out from, and how they are shown; to the number, at one flight condition."""

from dataclasses import asdict

import numpy as np
import pytest

from beaver_ftc.control.readout import Schedule
from beaver_ftc.studies import handling, linearise, margins
from beaver_ftc.studies.margins import (
    LawGains,
    Margin,
    OpenLoop,
    as_document,
    as_text,
    at,
    cases,
    frequencies,
    interpolated,
    law_response,
    loops,
    outputs,
    sensors,
)
from flying import scenario

REAL = {"control": {"law": "fault-tolerant"}, "sensors": "tactical-grade", "actuators": "servo"}
SURFACES = ("aileron", "elevator", "rudder", "flap")


def test_the_margins_at_a_flight_condition(changed, monkeypatch):
    monkeypatch.setattr(margins, "N_FREQUENCIES", 60)
    found = list(at(scenario(**REAL, uncertainty={})))
    assert not changed([list(asdict(each).values()) for each in found])


def coupled(rng):
    """A loop of four surfaces in which everything acts on everything."""
    G = rng.normal(size=(3, 4)) - 5.0 * np.eye(3, 4)
    loop = OpenLoop(
        -0.5 * np.eye(4) + 0.3 * rng.normal(size=(4, 4)), np.vstack((G, rng.normal(size=(1, 4)))),
        np.vstack((np.eye(4), rng.normal(size=(1, 4)))), 0.2 * rng.normal(size=(3, 5)), G,
        np.array([1.0, 0.5, 1.0, 0.8]), np.array([0.3, 0.5, 0.7, 0.9]), 0.01 * np.arange(5.0),
        0.1 * np.arange(5.0), 0.02,
    )  # fmt: skip
    law = LawGains(
        np.array([2.0, 3.0, 4.0]), np.array([0.2, 0.3, 0.4]), np.array([1.0, 2.0, 3.0]),
        0.5 * np.linalg.pinv(G), np.array([1.0, 1.2, 1.5, 2.0]), 0.3,  # whole, no start would fade
    )  # fmt: skip
    return loop, law


def test_the_law_answers_in_frequency_as_it_does_frame_by_frame():
    """Its equations stepped with a sine of each measured signal, once the start has died away."""
    loop, law = coupled(np.random.default_rng(8))
    dt, share, omega = loop.dt_s, law.share, 4.0
    z = np.exp(1j * omega * dt)
    expected = law_response(loop, law, z)
    for signal in range(5):
        rate, disturbance = np.zeros(3, complex), np.zeros(3, complex)
        position, before, y_before = np.zeros(4, complex), np.zeros(4, complex), np.zeros(5, complex)
        measured = np.eye(5)[signal]
        for k in range(3000):
            y = measured * z**k
            acting = (1.0 - share) * position + share * before  # over the elapsed frame
            seen = (1.0 - share) * y + share * y_before
            model = loop.f @ seen + loop.G @ acting
            ahead = rate + dt * (model + disturbance)
            missed = y[:3] - ahead
            rate, disturbance = ahead + law.L_rate * missed, disturbance + law.L_disturbance * missed
            demand = -law.Kp * (rate + share * dt * (loop.f @ y + loop.G @ position + disturbance))
            demand = demand - disturbance - loop.f @ y
            command = position + law.lead * (law.demand @ demand - position)
            before, y_before = position, y
            position = position + loop.approach * (command - position)
        np.testing.assert_allclose(position / z**3000, expected[:, signal], rtol=1e-6, atol=1e-9)


def test_a_loop_is_broken_at_one_surface_with_the_others_closed():
    """The return difference of all at once is that of each surface in turn, the earlier ones left open."""
    loop, law = coupled(np.random.default_rng(3))
    omega = np.array([0.5, 5.0, 50.0])
    found = loops(loop, law, omega)
    around = np.random.default_rng(1).normal(size=(4, 4)) + 1j
    for s in range(4):
        inverse = np.linalg.inv(np.eye(4) - around)
        assert 1.0 / inverse[s, s] == pytest.approx(1.0 - margins._others_closed(around, s))
    assert found.shape == (3, 4)
    assert np.abs(found).min() > 1e-4


def test_the_schedule_between_its_points_and_handed_over():
    gains = ([[axis + 10 * i, axis + 10 * i + 1.0] for axis in (1, 2, 3, 6)] for i in range(3))
    schedule = Schedule(np.array([500.0, 1500.0]), *map(np.array, gains))
    np.testing.assert_allclose(interpolated(schedule, 750.0, 0.0)[1], [11.25, 12.25, 13.25])
    np.testing.assert_allclose(interpolated(schedule, 750.0, 0.5), [[x + 10 * i for x in (1.25, 4.25, 3.25)]
                                                                     for i in range(3)])  # fmt: skip


def test_what_each_fault_leaves():
    found = list(cases(np.array([0, 1, 2]), SURFACES))
    assert [fault for fault, _ in found] == [
        "none", *(f"{s} {left}" for s in SURFACES[:3] for left in ("50 % lost", "90 % lost", "given up"))
    ]  # fmt: skip
    assert [left.tolist() for _, left in found[:4]] == [
        [1, 1, 1, 1], [0.5, 1, 1, 1], [0.1, 1, 1, 1], [0.0, 1, 1, 1]
    ]  # fmt: skip
    assert found[-1][1].tolist() == [1, 1, 0.0, 1]


def test_what_is_measured_of_the_states():
    y = np.array([0.1, 0.02, 40.0, 1000.0, 0.6])
    states = ("airspeed", "alpha", "q", "theta", "beta", "p", "r", "phi")
    step = 1e-6 * np.arange(1.0, 9.0)
    V = 40.0 + step[0]
    expected = [step[5], step[2], step[6], step[1], step[4], step[0], 1000.0 * (V / 40.0) ** 2 - 1000.0,
                0.6 * (40.0 / V) ** 3 - 0.6]  # fmt: skip
    np.testing.assert_allclose(outputs(states, y) @ step, expected, rtol=1e-6)


def test_how_late_and_how_smooth_each_signal_is():
    given = {
        "q": {"delay_s": 0.02, "bandwidth_rad_s": 50.0},
        "V": {"delay_s": 0.1},
        "qdyn": {"bandwidth_rad_s": 8.0},
    }
    delay_s, keep = sensors(scenario(sensors=given), 9, 0.01)
    assert delay_s.tolist() == [0, 0.02, 0, 0, 0, 0.1, 0, 0, 0]
    np.testing.assert_allclose(keep, [0, np.exp(-0.5), 0, 0, 0, 0, np.exp(-0.08), 0, 0])


def test_frequencies_run_from_the_autopilots_to_nyquist():
    found = frequencies(0.02)
    assert (found[0], found[-1], found.size) == (pytest.approx(0.3), pytest.approx(50 * np.pi), 600)


ROWS = [
    Margin(30.0, "none", "aileron", 8.0, np.inf, 60.0), Margin(42.5, "none", "aileron", 7.0, 20.0, 50.04),
    Margin(55.0, "none", "aileron", 9.0, 19.0, 49.96), Margin(30.0, "none", "flap", 6.0, 6.0, 45.0),
    Margin(30.0, "elevator given up", "flap", np.inf, np.inf, 44.99),
]  # fmt: skip


def test_the_margins_as_they_are_shown(changed):
    assert not changed(as_text(ROWS, (6.0, 45.0)).splitlines(), "text")
    assert not changed(as_document(ROWS, (6.0, 45.0)))


@pytest.mark.parametrize(
    ("up_db", "down_db", "phase_deg", "keeps"),
    [
        (6, 6, 45, True),
        (5.9, 9, 50, False),
        (9, 5.9, 50, False),
        (9, 9, 44.9, False),
        (np.inf, np.inf, 45, True),
    ],
)
def test_a_margin_keeps_what_is_asked_up_to_the_bound(up_db, down_db, phase_deg, keeps):
    assert Margin(40.0, "none", "flap", up_db, down_db, phase_deg).keeps(6.0, 45.0) is keeps


def test_linearise_asks_for_the_margins_that_the_scenario_declares(monkeypatch):
    """A loop that keeps 6 dB and 45 deg, but not the 45 dB and 6 deg of a mistaken order."""
    found = Margin(50.0, "healthy", "elevator", up_db=7.0, down_db=8.0, phase_deg=46.0)
    monkeypatch.setattr(margins, "study", lambda scenario: [found])
    monkeypatch.setattr(handling, "over_airspeeds", lambda scenario: [])
    declared = scenario(control={"gain_margin_db": 6.0, "phase_margin_deg": 45.0})
    monkeypatch.setattr(linearise, "load", lambda name: declared)
    document = linearise.Linearise("any").run(None)
    assert (document["gain_margin_db"], document["phase_margin_deg"]) == (6.0, 45.0)
    assert [row["keeps"] for row in document["margins"]] == [True]


def test_linearise_as_text_has_the_numbers_of_its_document(monkeypatch):
    """What has no end is null in the document, and never in the text."""
    rows = [
        {"airspeed_mps": 30.0, "fault": "none", "surface": "flap", "up_db": None, "down_db": 5.5,
         "phase_deg": 61.25, "keeps": False},
        {"airspeed_mps": 42.0, "fault": "none", "surface": "flap", "up_db": 7.25, "down_db": None,
         "phase_deg": 58.5, "keeps": True},
    ]  # fmt: skip
    modes = [{"where": "trimmed", "airspeed_mps": 30.0, "mode": "spiral", "quantity": "time to double",
              "value": None, "level": 1}]  # fmt: skip
    shown = []
    monkeypatch.setattr(handling, "as_text", lambda found: shown.append(found) or "the modes")
    document = {"margins": rows, "handling": modes, "gain_margin_db": 6.0, "phase_margin_deg": 45.0}
    text = linearise.Linearise("any").as_text(document, colour=False)
    *table, empty, modes_of = text.splitlines()
    assert (empty, modes_of) == ("", "the modes")
    assert table[1].split() == ["none", "flap", "7.2", "5.5", "58.5", "42"]
    assert table[-1] == "2 loops, 1 with less than 6 dB or 45 deg"
    assert shown == [[handling.Quality("trimmed", 30.0, "spiral", "time to double", np.inf, 1)]]
