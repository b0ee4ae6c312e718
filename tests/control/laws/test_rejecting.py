"""The default law: rejects what it is not told of, and leaves the diagnosis what it is told."""

import numpy as np
import pytest

from beaver_ftc.loop.loop import Loop
from beaver_ftc.plant import channels as ch
from flying import Memory, flown, loss, scenario

NEW, OLD = {"law": "fault-tolerant"}, {"law": "fault-tolerant-published"}
REAL = {
    "sensors": "tactical-grade", "actuators": "servo",
    "environment": {"turbulence": "dryden", "severity": "light"},
    "fdi": {"bounds": {"sensors": "tactical-grade", "turbulence": "light"}},
}  # fmt: skip


def error_deg_s(log, from_s=2.0):
    return np.sqrt(sum(log.rms_deg_s(axis, from_s, np.inf) ** 2 for axis in "pqr"))


class TestInRealAir:
    @pytest.mark.parametrize(("severity", "V"), [("light", 38.0), ("moderate", 52.0)])
    def test_a_tenth_of_the_published_laws_error(self, severity, V):
        real = REAL | {"environment": {"turbulence": "dryden", "severity": severity}}
        ours, published = (
            error_deg_s(flown(duration_s=12, initial={"airspeed_mps": V}, control=law, **real)[1])
            for law in (NEW, OLD)
        )
        assert ours < 0.1 * published

    def test_no_more_than_any_rival_and_no_shaking(self):
        error, travel = {}, {}
        for law in ("fault-tolerant", "indi", "lqr", "l1-adaptive"):
            flight, log = flown(duration_s=12, control={"law": law}, **REAL)
            error[law], travel[law] = error_deg_s(log), sum(flight.surface_travel_rad.values())
        ours = error.pop("fault-tolerant")
        best = min(error, key=error.get)
        assert ours <= error[best]
        assert travel["fault-tolerant"] <= 1.3 * travel[best]


class TestWithoutAir:
    def test_the_frames_of_delay_are_allowed_for(self):
        """Nothing to reject: what is left is the change of the reference within a frame."""
        _flight, log = flown(duration_s=10, uncertainty={}, control=NEW)
        assert error_deg_s(log) < 0.02

    def test_a_wrong_model_is_found_out(self):
        wrong = {"coefficients": {"Cm_0": 1.3, "Cl_p": 0.7, "Cn_beta": 1.3}}
        _, ours = flown(duration_s=12, uncertainty=wrong, control=NEW)
        _, published = flown(duration_s=12, uncertainty=wrong, control=OLD)
        assert error_deg_s(ours, 4.0) < 0.2 * error_deg_s(published, 4.0)

    @pytest.mark.parametrize("magnitude", [0.4, 0.8, 1.0])
    def test_an_elevator_loss_is_carried(self, magnitude):
        flight, log = flown(faults=[loss(magnitude=magnitude)], control=NEW, duration_s=24)
        assert [mode for _, mode in flight.supervisor] == ["nominal", "adaptive", "reallocated"]
        assert log.rms_deg_s("q", 14.0) < 0.1

    @pytest.mark.parametrize("V", [38.0, 45.0, 52.0])
    def test_the_unanticipated_fault_is_kept(self, V):
        fault = {"type": "unanticipated", "Cm_alpha3": 10, "at_s": 8}
        flight, log = flown(duration_s=25, faults=[fault], initial={"airspeed_mps": V}, control=NEW)
        assert flight.departure is None
        assert log.rms_deg_s("q", 9.0) < 0.1


class TestTheDiagnosisIsNotDisturbed:
    """It is told the command in effect, whatever gave it."""

    @pytest.mark.parametrize("surface", ["aileron", "elevator", "rudder"])
    def test_the_residual_of_a_healthy_flight_is_the_models_error_alone(self, surface):
        """The residual stays within the bound, and the fault is named."""
        flight, _ = flown(faults=[loss(surface, 0.5, at_s=6.0)], duration_s=16, control=NEW)
        assert flight.detection_time_s >= 6.0
        assert flight.isolated == surface
        assert flight.worst_residual_ratio < 1.0
        assert flight.estimate == pytest.approx(-0.5, abs=0.03)

    def test_the_command_that_is_diagnosed_is_the_one_in_effect(self):
        """With servos: where the diagnosis has the surfaces is where they are, lead or not."""
        memory = Memory()
        loop = Loop(scenario(duration_s=4, actuators="servo", control=NEW))
        memory.open(loop.columns)
        for rows in loop.chunks():
            memory.write(rows)
            behind = np.abs(
                loop.frames[0]["prediction"]["u_old"] - loop.frames[0]["truth"]["value"][ch.POS : ch.POS + 4]
            )
        assert behind.max() < 1e-9
