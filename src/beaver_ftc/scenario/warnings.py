"""What a scenario may do although it is unwise: said, never refused."""

from collections.abc import Iterator
from math import pi

from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.signals import Chirp

_SEVERITIES = ("none", "light", "moderate", "severe")
_MOMENTS = ("Cl", "Cm", "Cn")
_ROUNDING = 1e-9


def warnings_of(scenario: Scenario) -> tuple[str, ...]:
    """One line a warning, `key.path: what`."""
    return (*_airspeed(scenario), *_too_fast_for_the_frame(scenario), *_undeclared(scenario))


def _undeclared(scenario: Scenario) -> Iterator[str]:
    """Errors of the truth that `fdi.bounds` does not cover: an alarm may then have no fault behind it."""
    bounds, truth = scenario.fdi.bounds, scenario.uncertainty
    for name, sensor in scenario.sensors:
        if not sensor.is_within(getattr(bounds.sensors, name)):
            yield f"sensors.{name}: its errors are not within fdi.bounds.sensors.{name}"
    severity, declared = scenario.environment.severity, bounds.turbulence
    if _SEVERITIES.index(severity or "none") > _SEVERITIES.index(declared):
        yield f"environment.severity: {severity} is more than fdi.bounds.turbulence, {declared}"
    for name, ratio in truth.coefficients.items():
        share = bounds.coefficients
        allowed = share.get(name, 0.0) if isinstance(share, dict) else share
        if name[:2] in _MOMENTS and abs(ratio - 1.0) > allowed + _ROUNDING:
            yield f"uncertainty.coefficients.{name}: {ratio:g} is beyond fdi.bounds.coefficients, {allowed:g}"
    for axis, ratio in truth.inertia:
        if abs(ratio - 1.0) > bounds.inertia + _ROUNDING:
            yield f"uncertainty.inertia.{axis}: {ratio:g} is beyond fdi.bounds.inertia, {bounds.inertia:g}"
    if any(truth.cg_m):
        yield "uncertainty.cg_m: a displaced centre of gravity is covered by fdi.bounds.constant_rad_s2 only"


def _airspeed(scenario: Scenario) -> Iterator[str]:
    lowest, highest = scenario.airframe.envelope.airspeed_mps
    airspeed_mps = scenario.initial.airspeed_mps
    if not lowest <= airspeed_mps <= highest:
        yield (
            f"initial.airspeed_mps: {airspeed_mps:g} is outside the range the aerodynamic model "
            f"was identified in, {lowest:g} to {highest:g} m/s"
        )


def _too_fast_for_the_frame(scenario: Scenario) -> Iterator[str]:
    nyquist_hz = scenario.rate_hz / 2
    for path, frequency_hz in _frequencies_hz(scenario):
        if frequency_hz > nyquist_hz:
            yield f"{path}: {frequency_hz:g} Hz is over the Nyquist frequency of rate_hz, {nyquist_hz:g} Hz"


def _frequencies_hz(scenario: Scenario) -> Iterator[tuple[str, float]]:
    for axis in ("p", "q", "r"):
        for i, signal in enumerate(getattr(scenario.reference, axis)):
            shape = signal.shape
            if isinstance(shape, Chirp):
                yield f"reference.{axis}[{i}]", max(shape.start_frequency_hz, shape.end_frequency_hz)
            elif hasattr(shape, "frequency_hz"):
                yield f"reference.{axis}[{i}]", shape.frequency_hz
        sinusoid = getattr(scenario.uncertainty.sinusoid, axis)
        if sinusoid.amplitude_rad_s2 > 0:
            yield f"uncertainty.sinusoid.{axis}", sinusoid.frequency_rad_s / (2 * pi)
    for i, fault in enumerate(scenario.faults):
        if fault.type == "oscillatory":
            yield f"faults[{i}].frequency_rad_s", fault.frequency_rad_s / (2 * pi)
