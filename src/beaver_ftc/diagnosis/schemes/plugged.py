"""The scheme of a Python plug-in: its verdict replaces ours; our estimators serve the laws as before."""

from beaver_ftc.compiled import apart
from beaver_ftc.design.model import ALPHA, BETA
from beaver_ftc.diagnosis import conclusion
from beaver_ftc.diagnosis.detection import fdae
from beaver_ftc.diagnosis.isolation import estimators
from beaver_ftc.diagnosis.schemes import adaptive_estimators, none
from beaver_ftc.diagnosis.schemes.contract import CompiledScheme


@apart
def conclude(fdi, belief, measured, t):
    """Take the plug-in's verdict, fdi.plugin_verdict (contract.CompiledScheme)."""
    fdae.form_residual(fdi.fdae, measured.x)
    conclusion.note_plugin(fdi.verdict, fdi.plugin_verdict, t)
    estimators.take_estimate(fdi.isolation, fdi.verdict.isolated, fdi.plugin_verdict.theta)
    if fdi.verdict.detected:
        fdae.evaluate(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])


SCHEME = CompiledScheme(
    none.begin, adaptive_estimators.predict, conclude, adaptive_estimators.prepare,
    adaptive_estimators.accumulate,
)  # fmt: skip
