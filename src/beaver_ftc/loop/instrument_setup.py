"""The instruments of a flight, from its scenario: their errors, their delay lines, and which are recorded."""

from math import exp

import numpy as np

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant.instruments import LONGEST_DELAY, MOST_LINE, SENSORS, USUAL_LINE
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario, stages
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS, OF_THE_SLIPSTREAM, ROWS, frames_apart

# What sets the counters of random numbers apart: OF_THE_FIRST, OF_THE_FURTHER, OF_FAULTS, OF_FORCES,
# OF_THE_SAMPLED.
COUNTERS = (0, 0xD1B54A32D192ED03, 0x8CB92BA72F3D8DD7, 0xA0761D6478BD642F, 0xE7037ED1A0B428DB)


def are_ever_monitored(scenario: Scenario) -> bool:
    """Whether the sensor monitor runs at some time of the flight."""
    return any(Declared.of(then).monitors_sensors for then in _flown(scenario))


def _flown(scenario: Scenario) -> tuple[Scenario, ...]:
    """The scenario as it is at first, and after each change in flight."""
    return scenario, *(then for _, then in stages(scenario))


def has_real_engine(scenario: Scenario) -> bool:
    """Whether dpt is to be worked out from readings that can be wrong from the start."""
    real = any(not getattr(scenario.sensors, name).is_ideal for name in OF_THE_SLIPSTREAM)
    return real and scenario.airframe.has_engine_instruments


def records_further(scenario: Scenario) -> bool:
    """Whether accelerometers, the engine's instruments and what the monitor alone compares are recorded. A
    fault to come has no say in it."""
    declared = Declared.of(scenario)
    accelerometers = declared.uses_accelerometers or declared.follows_gusts_by_accelerometers
    sampled = any(not getattr(scenario.sensors, row.name).is_ideal for row in ROWS[N_IN_EQUATIONS:])
    return declared.monitors_sensors or accelerometers or has_real_engine(scenario) or sampled


def configure_instruments(instruments: np.void, scenario: Scenario, dt: float) -> None:
    """Fill the instruments' record; dt: seconds between samples, which is a JSBSim frame."""
    instruments["real"] = not scenario.sensors.is_ideal
    instruments["engine"] = has_real_engine(scenario)
    for i, name in enumerate(SENSORS):
        sensor = getattr(scenario.sensors, name)
        instruments["noise"][i], instruments["bias"][i], instruments["quantum"][i] = sensor.noise_bias_quantum
        instruments["gain"][i], instruments["dropout"][i] = 1.0 + sensor.scale_error, sensor.dropout_share
        instruments["drift"][i] = getattr(sensor, "drift_rad_s", 0.0) * dt
        instruments["keep"][i] = exp(-sensor.bandwidth_rad_s * dt) if sensor.bandwidth_rad_s else 0.0
        instruments["delay"][i] = sensor.delay_s / dt
        instruments["length"][i] = _samples(sensor.delay_s / dt)
        instruments["every"][i] = frames_apart(i, dt)
        if sensor.delay_s / dt > LONGEST_DELAY:
            raise BadInput(
                f"{scenario.name}: sensors.{name}.delay_s is {sensor.delay_s:g} s, "
                f"allowed: {LONGEST_DELAY} JSBSim frames, {LONGEST_DELAY * dt:g} s here"
            )

    instruments["first"] = np.cumsum(instruments["length"]) - instruments["length"]


def line_for(scenario: Scenario) -> int:
    """How many samples the delay lines of a flight keep: as many as most flights', or as any's."""
    instant_s = 1.0 / scenario.rate_hz / scenario.substeps
    needed = max(
        sum(_samples(getattr(then.sensors, name).delay_s / instant_s) for name in SENSORS)
        for then in _flown(scenario)
    )
    return USUAL_LINE if needed <= USUAL_LINE else MOST_LINE


def _samples(delay: float) -> int:
    """What a line of this delay, in JSBSim frames, keeps."""
    return int(delay) + 2 if delay else 0


def seed(instruments: np.void, number: int) -> None:
    """Let the random numbers of all instruments, further ones and faults, begin with a seed."""
    instruments["random"] = np.uint64(number) ^ np.array(COUNTERS, np.uint64)
