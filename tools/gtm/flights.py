"""Trim, flights, coefficients and masses, by JSBSim and by the specification, to compare both."""

import csv
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import degrees, radians
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import fsolve

from beaver_ftc_aircraft.gtm.database import read
from beaver_ftc_aircraft.gtm.folder import write_model
from beaver_ftc_aircraft.gtm.parameters import OUTPUTS, parameters
from beaver_ftc_aircraft.gtm.steady import ALTITUDE_FT, HEADING_DEG, Bench, Condition, Steady, pitch_angle
from tools.gtm.servos import Servos
from tools.gtm.specification import DATABASE, STEP_S, SURFACES, Controls, Specification, axes_of

# The specification's letters, and the names here.
NAMES = dict(
    zip(
        SURFACES,
        (
            "left_outboard_elevator", "left_inboard_elevator",
            "right_outboard_elevator", "right_inboard_elevator",
            "left_aileron", "right_aileron", "upper_rudder", "lower_rudder", "left_inboard_spoiler",
            "left_outboard_spoiler", "right_inboard_spoiler", "right_outboard_spoiler", "left_inboard_flap",
            "left_outboard_flap", "right_inboard_flap", "right_outboard_flap", "stabiliser",
        ),
        strict=True,
    )
)  # fmt: skip
CASES = (
    "rudder-off",
    "fin-off",
    "left-outboard-flap-off",
    "left-wing-tip-off",
    "left-elevator-off",
    "left-stabiliser-off",
)
SIGNALS = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "altitude")
_IN_JSBSIM = (
    "velocities/u-aero-fps", "velocities/v-aero-fps", "velocities/w-aero-fps",
    "velocities/p-rad_sec", "velocities/q-rad_sec", "velocities/r-rad_sec",
    "attitude/phi-rad", "attitude/theta-rad", "attitude/psi-rad", "position/h-sl-ft",
)  # fmt: skip
Plan = Callable[[float], Controls]  # commands at a time
EULER, ADAMS_BASHFORTH = 1, 3  # JSBSim's integrators of body rates: its usual one, and one of second order
FINE_S = 0.001
MOTION = slice(0, 6)  # of SIGNALS: u v w p q r


@cache
def bench(where: Path, scratch: Path) -> Bench:
    """The converted model, which is written into an empty folder."""
    return Bench(write_model(read(where / DATABASE), scratch / "gtm"))


def of_commands(elevator: float, aileron: float, rudder: float, throttle: float) -> Controls:
    """Controls that move all elevators alike, the ailerons in opposite directions, and all rudders and all
    throttles alike; deg and %."""
    found = dict.fromkeys(SURFACES, 0.0)
    found |= dict.fromkeys(("ELLOB", "ELLIB", "ELROB", "ELRIB"), elevator) | dict.fromkeys(
        ("RUDU", "RUDL"), rudder
    )
    return Controls(found | {"AILL": -aileron, "AILR": aileron}, (throttle, throttle))


def of_steady(steady: Steady) -> Controls:
    """The controls that hold a steady flight."""
    return of_commands(steady.elevator_deg, steady.aileron_deg, steady.rudder_deg, steady.throttle_percent)


def state_of(steady: Steady) -> np.ndarray:
    """The state of a steady flight, SIGNALS."""
    angles = radians(steady.phi_deg), radians(steady.theta_deg), radians(HEADING_DEG)
    return np.array([*steady.velocity_fps, 0.0, 0.0, 0.0, *angles, ALTITUDE_FT])


def specified_trim(spec: Specification, wanted: Condition, guess: Steady) -> Steady:
    """The trim by the equations of the specification, without sideslip; the bank angle is free."""

    def made(x: np.ndarray) -> Steady:
        first, phi, elevator, aileron, rudder, throttle = map(float, x)
        alpha = first if wanted.alpha_deg is None else wanted.alpha_deg
        dense = (spec.air(ALTITUDE_FT)[1] / 0.0023769) ** 0.5
        V = first if wanted.alpha_deg is not None else float(wanted.eas_kt or 0.0) / 0.592487 / dense
        theta = degrees(pitch_angle(radians(alpha), 0.0, radians(phi)))
        return Steady(
            V, V * 0.592487 * dense, alpha, 0.0, phi, theta, elevator, aileron, rudder, throttle, 0.0
        )

    def off(x: np.ndarray) -> np.ndarray:
        steady = made(x)
        return spec.rates_of_change(state_of(steady), of_steady(steady), 0)[:6]

    first = guess.alpha_deg if wanted.alpha_deg is None else guess.airspeed_fps
    others = "phi_deg", "elevator_deg", "aileron_deg", "rudder_deg", "throttle_percent"
    start = [first, *(getattr(guess, name) for name in others)]
    x, _, good, says = fsolve(off, start, full_output=True, xtol=1e-12)
    if good != 1 and np.abs(off(x)).max() > 1e-7:
        raise ValueError(says)
    return made(x)


def _command(model: Bench, controls: Controls) -> None:
    for letters, name in NAMES.items():
        model.fdm[f"fcs/{name}-cmd-rad"] = radians(controls.surfaces[letters])
    for side, throttle in zip(("left", "right"), controls.throttles, strict=True):
        model.fdm[f"fcs/{side}_engine-cmd-norm"] = throttle / 100.0
    model.fdm["fcs/throttle-cmd-norm"] = 0.0


@dataclass(frozen=True)
class Manoeuvre:
    """A manoeuvre: its first state, SIGNALS, its commands over time, its duration, and the damage with its
    instant."""

    name: str
    start: np.ndarray
    plan: Plan
    end_s: float
    case: int = 0
    onset_s: float = 10.0

    def by_specification(self, spec: Specification) -> np.ndarray:
        """SIGNALS at every step of 5 ms, (n, 10), by the specification."""
        servos, x, rows = Servos(spec.of, self.plan(0.0)), self.start, []
        for k in range(round(self.end_s / STEP_S) + 1):
            rows.append(x)
            t = k * STEP_S
            x = spec.step(x, servos.move(self.plan(t)), self._case_at(t))
        return np.array(rows)

    def by_jsbsim(self, model: Bench, dt: float = STEP_S, integrator: int = EULER) -> np.ndarray:
        """SIGNALS at the same times, by JSBSim. A frame reads the command of the time at which it ends."""
        fdm, x = model.fdm, self.start
        fdm["simulation/integrator/rate/rotational"] = integrator
        fdm.set_dt(dt)
        model.damage(0)
        _command(model, self.plan(0.0))
        model.place(x[9], x[:3], x[6:9], x[3:6])
        fdm.set_sim_time(0.0)
        every, rows = round(STEP_S / dt), []
        for k in range(round(self.end_s / dt) + 1):
            if k % every == 0:
                rows.append([fdm[name] for name in _IN_JSBSIM])
            t = (k + 1) * dt
            _command(model, self.plan(t))
            model.damage(self._case_at(t))
            fdm.run()
        model.damage(0)
        for side in ("left", "right"):
            fdm[f"fcs/{side}_engine-cmd-norm"] = 0.0
        found = np.array(rows)
        for angle in (SIGNALS.index("phi"), SIGNALS.index("psi")):
            found[:, angle] = np.unwrap(found[:, angle])
        return found

    def _case_at(self, t: float) -> int:
        return self.case if t >= self.onset_s - 1e-9 else 0


def coefficients(
    model: Bench, alpha: float, beta: float, V: float, rates: Any, deg: dict[str, float], case: int = 0,
    gear: float = 0.0,
) -> np.ndarray:  # fmt: skip
    """The coefficients CX, CY, CZ, Cl, Cm, Cn of the converted model, with its stops out of reach."""
    fdm, travel = model.fdm, parameters()["surfaces"]
    for letters, name in NAMES.items():
        fdm[f"fcs/{name}-cmd-rad"] = radians(deg[letters])
        fdm[f"actuators/{name}/position-min-rad"], fdm[f"actuators/{name}/position-max-rad"] = -1.6, 1.6
    fdm["gear/down"] = gear
    model.damage(case)
    velocity = V * axes_of(alpha, beta)
    model.place(800.0, velocity, (0.0, 0.0, 0.0), rates)
    found = np.array([fdm[f"aero/coefficient/{name}"] for name in OUTPUTS])
    fdm["gear/down"] = 0.0
    for name, of in travel.items():
        for end, stop in zip(("min", "max"), of["travel_deg"], strict=True):
            fdm[f"actuators/{name}/position-{end}-rad"] = radians(stop)
        fdm[f"fcs/{name}-cmd-rad"] = 0.0
    model.damage(0)
    return found


def at_the_given_points(model: Bench, where: Path) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients at the points of the source, (60, 6) each: those given, and those of the converted
    model."""
    with (where / "points.csv").open() as file:
        rows = [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]
    given = np.array([[row[name] for name in OUTPUTS] for row in rows])
    found = [
        coefficients(
            model, radians(row["alpha_deg"]), radians(row["beta_deg"]), row["V_ft_s"],
            [row[f"{axis}_rad_s"] for axis in "pqr"],
            {name: row[f"{name}_deg"] for name in SURFACES}, int(row["damage"]), row["GEAR"],
        )
        for row in rows
    ]  # fmt: skip
    return given, np.array(found)


def masses(model: Bench, case: int) -> np.ndarray:
    """Weight lbf, centre of gravity in JSBSim's structural frame ft, inertia xx yy zz xy xz yz slug ft2."""
    model.damage(case)
    model.place(800.0, (160.0, 0.0, 8.0), (0.0, 0.05, 0.0))
    names = ["weight-lbs", *(f"cg-{axis}-in" for axis in "xyz")]
    names += [f"i{name}-slugs_ft2" for name in ("xx", "yy", "zz", "xy", "xz", "yz")]
    found = np.array([model.fdm[f"inertia/{name}"] for name in names])
    model.damage(0)
    return found / np.array([1.0, 12.0, 12.0, 12.0, *[1.0] * 6])


def gravity_of(model: Bench, spec: Specification) -> float:
    """The gravity of JSBSim's Earth less the centrifugal part of the flight at the check point, ft/s2. At
    equal angles of attack, the squares of the trim speeds are proportional to the weights."""
    here = model.steady(Condition(alpha_deg=3.0))
    there = specified_trim(spec, Condition(alpha_deg=3.0), here)
    return float(spec.gravity * (here.airspeed_fps / there.airspeed_fps) ** 2)


def largest(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Largest difference of each signal, as a share of its span in the first flight, or of a tenth of its
    size, if the span is smaller."""
    span = np.maximum(np.ptp(one, axis=0), 0.1 * np.abs(one).max(axis=0))
    return np.asarray(np.abs(one - other).max(axis=0) / np.maximum(span, 1e-9))
