"""Limits of one frame, SETTLED_S into a healthy flight: surfaces with similar effects on the rates, and
failures of engines."""

from collections.abc import Sequence
from itertools import combinations
from math import degrees

import numpy as np

from beaver_ftc.control.engines import effects_of_engines
from beaver_ftc.loop.loop import Loop
from beaver_ftc.plant.instrumented import ENGINE_SIGNALS
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.detectability.certain import (
    SETTLED_S,
    detection_magnitude,
    excitation,
    least_distinguished_rad,
)
from beaver_ftc.studies.present.tables import all_finite

ALIKE_DEG = 3.0  # a pair has similar effects if one of the two needs a larger deflection to be distinguished


def alike(scenario: Scenario) -> list[Document]:
    """Pairs of surfaces with similar effects on the rates. told_apart_from_deg: by surface, the deflection
    (deg) from which it is certain to be distinguished from the other; None if no deflection is. by_forces:
    whether accelerometers distinguish the two."""
    flight = excitation(_short(scenario))
    aircraft = scenario.airframe
    by_force = [{*aircraft.separated_by_force(force)} for force in ("CY", "CZ")]
    pairs = []
    for s, other in combinations(range(aircraft.n), 2):
        from_deg = {
            aircraft.surfaces[i]: degrees(
                least_distinguished_rad(flight.G[:, i], flight.G[:, j], flight.bound[0])
            )
            for i, j in ((s, other), (other, s))
        }
        if max(from_deg.values()) > ALIKE_DEG:
            forces = any({s, other} <= separated for separated in by_force)
            limits = {"told_apart_from_deg": all_finite(from_deg), "by_forces": forces}
            pairs.append({"surfaces": tuple(from_deg), **limits})
    return pairs


def _short(scenario: Scenario) -> Scenario:
    """The begin of the scenario, without faults, long enough for an `Excitation`."""
    return scenario.model_copy(update={"duration_s": SETTLED_S + 1.0, "faults": ()})


def engine_failures(scenario: Scenario) -> list[Document]:
    """A row for each engine that is an effector; none without a thrust table or a power setting.

    - turns_rad_s2 (3,): size of the angular acceleration by a failure to idle: effect of the engine
      for each m/s2 of push times push, force at the setting in trim over mass.
    - shows: the same over the detection limit of one frame.
    - known: whether its moment is a signal, which the design model contains. held: whether the diagnosis also
      compares this signal with the thrust of all engines.
    """
    aircraft = scenario.airframe
    thrust = aircraft.engine.thrust
    power = aircraft.file.power_setting
    short = _short(scenario)
    effects = effects_of_engines(Declared.of(short))
    if thrust is None or power is None or not effects.size:
        return []
    loop = Loop(short)
    bound = excitation(short).bound[0]
    power_name, _ = power
    setting = loop.trim.settings[power_name]
    force_n = [
        np.interp(loop.trim.airspeed_mps, thrust.airspeed_mps, f) for f in zip(*thrust.force_n, strict=True)
    ]
    push_mps2 = np.interp(setting, thrust.setting, force_n) / aircraft.mass.mass_kg
    loop.release()
    has_engine_signal = any(name in ENGINE_SIGNALS for name in aircraft.signals)
    mapped = aircraft.file.model_error_map
    turns = np.abs(effects.T) * push_mps2
    return [
        {
            "engine": name,
            "turns_rad_s2": acceleration.tolist(),
            "shows": 1.0 / float(detection_magnitude(acceleration[None], bound[None])[0]),
            "known": has_engine_signal,
            "held": has_engine_signal and mapped is not None and mapped.knows_engines,
        }
        for name, acceleration in zip(aircraft.effectors, turns, strict=True)
    ]


def alike_in_words(pairs: Sequence[Document]) -> list[str]:
    """A sentence for each pair of surfaces that `alike` returns."""
    lines = []
    for pair in pairs:
        limits_deg = {name: x for name, x in pair["told_apart_from_deg"].items() if x is not None}
        conditions = " or ".join(
            f"{name} is at least {x:.2g} deg off its command" for name, x in limits_deg.items()
        )
        never = "never distinguish them" + (", accelerometers do" if pair["by_forces"] else "")
        verb = f"distinguish them if {conditions}" if conditions else never
        lines.append(f"{' and '.join(pair['surfaces'])} have similar effects on the rates: the rates {verb}")
    return lines


def failures_in_words(failures: Sequence[Document]) -> list[str]:
    """A sentence for each engine of `engine_failures`."""
    return [
        f"{row['engine']} failed to idle accelerates the aircraft by {max(row['turns_rad_s2']):.2g} rad/s2, "
        f"{row['shows']:.2g} times the detection limit of one frame"
        + ("; the design model knows its moment" if row["known"] else "")
        + (" and monitors it against the thrust" if row["held"] else "")
        for row in failures
    ]
