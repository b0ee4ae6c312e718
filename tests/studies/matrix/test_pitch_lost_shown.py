"""Elevator and flap lost: the report of rows made by hand, the linear numbers, short rows, the scenarios."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import block_diag

from beaver_ftc.scenario.diagnosis import EnginePower
from beaver_ftc.studies.matrix import pitch_lost
from beaver_ftc.studies.matrix.pitch_lost import (
    FILES,
    LAWS,
    LOST,
    PitchCase,
    about_trim,
    as_text,
    closed_loop,
    document_of,
    fly_case,
    loop_response,
    margins,
    run_pitch_lost,
    scenario_of,
)
from beaver_ftc.studies.present.page import contents
from kept import in_short

UNLIMITED = {
    "airspeed_mps": 52.0, "phugoid_damping": [0.05, 1.0], "gain_margin_db": None, "phase_margin_deg": None,
    "attitude_zero_rad_s": 0.123, "worth_deg": [-1.25, 2.5],
}  # fmt: skip


def outcome(number, departure=None):
    lost = departure is not None
    return {
        "q_rms_deg_s": None if lost else 0.5 + number / 10, "theta_swing_deg": None if lost else 2.0 + number,
        "outside_share": 0.25 if number % 4 == 1 else 0.0, "departure": departure,
    }  # fmt: skip


def rows_of(speeds):
    gone = {"time_s": 19.46, "signal": "alpha_rad"}
    return [
        {
            "law": law, "lost": name, "airspeed_mps": V,
            "without": outcome(i + 10 * j, gone if i in (1, 2, 3) else None),
            "with": outcome(i + j, gone if i in (3, 4) and law == LAWS[1] else None),
        }
        for law in LAWS for i, name in enumerate(LOST) for j, V in enumerate(speeds)
    ]  # fmt: skip


def test_the_report(changed):
    document = document_of(rows_of((45.0, 52.0)), (45.0,))
    document["margins"].append(UNLIMITED)
    assert not changed(as_text(document).splitlines(), "text")
    assert not changed({key: value for key, value in document.items() if key != "flights"})
    assert contents(FILES, document)["pitch-lost.txt"] == as_text(document) + "\n"
    assert list(contents(FILES, document)) == ["pitch-lost.json", "pitch-lost.txt"]
    assert document_of(rows_of((45.0,))[:3], (45.0,))["passed"]


def test_columns_stand_below_each_other():
    """A cell with two losses and a star is the widest there is."""
    rows = rows_of((45.0, 52.0))
    for row in rows:
        row["without"] = row["with"] = outcome(1, {"time_s": 19.5})
    margins_of = [{**UNLIMITED, "airspeed_mps": V} for V in (45.0, 52.0)]
    found = {"flights": rows, "margins": margins_of, "saved": 0, "harmed": 0}
    head, first = as_text(found).splitlines()[:2]
    assert [head.index(speed) for speed in ("45", "52")] == [
        i for i in range(len(first)) if first[i:].startswith("lost")
    ][::2]
    assert first.count("lost 19.5 s > lost 19.5 s* lost") == 1


def test_the_linear_loop(changed):
    config = EnginePower()
    model, power, trim_inhg = about_trim(38.0)
    response = loop_response(model.A, power, config)
    assert not changed({
        "A": model.A, "power": power, "trim_inhg": trim_inhg, "closed": closed_loop(model.A, power, config),
        "response": [in_short(response.real), in_short(response.imag)],
        "margins": margins(38.0, config),
    })  # fmt: skip


def test_the_slowest_damping_and_the_least_margins_are_those_of_known_systems():
    def turning(rate, damping):
        return np.array([[0.0, 1.0], [-(rate**2), -2.0 * damping * rate]])

    two = np.block([[turning(0.9, 0.3), np.zeros((2, 2))], [np.zeros((2, 2)), turning(1.1, 0.1)]])
    assert pitch_lost._phugoid_damping(two) == pytest.approx(0.3)
    assert pitch_lost._phugoid_damping(turning(0.5, 1.5)) == 1.0
    w = 1j * pitch_lost.FREQUENCIES_RAD_S
    gain_db, phase_deg = pitch_lost._least_margins(4.0 / (w + 1.0) ** 3)  # of 8 at sqrt(3)
    assert gain_db == pytest.approx(20 * np.log10(2.0), abs=0.02)
    crossing = np.sqrt(4.0 ** (2 / 3) - 1.0)
    assert phase_deg == pytest.approx(180.0 - 3 * np.degrees(np.arctan(crossing)), abs=0.1)
    assert pitch_lost._least_margins(0.5 / (w + 1.0)) == (None, None)
    gain_db, phase_deg = pitch_lost._least_margins(16.0 / (w + 1.0) ** 3)  # half of it would be stable
    assert gain_db == pytest.approx(20 * np.log10(2.0), abs=0.02)
    assert phase_deg == pytest.approx(3 * np.degrees(np.arctan(np.sqrt(16 ** (2 / 3) - 1))) - 180.0, abs=0.1)


@pytest.fixture
def short(monkeypatch):
    for name, value in (("DURATION_S", 4.0), ("AT_S", 1.0), ("SETTLED_S", 2.5)):
        monkeypatch.setattr(pitch_lost, name, value)


@pytest.mark.parametrize("lost", ["elevator -1 deg", "flap 20 deg down"])
def test_a_row(lost, short, changed):
    assert not changed(fly_case(PitchCase(lost, 38.0, LAWS[0])))


def test_the_flights_of_the_cases(changed):
    flown = {lost: scenario_of(PitchCase(lost, 45.0, LAWS[1]), True).model_dump(mode="json") for lost in LOST}
    assert not changed(
        {
            lost: [{k: v for k, v in f.items() if v is not None} for f in one["faults"]]
            for lost, one in flown.items()
        }
    )
    whole = scenario_of(PitchCase("elevator floats", 45.0, LAWS[1]), False)
    assert not changed(whole.model_dump(mode="json", exclude_defaults=True), "whole")
    assert not whole.control.power.enabled
    assert scenario_of(PitchCase("elevator floats", 45.0, LAWS[1]), True).control.power.enabled


@pytest.mark.parametrize("given", [None, (38.0,)])
def test_a_run_flies_every_pair_under_every_law(given, monkeypatch, tmp_path):
    seen = []

    def made(case):
        seen.append(case)
        return {**case._asdict(), "without": outcome(0), "with": outcome(0)}

    monkeypatch.setattr(pitch_lost, "fly_case", made)
    monkeypatch.setattr(pitch_lost, "LOST", dict(list(LOST.items())[:2]))
    document = run_pitch_lost(tmp_path, given)
    speeds = given or (38.0, 45.0, 52.0)
    assert seen == [PitchCase(lost, V, law) for law in LAWS for lost in list(LOST)[:2] for V in speeds]
    assert [found["airspeed_mps"] for found in document["margins"]] == list(speeds)
    assert document["passed"]


def test_the_phugoid_is_the_slow_oscillation_that_is_damped_least():
    """Pairs of poles of frequency and damping (0.2, 0.3), (0.3, 0.1); a fast and a real one do not count."""

    def pair(frequency, damping):
        return np.array([[0.0, 1.0], [-(frequency**2), -2.0 * damping * frequency]])

    system = block_diag(pair(0.2, 0.3), pair(0.3, 0.1), pair(5.0, 0.05), [[-0.01]])
    assert pitch_lost._phugoid_damping(system) == pytest.approx(0.1)
    assert pitch_lost._phugoid_damping(pair(5.0, 0.05)) == 1.0


@pytest.mark.parametrize("lost", [False, True])
def test_an_outcome_is_of_what_came_since_the_fault_and_once_settled(lost, monkeypatch):
    """Frames at 11, 12, 20, 30 and 40 s: the fault is at 12 s, settled is from 30 s on."""
    columns = {
        "t_s": [11.0, 12.0, 20.0, 30.0, 40.0], "q_rad_s": [9.0, 8.0, 7.0, 0.03, -0.04],
        "theta_rad": [9.0, 2.0, -3.0, 0.1, 0.35], "phi_rad": [9.0, 0.2, -0.5, 0.3, 0.1],
        "airspeed_mps": [99.0, 41.0, 38.0, 45.0, 43.0], "envelope_valid": [0.0, 1.0, 0.0, 1.0, 1.0],
    }  # fmt: skip
    made = SimpleNamespace(document=lambda: {"time_s": 50.0}) if lost else None
    power = SimpleNamespace(document=lambda: {"from_s": 13.0}) if lost else None

    def fly(scenario, kept):
        kept |= {name: np.array(column) for name, column in columns.items()}

    monkeypatch.setattr(pitch_lost, "fly", fly)
    monkeypatch.setattr(
        pitch_lost, "measure", lambda landing: SimpleNamespace(departure=made, engine_power=power)
    )
    found = pitch_lost._outcome("flight")
    assert found == {
        "q_rms_deg_s": None if lost else pytest.approx(np.degrees(np.sqrt(0.00125))),
        "theta_swing_deg": None if lost else pytest.approx(np.degrees(0.25)),
        "airspeed_mps": [38.0, 45.0], "bank_deg": pytest.approx(np.degrees(0.5)), "outside_share": 0.25,
        "departure": {"time_s": 50.0} if lost else None, "engine_power": {"from_s": 13.0} if lost else None,
    }  # fmt: skip
