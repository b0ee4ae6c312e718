"""Every fault type on every surface in the truth: what the aerodynamics see, from the log, and repair."""

import numpy as np
import pytest

from flying import flown

SURFACES = {
    "aileron": (-0.52, 0.52),
    "elevator": (-0.49, 0.49),
    "rudder": (-0.44, 0.44),
    "flap": (-0.1, 1.03),
}
RUNAWAY_RAD_S = 1.0472


def fault(actuator, kind, at_s=1.0, end_s=1.6, **more):
    return {"actuator": actuator, "type": kind, "at_s": at_s, "end_s": end_s, **more}


def deflections(*faults, **keys):
    """(log, inside): `inside` is True in the frames of the first fault."""
    keys = {"control": {"law": "nominal"}, **keys}
    _, log = flown(duration_s=2.5, faults=list(faults), fdi={"scheme": "none"}, **keys)
    t = log["t_s"]
    return log, (t > faults[0]["at_s"] - 1e-9) & (t < faults[0]["end_s"] - 1e-9)


def grown(t):
    return 1 - np.exp(-2 * np.maximum(t, 0))


# Type, its keys, and what the aerodynamics see of a command u, t seconds after the fault, within (low, high).
ACTS = [
    ("loss_of_effectiveness", {"magnitude": 0.3}, lambda u, t, *_: 0.7 * u),
    ("loss_of_effectiveness", {"magnitude": 0.5, "profile": "incipient", "kappa_per_s": 2},
     lambda u, t, *_: u * (1 - 0.5 * grown(t))),
    ("stuck", {"position_deg": 3}, lambda u, t, *_: np.full_like(u, np.deg2rad(3))),
    ("float", {}, lambda u, t, *_: np.zeros_like(u)),
    ("bias", {"bias_deg": 2}, lambda u, t, low, high: np.clip(u + np.deg2rad(2), low, high)),
]  # fmt: skip


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize(("kind", "keys", "expected"), ACTS)
def test_it_acts_while_it_is_there_alone(surface, kind, keys, expected):
    log, inside = deflections(fault(surface, kind, **keys))
    command, effective = log[f"{surface}_cmd_rad"], log[f"{surface}_effective_rad"]
    acts = expected(command, log["t_s"] - 1.0, *SURFACES[surface])
    assert effective[inside] == pytest.approx(acts[inside], abs=1e-9)
    assert effective[~inside] == pytest.approx(command[~inside], abs=1e-12)


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("direction", [-1, 1])
def test_a_hardover_runs_to_its_stop(surface, direction):
    log, inside = deflections(fault(surface, "hardover", direction=direction))
    effective = log[f"{surface}_effective_rad"][inside]
    stop = SURFACES[surface][direction > 0]
    moves = np.diff(effective) * direction * 100
    running = np.abs(effective[1:] - stop) > 1e-9
    assert moves[running] == pytest.approx(RUNAWAY_RAD_S, abs=1e-3)
    assert (moves >= -1e-9).all()
    if surface != "flap" or direction < 0:
        assert effective[-1] == pytest.approx(stop)


@pytest.mark.parametrize("surface", SURFACES)
def test_an_oscillation_swings_about_the_command(surface):
    swinging = fault(surface, "oscillatory", end_s=2.4, amplitude_deg=2, frequency_rad_s=20)
    log, inside = deflections(swinging)
    swing = (log[f"{surface}_effective_rad"] - log[f"{surface}_cmd_rad"])[inside]
    assert [swing.max(), -swing.min()] == pytest.approx([np.deg2rad(2)] * 2, rel=0.02)
    assert np.sum(np.diff(np.sign(swing)) != 0) == pytest.approx(1.4 * 20 / np.pi, abs=1)


@pytest.mark.parametrize("surface", SURFACES)
def test_a_rate_limit_is_kept(surface):
    log, inside = deflections(fault(surface, "rate_limit", scale=0.01))
    moves = np.abs(np.diff(log[f"{surface}_effective_rad"][inside])) * 100
    assert moves.max() <= 0.01 * RUNAWAY_RAD_S + 1e-6


def test_faults_on_several_surfaces_and_several_on_one_overlap():
    log, _ = deflections(
        fault("elevator", "bias", end_s=2.0, bias_deg=1),
        fault("elevator", "loss_of_effectiveness", at_s=1.2, end_s=1.8, magnitude=0.5),
        fault("aileron", "stuck", at_s=1.1, end_s=1.5, position_deg=-2),
        fault("rudder", "float", at_s=1.4, end_s=2.2),
    )
    t = log["t_s"]

    def effective_at(surface, instant):
        k = np.argmin(np.abs(t - instant))
        return log[f"{surface}_effective_rad"][k], log[f"{surface}_cmd_rad"][k]

    for instant, share, bias_deg in ((0.5, 1, 0), (1.1, 1, 1), (1.5, 0.5, 1), (1.9, 1, 1), (2.3, 1, 0)):
        effective, command = effective_at("elevator", instant)
        assert effective == pytest.approx(share * (command + np.deg2rad(bias_deg)), abs=1e-12)
    assert effective_at("aileron", 1.3)[0] == pytest.approx(np.deg2rad(-2))
    assert effective_at("aileron", 1.6)[0] == effective_at("aileron", 1.6)[1]
    assert effective_at("rudder", 2.0)[0] == 0.0
