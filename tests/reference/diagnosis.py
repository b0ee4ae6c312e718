"""The diagnosis of a whole flight, from readings and commands to names.

readings, commands -> prediction -> innovation and bound -> bank -> alarm -> isolation -> verdict
"""

from typing import NamedTuple

import numpy as np

from reference.bounds import Bounds, gyro_error
from reference.declaration import AXES, Declaration
from reference.detection import Bank
from reference.directions import uses_forces
from reference.forces import Force
from reference.isolation import Frame, Isolation
from reference.naming import UNANTICIPATED, Finding, Naming, Withdrawn
from reference.noise import Noise
from reference.pairs import Pairs
from reference.parity import Rows
from reference.prediction import DesignModel, Frames, frames_of, mean_of_frames, servo_positions
from reference.statistical import Statistical
from reference.types import Loss


class Readings(NamedTuple):
    """What the diagnosis reads, a row for each instant: JSBSim steps from the first frame on, n_s a frame.

    x (instants, 3) rad/s; y (instants, 4 + signals): alpha, beta, V, qdyn, signals; attitude (instants, 3)
    rad: bank, pitch, heading; force (instants, 3) m/s2, of accelerometers;
    altitude (instants,) m; command (instants, surfaces) rad: the one that acts at the end of each step.
    After the alarm also, a row for each frame, what the law takes for known: network (frames, 3) rad/s2 and
    effectiveness (frames, surfaces).
    trim: x, y, u at the start of the flight.
    """

    x: np.ndarray
    y: np.ndarray
    attitude: np.ndarray
    force: np.ndarray
    altitude: np.ndarray
    command: np.ndarray
    network: np.ndarray
    effectiveness: np.ndarray
    trim: tuple[np.ndarray, np.ndarray, np.ndarray]


class Result(NamedTuple):
    """columns: arrays by the names of log.parquet, a row for each frame. alarm: (frame, axis) or None; names:
    (frame, name) of each change of the name, None for none. findings: what is said at the end. withdrawn:
    names, and types of names that stayed, of faults of all types."""

    columns: dict[str, np.ndarray]
    alarm: tuple[int, str] | None
    names: list[tuple[int, str | None]]
    findings: list[Finding]
    withdrawn: tuple[list[Withdrawn], list[Withdrawn]]


class Flight(NamedTuple):
    """What prediction and bounds say of a flight, a row for each frame.

    x: rates rad/s. nu: innovation, eta_bar: its bound, rad/s2. n: changing gyro error, rad/s. of: means.
    """

    x: np.ndarray
    nu: np.ndarray
    eta_bar: np.ndarray
    n: np.ndarray
    of: Frames

    def frame(self, k: int, dt: float) -> Frame:
        """What frame k says."""
        bound = self.eta_bar[k] + (self.n[k] + self.n[k - 1]) / dt
        x, n = self.x[k - 1 : k + 1], self.n[k - 1 : k + 1]
        return Frame(k, k * dt, *x, self.of.F[k], self.nu[k], self.eta_bar[k], bound, *n)


def diagnose(declaration: Declaration, readings: Readings) -> Result:
    """From readings to names."""
    n, (x, y) = declaration.n, (readings.x, readings.y)
    model = DesignModel(declaration)
    model.anchor(*readings.trim)
    u, du = servo_positions(declaration, readings.command, readings.command[0])
    G = model.G(y)
    frames = frames_of(declaration, model.f(x, y), G, u)
    bounds = Bounds(declaration, model, x, y, u, du, readings.altitude)
    at_frames = x[::n]
    nu = np.concatenate([np.full((1, 3), np.nan), np.diff(at_frames, axis=0) / declaration.dt - frames.F[1:]])
    eta_bar, changing = mean_of_frames(n, bounds.now), gyro_error(declaration, at_frames)
    flight = Flight(at_frames, nu, eta_bar, changing, frames)
    bank = Bank(declaration, nu, eta_bar, changing)
    columns = _columns(flight, bank)
    if declaration.to_the_letter:
        bank.E[:, 0] = approximation_residual(declaration, bank, 0, flight, readings)
    detector = None
    if declaration.statistical:
        noise = Noise(declaration, bounds, readings.attitude, readings.force, readings.trim)
        number = 2 if uses_forces(declaration) else 0
        forces = [Force(noise, i, readings.attitude, readings.force) for i in range(number)]
        rows = Rows(noise, frames, forces, nu, readings.attitude, readings.force)
        detector = Statistical(declaration, noise, frames, rows)
    isolation = Isolation(declaration, bank, frames, bounds, G[0])
    naming = None
    if declaration.all_types:
        kind = Pairs if declaration["pairs"] else Naming
        naming = kind(declaration, isolation, bank, bounds, G, readings.command)
    result = Verdict(declaration, flight, bank, isolation, detector, naming).of_flight(columns)
    if result.alarm:
        residual = approximation_residual(declaration, bank, result.alarm[0], flight, readings)
        for i, axis in enumerate(AXES):
            columns[f"{axis}_residual_rad_s"] = residual[:, i]
    return result


def _columns(flight: Flight, bank: Bank) -> dict[str, np.ndarray]:
    residual, threshold = bank.nearest_to_alarm()
    columns = {}
    for i, axis in enumerate(AXES):
        columns[f"{axis}_design_rad_s2"] = flight.of.F[:, i]
        columns[f"{axis}_eta_bar_rad_s2"] = flight.eta_bar[:, i]
        columns[f"{axis}_threshold_rad_s"] = bank.T[:, 0, i]
        columns[f"{axis}_residual_rad_s"] = bank.E[:, 0, i]
        columns[f"{axis}_alarm_residual_rad_s"] = residual[:, i]
        columns[f"{axis}_alarm_threshold_rad_s"] = threshold[:, i]
    return columns


def approximation_residual(
    declaration: Declaration, bank: Bank, alarm: int, flight: Flight, readings: Readings
) -> np.ndarray:
    """detection.md, after the alarm: eps <- a eps + dt (nu - fhat - phi_known); before it E of the first
    filter.

    fhat: output of the network in the frame before. phi_known = -sum (1 - effectiveness) G_s u_s: what the
    law already takes into account, nothing in the published scheme.
    """
    eps, a, Gu = bank.E[:, 0].copy(), bank.a[0], flight.of.Gu
    for k in range(alarm + 1, len(eps)):
        expected = 1.0 if declaration.to_the_letter else readings.effectiveness[k - 1]
        known = -(Gu[k] * (1.0 - expected)).sum(axis=1)
        eps[k] = a * eps[k - 1] + declaration.dt * (flight.nu[k] - readings.network[k - 1] - known)
    return eps


class Verdict:
    """Alarm, candidates and names, frame by frame."""

    def __init__(
        self, declaration: Declaration, flight: Flight, bank: Bank, isolation: Isolation,
        detector: Statistical | None, naming: Naming | None,
    ) -> None:  # fmt: skip
        self.declaration, self.flight, self.bank, self.isolation = declaration, flight, bank, isolation
        self.detector, self.naming = detector, naming
        authority = declaration["authority"] if detector else "worst-case"
        self.by_worst_case = authority != "statistical"
        self.by_likelihood = detector if authority != "worst-case" else None
        self.alarm: tuple[int, str] | None = None
        self.names: list[tuple[int, str | None]] = []

    def of_flight(self, columns: dict[str, np.ndarray]) -> Result:
        """All frames; fills the columns."""
        of, surfaces, frames = self.isolation.of, self.declaration.aircraft.surfaces, len(self.flight.x)
        limits = np.full((3, frames, len(of), 3), np.nan)
        excluded = np.tile(1.0 * self.isolation.excluded, (frames, 1))
        effectiveness, shares = np.ones((frames, len(surfaces))), {}
        for k in range(1, frames):
            if self.detector:
                for name, share in self.detector.take(k, self.flight.nu[k]).items():
                    shares.setdefault(name, np.zeros(frames))[k] = share
            self.take(k)
            if self.alarm:
                limits[:, k] = self.isolation.eps, self.isolation.lower, self.isolation.upper
                excluded[k], effectiveness[k] = self.isolation.excluded, self.effectiveness()
        for row, one in enumerate(of):
            for i, axis in enumerate(AXES):
                for what, values in zip(("residual", "lower", "upper"), limits, strict=True):
                    columns[f"fie_{one.name}_{axis}_{what}_rad_s"] = values[:, row, i]
            columns[f"fie_{one.name}_excluded"] = excluded[:, row]
        columns |= shares
        columns |= {f"{s}_effectiveness_estimate": effectiveness[:, j] for j, s in enumerate(surfaces)}
        name, withdrawn = self.names[-1][1] if self.names else None, ([], [])
        if self.naming:
            findings, withdrawn = self.naming.findings(name), (self.naming.withdrawn, self.naming.retyped)
        else:
            left = [one.name for one, out in zip(of, self.isolation.excluded, strict=True) if not out]
            kind = name if name in (None, UNANTICIPATED) else Loss.name
            findings = [Finding(name, kind, None, left)]
        return Result(columns, self.alarm, self.names, findings if self.alarm else [], withdrawn)

    def take(self, k: int) -> None:
        """A frame: alarm if there was none, then exclusions and the name."""
        frame = self.flight.frame(k, self.declaration.dt)
        of = self.isolation.effect(frame)
        self.isolation.remember(of)
        started = self.alarm is not None
        if started:
            self.isolation.advance(of, frame)
        elif (axis := self.alarm_axis(k)) is not None:
            self.alarm = k, AXES[axis]
            self.isolation.start(frame)
        if self.alarm:
            worst_case = self.by_worst_case or self.declaration.all_types
            self.isolation.exclude(of, frame, started, worst_case, self.by_likelihood)
            if self.naming:
                name = self.naming.take(frame, of, started or self.isolation.remembers)
            else:
                name = self.isolation.decide(self.by_likelihood)
            if name != (self.names[-1][1] if self.names else None):
                self.names.append((k, name))

    def alarm_axis(self, k: int) -> int | None:
        """The axis of the alarm: of the worst case, or else of the largest score beyond its level; or
        None."""
        axis = self.bank.alarm_axis(k) if self.by_worst_case else None
        if axis is None and self.by_likelihood and self.by_likelihood.largest > 1.0:
            return self.by_likelihood.axis
        return axis

    def effectiveness(self) -> np.ndarray:
        """1 + theta of the surface that is named, 1 of others. Theta is that of the likelihoods, if they
        count."""
        found = np.ones(len(self.declaration.aircraft.surfaces))
        named = self.names[-1][1] if self.names else None
        for row, one in enumerate(self.isolation.of):
            if one.name == named:
                s = one.surface
                theta = self.isolation.theta[row, self.declaration.aircraft.main_axis[s]]
                found[s] += self.by_likelihood.theta(s) if self.by_likelihood and not self.naming else theta
        return found
