"""Our scheme: the bank of detection filters and, where it is declared, the statistical detector raise the
alarm; known faults are taken off what the estimator of the unknown has to explain.
"""

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.design.model import ALPHA, BETA
from beaver_ftc.diagnosis import conclusion, scheme
from beaver_ftc.diagnosis.detection import bank, fdae
from beaver_ftc.diagnosis.monitors import engine_symmetry, sensor_monitor
from beaver_ftc.diagnosis.schemes import fault_classes, statistics
from beaver_ftc.diagnosis.schemes.contract import CompiledScheme
from beaver_ftc.diagnosis.state import UNANTICIPATED, YAW


@apart
def begin(fdi, belief, measured):
    """Begin the filters, and fix the parity direction of each fault (contract.CompiledScheme)."""
    scheme.begin_filters(fdi, measured.x)
    bank.align(fdi.isolation, belief.G)


@apart
def predict(fdi, belief, measured, k, t):
    """Bring bank, likelihoods, isolation and FDAE to this frame (contract.CompiledScheme)."""
    found, bound, dt = fdi.verdict, fdi.bound, fdi.config.dt
    bank.innovate(fdi.bank, bound, measured.x, belief.x_then, belief.means.acceleration, dt)
    if fdi.statistical.tests.enabled:
        statistics.compare_likelihoods(fdi, belief, measured, k, t)
    scheme.predict_estimators(fdi, belief)
    fault_classes.observe(fdi.config.fault_class, fdi, belief)
    leaking = found.isolated >= 0 or found.lead >= 0
    fdae.predict(fdi.fdae, bound, belief.x_then, belief.expected, found.detected, leaking, dt)


@apart
def conclude(fdi, belief, measured, t):
    """From residuals to the alarm and a verdict, unless a sensor is at fault (contract.CompiledScheme)."""
    if sensor_monitor.has_alarm(fdi.sensor_monitor):
        return
    known, found = fdi.verdict.detected, fdi.verdict
    fdae.form_residual(fdi.fdae, measured.x)
    axis = axis_of_alarm(fdi, measured.y, t)
    if axis >= 0:
        conclusion.latch_alarm(found, axis, t)
    if found.detected:
        fault_classes.isolate_fault(fdi, measured, t, known)
        fdae.evaluate(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])


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
def prepare(fdi, belief, measured, k):
    """Prepare the statistical detector, where it is declared (contract.CompiledScheme)."""
    if fdi.statistical.tests.enabled:
        statistics.prepare(fdi, belief, measured, k)


@apart
def accumulate(fdi, belief, measured):
    """The same for an instant inside the frame (contract.CompiledScheme)."""
    if fdi.statistical.tests.enabled:
        statistics.accumulate(fdi, belief, measured)


SCHEME = CompiledScheme(begin, predict, conclude, prepare, accumulate)
