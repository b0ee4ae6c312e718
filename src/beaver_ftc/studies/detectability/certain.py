"""How small a fault is certain to be found, and what it can be taken for: over speed, altitude, excitation.

The fault mismatch function and the magnitudes from which detection and isolation are certain: a loss of
effectiveness of surface s, of magnitude m, changes the innovation by -m z_s. An admissible
uncertainty can hide eta_bar_i of it on axis i, and another fault, or none, survives as long as what is left
is within eta_bar_i of what it predicts. So

    detection is certain at a frame where    max_i  m |z_s,i| / 2 eta_bar_i  > 1
    fault j is excluded for certain where    M_sj(m) = min_{0 <= b <= 1} max_i |m z_s,i - b z_j,i| / 2
    eta_bar_i  > 1

M_sj is the fault mismatch function [Zhang2002] of the sharpened scheme; it grows with m. Both hold for the
frame-by-frame test of the innovation, whatever the fault's course; z is taken along the healthy flight, so
the loop's answer to the fault within the window is neglected.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations, combinations_with_replacement, product
from math import ceil, degrees, inf
from pathlib import Path

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, load
from beaver_ftc.control.engines import effects_of_engines
from beaver_ftc.design.model import design_of, responses_at
from beaver_ftc.documents.errors import BeaverFtcError, SimulationFailed
from beaver_ftc.loop.loop import Loop, fly
from beaver_ftc.plant.instrumented import ENGINE_SIGNALS
from beaver_ftc.results.log import Columns
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.airframe import find_aircraft
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.detectability import isolability
from beaver_ftc.studies.detectability.isolability import best_in_window, largest_and_median
from beaver_ftc.studies.present.tables import all_finite

DETECT_WITHIN_S, ISOLATE_WITHIN_S = 0.5, 1.0
SPEEDS_MPS, ALTITUDES_M = (36.0, 40.0, 44.0, 48.0, 52.0), (0.0, 1000.0, 2000.0, 3000.0)
SHARES = (0.9, 1.0, 1.1)  # of the speed another aircraft starts with
EXCITATIONS = (0.25, 0.5, 1.0, 2.0)  # of the scenario's references
SETTLED_S = 2.0  # the start of a reference is a step of its own
BISECTIONS = 16  # magnitudes to 2^-16
MAGNITUDES = ("detected", "detected_median", "isolated", "isolated_median")
AMPLITUDES = ("amplitude_deg_s", "values_deg_s")  # parameters of a reference
PLACE = ("airspeed_mps", "altitude_m", "excitation")
ALIKE_DEG = 3.0  # distinguished only from this deflection on: similar effects on the rates
TOO_SHORT = "the flight ends before a fault could be isolated"
MOTION = {"p": "roll", "q": "pitch", "r": "yaw"}
COLUMNS = (*PLACE, "fault", *MAGNITUDES, "confused_with", "why")
PARTS = ("points", "pairs")  # of the document: a row a fault, and a row a fault and another
PAIRS = (*PLACE, "fault", "other", *isolability.LOSS_COLUMNS, *isolability.DOUBLET_COLUMNS)


@dataclass(frozen=True)
class Excitation:
    """Along a flight of n frames: the moment of each surface that leads an axis, (n, 3) rad/s2 by its name,
    the bound on the uncertainty (n, 3) rad/s2, and the length of a frame dt s. G: as it begins, (3, surfaces)
    rad/s2 per rad.
    """

    moment: Mapping[str, np.ndarray]
    bound: np.ndarray
    dt: float
    G: np.ndarray = field(default_factory=lambda: np.zeros((3, 0)))

    @cached_property
    def excluding(self) -> dict[str, dict[str, np.ndarray]]:
        """Of each fault and each other the least magnitude (n,) from which each frame excludes the other."""
        return {
            fault: {
                other: exclusion_magnitude(z, of, self.bound)
                for other, of in self.moment.items() if other != fault
            }
            for fault, z in self.moment.items()
        }  # fmt: skip


def excitation(scenario: Scenario) -> Excitation:
    """Fly the scenario without its faults and weigh what the surfaces did with the design model.

    Raises BadInput when it cannot be trimmed, SimulationFailed when the flight ends before it has settled.
    """
    log = Columns()
    fly(scenario.model_copy(update={"faults": ()}), log)
    first = int(SETTLED_S * scenario.rate_hz)
    moment, bound, G = moments_of(scenario, log)
    of = {name: along[first:] for name, along in moment.items()}
    return Excitation(of, bound[first:], 1.0 / scenario.rate_hz, G[first])


def moments_of(
    scenario: Scenario, log: Mapping[str, np.ndarray]
) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Along a flight of n frames, by the design model: the moment of each surface that leads an axis, (n, 3)
    rad/s2 by its name; the bound (n, 3) rad/s2; and G (n, 3, surfaces) rad/s2 per rad."""
    aircraft = scenario.airframe
    y = _side_by_side(log, "alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", *aircraft.signals)
    u = _side_by_side(log, *(f"{surface}_cmd_rad" for surface in aircraft.surfaces))
    bound = _side_by_side(log, *(f"{axis}_eta_bar_rad_s2" for axis in AXES))
    design = design_of(scenario.design_model, aircraft)[0]
    design["linearised"] = design["frozen_alpha"] = False
    G = responses_at(design, np.zeros((len(y), 3)), y)[1]
    moment = G * u[:, None, :]
    of = {name: moment[:, :, aircraft.surfaces.index(name)] for name in aircraft.class_of_losses}
    return of, bound, G


def _side_by_side(log: Mapping[str, np.ndarray], *names: str) -> np.ndarray:
    return np.column_stack([log[name] for name in names])


def detection_magnitude(z: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Smallest magnitude (n,) certain to be detected by each frame alone; above 1 where a total loss is not.

    z, bound (n, 3) rad/s2.
    """
    with np.errstate(divide="ignore", over="ignore"):
        return np.min(2.0 * bound / np.abs(z), axis=1)


def mismatch(
    z: np.ndarray, other: np.ndarray, bound: np.ndarray, limits: tuple[float, float] = (0.0, 1.0)
) -> np.ndarray:
    """M_sj (n,) of m z_s = `z` and z_j = `other`, (n, 3): convex and piecewise linear in b, within limits."""
    a, b = z / (2.0 * bound), other / (2.0 * bound)
    best = np.full(len(a), np.inf)
    # least where two of +-(a_i - b_i t) are equal, one axis with itself at its zero, or at an end
    for (i, j), sign in product(combinations_with_replacement(range(3), 2), (1.0, -1.0)):
        with np.errstate(all="ignore"):
            corner = (a[:, i] - sign * a[:, j]) / (b[:, i] - sign * b[:, j])
        share = np.clip(np.nan_to_num(corner, nan=0.0, posinf=0.0, neginf=0.0), *limits)
        best = np.minimum(best, np.abs(a - share[:, None] * b).max(axis=1))
    return best


def exclusion_magnitude(z: np.ndarray, other: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Smallest magnitude (n,) for which each frame alone excludes the other fault; inf where 1 does not."""
    low, high = np.zeros(len(z)), np.ones(len(z))
    possible = mismatch(z, other, bound) > 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        enough = mismatch(middle[:, None] * z, other, bound) > 1.0
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return np.where(possible, high, np.inf)


def least_distinguished_rad(column: np.ndarray, other: np.ndarray, bound: np.ndarray) -> float:
    """The least deflection off its command, rad, of a surface with this column of G (3,) that a frame's rates
    are certain to tell from every deflection of another; inf where the columns are parallel. bound (3,)."""
    least = float(mismatch(column[None], other[None], bound[None], (-inf, inf))[0])
    return 1.0 / least if least > 1e-9 * np.abs(column / (2.0 * bound)).max() else inf


def alike(scenario: Scenario) -> list[Document]:
    """Pairs of surfaces with similar effects on the rates: the deflection, deg, from which each is certain to
    be distinguished from the other, None where none is; and whether accelerometers distinguish them."""
    seen, aircraft = excitation(_short(scenario)), scenario.airframe
    by_force = [{*aircraft.separated_by_force(force)} for force in ("CY", "CZ")]
    found = []
    for s, other in combinations(range(aircraft.n), 2):
        from_deg = {
            aircraft.surfaces[i]: degrees(least_distinguished_rad(seen.G[:, i], seen.G[:, j], seen.bound[0]))
            for i, j in ((s, other), (other, s))
        }
        if max(from_deg.values()) > ALIKE_DEG:
            forces = any({s, other} <= weighed for weighed in by_force)
            told = {"told_apart_from_deg": all_finite(from_deg), "by_forces": forces}
            found.append({"surfaces": tuple(from_deg), **told})
    return found


def _short(scenario: Scenario) -> Scenario:
    """Its beginning, long enough to weigh the surfaces in trim."""
    return scenario.model_copy(update={"duration_s": SETTLED_S + 1.0, "faults": ()})


def geometry(pairs: Sequence[Document]) -> list[str]:
    """A line a pair."""
    lines = []
    for pair in pairs:
        apart = {name: x for name, x in pair["told_apart_from_deg"].items() if x is not None}
        told = " or ".join(f"{name} is at least {x:.2g} deg off its command" for name, x in apart.items())
        never = f"never distinguish them{', accelerometers do' * pair['by_forces']}"
        says = f"distinguish them if {told}" if told else never
        lines.append(f"{' and '.join(pair['surfaces'])} have similar effects on the rates: the rates {says}")
    return lines


def engine_failures(scenario: Scenario) -> list[Document]:
    """Of each engine that is an effector: how a failure to idle turns the aircraft in trim, rad/s2; over what
    is certain to show in a frame; whether its moment is a signal, so that the design model knows it, and
    whether that is held against the thrust of all."""
    aircraft = scenario.airframe
    thrust, power = aircraft.engine.thrust, aircraft.file.power_setting
    short = _short(scenario)
    effects = effects_of_engines(Declared.of(short))
    if thrust is None or power is None or not effects.size:
        return []
    loop, bound = Loop(short), excitation(short).bound[0]
    setting = loop.trim.settings[power[0]]
    force_n = [
        np.interp(loop.trim.airspeed_mps, thrust.airspeed_mps, f) for f in zip(*thrust.force_n, strict=True)
    ]
    gained = np.interp(setting, thrust.setting, force_n) / aircraft.mass.mass_kg
    loop.release()
    known, mapped = any(name in ENGINE_SIGNALS for name in aircraft.signals), aircraft.file.model_error_map
    turns = np.abs(effects.T) * gained
    return [
        {
            "engine": name,
            "turns_rad_s2": of.tolist(),
            "shows": 1.0 / float(detection_magnitude(of[None], bound[None])[0]),
            "known": known,
            "held": known and mapped is not None and mapped.knows_engines,
        }
        for name, of in zip(aircraft.effectors, turns, strict=True)
    ]


def of_engines(failures: Sequence[Document]) -> list[str]:
    """A line an engine."""
    signal, against = "; the design model knows its moment", " and monitors it against the thrust"
    return [
        f"{of['engine']} failed to idle accelerates the aircraft by {max(of['turns_rad_s2']):.2g} rad/s2, "
        f"{of['shows']:.2g} times the detection limit of one frame"
        + signal * of["known"]
        + against * of["held"]
        for of in failures
    ]


def with_aircraft(scenario: Scenario, reference: str) -> Scenario:
    """The scenario with another aircraft, which starts where its flights do; a folder is looked for in the
    working directory. What is wrong with the other aircraft's truth is not with this one's."""
    find_aircraft(reference, Path())
    given = {"aircraft": reference, "initial": {}, "uncertainty": {}, "actuators": "ideal"}
    return Scenario.model_validate(_without_faults(scenario) | given)


def _without_faults(scenario: Scenario) -> Document:
    """The keys of a scenario without its faults, what is expected of them, and bounds on its own servos."""
    document = scenario.model_dump(mode="json", exclude_none=True)
    del document["fdi"]["bounds"]["actuators"]
    return {**document, "faults": [], "expect": {}}


def answer(scenario: Scenario, row: Document) -> str:
    """From which loss on a surface's fault is certain to be found at a place, in words."""
    axis = axis_of(scenario, row["fault"])
    signals = (signal.shape for signal in getattr(scenario.reference, axis))
    asked = row["excitation"] * sum(float(getattr(shape, "amplitude_deg_s", 0.0)) for shape in signals)
    place = f"at {row['airspeed_mps']:g} m/s and {row['altitude_m']:g} m, {asked:g} deg/s of {MOTION[axis]}"
    fault, detected, isolated = row["fault"], row["detected"], row["isolated"]
    soon = f"is certain to be detected within {DETECT_WITHIN_S:g} s"
    if detected is None:
        return f"{place}: not even a total loss of {fault} {soon} ({row['why']})"
    named = "none is certain to be isolated"
    if isolated is not None:
        named = f"isolated within {ISOLATE_WITHIN_S:g} s from {upwards(isolated)} on"
    return f"{place}: a loss of {fault} of {upwards(detected)} and more {soon}, {named}"


def upwards(magnitude: float) -> str:
    """A magnitude for which the promise holds: rounded up to per cent."""
    return f"{ceil(100.0 * magnitude - 1e-9)} %"


def axis_of(scenario: Scenario, surface: str) -> str:
    """The axis on which a surface shows most."""
    aircraft = scenario.airframe
    return AXES[aircraft.dominant_axis[aircraft.surfaces.index(surface)]]


def usual_airspeeds(aircraft: Aircraft, of_the_beaver: tuple[float, ...]) -> tuple[float, ...]:
    """These of the built-in aircraft, m/s, or about where another one starts."""
    if aircraft is load():
        return of_the_beaver
    return tuple(round(share * aircraft.usual_airspeed_mps, 1) for share in SHARES)


def survey_name(scenario: Scenario) -> str:
    """The name of the survey's result folder, at most 100 characters."""
    return f"{scenario.name[:86]}-detectability"


def look_at(scenario: Scenario, point: tuple[float, float, float]) -> dict[str, list[Document]]:
    """The rows of each of PARTS at a place: without a result, why there is none."""
    place, there = dict(zip(PLACE, point, strict=True)), at(scenario, *point)
    faults = scenario.airframe.class_of_losses
    try:
        seen = excitation(there)
        if len(seen.bound) < _windows(seen)[1]:
            raise SimulationFailed(TOO_SHORT)
        doublets = isolability.smallest_doublets(at(there, *point[:2], 0.0), SETTLED_S)
    except BeaverFtcError as error:
        none = dict.fromkeys((*MAGNITUDES, "confused_with")) | {"why": str(error)}
        points = [{"fault": fault, **none} for fault in faults]
        pairs = isolability.rows_without_result(faults, str(error))
    else:
        points = [{"fault": fault, **judge(seen, fault)} for fault in seen.moment]
        pairs = [row | doublets[row["fault"], row["other"]] for row in pairs_of(seen)]
    return {"points": [place | row for row in points], "pairs": [place | row for row in pairs]}


def at(scenario: Scenario, speed_mps: float, altitude_m: float, excitation: float) -> Scenario:
    """The scenario flown elsewhere, its references scaled."""
    document = _without_faults(scenario)
    document["initial"] |= {"airspeed_mps": speed_mps, "altitude_m": altitude_m}
    document["reference"] = {
        axis: scaled(signals, AMPLITUDES, excitation) for axis, signals in document["reference"].items()
    }
    return Scenario.model_validate(document)


def scaled(signals: Sequence[Document], keys: Collection[str], times: float) -> list[Document]:
    """Reference signals with these of their parameters multiplied."""
    return [
        {
            name: of | {key: (np.asarray(of[key]) * times).tolist() for key in of.keys() & {*keys}}
            for name, of in signal.items()
        }
        for signal in signals
    ]


def judge(seen: Excitation, fault: str) -> Document:
    """Magnitudes from which a fault is certain to be found along a flight.

    detected, isolated: whenever it strikes; `_median`: in half of the instants at which it may strike;
    None: not even a total loss. confused_with: the fault that survives longest; why: in words.
    """
    z = seen.moment[fault]
    detect, isolate = _windows(seen)
    found = best_in_window(detection_magnitude(z, seen.bound), detect)
    excluded = {other: best_in_window(least, isolate) for other, least in seen.excluding[fault].items()}
    isolated = np.maximum(found[: len(z) - isolate + 1], np.max(list(excluded.values()), axis=0))
    rival = max(excluded, key=lambda other: (excluded[other].max(), np.median(excluded[other])))
    least = (*largest_and_median(found, 1.0), *largest_and_median(isolated, 1.0))
    return {
        **dict(zip(MAGNITUDES, least, strict=True)),
        "confused_with": rival,
        "why": _why(seen, fault, rival, found.max(), excluded[rival], isolate),
    }


def _windows(seen: Excitation) -> tuple[int, int]:
    """The frames in which a fault is to be detected, and isolated."""
    detect, isolate = (max(round(s / seen.dt), 1) for s in (DETECT_WITHIN_S, ISOLATE_WITHIN_S))
    return detect, isolate


def pairs_of(seen: Excitation) -> list[Document]:
    """Of each fault and each other, what a flight shows: how small, and how soon."""
    return [
        {"fault": fault, "other": other, **isolability.loss_limits(least, _windows(seen)[1], seen.dt)}
        for fault, of_others in seen.excluding.items()
        for other, least in of_others.items()
    ]


def _why(seen: Excitation, fault: str, rival: str, detected: float, excluded: np.ndarray, frames: int) -> str:
    """What limits this fault at the worst instant for it to strike."""
    if detected > 1.0:
        share = 1.0 / detected
        return (
            f"{fault} barely moves: within {DETECT_WITHIN_S:g} s even a total loss reaches only "
            f"{100 * share:.0f} % of the detection limit"
        )
    if excluded.max() > 1.0:
        start = int(excluded.argmax())
        window = slice(start, start + frames)
        rest = mismatch(seen.moment[fault][window], seen.moment[rival][window], seen.bound[window]).max()
        return (
            f"a fault of {rival} explains even a total loss: within {ISOLATE_WITHIN_S:g} s the difference "
            f"reaches only {100 * rest:.0f} % of the detection limit"
        )
    as_soon = excluded.max() <= detected + 2.0**-BISECTIONS
    return "isolated as soon as detected" if as_soon else f"a fault of {rival} explains smaller losses"


def document_of(name: str, points: Sequence[Mapping[str, Sequence[Document]]]) -> Document:
    """What the command answers and `detectability.json` holds."""
    return {
        "scenario": name,
        "detect_within_s": DETECT_WITHIN_S,
        "isolate_within_s": ISOLATE_WITHIN_S,
        **{what: [row for point in points for row in point[what]] for what in PARTS},
    }
