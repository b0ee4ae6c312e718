"""The design model as a plant, on which the theory holds exactly: x[k+1] = x[k] + dt (f + G u + phi + eta).

A flight condition that moves, a law that follows changing references, an uncertainty that fights the
diagnosis with all it is allowed, and a fault with any course in time. The diagnosis is the flying one,
frame for frame.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.table import N_Y
from beaver_ftc.diagnosis.bounds import ROUNDING_RAD_S2
from beaver_ftc.diagnosis.model_prediction import evaluate_design
from beaver_ftc.loop.accounts import keep_closest
from beaver_ftc.loop.assembly import configure_design
from beaver_ftc.loop.frame import evaluate_elapsed
from beaver_ftc.loop.stepping import diagnose
from beaver_ftc.scenario.schema import Scenario

TRAVEL_RAD = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])


@kernel
def evaluate(frames):
    """What the design model makes of this instant, and of the frame that ends with it."""
    frame = frames[0]
    evaluate_design(frame.prediction, frame.measured)
    evaluate_elapsed(frame)


@kernel
def note(frames):
    """How close the residuals have come to their thresholds."""
    frame = frames[0]
    keep_closest(frame.accounts.closest, frame.fdi.bank, frame.fdi.statistical.alarm)


def conclude(frames):
    """The flying diagnosis of this instant: compiled once, for all who call it from Python."""
    diagnose(frames)
    note(frames)


class DesignPlant:
    """One flight. theta(k): lost effectiveness of `surface` at frame k, 0 while healthy; or position(k, u):
    where it really is, rad.
    """

    def __init__(
        self,
        seed=0,
        rate_hz=100.0,
        airspeed_mps=45.0,
        surface=None,
        theta=None,
        position=None,
        actuators="ideal",
        beside=(),
        aircraft=None,
        **fdi,
    ):
        keys = {"rate_hz": rate_hz, "fdi": fdi, "actuators": actuators}
        scenario = Scenario.model_validate({"name": "design-plant", **keys})
        scenario._airframe = aircraft
        self.servo = actuators == "servo"
        self.frames = configure_design(scenario, TRAVEL_RAD)
        self.frame, self.fdi = self.frames[0], self.frames[0]["fdi"]
        self.fdi["bound"]["earth_rate_rad_s"] = 0.0  # this plant flies over a flat Earth at rest
        self.dt, self.airspeed_mps = 1.0 / rate_hz, airspeed_mps
        self.surface = surface
        self.position = position or (lambda k, u: u * (1 + theta(k)) if theta else u)
        self.beside = beside  # (surface, position) of further faults
        self.rng = np.random.default_rng(seed)
        self.wave = self.rng.uniform(0.2, 2.0, 8), self.rng.uniform(0, 6.28, 8)
        self.amplitude = self.rng.uniform(0.0, 0.2, 3)
        self.x, self.u, self.k = self.rng.uniform(-0.05, 0.05, 3), np.zeros(4), 0
        self.commanded = np.zeros(4)
        self.innovations, self.bounds = [], []

    def _waves(self):
        frequency, phase = self.wave
        return np.sin(frequency * self.k * self.dt + phase)

    def condition(self):
        """y: incidence and airspeed wander slowly."""
        w = self._waves()
        V = self.airspeed_mps * (1 + 0.05 * w[0])
        y = np.zeros(N_Y)
        y[:5] = 0.1 + 0.05 * w[1], 0.05 * w[2], V, 0.5 * V * V, 0.3 + 0.1 * w[3]
        return y

    def command(self, f, G):
        """Feedback linearisation towards square and sine references, limited: it need not be a good law."""
        w = self._waves()
        reference = self.amplitude * np.array([np.sign(w[4]), w[5], np.sign(w[6])])
        u = np.linalg.solve(G[:, :3], 3.0 * (reference - self.x) - f)
        return np.append(np.clip(u, -0.4, 0.4), 0.0)

    def moved(self, u, command):
        """Where an actuator at u is a frame later: 20 rad/s, 60 deg/s."""
        if not self.servo:
            return command
        farthest = np.deg2rad(60) * self.dt
        return u + np.clip((command - u) * (1 - np.exp(-20 * self.dt)), -farthest, farthest)

    def effect(self, G):
        """phi of the fault, rad/s2."""
        faults = [] if self.surface is None else [(self.surface, self.position), *self.beside]
        off = [G[:, s] * (position(self.k, self.u[s]) - self.u[s]) for s, position in faults]
        return np.sum(off, axis=0) if off else np.zeros(3)

    def fly(self, frames, uncertainty, until=lambda plant: False):
        """Fly so many frames, or until `until`, against `uncertainty(plant, bound, phi)` in rad/s2."""
        for _ in range(frames):
            self._step(uncertainty)
            if until(self):
                break
        return self

    def _step(self, uncertainty):
        frame = self.frame
        frame["k"], frame["t"] = self.k, self.k * self.dt
        measured, prediction = frame["measured"], frame["prediction"]
        measured["x"], measured["y"], prediction["u"] = self.x, self.condition(), self.u
        prediction["commanded"] = self.commanded
        evaluate(self.frames)
        f, G = prediction["f"].copy(), prediction["G"].copy()
        phi = self.effect(G)
        frame["accounts"]["guarantee"]["phi"] = phi
        bound = np.maximum(self.fdi["bound"]["eta_now"] - ROUNDING_RAD_S2, 0.0)
        conclude(self.frames)
        eta = np.clip(uncertainty(self, bound, phi), -bound, bound)
        self.innovations.append(phi + eta)
        self.bounds.append(bound)
        self.x = self.x + self.dt * (f + G @ self.u + phi + eta)
        self.commanded = self.command(f, G)
        self.u = self.moved(self.u, self.commanded)
        self.k += 1

    @property
    def detected_at_s(self):
        return float(self.fdi["verdict"]["detected_at_s"]) if self.fdi["verdict"]["detected"] else np.inf

    @property
    def certain_after_s(self):
        certain = float(self.frame["accounts"]["guarantee"]["certain_after_s"])
        return certain if certain >= 0 else np.inf

    def excluded(self, surface):
        """Whether the estimator of a surface has been excluded."""
        return bool(self.fdi["isolation"]["estimator"][surface]["excluded"])

    def position_excluded(self, surface):
        """Whether the estimator of a surface that may be anywhere has been excluded."""
        return self.excluded(int(self.fdi["layout"]["position"][surface]))


def _random(plant, bound, phi):
    return plant.rng.uniform(-bound, bound)


def _bang_bang(plant, bound, phi):
    held = plant.k // 7
    return bound * np.sign(np.random.default_rng(held).uniform(-1, 1, 3))


def _push(plant, bound, phi):
    """Everything in the direction in which the residual already leans."""
    return bound * np.where(plant.fdi["bank"]["output"]["residual"][0] >= 0, 1.0, -1.0)


def _hide(plant, bound, phi):
    """As much of the fault as possible is undone."""
    return -phi


def _exaggerate(plant, bound, phi):
    """The fault seems larger than its set allows."""
    return np.where(phi == 0.0, bound, np.sign(phi) * bound)


def _sinusoid(plant, bound, phi):
    return bound * np.sin(plant.wave[0][7] * 10 * plant.k * plant.dt)


def _across(plant, bound, phi):
    """The fault seems to be another surface's: roll and yaw are pushed apart."""
    return bound * np.array([1.0, np.sign(plant.k % 3 - 1.0), -1.0]) * (1 if plant.k // 20 % 2 else -1)


UNCERTAINTIES = {
    "random": _random,
    "bang-bang": _bang_bang,
    "push": _push,
    "hide": _hide,
    "exaggerate": _exaggerate,
    "sinusoid": _sinusoid,
    "across": _across,
}
