"""Handling qualities: short period, phugoid, Dutch roll, roll and spiral mode against MIL-F-8785C's levels.

The modes are those of the aircraft with fixed controls, whose truth is linearised by differences: healthy in
trim, and degraded where a flight with a failure ends, with the surfaces at their positions then. A law that
controls the rates changes all of these modes. They matter to a pilot who flies without the law. Requirements:
class I, flight phase category B (light aircraft; climb, cruise, descent). The addition to the limits of the
Dutch roll for large ratios of bank to sideslip (3.3.1.1, above 20 rad2/s2) is left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, log
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from beaver_ftc.aircraft.aircraft import GRAVITY_MPS2
from beaver_ftc.documents.document import parse
from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.documents.files import Document
from beaver_ftc.plant.adapter import FlightState
from beaver_ftc.plant.conditions import trimmed
from beaver_ftc.plant.linear import LinearModel, differences
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.linear_systems import CLASSICAL, Mode, modes
from beaver_ftc.studies.margins import over_envelope
from beaver_ftc.studies.present.tables import aligned, grouped, number, values_of

WORSE = 4  # in place of a level: worse than level 3
_STATES = ("alpha_rad", "beta_rad", "p_rad_s", "q_rad_s", "r_rad_s", "phi_rad", "theta_rad", "psi_rad")


@dataclass(frozen=True)
class Limit:
    """The requirements of levels 1 to 3 on one quantity of a mode [MIL-F-8785C]. levels: (least, most) of
    each level. clause: of the specification, and its table or figure."""

    mode: str
    quantity: str
    clause: str
    levels: tuple[tuple[float, float], ...]
    unit: str = ""
    table: str = ""

    def level(self, value: float) -> int:
        """The best level whose limits contain the value; WORSE if there is none."""
        levels = (i for i, (least, most) in enumerate(self.levels, 1) if least <= value <= most)
        return next(levels, WORSE)

    def margin(self, value: float, level: int) -> float:
        """Distance of the value from the nearer limit of a level; negative outside."""
        least, most = self.levels[level - 1]
        return min(value - least, most - value)


_FILE = Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8")
LIMITS = TypeAdapter(tuple[Limit, ...]).validate_python(parse(_FILE).data)


@dataclass(frozen=True)
class Quality:
    """One quantity of one mode, its value and level. where: `trimmed` or `at the end`. A time to double is
    infinite if the mode does not diverge."""

    where: str
    airspeed_mps: float
    mode: str
    quantity: str
    value: float
    level: int


Qualities = list[Quality]


def of_model(linear: LinearModel, airspeed_mps: float, where: str) -> Qualities:
    """The handling qualities of a linear aircraft. n/alpha = -A[alpha, alpha] V / g, 1/rad."""
    alpha = linear.states.index("alpha")
    g_per_rad = -linear.A[alpha, alpha] * airspeed_mps / GRAVITY_MPS2
    values = _values(modes(linear.of(CLASSICAL).A), float(g_per_rad))
    qualities = []
    for limit in LIMITS:
        value = values[limit.mode, limit.quantity]
        level = limit.level(value)
        qualities.append(Quality(where, airspeed_mps, limit.mode, limit.quantity, value, level))
    return qualities


def _values(by_name: Mapping[str, Mode], g_per_rad: float) -> dict[tuple[str, str], float]:
    """Each quantity of LIMITS by mode and name. g_per_rad: load factor per angle of attack, n/alpha, 1/rad;
    the control anticipation parameter CAP is w^2 / (n/alpha), w of the short period, rad/s; infinite if
    n/alpha is not positive."""
    short, dutch, phugoid = by_name["short_period"], by_name["dutch_roll"], by_name["phugoid"]
    roll = by_name["roll"].pole
    spiral = by_name["spiral"].pole.real
    cap = short.frequency_rad_s**2 / g_per_rad if g_per_rad > 0.0 else inf
    return {
        ("short period", "damping"): short.damping,
        ("short period", "CAP"): cap,
        ("Dutch roll", "damping"): dutch.damping,
        ("Dutch roll", "damping x frequency"): dutch.damping * dutch.frequency_rad_s,
        ("Dutch roll", "frequency"): dutch.frequency_rad_s,
        ("roll", "time constant"): 0.0 if roll.imag else -1.0 / roll.real,
        ("spiral", "time to double"): inf if roll.imag else _double_s(spiral),
        ("phugoid", "damping"): phugoid.damping,
        ("phugoid", "time to double"): _double_s(phugoid.pole.real),
        # roll and spiral mode may be one oscillation: then neither has values of its own
        ("roll-spiral", "damping x frequency"): -roll.real if roll.imag else inf,
    }


def _double_s(real: float) -> float:
    """Time in which a mode doubles, s: log(2) / real; infinite if it does not diverge. real: part of its
    pole, 1/s."""
    return log(2.0) / real if real > 0.0 else inf


def where_trimmed(scenario: Scenario) -> Qualities:
    """The qualities of a scenario's healthy aircraft in trim. Raises BadInput as a trim does."""
    plant, point = trimmed(scenario)
    return of_model(differences(plant, point), point.airspeed_mps, "trimmed")


def where_ended(scenario: Scenario, end: Mapping[str, float]) -> Qualities:
    """The qualities of the aircraft at the end of a flight, with the effective deflections of its surfaces
    then. end: the last row of the log by column; engine settings that it lacks are those of the trim.

    Raises SimulationFailed if the aircraft cannot be linearised there.
    """
    plant, point = trimmed(scenario)
    states: Document = {name: float(end[name]) for name in _STATES}
    surfaces = {surface: float(end[f"{surface}_effective_rad"]) for surface in scenario.airframe.surfaces}
    settings = {name: float(end.get(name, value)) for name, value in point.settings.items()}
    state = FlightState(
        float(end["airspeed_mps"]), float(end["altitude_m"]),
        surfaces_rad=surfaces, settings=settings, **states,
    )  # fmt: skip
    linear = differences(plant, state)
    if not np.isfinite(linear.A).all():
        raise SimulationFailed(f"{scenario.name}: nothing can be linearised where it ended")
    return of_model(linear, state.airspeed_mps, "at the end")


def over_airspeeds(scenario: Scenario) -> Qualities:
    """The qualities of the healthy aircraft over the airspeeds of the envelope. If the scenario has a fault,
    also those at the end of its flight, unless the aircraft is lost."""
    from beaver_ftc.loop.loop import fly
    from beaver_ftc.results.log import MemoryLog

    qualities = [quality for flight in over_envelope(scenario) for quality in where_trimmed(flight)]
    if scenario.faults:
        log = MemoryLog()
        if fly(scenario, log).departure is None:
            qualities += where_ended(scenario, dict(zip(log.columns, log.rows[-1].tolist(), strict=True)))
    return qualities


def as_text(rows: list[Document]) -> str:
    """A line for each flight condition, a column for each quantity, with the level in brackets; the last
    column has the worst level."""
    lines = [
        ["aircraft alone,", *(limit.mode for limit in LIMITS), ""],
        ["airspeed, m/s", *(f"{limit.quantity} {limit.unit}".strip() for limit in LIMITS), "level"],
    ]
    for (where, airspeed_mps), rows_of_condition in grouped(rows, "where", "airspeed_mps").items():
        ended = " at the end" if where == "at the end" else ""
        cells = [
            f"{number(row['value'], none='never')} ({level_text(row['level'])})" for row in rows_of_condition
        ]
        lines.append(
            [f"{airspeed_mps:.1f}{ended}", *cells, level_text(max(values_of(rows_of_condition, "level")))]
        )
    clauses = ", ".join(dict.fromkeys(f"{limit.clause} {limit.table}".strip() for limit in LIMITS))
    legend = f"in brackets: level of MIL-F-8785C, class I, category B:\n{clauses}"
    return f"{aligned(lines)}\n\n{legend}"


def level_text(level: int) -> str:
    """A level in words."""
    return "none" if level == WORSE else str(level)
