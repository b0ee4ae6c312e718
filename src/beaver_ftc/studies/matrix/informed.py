"""The informed test: whether a test that knows the fault detects it, at the same rate of false alarms.

The test knows the acceleration phi that the fault adds. phi follows from the effective deflection of the
surface in the truth less that of a healthy surface with the same commands. Coefficients are unknown
constants, evenly distributed over their tolerance.
"""

from math import prod, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, Term
from beaver_ftc.aircraft.aircraft import MOMENTS
from beaver_ftc.compiled import plain
from beaver_ftc.design.actuators import nearer
from beaver_ftc.design.context import Context
from beaver_ftc.design.model import accelerate, design_record
from beaver_ftc.design.table import N_SIGNALS, signals
from beaver_ftc.diagnosis.informed_test import (
    WhiteningFilter,
    detection_probability,
    with_measured_gust,
)
from beaver_ftc.results.log import Columns
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.declared import Declared

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

COLUMNS = (
    "t_s", "p_rad_s", "q_rad_s", "r_rad_s", "alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa",
)  # fmt: skip


def columns_of(aircraft: Aircraft) -> Columns:
    """An empty log with the columns of a flight that the test needs."""
    surfaces = [f"{s}_{kind}_rad" for s in aircraft.surfaces for kind in ("cmd", "effective")]
    return Columns(*COLUMNS, *aircraft.signals, *surfaces)


def informed_row(scenario: "Scenario", log: Columns, surface: str) -> Document:
    """told_deflection: deflection d of the fault of a surface from its begin to the end of the flight.
    told_chance: the probability of detecting it in this time.

    d: size of phi (n, 3) rad/s2, 0 until the fault, in the whitened noise, in standard deviations, if the
    unknown coefficients may add regressors @ c. regressors (n, 3, m) rad/s2 per 1; c (m,) with standard
    deviations sigma (m,), tolerance / sqrt(3) of an even distribution. If the diagnosis monitors the sensors,
    d is the smallest value over an error of each gyro.
    """
    assert scenario.fdi.statistical is not None
    aircraft = scenario.airframe
    context, coefficients = _declared(scenario)
    at_s = scenario.faults[0].at_s
    is_faulty = log["t_s"] > at_s + 0.5 * context.dt_s
    off_rad = np.where(
        is_faulty, log[f"{surface}_effective_rad"] - healthy_positions(context, log, surface), 0.0
    )
    own_terms = [term for term in aircraft.moments if term.surface == surface]
    phi = np.sum([term.value * term_acceleration(aircraft, term, log, off_rad) for term in own_terms], axis=0)
    unknown = [(t, c) for t, c in zip(aircraft.moments, coefficients, strict=True) if c > 0.0]
    regressors = [term_acceleration(aircraft, t, log, log.get(f"{t.surface}_cmd_rad")) for t, _ in unknown]
    sigma = np.array([c for _, c in unknown]) / sqrt(3.0)
    stacked = np.stack(regressors, axis=-1) if unknown else np.zeros((*phi.shape, 0))
    # the gyro that may have any error; None: no gyro
    gyros = range(3) if Declared.of(scenario).monitors_sensors else (None,)
    d = min(WhiteningFilter(context, gyro).deflection_with_unknowns(phi, stacked, sigma) for gyro in gyros)
    rate = scenario.fdi.statistical.false_alarms_per_h
    return {"told_deflection": d, "told_chance": detection_probability(d, scenario.duration_s - at_s, rate)}


def _declared(scenario: "Scenario") -> tuple[Context, np.ndarray]:
    """The context of a flight with exact coefficients, and the absolute tolerances of the coefficients. If
    the diagnosis subtracts the gust that the vanes measure, the context has the measured gust."""
    from beaver_ftc.loop.loop import Loop
    from beaver_ftc.loop.plugin_context import context_of
    from beaver_ftc.loop.readout import FrameReadout

    loop = Loop(scenario)
    exact = scenario.with_({"fdi.bounds.coefficients": 0.0})
    coefficients = context_of(loop.frames, scenario, loop.trimmed, {}).declared.coefficients
    context = context_of(loop.frames, exact, loop.trimmed, {})
    diagnosis = FrameReadout(loop.frames[0]).diagnosis
    if diagnosis.gust.subtracts_measured_gust:
        context = with_measured_gust(context, np.sqrt(diagnosis.input_noise_variance))
    loop.release()
    return context, coefficients


def healthy_positions(context: Context, columns: Columns, surface: str) -> np.ndarray:
    """Positions of a healthy surface, without a dead band, under the commands of a flight, (frames,) rad:

        u <- u + clip(a (command - u), -step, step)      a = 1 - exp(-bandwidth h)      step = rate h

    in each JSBSim frame of h s, with the command limited to the travel, from the first position of the log
    on. A bandwidth of 0 stands for no lag, a rate limit of 0 for none. A position is that at the end of its
    frame.
    """
    s = context.surfaces.index(surface)
    commands = columns[f"{surface}_cmd_rad"]
    bandwidth = context.declared.bandwidth_rad_s[s]
    rate = context.declared.rate_limit_rad_s[s]
    h = context.dt_s / context.substeps
    a = 1.0 - np.exp(-bandwidth * h) if bandwidth else 1.0
    step = rate * h if rate else np.inf
    u = columns[f"{surface}_effective_rad"][0]
    positions = np.empty_like(commands)
    for k, command in enumerate(np.clip(commands, *context.travel_rad[:, s])):
        for _ in range(context.substeps):
            u = plain(nearer)(u, command, a, step)
        positions[k] = u
    return positions


def term_acceleration(
    aircraft: Aircraft, term: Term, columns: Columns, deflection: np.ndarray | None
) -> np.ndarray:
    """Acceleration by a term whose coefficient is one, (frames, 3) rad/s2, along a flight: the product of its
    factors, scaled to a moment and divided by the inertia. deflection (frames,) rad: of its surface, if
    any."""
    x = np.array([columns[f"{axis}_rad_s"] for axis in AXES])
    names = "alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", *aircraft.signals
    y = np.array([columns[name] for name in names])
    design = design_record(aircraft).view(np.recarray)[0]
    signal = np.empty((N_SIGNALS, y.shape[1]))
    C = np.zeros((3, 1, y.shape[1]))
    plain(signals)(design.moments, x, y, signal)
    values: dict[str | None, Any] = dict(zip(aircraft.signal_names, signal, strict=False))
    values[term.surface] = deflection
    C[MOMENTS.index(term.coefficient), 0] = prod(values[factor] for factor in term.factors)
    plain(accelerate)(design, y, C)
    return C[:, 0].T
