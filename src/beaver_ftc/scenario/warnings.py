"""What a scenario may do although it is unwise: said, never refused."""

from collections.abc import Iterator
from math import pi

from beaver_ftc.design.coefficients import ENVELOPE_AIRSPEED_MPS
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.signals import Chirp


def warnings_of(scenario: Scenario) -> tuple[str, ...]:
    """One line a warning, `key.path: what`."""
    return (*_airspeed(scenario), *_too_fast_for_the_frame(scenario))


def _airspeed(scenario: Scenario) -> Iterator[str]:
    lowest, highest = ENVELOPE_AIRSPEED_MPS
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
