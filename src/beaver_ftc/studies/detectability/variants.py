"""Variants of a scenario, each with one change, which show what limits the detection of a loss.

If one error is left out of scenario and declaration, the variant shows how much this error limits the
detection. With another reference, it shows whether the reference helps.
"""

from collections.abc import Iterator

from beaver_ftc.results.model import Document
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.detectability.certain import AMPLITUDES, axis_of
from beaver_ftc.studies.detectability.places import scaled

AS_IT_IS = "as it is"
NOTHING = {"p": 0.0, "q": 0.0, "r": 0.0}
FREQUENCIES = ("frequency_hz", "start_frequency_hz", "end_frequency_hz")  # keys of a reference
# The sine that is added to an axis without a reference.
ADDED_DEG_S = 3.0
ADDED_HZ = 0.25


def variants_of(scenario: Scenario, surface: str) -> Iterator[tuple[str, Scenario]]:
    """(name, scenario) of each variant; the first is the scenario as it is."""
    for name, change in ((AS_IT_IS, {}), *_left_out(scenario), *_other_references(scenario, surface)):
        yield name, scenario.with_({"faults": [], "expect": {}, **change})


def _left_out(scenario: Scenario) -> Iterator[tuple[str, Document]]:
    """(name, changed keys) of variants without an error that may hide a fault, in flight and in the
    declaration."""
    declared = Declared.of(scenario)
    environment = scenario.environment
    if environment.is_turbulent or environment.gusts or declared.air.moves:
        yield "without turbulence", {"environment": {}, "fdi.bounds.turbulence": "none"}
    if not (scenario.sensors.is_ideal and declared.sensors.is_ideal):
        yield (
            "with perfect sensors",
            {"sensors": "ideal", "fdi.bounds.sensors": "ideal", "design_model.sensors": None},
        )
    if not (scenario.actuators.is_ideal and declared.servo_errors.is_none):
        no_errors = {
            "fdi.bounds.deflection_deg": 0.0,
            "fdi.bounds.actuators": {},
            "design_model.actuators": None,
        }
        yield "with perfect servos", {"actuators": "ideal", "uncertainty.actuators": {}, **no_errors}
    exact = {"coefficients": 0.0, "inertia": 0.0, "inertia_coupling": NOTHING, "constant_rad_s2": NOTHING}
    no_bounds = {f"fdi.bounds.{key}": value for key, value in exact.items()}
    yield "without uncertainty of the model", {"uncertainty": {}, **no_bounds}


def _other_references(scenario: Scenario, surface: str) -> Iterator[tuple[str, Document]]:
    """(name, changed keys) of variants with a larger or faster reference on the axis of the largest effect of
    the surface; with a sine, if this axis has no reference."""
    axis = axis_of(scenario, surface)
    signals = scenario.model_dump(mode="json", exclude_none=True)["reference"].get(axis, [])
    for quantity, keys in (("amplitude", AMPLITUDES), ("frequency", FREQUENCIES)):
        if (twice := scaled(signals, keys, 2.0)) != signals:
            yield f"with twice the {quantity} of reference.{axis}", {f"reference.{axis}": twice}
    if not signals:
        sine = {"amplitude_deg_s": ADDED_DEG_S, "frequency_hz": ADDED_HZ}
        label = f"with a sine of {ADDED_DEG_S:g} deg/s and {ADDED_HZ:g} Hz as reference.{axis}"
        yield label, {f"reference.{axis}": [{"sine": sine}]}
