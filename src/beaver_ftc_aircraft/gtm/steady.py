"""Steady flight of the whole aircraft: elevators together, ailerons against one another, rudders together,
both throttles together.

Newton's method on JSBSim's own six accelerations, with time standing still.
"""

from dataclasses import dataclass
from functools import cached_property
from math import atan, cos, degrees, radians, sin, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc.plant import bare
from beaver_ftc_aircraft.gtm.parameters import cases, parameters, surfaces
from beaver_ftc_aircraft.gtm.systems import THROTTLE, damage_property

FT_S_PER_KNOT = 1.0 / 0.592487
SEA_LEVEL_SLUG_FT3 = 0.0023769
LATITUDE_DEG, LONGITUDE_DEG, HEADING_DEG, ALTITUDE_FT = 37.827926944, -75.494061666, 90.0, 800.0
_ACCELERATIONS = (
    *(f"accelerations/{axis}dot-ft_sec2" for axis in "uvw"),
    *(f"accelerations/{axis}dot-rad_sec2" for axis in "pqr"),
)
_STEPS, _SMALL = 40, 1e-9
# Of angle of attack, bank, elevator, right aileron and rudder, rad, and the throttle; if the first is given,
# of the airspeed in its place, ft/s.
_DIFFERENCES = np.array([1e-5, 1e-5, 1e-4, 1e-4, 1e-4, 1e-3])
_GUESS = np.array([radians(3.0), 0.0, radians(2.4), 0.0, 0.0, 0.4])
_LARGEST_STEP = np.array([0.05, 0.1, 0.2, 0.2, 0.2, 0.3])
_OF_AIRSPEED = 0.01, 20.0  # difference and largest step, ft/s


@dataclass(frozen=True)
class Condition:
    """What is wanted: equivalent airspeed in knots, or angle of attack."""

    eas_kt: float | None = None
    alpha_deg: float | None = None


@dataclass(frozen=True)
class Steady:
    """What was found; aileron: the right one, the left one is its opposite. left: of the accelerations,
    ft/s2 and rad/s2."""

    airspeed_fps: float
    eas_kt: float
    alpha_deg: float
    beta_deg: float
    phi_deg: float
    theta_deg: float
    elevator_deg: float
    aileron_deg: float
    rudder_deg: float
    throttle_percent: float
    left: float

    @property
    def velocity_fps(self) -> tuple[float, float, float]:
        """Along the body axes."""
        alpha, beta = radians(self.alpha_deg), radians(self.beta_deg)
        V = self.airspeed_fps
        return V * cos(alpha) * cos(beta), V * sin(beta), V * sin(alpha) * cos(beta)

    def commands(self) -> dict[str, float]:
        """Properties that command it."""
        found = {f"fcs/{name}-cmd-rad": radians(self.elevator_deg) for name in surfaces("elevator")}
        for name, of in surfaces("aileron").items():
            sign = -1.0 if of["side"] == "left" else 1.0
            found[f"fcs/{name}-cmd-rad"] = radians(sign * self.aileron_deg)
        found |= {f"fcs/{name}-cmd-rad": radians(self.rudder_deg) for name in surfaces("rudder")}
        return found | {THROTTLE: self.throttle_percent / 100.0}


class Bench:
    """A model with time standing still."""

    def __init__(self, model: Path) -> None:
        self.fdm = bare(model)

    def damage(self, case: int) -> None:
        """Let this case, by its number, be in force; 0: none."""
        for number, name in enumerate(cases(), 1):
            self.fdm[damage_property(name)] = float(number == case)

    def place(
        self, altitude_ft: float, velocity_fps: Any, angles_rad: Any, rates: Any = (0.0, 0.0, 0.0)
    ) -> None:
        """Put it there: velocity along body axes; roll, pitch, heading; body rates."""
        fdm = self.fdm
        fdm["ic/lat-geod-deg"], fdm["ic/long-gc-deg"] = LATITUDE_DEG, LONGITUDE_DEG
        fdm["ic/h-sl-ft"] = altitude_ft
        for name, angle in zip(("phi", "theta", "psi-true"), angles_rad, strict=True):
            fdm[f"ic/{name}-rad"] = float(angle)
        for axis, speed in zip("uvw", velocity_fps, strict=True):
            fdm[f"ic/{axis}-fps"] = float(speed)
        for axis, rate in zip("pqr", rates, strict=True):
            fdm[f"ic/{axis}-rad_sec"] = float(rate)
        fdm.run_ic()
        fdm.suspend_integration()
        fdm.run()
        fdm.resume_integration()

    def accelerations(self) -> np.ndarray:
        """Of u, v, w in ft/s2, of p, q, r in rad/s2."""
        return np.array([self.fdm[name] for name in _ACCELERATIONS])

    def steady(self, wanted: Condition) -> Steady:
        """Level flight as wanted, without sideslip. Raises BadInput where there is none."""
        self.damage(0)
        x, scale, most = _GUESS.copy(), _DIFFERENCES.copy(), _LARGEST_STEP.copy()
        if wanted.alpha_deg is not None:
            x[0] = _usual_speed(wanted.alpha_deg)
            scale[0], most[0] = _OF_AIRSPEED
        for _ in range(_STEPS):
            off = self._off(wanted, x)
            if np.abs(off).max() < _SMALL:
                break
            columns = [(self._off(wanted, x + step) - off) / sum(step) for step in np.diag(scale)]
            step = np.linalg.lstsq(np.array(columns).T, -off, rcond=None)[0]
            x = x + step * min(1.0, float((most / np.maximum(np.abs(step), 1e-12)).min()))
        left = float(np.abs(self._off(wanted, x)).max())
        if not left < 1e-6:
            raise BadInput(f"no steady flight with {wanted}, allowed: where one is")
        return self._found(wanted, x, left)

    def _off(self, wanted: Condition, x: np.ndarray) -> np.ndarray:
        found = self._found(wanted, x, 0.0)
        for name, number in found.commands().items():
            self.fdm[name] = number
        angles_deg = found.phi_deg, found.theta_deg, HEADING_DEG
        self.place(ALTITUDE_FT, found.velocity_fps, map(radians, angles_deg))
        return self.accelerations()

    def _found(self, wanted: Condition, x: np.ndarray, left: float) -> Steady:
        first, phi, elevator, aileron, rudder, throttle = map(float, x)
        thin = sqrt(self.density / SEA_LEVEL_SLUG_FT3)
        if wanted.alpha_deg is None:
            alpha, V = first, float(wanted.eas_kt or 0.0) * FT_S_PER_KNOT / thin
        else:
            alpha, V = radians(wanted.alpha_deg), first
        theta = pitch_angle(alpha, 0.0, phi)
        eas = V / FT_S_PER_KNOT * thin
        angles = [degrees(x) for x in (alpha, 0.0, phi, theta, elevator, aileron, rudder)]
        return Steady(V, eas, *angles, 100.0 * throttle, left)  # type: ignore[call-arg]

    @cached_property
    def density(self) -> float:
        """Of the air at ALTITUDE_FT, slug/ft3."""
        self.place(ALTITUDE_FT, (100.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        return float(self.fdm["atmosphere/rho-slugs_ft3"])


def _usual_speed(alpha_deg: float) -> float:
    """About what level flight at this angle of attack takes, ft/s."""
    lift = parameters()["mass"]["weight_lbf"] / (0.0023 * 0.5 * parameters()["geometry"]["area_ft2"])
    return sqrt(lift / min(1.1, 0.12 + 0.09 * alpha_deg))


def pitch_angle(alpha: float, beta: float, phi: float) -> float:
    """The pitch attitude of level flight [Stevens and Lewis, 2.2-4], rad."""
    a = cos(alpha) * cos(beta)
    b = sin(phi) * sin(beta) + cos(phi) * sin(alpha) * cos(beta)
    return atan(b / a)
