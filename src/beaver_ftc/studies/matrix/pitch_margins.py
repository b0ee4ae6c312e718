"""Engine power as a pitch effector about the trim, linear: what it is worth, and the margins of its law."""

from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.scenario.control import EnginePower

if TYPE_CHECKING:
    from beaver_ftc.plant.linear import LinearModel

Document = dict[str, Any]
STATES = ("airspeed", "alpha", "q", "theta")
FREQUENCIES_RAD_S = np.geomspace(1e-3, 1e2, 20001)
SLOW_RAD_S = 1.0  # the phugoid is slower than this, the short period faster


def margins(airspeed_mps: float, config: EnginePower) -> Document:
    """Of the loop through engine power at one airspeed, elevator and flap standing still.

    phugoid_damping: without and with the law. gain_margin_db, phase_margin_deg: the least of all crossings,
    null where there is none. attitude_zero_rad_s: the right-half-plane zero from power to attitude.
    worth_deg: pitching moment of the throttle closed and opened, in deg of elevator.
    """
    model, power, trim_inhg = about_trim(airspeed_mps)
    gain_db, phase_deg = _least_margins(loop_response(model.A, power, config))
    elevator = model.B[STATES.index("q"), model.inputs.index("elevator")]
    ends = np.array([config.lowest_inhg, config.highest_inhg]) - trim_inhg
    return {
        "airspeed_mps": airspeed_mps,
        "phugoid_damping": [
            _phugoid_damping(system) for system in (model.A, closed_loop(model.A, power, config))
        ],
        "gain_margin_db": gain_db,
        "phase_margin_deg": phase_deg,
        "attitude_zero_rad_s": _attitude_zero(model.A, power),
        "worth_deg": np.rad2deg(ends * power[STATES.index("q")] / elevator).tolist(),
    }


def about_trim(airspeed_mps: float) -> tuple["LinearModel", np.ndarray, float]:
    """The four longitudinal states, the column (4,) of manifold pressure in inHg, and its trim."""
    from beaver_ftc.plant.adapter import Plant
    from beaver_ftc.plant.linear import differences, engine_slope
    from beaver_ftc.plant.trim import trim
    from beaver_ftc.scenario.schema import Initial

    plant, point = Plant(100), trim(airspeed_mps, Initial().altitude_m)
    model = differences(plant, point)
    rows = [model.states.index(name) for name in STATES]
    return model.of(STATES), engine_slope(plant, point)[rows], point.manifold_pressure_inhg


def _law(config: EnginePower) -> tuple[float, float]:
    """Gains: inHg per m/s, inHg per rad."""
    return config.speed_gain_inhg_per_mps, float(np.rad2deg(config.attitude_gain_inhg_per_deg))


def loop_response(A: np.ndarray, power: np.ndarray, config: EnginePower) -> np.ndarray:
    """The loop cut at the manifold pressure, over FREQUENCIES_RAD_S; 1 + L = 0 is the closed loop's."""
    speed_gain, attitude_gain = _law(config)
    s = 1j * FREQUENCIES_RAD_S
    x = np.linalg.solve(s[:, None, None] * np.eye(4) - A, np.broadcast_to(power, (len(s), 4))[..., None])
    V, q = x[:, STATES.index("airspeed"), 0], x[:, STATES.index("q"), 0]
    smooth, slow = 1.0 / (1.0 + s * config.smoothing_s), 1.0 / (1.0 + s * config.washout_s)
    remembered = 1.0 / (s + 1.0 / config.attitude_memory_s)
    return speed_gain * smooth * (1.0 - slow) * V - attitude_gain * remembered * q


def closed_loop(A: np.ndarray, power: np.ndarray, config: EnginePower) -> np.ndarray:
    """System matrix (7, 7) of the aircraft, the smoothed airspeed, its slow mean, and the attitude missed."""
    speed_gain, attitude_gain = _law(config)
    F = np.zeros((7, 7))
    F[:4, :4] = A
    F[4, [0, 4]] = np.array([1.0, -1.0]) / config.smoothing_s
    F[5, [4, 5]] = np.array([1.0, -1.0]) / config.washout_s
    F[6, 2], F[6, 6] = 1.0, -1.0 / config.attitude_memory_s
    F[:4] += np.outer(power, [0, 0, 0, 0, -speed_gain, speed_gain, attitude_gain])
    return F


def _phugoid_damping(system: np.ndarray) -> float:
    """Damping ratio of the slow oscillation; 1 if there is none."""
    poles = np.linalg.eigvals(system)
    slow = poles[(np.abs(poles) < SLOW_RAD_S) & (poles.imag > 1e-6)]
    return float(min(-slow.real / np.abs(slow), default=1.0))


def _least_margins(response: np.ndarray) -> tuple[float | None, float | None]:
    """Gain margin (dB, either way) and phase margin (deg) over all crossings."""
    through = (np.diff(np.sign(response.imag)) != 0) & (response.real[1:] < 0.0)
    gains = np.abs(20.0 * np.log10(np.abs(response.real[1:][through])))
    crossed = np.diff(np.sign(np.abs(response) - 1.0)) != 0
    phases = np.abs(np.rad2deg(np.angle(-response[1:][crossed])))
    return (float(gains.min()) if gains.size else None), (float(phases.min()) if phases.size else None)


def _attitude_zero(A: np.ndarray, power: np.ndarray) -> float:
    """The zero in the right half-plane from power to attitude, rad/s: Rosenbrock's pencil."""
    from scipy.linalg import eigvals

    C = np.eye(4)[STATES.index("theta")]
    pencil = np.block([[A, power[:, None]], [C[None, :], np.zeros((1, 1))]])
    found = eigvals(pencil, np.diag([1.0, 1.0, 1.0, 1.0, 0.0]))
    finite = found[np.isfinite(found) & (np.abs(found) < 1e6)]
    return float(finite.real.max())
