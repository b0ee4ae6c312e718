"""The errors that a scenario declares, and the keys of a scenario in which they are multiples of the declared
size.

Each error has exactly the size of its limit, times a factor, within the limits of its key: every coefficient,
inertia and bias is wrong by this amount with a random sign. Turbulence has steps (`_air`). An error that is
not declared has a fixed size as its unit, and is absent from all flights in which it is not the enlarged
error.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator

from beaver_ftc.aircraft import AXES
from beaver_ftc.design.turbulence import SEVERITIES
from beaver_ftc.documents.document import Section
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.actuators import TrueActuator
from beaver_ftc.scenario.air import air_of
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import ActuatorBound
from beaver_ftc.scenario.model_errors import Sinusoid, TrueInertia
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sensors import PRESETS, Sensors
from beaver_ftc.studies.present.tables import values_of

FREQUENCIES_RAD_S = (5.0, 15.0)  # of an unstructured acceleration, if the scenario has none
UNDECLARED_SHARE = 0.01  # unit of an error of a coefficient or a moment of inertia that is not declared
UNDECLARED_SENSORS = "tactical-grade"
UNDECLARED_AIR = "light"
FACTOR_LIMITS = (0.1, 10.0)  # limits of the factors on a coefficient and on a bandwidth or rate limit
_RANDOM = ("noise_std", "quantum")  # begins of keys of a sensor: sizes without a sign
_SIGNED = ("bias", "scale_error", "drift")  # those with a sign
_IDEAL = Sensors()

SensorErrors = Mapping[str, Mapping[str, float]]  # errors by sensor and key
# From a factor and a generator for signs to the keys of a scenario.
Change = Callable[[float, Generator], Document]


class Error(NamedTuple):
    """One kind of error.

    says: the declared size, or that it is not declared. change: makes the keys of a scenario with this error
    times a factor, with random signs. declared: whether it is declared.
    """

    name: str
    says: str
    change: Change
    declared: bool = True


def errors_of(scenario: Scenario) -> tuple[Error, ...]:
    """The kinds of errors that the bounds of a scenario declare, or that a truth may have without a
    declaration."""
    bounds = scenario.fdi.bounds
    declared = Declared.of(scenario)
    airframe = scenario.airframe
    names = [term.name for term in airframe.moments if term.name in airframe.terms]
    shares = {name: declared.coefficients.of(name) for name in names}
    inertia = dict.fromkeys(("Ix", "Iy", "Iz"), bounds.inertia)
    constant = declared.constant_rad_s2
    errors = (
        _of_ratios("moment coefficients", "uncertainty.coefficients", shares, FACTOR_LIMITS),
        _of_ratios("moments of inertia", "uncertainty.inertia", inertia, _limits(TrueInertia, "Ix")),
        _coupling(declared.coupling) if any(declared.coupling) else None,
        _acceleration(scenario, constant) if any(constant) else None,
        None if declared.servo_errors.is_none else _servos(declared),
        _sensors({} if bounds.sensors.is_ideal else bounds.sensors.model_dump()),
        _air(bounds.turbulence),
    )
    return tuple(filter(None, errors))


def changes_of(errors: Sequence[Error], factors: Mapping[str, float], draws: Generator) -> Document:
    """The keys of a truth in which each error has its factor. Errors without a factor are absent. Random
    numbers are drawn for all errors, so that signs do not depend on the factors."""
    truth: Document = {"uncertainty": {}, "sensors": "ideal", "environment": {}}
    for error in errors:
        changes = error.change(factors.get(error.name, 0.0), draws)
        truth |= changes if error.name in factors else {}
    return truth


@cache
def _limits(section: type[Section], key: str) -> tuple[Any, Any]:
    """The smallest and the largest value that a key of a section may have; None without a limit."""
    schema = section.model_json_schema()["properties"][key]
    return schema.get("minimum"), schema.get("maximum")


def _signs(draws: Generator, names: Sequence[str]) -> dict[str, float]:
    """A random sign, 1 or -1, for each name."""
    return dict(zip(names, draws.choice((-1.0, 1.0), len(names)).tolist(), strict=True))


def signed(
    sizes: Mapping[str, float], usual: float, limits: tuple[float, float], times: float,
    draws: Generator,
) -> dict[str, float]:  # fmt: skip
    """The value of each key: usual + times * sign * size, with a random sign, within the limits. times: the
    factor."""
    signs = _signs(draws, [*sizes])
    return {key: float(np.clip(usual + times * signs[key] * size, *limits)) for key, size in sizes.items()}


def _of_ratios(name: str, section: str, shares: Mapping[str, float], limits: tuple[float, float]) -> Error:
    """The error of factors of the truth, which differ from 1 by these shares; by UNDECLARED_SHARE if none is
    declared."""
    is_declared = any(shares.values())
    shares = shares if is_declared else dict.fromkeys(shares, UNDECLARED_SHARE)
    largest = f"{100.0 * max(shares.values()):g} %"
    size = largest if is_declared else _unknown(largest)
    return Error(
        name, size, lambda times, draws: {section: signed(shares, 1.0, limits, times, draws)}, is_declared
    )


def _coupling(theta: Sequence[float]) -> Error:
    """The error of the inertia coupling of each axis, of the sizes theta (3,)."""
    sizes = dict(zip(AXES, theta, strict=True))
    section = "uncertainty.inertia_coupling"
    return Error(
        "inertia coupling",
        f"{max(theta):g}",
        lambda times, draws: {section: signed(sizes, 0.0, (-1.0, 1.0), times, draws)},
    )


def _acceleration(scenario: Scenario, sizes: Sequence[float]) -> Error:
    """A sinusoidal acceleration of each axis, of these sizes (3,) rad/s2, with the frequency of the scenario
    or a random one."""
    _, limit_rad_s2 = _limits(Sinusoid, "amplitude_rad_s2")
    waves = {axis: getattr(scenario.uncertainty.sinusoid, axis) for axis in AXES}
    frequency_of_axis = {axis: wave.frequency_rad_s for axis, wave in waves.items() if wave.amplitude_rad_s2}

    def change(times: float, draws: Generator) -> Document:
        """The sinusoids of all axes, with amplitudes within the limit of the key."""
        frequencies = dict(zip(AXES, draws.uniform(*FREQUENCIES_RAD_S, len(AXES)).tolist(), strict=True))
        return {
            "uncertainty.sinusoid": {
                axis: {"amplitude_rad_s2": min(times * size, limit_rad_s2), "frequency_rad_s": rad_s}
                for (axis, rad_s), size in zip((frequencies | frequency_of_axis).items(), sizes, strict=True)
            }
        }

    return Error("unstructured acceleration", f"{max(sizes):g} rad/s2", change)


def _servos(declared: Declared) -> Error:
    """Errors of bandwidths and rate limits with random signs, and dead bands, of each actuator."""
    bounds = {name: bound.model_dump() for name, bound in declared.servo_errors}
    _, widest_deg = _limits(TrueActuator, "dead_band_deg")

    def change(times: float, draws: Generator) -> Document:
        """The errors of all actuators."""
        truth = {}
        for name, bound in bounds.items():
            shares = {key: bound[key] for key in ("bandwidth", "rate_limit")}
            band_deg = min(times * bound["dead_band_deg"], widest_deg)
            truth[name] = signed(shares, 1.0, FACTOR_LIMITS, times, draws) | {"dead_band_deg": band_deg}
        return {"uncertainty.actuators": truth}

    largest = {key: max(values_of(bounds.values(), key)) for key in ActuatorBound.model_fields}
    size = "{bandwidth:.0%}, {rate_limit:.0%}, {dead_band_deg:g} deg".format(**largest).replace("%", " %")
    return Error("actuators", size, change)


def _sensors(declared: SensorErrors) -> Error:
    """Errors of all sensors: noise and resolution, and biases, slopes and drifts with random signs."""
    bounds = declared or PRESETS[UNDECLARED_SENSORS]

    def change(times: float, draws: Generator) -> Document:
        """The errors of all sensors, each key within its limits."""
        truth = {}
        for name, keys in bounds.items():
            signs = _signs(draws, list(keys))
            kind: type[Section] = type(getattr(_IDEAL, name))
            truth[name] = {
                key: float(
                    np.clip(
                        times * abs(value) * (signs[key] if key.startswith(_SIGNED) else 1.0),
                        *_limits(kind, key),
                    )
                )
                for key, value in keys.items()
                if value and key.startswith((*_RANDOM, *_SIGNED))
            }
        return {"sensors": truth}

    name = _preset(declared) if declared else _unknown(UNDECLARED_SENSORS)
    return Error("sensor errors", name, change, bool(declared))


def _preset(declared: SensorErrors) -> str:
    """The name of the preset with these errors, zeros left out; `as declared` if there is none."""
    used = {
        name: sizes
        for name, sizes_of_sensor in declared.items()
        if (sizes := {key: value for key, value in sizes_of_sensor.items() if value})
    }
    return next((name for name, preset in PRESETS.items() if preset == used), "as declared")


def _air(declared: str) -> Error:
    """Turbulence: the strongest severity whose wind at 20 ft is at most the factor times that of the declared
    one. The winds, 0, 15, 30 and 45 kt, are proportional to the index in SEVERITIES."""
    is_declared = declared != "none"
    base = SEVERITIES.index(declared if is_declared else UNDECLARED_AIR)

    def change(times: float, draws: Generator) -> Document:
        return {"environment": air_of(SEVERITIES[min(int(times * base), len(SEVERITIES) - 1)])}

    return Error("turbulence", declared if is_declared else _unknown(UNDECLARED_AIR), change, is_declared)


def _unknown(unit: str) -> str:
    """The size of an error that is not declared."""
    return f"none; unit {unit}"
