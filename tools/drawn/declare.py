"""Changes of a drawn scenario: its keys must agree, and `fdi.bounds` must contain its true errors."""

from math import pi
from typing import Any

from beaver_ftc.scenario.sensors import PRESETS

Words = dict[str, Any]

AXES = "pqr"
SLOWEST_MPS = 20.0
FASTEST_DAMPING_PER_S = 10.0  # of a body rate
PUBLISHED = {"inertia_coupling": 0.25, "constant_rad_s2": 0.02}
UNLIMITED_DEG_S = 60.0  # rate of a slow surface without a limit of its own
SEVERITIES = ("none", "light", "moderate", "severe")
CHANNELS = (("altitude_m", "altitude"), ("airspeed_mps", "airspeed"), ("heading_deg", "heading"))
ROOM = 0.9  # what is declared of an oscillation or a slow surface, beside its own


def fit(words: Words) -> None:
    """Correct what the schema alone cannot express: orders, and keys that require or exclude one another."""
    for axis in words.get("reference", {}).values():
        for signal in axis:
            for shape in signal.values():
                if shape.get("end_s", 1e9) <= shape.get("start_s", 0.0):
                    shape["end_s"] = shape["start_s"] + 1.0
    for legs in words.get("autopilot", {}).values():
        legs.sort(key=lambda leg: leg.get("at_s", 0.0))
        legs[:] = list({leg.get("at_s", 0.0): leg for leg in legs}.values())
        for leg in legs:
            leg.update({} if "value" in leg else {"hold": True})
    if not words.get("faults"):
        of_a_fault = ("detected_within_s", "isolated", "candidate_type", "post_fault")
        _drop(words.get("expect", {}), of_a_fault)
    for section in (words.get("expect", {}), words.get("expect", {}).get("arrives", {})):
        _drop(section, tuple(key for channel, key in CHANNELS if not words.get("autopilot", {}).get(channel)))


def _drop(section: Words, beginnings: tuple[str, ...]) -> None:
    for key in [key for key in section if key.startswith(beginnings)]:
        del section[key]


def declare(words: Words) -> None:
    """Raise `fdi.bounds`, and the declared limits of faults, until they contain the truth of the scenario."""
    fdi = words.setdefault("fdi", {})
    bounds = fdi.setdefault("bounds", {})
    _declare_sensors(words, bounds)
    _declare_model(words.get("uncertainty", {}), bounds)
    _declare_air(words, bounds)
    _declare_faults(words, fdi)


def _declare_sensors(words: Words, bounds: Words) -> None:
    """Declare the largest of each error of the sensors that fly while a declaration is in force."""
    for change in words.get("changes", ()):
        if "declared_sensors" in change:
            change["declared_sensors"] = _widest(
                change["declared_sensors"], *_flown_from(words, change["at_s"])
            )
    bounds["sensors"] = _widest(bounds.get("sensors", {}), *_flown_from(words, 0.0))


def _flown_from(words: Words, at_s: float) -> list[Any]:
    """The sensors that fly from a declaration until the next one."""
    changes = words.get("changes", ())
    until_s = min((c["at_s"] for c in changes if "declared_sensors" in c and c["at_s"] > at_s), default=1e9)
    timed = [(0.0, words.get("sensors", {})), *((c["at_s"], c["sensors"]) for c in changes if "sensors" in c)]
    before = [sensors for time_s, sensors in timed if time_s <= at_s]
    return [*before[-1:], *(sensors for time_s, sensors in timed if at_s < time_s < until_s)]


def _widest(*given: Any) -> Words:
    widest: Words = {}
    for one in given:
        for signal, errors in (PRESETS[one] if isinstance(one, str) else one).items():
            known = widest.setdefault(signal, {})
            for key, size in errors.items():
                known[key] = max(abs(size), known.get(key, 0.0))
    return widest


def _declare_model(truth: Words, bounds: Words) -> None:
    """Declare the errors of coefficients, inertias and servos, the inertia coupling and the sinusoids."""
    for key in ("coefficients", "inertia"):
        off = [abs(ratio - 1.0) for ratio in truth.get(key, {}).values()]
        if off:
            bounds[key] = max(*off, bounds.get(key, 0.0))
    if "actuators" in truth:
        bounds["actuators"] = _widest_servos(truth["actuators"], bounds.get("actuators", {}))
    couplings = truth.get("inertia_coupling", {})
    amplitudes = {axis: wave.get("amplitude_rad_s2", 0.0) for axis, wave in truth.get("sinusoid", {}).items()}
    for key, sizes in (("inertia_coupling", couplings), ("constant_rad_s2", amplitudes)):
        if key in bounds:
            bounds[key] = {axis: max(abs(sizes.get(axis, 0.0)), bounds[key].get(axis, 0.0)) for axis in AXES}


def _widest_servos(truth: Words, known: Words) -> Words:
    """The larger ones of the true and the declared errors of the actuators. A key beside the surfaces is for
    the surfaces without this key."""
    exact = {"bandwidth": 1.0, "rate_limit": 1.0, "dead_band_deg": 0.0}
    widest: Words = {}
    for name in ("", *(name for name in {**truth, **known} if name not in exact)):
        off, bound = ({**of, **of.get(name, {})} for of in (truth, known))
        found = {
            key: max(abs(off.get(key, neutral) - neutral), bound.get(key, 0.0))
            for key, neutral in exact.items()
        }
        widest |= {name: found} if name else found
    return widest


def _declare_air(words: Words, bounds: Words) -> None:
    """Turbulence; and gusts, which the vanes see. A diagnosis that expects turbulence takes their slope for a
    rotation of the air, and JSBSim's gusts do not turn it."""
    air = words.get("environment", {})
    there, declared = air.get("severity", "none"), bounds.get("turbulence", "none")
    bounds["turbulence"] = max(there, declared, key=SEVERITIES.index)
    gusts = air.get("gust", [])
    steepest = max(
        (_steepest_mps2(gust) for gust in ([gusts] if isinstance(gusts, dict) else gusts)), default=0.0
    )
    if steepest and bounds["turbulence"] != "none":
        constant = bounds.get("constant_rad_s2", {})
        turned = FASTEST_DAMPING_PER_S * steepest / SLOWEST_MPS
        known = 0.0 if "constant_rad_s2" in bounds else PUBLISHED["constant_rad_s2"]
        bounds["constant_rad_s2"] = {axis: constant.get(axis, known) + turned for axis in AXES}


def _steepest_mps2(gust: Words) -> float:
    height = sum(part * part for part in gust["velocity_mps"]) ** 0.5
    return 0.5 * pi * height / min(gust.get("rise_s", 1.0), gust.get("fade_s", 1.0))


def _declare_faults(words: Words, fdi: Words) -> None:
    """Declare the slowest servo and oscillation: the diagnosis takes a slower servo for a jam, and a slower
    oscillation for a bias."""
    actuators = words.get("design_model", {}).get("actuators") or words.get("actuators", {})
    for fault in words.get("faults", ()):
        if fault["type"] == "rate_limit":
            own = actuators if isinstance(actuators, dict) else {}
            own = own.get(fault.get("actuator"), {}) or own
            limit = 60.0 if actuators == "servo" else own.get("rate_limit_deg_s") or UNLIMITED_DEG_S
            slowest = ROOM * fault["scale"] * limit
            fdi["slowest_rate_deg_s"] = min(fdi.get("slowest_rate_deg_s", 0.5), slowest)
        if fault["type"] == "oscillatory":
            slowest = ROOM * fault["frequency_rad_s"]
            fdi["slowest_oscillation_rad_s"] = min(fdi.get("slowest_oscillation_rad_s", 1.0), slowest)
