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


@pytest.mark.parametrize("surface", SURFACES)
class TestOneFault:
    def check(self, surface, kind, expected, tolerance=1e-9, **more):
        """expected(command, time since the fault) while it is there; the command itself before and after."""
        log, inside = deflections(fault(surface, kind, **more))
        command, effective = log[f"{surface}_cmd_rad"], log[f"{surface}_effective_rad"]
        since = log["t_s"] - 1.0
        assert effective[inside] == pytest.approx(expected(command, since)[inside], abs=tolerance)
        assert effective[~inside] == pytest.approx(command[~inside], abs=1e-12)

    def test_loss(self, surface):
        self.check(surface, "loss_of_effectiveness", lambda u, t: 0.7 * u, magnitude=0.3)

    def test_incipient_loss(self, surface):
        def expected(u, t):
            return u * (1 - 0.5 * (1 - np.exp(-2 * np.maximum(t, 0))))

        more = {"magnitude": 0.5, "profile": "incipient", "kappa_per_s": 2}
        self.check(surface, "loss_of_effectiveness", expected, **more)

    def test_stuck(self, surface):
        self.check(surface, "stuck", lambda u, t: np.full_like(u, np.deg2rad(3)), position_deg=3)

    def test_float(self, surface):
        self.check(surface, "float", lambda u, t: np.zeros_like(u))

    @pytest.mark.parametrize("direction", [-1, 1])
    def test_hardover(self, surface, direction):
        low, high = SURFACES[surface]
        log, inside = deflections(fault(surface, "hardover", direction=direction))
        effective = log[f"{surface}_effective_rad"][inside]
        stop = high if direction > 0 else low
        moves = np.diff(effective) * direction * 100
        running = np.abs(effective[1:] - stop) > 1e-9
        assert moves[running] == pytest.approx(RUNAWAY_RAD_S, abs=1e-3)
        assert (moves >= -1e-9).all()
        if surface != "flap" or direction < 0:
            assert effective[-1] == pytest.approx(stop)

    def test_bias(self, surface):
        low, high = SURFACES[surface]
        self.check(surface, "bias", lambda u, t: np.clip(u + np.deg2rad(2), low, high), bias_deg=2)

    def test_oscillation(self, surface):
        log, inside = deflections(
            fault(surface, "oscillatory", end_s=2.4, amplitude_deg=2, frequency_rad_s=20)
        )
        swing = (log[f"{surface}_effective_rad"] - log[f"{surface}_cmd_rad"])[inside]
        assert swing.max() == pytest.approx(np.deg2rad(2), rel=0.02)
        assert swing.min() == pytest.approx(-np.deg2rad(2), rel=0.02)
        flips = np.sum(np.diff(np.sign(swing)) != 0)
        assert flips == pytest.approx(1.4 * 20 / np.pi, abs=1)

    def test_rate_limit(self, surface):
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
