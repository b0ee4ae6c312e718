"""How values are drawn where a flight means something: the functions that ranges.yaml names.

Each takes the circumstances, the key's path and the numbers of the file.
"""

from functools import partial
from math import degrees
from typing import Any

from beaver_ftc.scenario.sensors import PRESETS
from tools.data import beside
from tools.drawn.walk import NEVER, Circumstances, Ranges, log_uniform

AT_THE_BOUND = 0.3  # share of errors that are as large as they may be
LARGE_REFERENCES = 0.1  # share of amplitudes beyond what an aircraft can follow
COARSEST = PRESETS["consumer-grade"]
# Keys whose error no bound in `fdi.bounds` covers: given only in flights that promise less.
UNDECLARABLE = (
    "design_model.*", "uncertainty.cg_m", "*sensors.*.delay_s", "*sensors.*.bandwidth_rad_s",
    "*sensors.*.dropout_share",
)  # fmt: skip


def within(now: Circumstances, path: str, low: float, high: float) -> float:
    """A number from a uniform distribution."""
    return float(now.rng.uniform(low, high))


def over_decades(now: Circumstances, path: str, low: float, high: float) -> float:
    """A number whose logarithm is from a uniform distribution."""
    return log_uniform(now.rng, low, high)


def none_or_within(now: Circumstances, path: str, low: float, high: float) -> float:
    """0 in some flights, otherwise as `within`."""
    return 0.0 if now.rng.random() < AT_THE_BOUND else within(now, path, low, high)


def about(now: Circumstances, path: str, middle: float, bound: float) -> float:
    """The middle plus an error within a bound, often exactly the bound."""
    return middle + signed(now, bound)


def size(now: Circumstances, path: str, bound: float) -> float:
    """A magnitude up to a bound, often exactly the bound."""
    return abs(signed(now, bound))


def vector(now: Circumstances, path: str, bound: float) -> list[float]:
    """Three numbers as of `signed`."""
    return [signed(now, bound) for _ in range(3)]


def signed(now: Circumstances, bound: float) -> float:
    """A number of either sign within a bound, often exactly at it."""
    largest = bound if now.rng.random() < AT_THE_BOUND else now.rng.uniform(0.0, bound)
    return float(largest * now.rng.choice([-1.0, 1.0]))


def share_of_flight(now: Circumstances, path: str, low: float, high: float) -> float:
    """A time as a share of the flight, s."""
    return float(now.rng.uniform(low, high) * now.duration_s)


def amplitude(now: Circumstances, path: str) -> float:
    """The amplitude of a reference, deg/s."""
    largest = 140.0 if now.rng.random() < LARGE_REFERENCES else 5.0
    return log_uniform(now.rng, 0.1, largest) * float(now.rng.choice([-1, 1]))


def table(now: Circumstances, path: str) -> dict[str, Any]:
    """A table of a resolved scenario: the name of the file and its numbers."""
    times = sorted({round(float(now.rng.uniform(0, now.duration_s)), 3) for _ in range(4)})
    return {"file": "drawn.csv", "time_s": times, "values_deg_s": [signed(now, 4.0) for _ in times]}


def ratios(now: Circumstances, path: str, share: float) -> dict[str, float]:
    """Ratios of a few aerodynamic terms, or of all, with errors up to a share."""
    names = list(now.aircraft.terms)
    if now.rng.random() < 0.5:
        names = [names[i] for i in now.rng.integers(len(names), size=3)]
    return {name: 1.0 + signed(now, share) for name in names}


def of_an_instrument(now: Circumstances, path: str) -> float:
    """An error of an instrument: up to twice that of a consumer-grade one, often less."""
    _, signal, key = path.rsplit(".", 2)
    known = COARSEST.get(signal, {})
    error = log_uniform(now.rng, 0.01, 2.0) * (
        known.get(key) or known.get(key.replace("quantum", "bias"), 0.01)
    )
    return error * float(now.rng.choice([-1, 1])) if key.startswith(("bias", "scale", "drift")) else error


def surface(now: Circumstances, path: str) -> str:
    """The name of one surface of the aircraft."""
    return str(now.rng.choice(list(now.aircraft.surfaces)))


def loss(now: Circumstances, path: str) -> float:
    """A loss of effectiveness, often a complete one."""
    return float(now.rng.choice([1.0, now.rng.uniform(0.1, 1.0)]))


def jam(now: Circumstances, path: str) -> float:
    """A position within the travel of every surface, deg."""
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
    """The size of the fault of a sensor, in its unit; that of a scale error as a share."""
    if kind == "scale":
        return signed(now, 0.8)
    error = log_uniform(now.rng, *_SENSOR_SIZES.get(sensor, (0.1, 1.0)))
    return error if kind == "noise" else error * float(now.rng.choice([-1, 1]))


def gust_velocity(now: Circumstances, path: str) -> list[float]:
    """To any side, m/s."""
    way = now.rng.normal(size=3)
    return (now.rng.uniform(0.5, 6.0) * way / (way @ way) ** 0.5).tolist()


def airspeed(now: Circumstances, path: str) -> float:
    """In the envelope."""
    return float(now.rng.uniform(*now.aircraft.envelope.airspeed_mps))


def travel(now: Circumstances, path: str) -> list[float]:
    """Both stops, deg."""
    return [-float(now.rng.uniform(15, 25)), float(now.rng.uniform(15, 25))]


def poles(now: Circumstances, path: str) -> list[float]:
    """Up to two, 1/s."""
    return [log_uniform(now.rng, 1.0, 1e6) for _ in range(now.rng.integers(3))]


def wind(now: Circumstances, path: str) -> list[float]:
    """Up and down no more than the watch of the instruments admits."""
    return [*(float(now.rng.uniform(-12, 12)) for _ in range(2)), signed(now, 1.0)]


def _read() -> dict[str, Any]:
    """{pattern: function of circumstances and path, or NEVER for a key that is left out}."""
    found: dict[str, Any] = {}
    for pattern, drawn in beside(__file__).items():
        found[pattern] = drawn
        for name, numbers in drawn.items() if drawn != NEVER else ():
            found[pattern] = partial(_numbered, globals()[name], numbers)
    return found


def _numbered(draw: Any, numbers: list[float], now: Circumstances, path: str) -> Any:
    return draw(now, path, *numbers)


_PATTERNS = _read()
RANGES = Ranges(_PATTERNS)
DECLARED_ONLY = Ranges(
    {**dict.fromkeys(UNDECLARABLE, NEVER), **{k: v for k, v in _PATTERNS.items() if k not in UNDECLARABLE}}
)
