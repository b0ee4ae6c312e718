"""Proposals that tell candidates apart do so when they are flown, and what is said to be impossible is."""

import json
import sys
from dataclasses import replace
from math import radians
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import beaver_ftc as bf
from beaver_ftc.cli.main import main
from beaver_ftc_assurance.candidates import Candidate, distinguish
from beaver_ftc_assurance.doublet import Situation, doublet
from beaver_ftc_assurance.separation import as_text, separate
from fault_kinds import BIAS, FLOAT, STUCK
from samples import samples

SMALL = {
    "p": [{"sine": {"amplitude_deg_s": 1, "frequency_hz": 0.5}}],
    "r": [{"sine": {"amplitude_deg_s": 0.5, "frequency_hz": 0.3}}],
}
STUCK_AILERON = {"type": "stuck", "actuator": "aileron", "position_deg": 0.6, "at_s": 1}
NAMES = ("aileron", "elevator", "rudder", "flap")
PLAIN = Situation(
    G=np.array([[-10.0, 0.0, 2.0, 0.0], [0.0, -8.0, 0.0, -4.0], [-1.0, 0.0, -3.0, 0.0]]),
    u=np.zeros(4), x=np.zeros(3), rate=radians(20), bound=np.full(3, 0.02),
    stops=np.array([[-0.3] * 4, [0.3] * 4]), approach=np.ones(4), step=np.full(4, np.inf), instants=1,
    in_blocks=False, dt=0.01, alpha=0.05, alpha_range=(-0.1, 0.28),
)  # fmt: skip


def ambiguous(**more):
    """A flight that ends while two candidates are left."""
    fdi = {"fault_class": "all", "sensor_monitor": "never", **more.pop("fdi", {})}
    return bf.load(
        {"name": "open", "duration_s": 1.1, "fdi": fdi, "reference": SMALL, "faults": [STUCK_AILERON], **more}
    )


def test_what_is_left_of_a_bias_holds_the_true_one():
    bias = {"type": "bias", "actuator": "aileron", "bias_deg": 2.0, "at_s": 1}
    pairs = separate(ambiguous(faults=[bias], duration_s=1.03))["pairs"]
    left = [one["deg"] for pair in pairs for one in pair["candidates"] if one["type"] == "bias"]
    assert left
    assert all(low <= 2.0 <= high for low, high in left)


@pytest.mark.parametrize("substeps", [1, 3])
def test_what_is_proposed_tells_apart_when_it_is_flown(substeps):
    document = separate(ambiguous(fdi={"probing": {}}, substeps=substeps))
    told = [pair for pair in document["pairs"] if pair["separates"]]
    assert told
    assert document["passed"]
    for pair in told:
        assert [one["type"] for one in pair["left"]] in ([], ["stuck"])


def test_it_takes_what_the_two_intervals_ask_for():
    """Jammed at 2 deg, or a loss of all: apart by 2 deg wherever it is commanded."""
    jam, floating = Candidate(1, STUCK, 0.03, 0.031), Candidate(1, FLOAT, 0.0, 0.0)
    assert distinguish(jam, floating, PLAIN, NAMES)["separates"]
    room = 2 * 1.1 * 0.02 / 8.0
    near = replace(jam, low=0.9 * room, high=0.95 * room)
    pair = distinguish(near, floating, PLAIN, NAMES)
    assert not pair["separates"]
    assert pair["needs"]["elevator"]["at_least_deg"] == pytest.approx(np.degrees(room))
    biased = Candidate(1, BIAS, 1.2 * room, 1.25 * room)
    pair = distinguish(near, biased, PLAIN, NAMES)
    assert pair["separates"]  # one of them follows the command: from 1.25 - 1.35 to less than 0.9 - 1
    assert pair["amplitude_deg"] == pytest.approx(np.degrees(1.35 * room), abs=0.06)
    assert not distinguish(near, replace(biased, low=0.9 * room), PLAIN, NAMES)["separates"]  # as health is


def test_surfaces_that_act_along_one_direction_cannot_be_told_apart_by_a_frame():
    pair = distinguish(Candidate(1, STUCK, 0.1, 0.11), Candidate(3, STUCK, 0.2, 0.22), PLAIN, NAMES)
    assert not pair["separates"]
    assert "no direction shows the fault" in pair["because"]


def test_a_surface_without_effect_shows_no_type():
    none = replace(PLAIN, G=np.zeros((3, 4)))
    pair = distinguish(Candidate(1, STUCK, 0.1, 0.11), Candidate(1, FLOAT, 0.0, 0.0), none, NAMES)
    assert "no direction shows the fault" in pair["because"]
    assert pair["needs"]["elevator"]["at_least_deg"] is None


@settings(max_examples=samples(25), deadline=None)
@given(st.floats(-0.2, 0.2), st.sampled_from([1, 2, 4]), st.floats(0.3, 1.0), st.floats(0.005, 0.1))
def test_a_doublet_is_there_and_back_within_every_limit(target, instants, approach, step):
    at = replace(PLAIN, instants=instants, approach=np.full(4, approach), step=np.full(4, step))
    found = doublet({0: target}, at)
    if found is None:
        return
    commands, tells = found
    p, last, rates, seen = 0.0, 0.0, np.zeros(3), []
    for command in commands[:, 0]:
        mean = 0.0
        for instant in range(instants):
            if instants == 1 or instant:
                p += approach * (command - p)
            mean += p / instants
        if instants > 1:
            p += approach * (command - p)
        assert abs(mean - last) <= step * instants + 1e-7
        last = mean
        rates = rates + at.dt * at.G[:, 0] * mean
        assert (abs(rates) <= at.rate + 1e-7).all()
        seen.append(mean)
    assert abs(rates) == pytest.approx(0.0, abs=1e-6)
    assert (abs(commands) <= 0.3 + 1e-7).all()
    there = np.array(seen[tells - at.frames_held : tells]) * np.sign(target)
    assert (there >= abs(target) - 1e-7).all()


def test_where_frames_are_examined_in_blocks_no_frame_tells_types_apart():
    both = Candidate(0, STUCK, 0.1, 0.11), Candidate(0, BIAS, 0.1, 0.11)
    assert distinguish(*both, PLAIN, NAMES)["separates"]
    assert "blocks of frames" in distinguish(*both, replace(PLAIN, in_blocks=True), NAMES)["because"]


def test_where_a_surface_already_tells_it_is_held():
    """A jam at neutral and a bias differ by 0.15 rad where the surface is: between two deflections tried."""
    there = replace(PLAIN, u=np.array([0.0, -0.2001, 0.0, 0.0]))
    found = distinguish(Candidate(1, STUCK, 0.0, 0.0), Candidate(1, BIAS, 0.05, 0.06), there, NAMES)
    assert found["amplitude_deg"] == pytest.approx(0.0, abs=1e-9)
    assert np.array(found["commands_rad"]["elevator"]) == pytest.approx(-0.2001, abs=1e-12)
    kinds = [{"surface": "elevator", "type": kind} for kind in ("stuck", "bias")]
    document = {"scenario": "mine", "time_s": 1.0, "assumes": "it stays", "not_constant": []}
    text = as_text(document | {"pairs": [found | {"candidates": kinds}]})
    assert "elevator stuck or elevator bias: elevator held in place, distinguished after 0.03 s" in text


def test_a_slow_actuator_has_all_of_the_half_second():
    """Its travel does not suffice there and back in 16 frames, the time tried before."""
    commands, tells = doublet({0: 0.1}, replace(PLAIN, approach=np.full(4, 0.04)))
    assert tells == 50
    assert abs(commands).max() < 0.3


def test_a_limit_on_the_rates_can_leave_none():
    pair = distinguish(
        Candidate(0, STUCK, 0.1, 0.11), Candidate(0, BIAS, 0.1, 0.11), replace(PLAIN, rate=1e-4), NAMES
    )
    assert not pair["separates"]
    assert "keeps the rates below" in pair["because"]


@pytest.mark.parametrize(
    ("scenario", "says"),
    [
        ({"faults": []}, "no alarm was raised"),
        ({"fdi": {"fault_class": "published"}}, "one candidate or none is left"),
        ({"fdi": {"scheme": "none"}}, "'none' states no bounds"),
        ({"fdi": {"pairs": True}}, "fdi.pairs: two faults"),
        ({"duration_s": 1.07}, "the flight ends with its alarm"),
    ],
)
def test_what_cannot_be_asked_is_refused_in_a_line(scenario, says):
    with pytest.raises(bf.BadInput, match=says):
        separate(ambiguous(**scenario))


def test_by_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("open.yaml").write_text(json.dumps(ambiguous().model_dump(mode="json", exclude_none=True)))
    monkeypatch.setattr(sys, "argv", ["beaver-ftc", "separate", "open.yaml", "--format", "json"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    answered = json.loads(capsys.readouterr().out)
    written = json.loads(Path("runs/open-separation/separation.json").read_text())
    assert answered == written | {"folder": "runs/open-separation"}
    assert "aileron" in as_text(written)
