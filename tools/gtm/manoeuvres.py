"""The manoeuvres that are compared: doublets, damage in a turn, a spin."""

from math import atan2, cos, radians, sin

import numpy as np
from scipy.optimize import root

from beaver_ftc_aircraft.gtm.steady import Steady
from tools.gtm.flights import CASES, Manoeuvre, of_commands, state_of
from tools.gtm.specification import Controls, Specification


def doublets(steady: Steady) -> Manoeuvre:
    """Doublets of 2 deg: elevator at 1 s, rudder at 4 s, ailerons at 7 s, half a second to either side."""

    def plan(t: float) -> Controls:
        size = {at: 2.0 * ((at <= t < at + 0.5) - 1.0 * (at + 0.5 <= t < at + 1.0)) for at in (1.0, 4.0, 7.0)}
        return of_commands(
            steady.elevator_deg - size[1.0], steady.aileron_deg + size[7.0],
            steady.rudder_deg + size[4.0], steady.throttle_percent,
        )  # fmt: skip

    return Manoeuvre("doublets", state_of(steady), plan, 15.0)


# Case 2 departs: what is compared ends before two flights that differ by rounding differ by more.
_ENDS_S = {2: 12.0}


def damaged(steady: Steady, case: int) -> Manoeuvre:
    """Damage at 10 s, in a turn that an aileron pulse at 6 s begins; the controls stay as they are."""

    def plan(t: float) -> Controls:
        pulse = -2.0 if 6.0 <= t < 6.8 else 0.0
        aileron, throttle = steady.aileron_deg + pulse, steady.throttle_percent
        return of_commands(steady.elevator_deg, aileron, steady.rudder_deg, throttle)

    return Manoeuvre(CASES[case - 1], state_of(steady), plan, _ENDS_S.get(case, 15.0), case)


# What the source's own figures have of a spin in equilibrium, deg and deg/s.
SPIN = {"alpha": 23.2, "beta": 0.9, "p": -363.0, "q": 27.0, "r": -155.0}


def spin(spec: Specification) -> Manoeuvre:
    """A steady spin of the specification near the published one: its airspeed, attitude and controls make
    all six accelerations zero."""
    rates = np.array([SPIN[axis] for axis in "pqr"]) * np.pi / 180.0
    size = float(np.linalg.norm(rates))
    down = -rates / size  # a steady spin turns about the vertical, this one to the left
    alpha, beta = radians(SPIN["alpha"]), radians(SPIN["beta"])

    def made(x: np.ndarray) -> tuple[np.ndarray, Controls]:
        V, elevator, aileron, rudder, tilt, turn = map(float, x)
        along = down + np.array([0.0, tilt / 100.0, turn / 100.0])
        along = along / np.linalg.norm(along)
        theta, phi = -np.arcsin(along[0]), atan2(along[1], along[2])
        p, q, r = -along * size
        u, v, w = V * cos(alpha) * cos(beta), V * sin(beta), V * sin(alpha) * cos(beta)
        state = np.array([u, v, w, p, q, r, phi, theta, 0.0, 3000.0])
        return state, of_commands(elevator, aileron, rudder, 0.0)

    def off(x: np.ndarray) -> np.ndarray:
        state, controls = made(x)
        return spec.rates_of_change(state, controls, 0)[:6]

    tries = ((V, rudder) for V in (90.0, 110.0, 130.0) for rudder in (-20.0, 20.0))
    found = [root(off, [V, -15.0, 0.0, rudder, 0.0, 0.0]).x for V, rudder in tries]  # not each gets there
    state, controls = made(min(found, key=lambda x: float(np.abs(off(x)).max())))
    return Manoeuvre("spin", state, lambda t: controls, 5.0)
