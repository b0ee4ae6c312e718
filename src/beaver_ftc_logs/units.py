"""Units that a vehicle file may name, and their sizes in SI; a share of travel has the unit 1. Units of time,
the usual pulse of a servo, and factors of mistakes."""

from math import pi

from beaver_ftc.aircraft import GRAVITY_MPS2, M_PER_FT

RATE = "rate"
ANGLE = "angle"
SPEED = "speed"
ACCELERATION = "acceleration"
LENGTH = "length"
SHARE = "share"
_RAD_PER_DEG = pi / 180.0
# Unit -> its kind, and its size in the SI unit. The SI unit is the first of each kind.
SI_UNITS: dict[str, tuple[str, float]] = {
    "rad/s": (RATE, 1.0), "deg/s": (RATE, _RAD_PER_DEG), "cdeg/s": (RATE, 0.01 * _RAD_PER_DEG),
    "mrad/s": (RATE, 1e-3),
    "rad": (ANGLE, 1.0), "deg": (ANGLE, _RAD_PER_DEG), "cdeg": (ANGLE, 0.01 * _RAD_PER_DEG),
    "mrad": (ANGLE, 1e-3),
    "m/s": (SPEED, 1.0), "cm/s": (SPEED, 0.01), "km/h": (SPEED, 1.0 / 3.6), "kt": (SPEED, 1852.0 / 3600.0),
    "ft/s": (SPEED, M_PER_FT), "mph": (SPEED, 0.44704),
    "m/s2": (ACCELERATION, 1.0), "g": (ACCELERATION, GRAVITY_MPS2), "mg": (ACCELERATION, 1e-3 * GRAVITY_MPS2),
    "ft/s2": (ACCELERATION, M_PER_FT),
    "m": (LENGTH, 1.0), "cm": (LENGTH, 0.01), "ft": (LENGTH, M_PER_FT),
    "1": (SHARE, 1.0), "%": (SHARE, 0.01),
}  # fmt: skip
# Usual pulse of a servo at neutral, and difference from it to either end of the travel, us.
NEUTRAL_PULSE_US = 1500.0
HALF_PULSE_RANGE_US = 400.0
# Unit of the time column -> its size, s.
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
# Factors that correct another sign or unit of a column: radians as degrees, ones as thousandths, and the
# reverse.
UNIT_FACTORS = (-1.0, 1.0 / _RAD_PER_DEG, 1000.0, _RAD_PER_DEG, 1e-3)


def nearest_unit(kind: str, si_factor: float, max_ratio: float) -> str | None:
    """The unit of a kind whose size in SI is nearest to si_factor, a positive number, by ratio; None if the
    ratio exceeds max_ratio."""
    sizes = {name: size for name, (unit_kind, size) in SI_UNITS.items() if unit_kind == kind}
    ratios = {name: max(si_factor / size, size / si_factor) for name, size in sizes.items()}
    nearest = min(ratios, key=lambda name: ratios[name])
    return nearest if ratios[nearest] <= max_ratio else None
