"""Feedback linearisation with proportional-integral feedback [Zhang2005, sec. V].

    demand = xm' + Kp e + Ki int e - f - fhat,    e = xm - x,    then G u = demand

    x, xm      (3,) rad/s          body rates: measured, of the reference model
    f, G       rad/s2, rad/s2 per rad   design model
    fhat       (3,) rad/s2         acceleration that the model does not explain (`surfaces.output.unknown`)
    Kp, Ki     1/s, 1/s2           gains

The laws nominal, adaptive, fault-tolerant-published and oracle-published are this one. They differ in fhat,
in the effectiveness in G, and in the surfaces that carry the demand (plugins.yaml).
"""

import numpy as np

from beaver_ftc.compiled import apart, fill, kernel, record, sized
from beaver_ftc.control import CompiledLaw, laws
from beaver_ftc.control.allocation import set_demand
from beaver_ftc.scenario.declared import Declared

CONFIG = record(Kp=float, Ki=float)  # gains 1/s, 1/s2
MEMORY = record(integral=3)  # of the error, rad
FEEDBACK = record(config=CONFIG, memory=MEMORY)


@sized
def published_dtype(n: int) -> np.dtype:
    """The law's records; they do not depend on the number of surfaces n."""
    return FEEDBACK


def configure(law: np.void, control: np.void, prediction: np.void, declared: Declared, y: np.ndarray) -> None:
    """Fill the gains (control.CompiledLaw)."""
    config = declared.control
    fill(law["config"], Kp=config.proportional_per_s, Ki=config.integral_per_s2)


@apart
def command(control, assessment, faults, prediction, measured, mode, t):
    """From what is measured to the command of each surface (control.CompiledLaw)."""
    unknown = control.surfaces.output.unknown
    command_by(control.published, unknown, control, assessment, faults, prediction, measured, mode, t)


@kernel
def command_by(law, fhat, control, assessment, faults, prediction, measured, mode, t):
    """The steps of the law in a frame, with a record of type FEEDBACK; zhang2005.py has its own fhat."""
    axes = control.axes
    reference = control.reference
    laws.prepare(control, assessment, prediction, mode, t)
    demand(law, axes, reference.output, measured.x, prediction.f, fhat)
    laws.command_surfaces(control, assessment, faults, prediction, laws.WITHOUT_OBSERVER)
    integrate(law, axes, reference, control.allocation.output.command, measured.x)
    laws.complete(control, assessment, measured, t)


@kernel
def demand(law, axes, reference, x, f, fhat):
    """Fill demand and hold of the axes, (3,) rad/s2:

        demand = xm' + Kp e + Ki int e - f - fhat,    e = xm - x,    hold = -f - fhat

    reference: the output of laws/reference.py, whose governed rate and acceleration are xm, xm'.
    """
    config = law.config
    for i in range(3):
        error = reference.governed_rate[i] - x[i]
        feedback = config.Kp * error + config.Ki * law.memory.integral[i]
        acceleration = reference.governed_acceleration[i] + feedback - f[i] - fhat[i]
        set_demand(axes, i, acceleration, -f[i] - fhat[i], 0.0)


@kernel
def integrate(law, axes, reference, u, x):
    """Advance the integrators, less the part of the demand that was not given (anti-windup):

        int e <- int e + dt (e + (G u - demand) / Kp)

    u (n,) rad: the command. The gain 1/Kp of this back-calculation unwinds the integral within one time
    constant of the closed loop.
    """
    G = axes.G
    dt = reference.config.dt
    for i in range(3):
        acceleration = 0.0
        for s in range(u.size):
            acceleration += G[i, s] * u[s]
        error = reference.output.governed_rate[i] - x[i]
        law.memory.integral[i] += dt * (error + (acceleration - axes.demand[i]) / law.config.Kp)


def unexplained(control: np.void) -> np.ndarray:
    """The acceleration that the law attributes to no model, (3,) rad/s2 (control.CompiledLaw)."""
    return unexplained_by(control["published"], control["surfaces"]["output"]["unknown"])


def unexplained_by(law: np.void, fhat: np.ndarray) -> np.ndarray:
    """The same of a record of type FEEDBACK: fhat - Ki int e, because the integrators stand for a missing
    fhat."""
    found: np.ndarray = fhat - law["config"]["Ki"] * law["memory"]["integral"]
    return found


def begin(control: np.void, before: np.void, unexplained: np.ndarray, learnt: np.ndarray) -> None:
    """Take over in flight: the integrators begin where the demand is (control.CompiledLaw).

    learnt (3,) rad/s2: the part that the network of the diagnosis explains. Only a law that uses the verdict
    and is not informed subtracts it, as fhat.
    """
    uses_network = control["config"]["uses_verdict"] and not control["config"]["informed"]
    begin_integrators(control["published"], unexplained, learnt if uses_network else np.zeros(3))


def begin_integrators(law: np.void, unexplained: np.ndarray, fhat: np.ndarray) -> None:
    """Let the integrators of a record of type FEEDBACK stand for the part of `unexplained` that fhat does not
    explain, both (3,) rad/s2: int e = (fhat - unexplained) / Ki, if Ki > 0."""
    if law["config"]["Ki"] > 0.0:
        law["memory"]["integral"] = (fhat - unexplained) / law["config"]["Ki"]


LAW = CompiledLaw(published_dtype, command, configure=configure, unexplained=unexplained, begin=begin)
