"""Plug-ins before the flight: those that a scenario names, what each is given, and the record made ready."""

import numpy as np

from beaver_ftc.control import Law, has_kernels, row_of
from beaver_ftc.diagnosis import Detector
from beaver_ftc.diagnosis.config import PLUGIN_SCHEME, WORST_CASE_DETECTOR
from beaver_ftc.loop.assembly import Trim
from beaver_ftc.loop.plugin_context import context_of
from beaver_ftc.loop.plugin_frame import PluginFrame
from beaver_ftc.plugins import DETECTORS, LAWS, is_compiled, made
from beaver_ftc.scenario.schema import Scenario


def named_detector(scenario: Scenario) -> Detector | None:
    """The plug-in a scenario names for its diagnosis; None if it is compiled in.

    Raises BadInput for a name that cannot be loaded.
    """
    scheme = scenario.fdi.scheme
    return None if is_compiled(DETECTORS, scheme) else made(DETECTORS, scheme)


def named_law(frames: np.ndarray, scenario: Scenario, trim: Trim) -> Law | None:
    """The plug-in a scenario names for its law; None if it is compiled in, or has a compiled form, which is
    put into the record then. trim: as in `context_of`. Raises as `named_detector` does."""
    if is_compiled(LAWS, scenario.control.law):
        return None
    law = made(LAWS, scenario.control.law)
    compile_into = getattr(law, "compile_into", None)
    if compile_into is None or not has_kernels(scenario.control.law):
        return law
    law.reset(context_of(frames, scenario, trim, scenario.control.options))
    control = frames["control"][0]
    control["power"]["config"]["enabled"] = 0
    compile_into(control[row_of(scenario.control.law).file])
    return None


def plugged(
    frames: np.ndarray,
    scenario: Scenario,
    trim: Trim,
    detector: Detector | None,
    law: Law | None,
    begun: PluginFrame | None = None,
) -> PluginFrame | None:
    """The frame with these plug-ins, the record made ready for them; None with none. begun: as in
    `PluginFrame`. Raises SimulationFailed for a plug-in that fails at reset."""
    if detector is None and law is None:
        return None
    if detector is not None:  # no built-in isolation; instead, one estimator a surface for its verdict
        fdi = frames["fdi"][0]
        fdi["config"]["enabled"] = fdi["config"]["diagnoses_all_types"] = fdi["isolation"]["config"][
            "n_estimators"
        ] = 0
        fdi["statistical"]["test"]["enabled"] = fdi["sensor_monitor"]["config"]["enabled"] = 0
        fdi["config"]["scheme_number"] = PLUGIN_SCHEME
        fdi["config"]["exclusion_authority"] = WORST_CASE_DETECTOR
        fdi["types"]["pair"]["enabled"] = 0
        n = fdi["types"]["surface"].size
        fdi["isolation"]["estimator"]["surface"][:n] = range(n)
    if law is not None:
        control = frames["control"][0]
        control["power"]["config"]["enabled"] = 0
        config = control["config"]
        config["uses_verdict"], config["reallocates"] = getattr(law, "fault_tolerant", False), 0
        config["informed"] = 0
    return PluginFrame(frames, scenario, trim, detector, law, begun)
