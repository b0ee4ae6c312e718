"""Margins of every surface's loop over the envelope, healthy and with each fault that is accommodated."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from math import exp, inf
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.control.laws.gains import margins
from beaver_ftc.control.laws.state import REJECTING
from beaver_ftc.control.state import COMPILED
from beaver_ftc.design.model import QDYN
from beaver_ftc.design.variants import jacobian
from beaver_ftc.diagnosis.state import PITCH
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.engine.words import aligned
from beaver_ftc.studies.margins.aircraft_loop import (
    RATES,
    LawGains,
    Parts,
    allocation,
    frequencies,
    interpolated,
    loops,
)

if TYPE_CHECKING:
    from beaver_ftc.plant.linear import LinearModel
    from beaver_ftc.scenario.schema import Scenario

N_AIRSPEEDS = 5
LEFT = (0.5, 0.1)  # effectiveness of the losses looked at; 0: given up
LEAST_LOOP = 1e-3  # of a surface that hardly moves there is no loop to speak of


@dataclass(frozen=True)
class Margin:
    """Of one surface's loop: how much its gain may grow and shrink, dB, and its phase lag, deg."""

    airspeed_mps: float
    fault: str
    surface: str
    up_db: float
    down_db: float
    phase_deg: float

    def keeps(self, gain_db: float, phase_deg: float) -> bool:
        """Whether all are at least these."""
        return min(self.up_db, self.down_db) >= gain_db and self.phase_deg >= phase_deg


def study(scenario: "Scenario") -> list[Margin]:
    """The margins of a scenario's default law with its actuators, sensors and frame rate.

    Raises BadInput for another law: its loop is not this one.
    """
    known = [name for name, (_, inner) in COMPILED.items() if inner == REJECTING]
    if scenario.control.law not in known:
        says = f"margins are known of the default law's loop, allowed: {', '.join(known)}"
        raise BadInput(f"{scenario.name}: control.law: {scenario.control.law}: {says}")
    low, high = scenario.airframe.envelope.airspeed_mps
    found: list[Margin] = []
    for V in np.linspace(low, high, N_AIRSPEEDS):
        found += at(scenario.with_({"initial.airspeed_mps": float(V)}))
    return found


def at(scenario: "Scenario") -> Iterator[Margin]:
    """The margins at a scenario's flight condition."""
    from beaver_ftc.loop.assembly import y_places
    from beaver_ftc.loop.loop import Loop
    from beaver_ftc.plant.conditions import trimmed
    from beaver_ftc.plant.linear import differences

    plant, point = trimmed(scenario)
    linear = differences(plant, point)
    frame = Loop(scenario).frames[0]
    truth = frame["truth"]["value"] * frame["truth"]["factor"]
    y = truth[y_places(frame)]
    omega = frequencies(1.0 / scenario.rate_hz)
    for fault, left in cases(frame["control"], scenario.airframe.surfaces):
        parts, law = parts_of(scenario, frame, linear, y, left)
        L = loops(parts, law, omega)
        for s, surface in enumerate(scenario.airframe.surfaces):
            if np.abs(L[:, s]).max() > LEAST_LOOP:
                V = scenario.initial.airspeed_mps
                yield Margin(V, fault, surface, *(float(value) for value in margins(L[:, s])))


def cases(control: np.void, surfaces: tuple[str, ...]) -> Iterator[tuple[str, np.ndarray]]:
    """What a fault is called, and the effectiveness (n,) it leaves."""
    healthy = np.ones(len(surfaces))
    yield "none", healthy
    for s in control["main"]:
        for left in LEFT:
            yield f"{surfaces[s]} {100 * (1 - left):.0f} % lost", _with(healthy, s, left)
        yield f"{surfaces[s]} given up", _with(healthy, s, 0.0)


def _with(left: np.ndarray, s: int, value: float) -> np.ndarray:
    changed = left.copy()
    changed[s] = value
    return changed


def parts_of(
    scenario: "Scenario", frame: np.void, linear: "LinearModel", y: np.ndarray, left: np.ndarray
) -> tuple[Parts, LawGains]:
    """The loop with the effectiveness `left` (n,), the law knowing it; y: the measured signals in trim."""
    control, belief, dt = frame["control"], frame["belief"], 1.0 / scenario.rate_hz
    rejection = control["rejection"]
    _, G, f_x, f_y = jacobian(belief["design"], np.zeros(3), y, control["trim"])
    lost = 1.0 - left[control["main"][PITCH]] if control["stand_in"] >= 0 else 0.0
    whole = 1.0 - (1.0 - belief["actuators"]["approach"]) ** scenario.substeps
    C = outputs(linear.states, y)
    parts = Parts(
        linear.A, linear.B, C, np.hstack((f_x, f_y[:, : len(C) - 3])), G * left, left, whole,
        *sensors(scenario, len(C), dt), dt,
    )  # fmt: skip
    demand = allocation(G * left, control["main"], control["stand_in"], lost)
    lead, share = np.array(rejection["lead"]), float(rejection["share"])
    return parts, LawGains(*interpolated(rejection, y[QDYN], lost), demand, lead, share)


def outputs(states: tuple[str, ...], y: np.ndarray) -> np.ndarray:
    """What is measured, (7 + declared signals, states): rates, alpha, beta, V, qdyn, and what goes with V.

    qdyn goes with V^2, the slipstream (the Beaver's one declared signal) with V^-3; with altitude neither.
    """
    C = np.zeros((3 + len(y), len(states)))
    for row, name in enumerate((*RATES, "alpha", "beta", "airspeed")):
        C[row, states.index(name)] = 1.0
    V = states.index("airspeed")
    C[6, V] = 2.0 * y[QDYN] / y[2]
    C[7:, V] = -3.0 * y[4:] / y[2]
    return C


def sensors(scenario: "Scenario", m: int, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """delay_s and keep (m,) of what is measured."""
    delay, keep = np.zeros(m), np.zeros(m)
    for i, name in enumerate((*RATES, "alpha", "beta", "V", "qdyn")):
        sensor = getattr(scenario.sensors, name)
        delay[i] = sensor.delay_s
        keep[i] = exp(-sensor.bandwidth_rad_s * dt) if sensor.bandwidth_rad_s else 0.0
    return delay, keep


def as_document(found: list[Margin], asked: tuple[float, float]) -> dict[str, Any]:
    """For `--format json`; a margin without end is null."""
    rows = [{**_finite(asdict(margin)), "keeps": margin.keeps(*asked)} for margin in found]
    return {"gain_margin_db": asked[0], "phase_margin_deg": asked[1], "margins": rows}


def _finite(row: dict[str, Any]) -> dict[str, Any]:
    return {key: None if value == inf else value for key, value in row.items()}


def as_text(found: list[Margin], asked: tuple[float, float]) -> str:
    """A line for each fault and surface, the least over the airspeeds."""
    table = [["fault", "surface", "gain up, dB", "down, dB", "phase, deg", "least at, m/s"]]
    for fault, surface in dict.fromkeys((each.fault, each.surface) for each in found):
        rows = [each for each in found if (each.fault, each.surface) == (fault, surface)]
        least = min(rows, key=lambda each: each.phase_deg)
        numbers = [min(getattr(each, of) for each in rows) for of in ("up_db", "down_db", "phase_deg")]
        table.append([fault, surface, *(f"{n:.1f}" for n in numbers), f"{least.airspeed_mps:.0f}"])
    short = sum(not each.keeps(*asked) for each in found)
    end = f"{len(found)} loops, {short} with less than {asked[0]:g} dB or {asked[1]:g} deg"
    return f"{aligned(table)}\n\n{end}"
