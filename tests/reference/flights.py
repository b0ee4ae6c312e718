"""Flights to compare with: what a scenario declares, and what its diagnosis read, by public names alone.

The log has the true flow, air data and signals, and one row a frame. What instruments with errors read, and
what is read inside a frame, is not in it. A second flight shows both: the same truth at the rate of the
JSBSim steps under the commands of the log, with a detector that writes down what it is given.
"""

from math import ceil
from typing import Any

import numpy as np
import yaml

import beaver_ftc as bf
from reference.declaration import AircraftFile, Declaration
from reference.diagnosis import Readings
from reference.directions import uses_forces

FLOW = ("alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa")
ATTITUDE = ["phi_rad", "theta_rad", "psi_rad"]
_files: dict[str, AircraftFile] = {}


def declared(document: dict[str, Any]) -> Declaration:
    """The declared half of a scenario's document."""
    name = document.get("aircraft", "beaver")
    if name not in _files:
        text = (bf.aircraft(name).folder / "aircraft.yaml").read_text(encoding="utf-8")
        _files[name] = AircraftFile(yaml.safe_load(text))
    return Declaration(_files[name], document)


def read(document: dict[str, Any], log: Any, declaration: Declaration) -> Readings:
    """What the diagnosis of this flight read; the log's own columns where they say it."""
    aircraft, n = declaration.aircraft, declaration.n
    x = log[[f"{axis}_measured_rad_s" for axis in "pqr"]].to_numpy()
    command = log[[f"{s}_cmd_rad" for s in aircraft.surfaces]].to_numpy()
    network = log[[f"{axis}_network_rad_s2" for axis in "pqr"]].to_numpy()
    effectiveness = log[[f"{s}_effectiveness_used" for s in aircraft.surfaces]].to_numpy()
    if n == 1 and document.get("sensors", "ideal") == "ideal" and not uses_forces(declaration):
        y, attitude = log[[*FLOW, *aircraft.signals]].to_numpy(), log[ATTITUDE].to_numpy()
        return Readings(
            x,
            y,
            attitude,
            0.0 * x,
            log["altitude_m"].to_numpy(),
            command,
            network,
            effectiveness,
            (x[0], y[0], command[0]),
        )
    seen, at_each_step = _seen(document, command, n)
    frames = min(len(x), (len(seen.measured) - 1) // n + 1)  # an aircraft may be lost inside the last frame
    steps = (frames - 1) * n + 1
    commands = np.concatenate([command[:1], at_each_step])[:steps]
    of_steps = (
        np.array([getattr(one, name) for one in seen.measured[:steps]])
        for name in ("x", "y", "attitude", "force", "altitude_m")
    )
    found = Readings(*of_steps, commands, network, effectiveness, seen.trim)
    assert np.array_equal(found.x[::n], x[:frames]), "the second flight is another one"
    return found


def instruments(document: dict[str, Any], log: Any, declaration: Declaration) -> Any:
    """What the sensor monitor of this flight reads at every JSBSim step, (14, steps); length of a step, s;
    airspeed in trim, m/s; altitude of the start, m. No detector is given the readings of the engine."""
    seen, _ = _seen(document, log.filter(like="_cmd_rad").to_numpy(), declaration.n)
    Y = [np.hstack([m.x, m.y[:4], m.attitude, m.altitude_m, m.force]) for m in seen.measured]
    return np.transpose(Y), declaration.dt / declaration.n, seen.trim[1][2], log["altitude_m"][0]


def _seen(document: dict[str, Any], command: np.ndarray, n: int) -> Any:
    """The second flight, and the commands at each step."""
    seen, at_each_step = _Recorder(), np.repeat(command[1:], n, axis=0)
    bf.fly(_by_the_step(document, n), detector=seen, law=_Player(at_each_step))
    return seen, at_each_step


def _by_the_step(document: dict[str, Any], n: int) -> dict[str, Any]:
    """The same truth with a frame for each JSBSim step. Faults begin and end in the first step of a frame."""
    rate, faults = document.get("rate_hz", 100), []
    for fault in document.get("faults", []):
        frame = {key: ceil(fault[key] * rate - 1e-9) for key in ("at_s", "end_s") if key in fault and n > 1}
        faults.append(fault | {key: ((k - 1) * n + 1) / (rate * n) for key, k in frame.items()})
    truth = {key: value for key, value in document.items() if key not in ("fdi", "control", "expect")}
    return truth | {"rate_hz": rate * n, "substeps": 1, "faults": faults}


class _Recorder:
    """A detector without a verdict."""

    def reset(self, context: Any) -> None:
        self.trim = context.trim_x, context.trim_y, context.trim_rad
        self.measured: list[Any] = []

    def step(self, measured: Any, command: np.ndarray) -> Any:
        self.measured.append(measured)
        return bf.Verdict()


class _Player:
    """A law that repeats the commands of another flight; command k acts after frame k."""

    def __init__(self, commands: np.ndarray) -> None:
        self._commands = commands

    def reset(self, context: Any) -> None:
        self._k = 0

    def step(self, measured: Any, reference: Any, verdict: Any) -> np.ndarray:
        command = self._commands[min(self._k, len(self._commands) - 1)]
        self._k += 1
        return command
