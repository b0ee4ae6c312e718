"""The gains of the disturbance-rejecting law, derived from what is declared.

Two numbers are chosen, by flights in turbulence beside the rivals: RATIO below, and the share of an
actuator's rate that noise may take (`noise_share`). Everything else follows.

One number s sets feedback Kp = s and observer w = RATIO s of a loop. It is the largest that leaves the
margins asked for with the declared actuator, one JSBSim frame of delay, the frame rate, and the gyro's
declared lag and delay; and, where gyros are noisy, that moves the surface no faster than a share of its rate
limit. The plant of a loop is an integrator, the inversion having made it one: the margins are those of this
design loop, with a reserve for the rest of the aircraft.

A loop's response is found a frequency at a time from the equations of rejecting.py, z-transformed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import exp, hypot, inf, pi, radians, sqrt

import numpy as np

from beaver_ftc.design.model import AIRSPEED, QDYN, effectiveness, own_damping
from beaver_ftc.diagnosis.state import PITCH
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sensors import RateGyro

N_POINTS = 5  # of the schedule over dynamic pressure
N_LOOPS = 4  # roll, pitch, yaw, and pitch by the surface that stands in
MEMORY_S = 5.0  # of the effectiveness seen by the observer: a slow reference's swing
RATIO = 6.5  # observer over feedback: of those with the same margins, near the least error in turbulence
LEAST_LEAD_RATIO, MOST_LEAD = 1.0, 4.0  # lead compensation makes an actuator at most this many times as fast
RESERVE_DB, RESERVE_DEG = 0.5, 2.0  # kept for what an integrator is not: the rest of the aircraft
N_FREQUENCIES, N_CANDIDATES = 160, 40
LEAST_PER_S = 0.5
DEFAULT_RATE_RAD_S = pi / 3.0  # of an actuator with no declared rate limit: the aircraft's default
GYROS = ("p", "q", "r")


@dataclass(frozen=True)
class Loop:
    """What limits one loop. dt_s: frame. share: of it until a command acts. approach: of the way to its
    command the actuator goes in a frame. lead: see rejecting.py. delay_s, keep: the gyro's."""

    dt_s: float
    share: float
    approach: float
    lead: float
    delay_s: float = 0.0
    keep: float = 0.0


@dataclass(frozen=True)
class Gyro:
    """What is declared of a rate gyro; keep: what its lag keeps from frame to frame."""

    noise_rad_s: float = 0.0
    delay_s: float = 0.0
    keep: float = 0.0


def lead_of(approach: float) -> float:
    """By how much to lead an actuator that goes this share of the way in a frame; it never overshoots."""
    return min(1.0 / approach, MOST_LEAD) if approach < 1.0 else LEAST_LEAD_RATIO


def frequencies(dt_s: float) -> np.ndarray:
    """From far below any loop to Nyquist, rad/s."""
    return np.geomspace(0.002 / dt_s, pi / dt_s, N_FREQUENCIES)


def corrections(observer_per_s: float, dt_s: float) -> tuple[float, float]:
    """L_rate and L_disturbance (1/s) of an observer with both poles at exp(-w dt)."""
    pole = np.exp(-observer_per_s * dt_s)
    return 1.0 - pole * pole, (1.0 - pole) ** 2 / dt_s


def controller(loop: Loop, s: float, z: np.ndarray) -> np.ndarray:
    """Actuator command over measured rate, times -G: the law's own response (n,), 1/s, at z (n,)."""
    dt, share = loop.dt_s, loop.share
    L_rate, L_disturbance = corrections(RATIO * s, dt)
    back = 1.0 / z
    mean = share * back + 1.0 - share  # of the surface's moment over the elapsed frame
    actuator = loop.approach / (z - 1.0 + loop.approach)
    one, none = np.ones_like(z), np.zeros_like(z)
    # unknowns: rate, disturbance, position (times G), command (times G); driven by the measured rate
    rows = [
        [one - (1 - L_rate) * back, -(1 - L_rate) * dt * back, -(1 - L_rate) * dt * mean, none],
        [L_disturbance * back, one - back + L_disturbance * dt * back, L_disturbance * dt * mean, none],
        [none, none, one, -actuator],
        [loop.lead * s * one, loop.lead * (1 + s * share * dt) * one,
         (loop.lead - 1 + loop.lead * s * share * dt) * one, one],
    ]  # fmt: skip
    driven = np.stack([L_rate * one, L_disturbance * one, none, none], 1)
    return -np.linalg.solve(np.moveaxis(np.array(rows), 2, 0), driven[..., None])[..., 3, 0]


def open_loop(loop: Loop, s: float, z: np.ndarray) -> np.ndarray:
    """The loop broken at the surface, (n,)."""
    plant = loop.dt_s * (loop.share + (1.0 - loop.share) * z) / (z - 1.0)
    actuator = loop.approach / (z - 1.0 + loop.approach)
    gyro = z ** (-loop.delay_s / loop.dt_s) * (1.0 - loop.keep) / (1.0 - loop.keep / z)
    return controller(loop, s, z) * actuator * plant * gyro


def margins(L: np.ndarray) -> tuple[float, float, float]:
    """Upper and lower gain margin, dB, and phase margin, deg, of an open loop sampled along the frequencies.

    Between two samples L is taken as straight in log magnitude and phase. At the last one, Nyquist perhaps,
    L is real: a crossing if negative. `control.stability_margins` of the sampled loop agrees to 0.1 %, and
    takes 300 times as long for each of the candidates that a flight's gains are chosen from.
    """
    level, phase = 20.0 * np.log10(np.abs(L)), np.degrees(np.unwrap(np.angle(L)))
    upper, lower = inf, inf
    if L[-1].real < -abs(L[-1].imag) * 1e6:
        upper, lower = (-level[-1], inf) if level[-1] < 0.0 else (inf, level[-1])
    for turn in np.arange(-180.0 - 360.0 * 3, 181.0, 360.0):
        at = _where(phase - turn, level)
        upper = min([upper, *(-x for x in at if x < 0.0)])
        lower = min([lower, *(x for x in at if x >= 0.0)])
    away = [abs((x + 180.0) % 360.0) for x in _where(level, phase)]
    return upper, lower, min([inf, *(min(x, 360.0 - x) for x in away)])


def _where(of: np.ndarray, value: np.ndarray) -> list[float]:
    """`value` wherever `of` passes zero."""
    i = np.flatnonzero(np.signbit(of[:-1]) != np.signbit(of[1:]))
    part = of[i] / (of[i] - of[i + 1])
    return list(value[i] + part * (value[i + 1] - value[i]))


def noise_speed(loop: Loop, s: float, z: np.ndarray, omega: np.ndarray) -> float:
    """Standard deviation of G times the surface's speed, over that of a gyro's sample, 1/s2."""
    actuator = loop.approach / (z - 1.0 + loop.approach)
    moved = np.abs((z - 1.0) / loop.dt_s * actuator * controller(loop, s, z) / (1.0 + open_loop(loop, s, z)))
    return sqrt(float(np.trapezoid(moved**2, omega)) * loop.dt_s / pi)


@lru_cache(maxsize=64)
def candidates(loop: Loop, gain_db: float, phase_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Values of s, 1/s, ascending, that leave the margins, and the noise speed of each, 1/s2."""
    omega = frequencies(loop.dt_s)
    z = np.exp(1j * omega * loop.dt_s)
    fastest = 0.5 / (loop.dt_s * (0.5 + loop.share) + loop.delay_s)
    kept: list[float] = []
    speeds: list[float] = []
    for s in np.geomspace(LEAST_PER_S, max(fastest, 2.0 * LEAST_PER_S), N_CANDIDATES):
        upper, lower, phase = margins(open_loop(loop, float(s), z))
        if kept and not (min(upper, lower) >= gain_db + RESERVE_DB and phase >= phase_deg + RESERVE_DEG):
            break
        kept.append(float(s))
        speeds.append(noise_speed(loop, float(s), z, omega))
    return np.array(kept), np.array(speeds)


def fastest(
    loop: Loop, margin: tuple[float, float], noise_rad_s: float, G: float, speed_rad_s: float
) -> float:
    """The largest s, 1/s, for these margins (dB, deg) and at most this mean surface speed from noise; G
    rad/s2 per rad."""
    values, speeds = candidates(loop, *margin)
    if noise_rad_s <= 0.0:
        return float(values[-1])
    allowed = max(abs(G) * speed_rad_s / noise_rad_s, float(speeds[0]))
    return float(np.exp(np.interp(np.log(allowed), np.log(speeds), np.log(values))))


def fading(dt_s: float) -> float:
    """Share of the past that is forgotten in a frame of dt_s seconds."""
    return 1.0 - exp(-dt_s / MEMORY_S)


def set_up(
    config: np.void,
    *,
    dt_s: float,
    substeps: int,
    approach: np.ndarray,
    speed_rad_s: np.ndarray,
    gyros: Sequence[Gyro],
    margin: tuple[float, float],
    qdyn: np.ndarray,
    G: np.ndarray,
    carriers: Sequence[tuple[int, int]],
) -> None:
    """Fill the schedule of the law's configuration, and the leads.

    approach (n,): share of the way an actuator goes in a JSBSim frame. speed_rad_s (n,): mean speed of a
    surface that noise may cause. margin: dB and deg. qdyn (N_POINTS,) Pa and G (N_POINTS, 3, n) there.
    carriers: axis and surface of each loop.
    """
    whole = 1.0 - (1.0 - approach) ** substeps
    config["dt"], config["share"], config["qdyn"] = dt_s, 1.0 / substeps, qdyn
    config["fading"] = fading(dt_s)
    config["lead"] = [lead_of(float(a)) for a in whole]
    for row, (axis, surface) in enumerate(carriers):
        gyro = gyros[axis]
        reach = float(whole[surface])
        loop = Loop(dt_s, 1.0 / substeps, reach, lead_of(reach), gyro.delay_s, gyro.keep)
        for j in range(len(qdyn)):
            speed = float(speed_rad_s[surface])
            s = fastest(loop, margin, gyro.noise_rad_s, float(G[j, axis, surface]), speed)
            config["Kp_at"][row, j] = s
            config["L_rate_at"][row, j], config["L_disturbance_at"][row, j] = corrections(RATIO * s, dt_s)


def configure(law: np.void, control: np.void, belief: np.void, scenario: Scenario, y: np.ndarray) -> None:
    """Derive the gains of a scenario into the law's configuration (base.CompiledLaw); y: the measured signals
    in trim."""
    config, dt, layout = scenario.control, 1.0 / scenario.rate_hz, control["layout"]
    speeds_mps = np.linspace(*scenario.airframe.envelope.airspeed_mps, N_POINTS)
    signals = np.tile(y, (N_POINTS, 1))
    signals[:, AIRSPEED], signals[:, QDYN] = speeds_mps, y[QDYN] * (speeds_mps / y[AIRSPEED]) ** 2
    carriers = [(axis, int(s)) for axis, s in enumerate(layout["main"])]
    if layout["stand_in"] >= 0:
        carriers.append((PITCH, int(layout["stand_in"])))
    set_up(
        law["config"],
        dt_s=dt,
        substeps=scenario.substeps,
        approach=belief["actuators"]["approach"],
        speed_rad_s=config.noise_share * _shares(belief["design"], y, carriers) * _rate_limits(scenario),
        gyros=[_gyro(getattr(scenario.sensors, axis), dt) for axis in GYROS],
        margin=(config.gain_margin_db, config.phase_margin_deg),
        qdyn=signals[:, QDYN],
        G=np.stack([effectiveness(belief["design"], each) for each in signals]),
        carriers=carriers,
    )


def _shares(design: np.void, y: np.ndarray, carriers: list[tuple[int, int]]) -> np.ndarray:
    """What part of the noise that is allowed each surface (n,) may have: the root of how much of its own
    damping the axis has, beside the most damped one."""
    a = np.abs(own_damping(design, y))
    shares = np.ones(design["G0"].shape[1])
    for axis, s in carriers:
        shares[s] = sqrt(a[axis] / a.max())
    return shares


def _rate_limits(scenario: Scenario) -> np.ndarray:
    """Declared rate limits (n,) rad/s, the aircraft's default where none is."""
    surfaces = scenario.airframe.surfaces
    limits_deg_s = [getattr(scenario.actuators, surface).rate_limit_deg_s for surface in surfaces]
    return np.array([radians(limit) or DEFAULT_RATE_RAD_S for limit in limits_deg_s])


def _gyro(sensor: RateGyro, dt: float) -> Gyro:
    noise, _, quantum = sensor.noise_bias_quantum
    lag = sensor.bandwidth_rad_s
    return Gyro(hypot(noise, quantum / sqrt(12.0)), sensor.delay_s, exp(-lag * dt) if lag else 0.0)
