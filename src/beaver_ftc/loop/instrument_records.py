"""The instruments of a flight, and the watch over them: from a scenario to their records."""

from math import exp

import numpy as np

from beaver_ftc.aircraft.units import EARTH_RADIUS_M, GRAVITY_MPS2
from beaver_ftc.design.context import DesignFunctions
from beaver_ftc.design.dryden import Dryden
from beaver_ftc.diagnosis.bounds.admitted import GUST_LIMIT_SIGMA
from beaver_ftc.diagnosis.bounds.variances import gust_effect
from beaver_ftc.diagnosis.monitors.accelerometers import NEVER_STILL
from beaver_ftc.diagnosis.monitors.sensor_records import NOBODY, POLES_PER_S
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.faults import OF_THE_SLIPSTREAM
from beaver_ftc.plant.instruments import LONGEST_DELAY, MOST_LINE, PHI, SENSORS, USUAL_LINE
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.faults import of_a_sensor
from beaver_ftc.scenario.interventions import stages
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS, ROWS

FASTER = 1.4  # than at the start a flight may become
TAKEN_OVER_PER_S = 3.0  # by the attitude, of a rate it stands in for, where its own noise is declared
# What sets the counters of random numbers apart: OF_THE_FIRST, OF_THE_FURTHER, OF_FAULTS, OF_FORCES,
# OF_THE_SAMPLED.
COUNTERS = (0, 0xD1B54A32D192ED03, 0x8CB92BA72F3D8DD7, 0xA0761D6478BD642F, 0xE7037ED1A0B428DB)


def breaks_instruments(scenario: Scenario) -> bool:
    """Whether an instrument fails in this flight."""
    return any(of_a_sensor(fault) for fault in scenario.faults)


def comes_to_be_watched(scenario: Scenario) -> bool:
    """Whether they are at some time of the flight."""
    flown = (scenario, *(then for _, then in stages(scenario)))
    return any(Declared.of(then).monitors_sensors for then in flown)


def columns_of_the_watch(scenario: Scenario) -> int:
    """How many the log has: none, share and test, and of flights in which readings go missing, which."""
    lost = any(fault.type == "lost" for fault in scenario.faults)
    return comes_to_be_watched(scenario) * (3 if lost else 2)


def has_real_engine(scenario: Scenario) -> bool:
    """Whether dpt is to be worked out from readings that can be wrong from the start."""
    real = any(not getattr(scenario.sensors, name).is_ideal for name in OF_THE_SLIPSTREAM)
    return real and scenario.airframe.has_engine_instruments


def truth_read(scenario: Scenario) -> tuple[ch.Channel, ...]:
    """What is read from the truth in this flight."""
    usual = ch.truth_channels(scenario.airframe)
    return (*usual, *ch.further_channels(scenario.airframe)) if reads_further(scenario) else usual


def reads_further(scenario: Scenario) -> bool:
    """Whether accelerometers, the engine's instruments and what the monitor alone compares are read."""
    declared = Declared.of(scenario)
    accelerometers = declared.uses_accelerometers or declared.follows_gusts_by_accelerometers
    fails = breaks_instruments(scenario) or has_real_engine(scenario)
    sampled = any(not getattr(scenario.sensors, row.name).is_ideal for row in ROWS[N_IN_EQUATIONS:])
    return declared.monitors_sensors or accelerometers or fails or sampled


def configure(frame: np.void, scenario: Scenario, dt: float) -> None:
    """Fill the instruments' record; dt: seconds between samples, which is a JSBSim frame."""
    instruments = frame["instruments"]
    instruments["real"] = not scenario.sensors.is_ideal
    instruments["engine"] = has_real_engine(scenario)
    declared, statistical = Declared.of(scenario), frame["fdi"]["statistical"]
    statistical["forces"]["known"] = declared.uses_accelerometers
    statistical["air"]["output"]["read"] = declared.follows_gusts_by_accelerometers
    for i, name in enumerate(SENSORS):
        sensor = getattr(scenario.sensors, name)
        instruments["noise"][i], instruments["bias"][i], instruments["quantum"][i] = sensor.noise_bias_quantum
        instruments["gain"][i], instruments["dropout"][i] = 1.0 + sensor.scale_error, sensor.dropout_share
        instruments["drift"][i] = getattr(sensor, "drift_rad_s", 0.0) * dt
        instruments["keep"][i] = exp(-sensor.bandwidth_rad_s * dt) if sensor.bandwidth_rad_s else 0.0
        instruments["delay"][i] = sensor.delay_s / dt
        instruments["length"][i] = _samples(sensor.delay_s / dt)
        instruments["every"][i] = _frames_apart(i, dt)
        if sensor.delay_s / dt > LONGEST_DELAY:
            raise BadInput(
                f"{scenario.name}: sensors.{name}.delay_s is {sensor.delay_s:g} s, "
                f"allowed: {LONGEST_DELAY} JSBSim frames, {LONGEST_DELAY * dt:g} s here"
            )

    instruments["first"] = np.cumsum(instruments["length"]) - instruments["length"]


def _frames_apart(i: int, dt: float) -> int:
    """JSBSim frames from one sample of sensor i to the next, dt s each."""
    return max(round(1.0 / ROWS[i].rate_hz / dt), 1) if ROWS[i].rate_hz else 1


def line_for(scenario: Scenario) -> int:
    """How many samples the delay lines of a flight keep: as many as most flights', or as any's."""
    instant_s, flown = 1.0 / scenario.rate_hz / scenario.substeps, [scenario]
    flown += [then for _, then in stages(scenario)]
    delays = [[getattr(then.sensors, name).delay_s / instant_s for name in SENSORS] for then in flown]
    needed = [sum(_samples(delay) for delay in of_it) for of_it in delays]
    return USUAL_LINE if max(needed) <= USUAL_LINE else MOST_LINE


def _samples(delay: float) -> int:
    """What a line of this delay, in JSBSim frames, keeps."""
    return int(delay) + 2 if delay else 0


def seed(instruments: np.void, number: int) -> None:
    """Let the random numbers of all instruments, further ones and faults, begin with a seed."""
    instruments["random"] = np.uint64(number) ^ np.array(COUNTERS, np.uint64)


def configure_watch(watch: np.void, scenario: Scenario, h: float) -> None:
    """Fill the watch's record; h: seconds between two looks, which is a JSBSim frame."""
    declared = Declared.of(scenario)
    watch["config"]["enabled"], watch["config"]["instants"] = declared.monitors_sensors, scenario.substeps
    watch["memory"]["past"] = scenario.substeps - 1  # the first look ends a frame
    watch["output"]["named"], watch["output"]["alarmed_at_s"], watch["output"]["named_at_s"] = (
        NOBODY,
        -1.0,
        -1.0,
    )
    watch["config"]["engine"] = scenario.airframe.has_engine_instruments
    step, errors, initial = watch["step"], declared.sensors, scenario.initial
    step["config"]["h"], step["config"]["decay"] = h, [exp(-pole * h) for pole in POLES_PER_S]
    step["config"]["gravity"] = GRAVITY_MPS2 * (1.0 + initial.altitude_m / EARTH_RADIUS_M) ** -2
    step["config"]["gust"], step["config"]["gusts"] = gusts_seen(declared.air, initial.airspeed_mps, h)
    step["config"]["swift"] = FASTER * initial.airspeed_mps
    step["config"]["low"], step["config"]["rising"] = declared.air.low_m, declared.vertical_wind_mps
    if watch["config"]["engine"]:  # whose keys the aircraft names
        step["memory"]["command"] = [
            getattr(initial, name) for name in ("engine_rpm", "manifold_pressure_inhg")
        ]
    for i, name in enumerate(SENSORS):
        error = errors[name]
        step["config"]["offset"][i], step["config"]["slope"][i], step["config"]["steady"][i] = (
            error.worst,
            error.slope,
            error.steady,
        )
        watch["config"]["longest_still"][i] = longest_still(error.noise, error.resolution) * _frames_apart(
            i, h
        )
        step["config"]["drift"] = max(
            step["config"]["drift"], abs(getattr(getattr(errors.declared, name), "drift_rad_s", 0.0))
        )
    blurred = watch["config"]["blurred"] = np.any(
        step["config"]["offset"][PHI : PHI + 3] > step["config"]["steady"][PHI : PHI + 3]
    )
    watch["config"]["follows"] = min(1.0, h * TAKEN_OVER_PER_S) if blurred else 1.0


def longest_still(noise: float, quantum: float) -> int:
    """For how many looks no sound instrument, of this noise and resolution, gives the very same reading."""
    if quantum == 0.0:
        return 3
    return 50 if noise > quantum / 4.0 else NEVER_STILL


def gusts_seen(air: Dryden, airspeed_mps: float, h: float) -> tuple[float, np.ndarray]:
    """Speed of gusts, m/s, and of their changes in h s what passes each filter of the watch: bounds.

    The speed of a gust changes like a random walk (`Dryden.velocity_walk`); a filter with a pole of lam 1/s
    keeps 1 / 2 lam of it.
    """
    sigma_mps, intensity = air.sigma_mps, air.velocity_walk(airspeed_mps, FASTER)
    kept_s = [h / (1.0 - exp(-2.0 * pole * h)) for pole in POLES_PER_S]
    return GUST_LIMIT_SIGMA * sigma_mps, GUST_LIMIT_SIGMA * np.sqrt(intensity * np.array(kept_s))


def anchor_watch(watch: np.void, design: np.ndarray, y: np.ndarray) -> None:
    """Show the watch the trim: y, and how the rates are damped there; design: the designer's record, (1,)."""
    watch["config"]["trim"][3:7] = y[:4]
    watch["config"]["damping"] = gust_effect(DesignFunctions(design.copy()), y)
