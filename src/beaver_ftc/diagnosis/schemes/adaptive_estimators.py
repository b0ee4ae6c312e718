"""Our scheme: the bank of detection filters and, where it is declared, the statistical detector raise the
alarm; known faults are taken off what the estimator of the unknown has to explain."""

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.design.model import ALPHA, BETA
from beaver_ftc.diagnosis import conclusion
from beaver_ftc.diagnosis.detection import fdae
from beaver_ftc.diagnosis.monitors import engine_symmetry
from beaver_ftc.diagnosis.schemes.contract import CompiledScheme
from beaver_ftc.diagnosis.state import UNANTICIPATED, YAW


@apart
def predict(fdi, belief):
    """Bring the FDAE to this frame (contract.CompiledScheme)."""
    found = fdi.verdict
    leaking = found.isolated >= 0 or found.lead >= 0
    fdae.predict(fdi.fdae, fdi.bound, belief.x_then, belief.expected, found.detected, leaking, fdi.config.dt)


@apart
def detect(fdi, belief, measured, t):
    """Raise the alarm by the bank or the statistical detector (contract.CompiledScheme)."""
    axis = axis_of_alarm(fdi, measured.y, t)
    if axis >= 0:
        conclusion.latch_alarm(fdi.verdict, axis, t)


@kernel
def axis_of_alarm(fdi, y, t):
    """The axis on which a detector raises the alarm, or -1. An engine that has failed is outside the class:
    no surface is isolated then. y: measured signals."""
    apart_now, found = fdi.bound.error_map.apart_now, fdi.verdict
    if not found.detected and engine_symmetry.detect(fdi.engines, apart_now, y):
        conclusion.note_isolated(found, UNANTICIPATED, t)
        return YAW
    return fdae.detect(fdi.bank, fdi.config.authority, fdi.statistical.alarm)


@apart
def evaluate(fdi, measured):
    """Evaluate the FDAE's network (contract.CompiledScheme)."""
    fdae.evaluate(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])


SCHEME = CompiledScheme(predict, detect, evaluate)
