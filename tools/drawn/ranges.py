"""Where a flight means something: what the schema admits and does not say.

What is never given has its reason. A key that is not here is drawn from its schema alone.
"""

from collections.abc import Callable
from math import degrees
from typing import Any

from beaver_ftc.scenario.sensors import PRESETS
from tools.drawn.walk import Circumstances, Ranges, log_uniform

Ranged = Callable[[Circumstances, str], Any]
AT_THE_BOUND = 0.3  # share of errors that are as large as they may be
LARGE_REFERENCES = 0.1  # share of amplitudes beyond what an aircraft can follow
COARSEST = PRESETS["consumer-grade"]
# Keys whose error no bound in `fdi.bounds` covers: given only in flights that promise less.
UNBOUNDED = ("delay_s", "bandwidth_rad_s", "dropout_share")  # of an instrument
UNDECLARABLE = ("design_model.*", "uncertainty.cg_m", *(f"*sensors.*.{key}" for key in UNBOUNDED))


def within(low: float, high: float) -> Ranged:
    """Equally likely anywhere."""
    return lambda now, path: float(now.rng.uniform(low, high))


def over_decades(low: float, high: float) -> Ranged:
    """Equally likely on a logarithmic scale."""
    return lambda now, path: log_uniform(now.rng, low, high)


def either(*values: Any) -> Ranged:
    """One of these."""
    return lambda now, path: values[now.rng.integers(len(values))]


def none_or(ranged: Ranged) -> Ranged:
    """0 now and then."""
    return lambda now, path: 0.0 if now.rng.random() < AT_THE_BOUND else ranged(now, path)


def up_to(bound: float) -> Ranged:
    """Of either sign, and often right at the bound."""
    return lambda now, path: signed(now, bound)


def signed(now: Circumstances, bound: float) -> float:
    """Anywhere within a bound of either sign, and often right at it."""
    size = bound if now.rng.random() < AT_THE_BOUND else now.rng.uniform(0.0, bound)
    return float(size * now.rng.choice([-1.0, 1.0]))


def _share_of_flight(low: float, high: float) -> Ranged:
    return lambda now, path: float(now.rng.uniform(low, high) * now.duration_s)


def _amplitude(now: Circumstances, path: str) -> float:
    largest = 140.0 if now.rng.random() < LARGE_REFERENCES else 5.0
    return log_uniform(now.rng, 0.1, largest) * float(now.rng.choice([-1, 1]))


def _table(now: Circumstances, path: str) -> dict[str, Any]:
    """As a fully resolved scenario has it: the numbers stand beside the file's name."""
    times = sorted({round(float(now.rng.uniform(0, now.duration_s)), 3) for _ in range(4)})
    return {"file": "drawn.csv", "time_s": times, "values_deg_s": [signed(now, 4.0) for _ in times]}


def _ratios(share: float) -> Ranged:
    """A few aerodynamic terms, or all, off by up to a share."""

    def draw(now: Circumstances, path: str) -> dict[str, float]:
        names = list(now.aircraft.terms)
        if now.rng.random() < 0.5:
            names = [names[i] for i in now.rng.integers(len(names), size=3)]
        return {name: 1.0 + signed(now, share) for name in names}

    return draw


def _of_an_instrument(now: Circumstances, path: str) -> float:
    """An error of a reading: up to twice a consumer-grade instrument's, often less."""
    _, signal, key = path.rsplit(".", 2)
    size = COARSEST.get(signal, {}).get(key) or COARSEST.get(signal, {}).get(
        key.replace("quantum", "bias"), 0.01
    )
    size = log_uniform(now.rng, 0.01, 2.0) * size
    return size * float(now.rng.choice([-1, 1])) if key.startswith(("bias", "scale", "drift")) else size


def _surface(now: Circumstances, path: str) -> str:
    return str(now.rng.choice(list(now.aircraft.surfaces)))


def _jam(now: Circumstances, path: str) -> float:
    """Within the travel of any surface."""
    travels = now.aircraft.travel.values()
    least = max(degrees(travel.min_rad) for travel in travels)
    most = min(degrees(travel.max_rad) for travel in travels)
    return float(now.rng.uniform(max(-5.0, least), min(15.0, most)))


_SENSOR_SIZES = {
    **dict.fromkeys("pqr", (0.3, 10.0)),
    **dict.fromkeys(("alpha", "beta", "phi", "theta", "psi"), (0.5, 10.0)),
    "V": (1.0, 10.0), "qdyn": (20.0, 300.0), "altitude": (5.0, 100.0), "engine_rpm": (20.0, 300.0),
    "manifold_pressure": (0.3, 5.0), **dict.fromkeys(("ax", "ay", "az"), (0.3, 10.0)),
}  # fmt: skip


def size_of_sensor_fault(now: Circumstances, sensor: str, kind: str) -> float:
    """In the sensor's unit; a scale as a share."""
    if kind == "scale":
        return signed(now, 0.8)
    size = log_uniform(now.rng, *_SENSOR_SIZES.get(sensor, (0.1, 1.0)))
    return size if kind == "noise" else size * float(now.rng.choice([-1, 1]))


def _gust_velocity(now: Circumstances, path: str) -> list[float]:
    way = now.rng.normal(size=3)
    return (now.rng.uniform(0.5, 6.0) * way / (way @ way) ** 0.5).tolist()


def _airspeed(now: Circumstances, path: str) -> float:
    return float(now.rng.uniform(*now.aircraft.envelope.airspeed_mps))


def _travel(now: Circumstances, path: str) -> list[float]:
    return [-float(now.rng.uniform(15, 25)), float(now.rng.uniform(15, 25))]


def _poles(now: Circumstances, path: str) -> list[float]:
    return [log_uniform(now.rng, 1.0, 1e6) for _ in range(now.rng.integers(3))]


def _wind(now: Circumstances, path: str) -> list[float]:
    """Up and down no more than the watch of the instruments admits."""
    return [*(float(now.rng.uniform(-12, 12)) for _ in range(2)), signed(now, 1.0)]


_PATTERNS: dict[str, Ranged | None] = {
    "name": None,  # given to every flight
    "description": None,
    "fdi.options": None,  # of a plug-in, which alone knows their names
    "control.options": None,
    **dict.fromkeys(f"*declared_sensors.*.{key}" for key in UNBOUNDED),
    **dict.fromkeys(f"fdi.bounds.sensors.*.{key}" for key in UNBOUNDED),
    "initial.altitude_m": within(800, 3000),
    "initial.engine_rpm": within(1500, 2200),
    "initial.manifold_pressure_inhg": within(16, 24),
    "initial.flap_deg": within(0, 12),
    "initial.on_ground": None,  # for those who take off: under an autopilot
    "reference.?.csv": _table,
    "reference.*.amplitude_deg_s": _amplitude,
    "reference.*frequency_hz": over_decades(0.1, 1.0),
    "reference.*.phase_deg": within(-360, 360),
    "reference.*.start_s": _share_of_flight(0.0, 0.4),
    "reference.*.end_s": _share_of_flight(0.5, 1.2),
    "reference.*.width_s": over_decades(0.2, 2.0),
    "autopilot.*.at_s": _share_of_flight(0.0, 0.8),
    "autopilot.*.hold": None,  # said where there is no value
    "autopilot.altitude_m.value": within(800, 3000),
    "autopilot.airspeed_mps.value": _airspeed,
    "uncertainty.inertia_coupling.?": up_to(0.25),
    "uncertainty.sinusoid.?.amplitude_rad_s2": lambda now, path: abs(signed(now, 0.02)),
    "uncertainty.sinusoid.?.frequency_rad_s": over_decades(0.1, 15.0),
    "uncertainty.coefficients": _ratios(0.1),
    "uncertainty.mass": within(0.95, 1.05),
    "uncertainty.inertia.*": lambda now, path: 1.0 + signed(now, 0.05),
    "uncertainty.actuators*.bandwidth": within(0.7, 1.3),
    "uncertainty.actuators*.rate_limit": within(0.7, 1.3),
    "*actuators*.dead_band_deg": within(0.0, 0.2),
    "uncertainty.cg_m": lambda now, path: [signed(now, 0.02) for _ in range(3)],
    "*actuators*.bandwidth_rad_s": over_decades(3, 100),
    "*actuators*.rate_limit_deg_s": over_decades(5, 500),
    "*actuators*.travel_deg": _travel,
    "*sensors.*.noise_std_*": _of_an_instrument,
    "*sensors.*.bias_*": _of_an_instrument,
    "*sensors.*.quantum_*": _of_an_instrument,
    "*sensors.*.scale_error": _of_an_instrument,
    "*sensors.*.drift_deg_h": up_to(2.0),
    "*sensors.*.delay_s": within(0.0, 0.1),
    "*sensors.*.bandwidth_rad_s": over_decades(5.0, 100.0),
    "*sensors.*.dropout_share": within(0.0, 0.3),
    "environment.wind_mps": _wind,
    "environment.gust.velocity_mps": _gust_velocity,
    "environment.gust.at_s": _share_of_flight(0.05, 0.4),
    "environment.gust.hold_s": within(0.0, 1.0),
    "environment.gust.*_s": over_decades(0.3, 2.0),
    "faults.*.at_s": _share_of_flight(0.1, 0.5),
    "faults.*.end_s": _share_of_flight(0.55, 1.1),
    "faults.*.actuator": _surface,
    "faults.*.kappa_per_s": over_decades(0.2, 20),
    "faults.*.magnitude": lambda now, path: float(now.rng.choice([1.0, now.rng.uniform(0.1, 1.0)])),
    "faults.*.position_deg": _jam,
    "faults.*.bias_deg": up_to(6.0),
    "faults.*.scale": over_decades(0.001, 0.3),
    "faults.*.amplitude_deg": over_decades(0.2, 5.0),
    "faults.*.frequency_rad_s": over_decades(1.01, 20.0),
    "faults.*.Cm_alpha3": up_to(15.0),
    "fdi.statistical.false_alarms_per_h": over_decades(1e-6, 1e-3),
    "fdi.statistical.misnaming": over_decades(1e-7, 1e-4),
    "fdi.statistical.uncertainty_rad_s": within(15.0, 30.0),
    "fdi.pole_bank_per_s": _poles,
    "fdi.bounds.coefficients": within(0.0, 0.1),
    "fdi.bounds.inertia": within(0.0, 0.05),
    "fdi.bounds.constant_rad_s2.?": none_or(within(0.0, 0.1)),
    "fdi.bounds.inertia_coupling.?": none_or(within(0.0, 0.5)),
    "fdi.bounds.actuators*.bandwidth": within(0.0, 0.3),
    "fdi.bounds.actuators*.rate_limit": within(0.0, 0.3),
    "fdi.bounds.deflection_deg": within(0.0, 0.5),
    "control.power.lowest_inhg": within(8.0, 15.0),
    "control.power.highest_inhg": within(25.0, 36.5),
    "design_model.coefficients": _ratios(0.2),
    "expect.isolated_as": _surface,
    "changes.at_s": _share_of_flight(0.15, 0.85),
}  # fmt: skip

RANGES = Ranges(_PATTERNS)
DECLARED_ONLY = Ranges(
    {**dict.fromkeys(UNDECLARABLE), **{k: v for k, v in _PATTERNS.items() if k not in UNDECLARABLE}}
)
