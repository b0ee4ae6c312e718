"""Margins of the default law on the whole aircraft, as `beaver-ftc linearise` shows them.

The loop of each surface (margins_loop.py) is judged over the envelope, healthy and with each fault that the
law accommodates. The aircraft is the truth linearised by differences (plant/linear.py), with inputs held over
a frame. The law is that of control/laws/loop_design.py with the derivatives of the design model. A known loss
of effectiveness scales both the surface and the effectiveness that the law assumes. A surface that is given
up gets no demand.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import product
from math import exp, inf

import numpy as np

from beaver_ftc.aircraft import AXES, PITCH, ROLL, YAW
from beaver_ftc.control import flown_by
from beaver_ftc.control.laws.gain_schedule import STAND_IN
from beaver_ftc.control.laws.loop_design import margins
from beaver_ftc.control.readout import DefaultLaw
from beaver_ftc.design.engine import DPT_0
from beaver_ftc.design.plain_model import jacobian
from beaver_ftc.design.table import AIRSPEED, DPT, QDYN
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import Document
from beaver_ftc.loop.loop import Loop
from beaver_ftc.loop.readout import FrameReadout
from beaver_ftc.plant.conditions import trimmed
from beaver_ftc.plant.linear import LinearModel, differences
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.margins_loop import OpenLoop, frequencies, loops
from beaver_ftc.studies.present.tables import aligned, all_finite, grouped

N_AIRSPEEDS = 5
NUMBERS = ("up_db", "down_db", "phase_deg")  # keys of the margins in a row
REMAINING = (0.5, 0.1, 0.0)  # effectiveness after the losses that are judged; 0: given up
LEAST_LOOP = 1e-3  # a surface with a smaller |L| at all frequencies has no loop worth judging


@dataclass(frozen=True)
class Margin:
    """The margins of the loop of one surface: gain margins upwards and downwards, dB, and phase margin,
    deg."""

    airspeed_mps: float
    fault: str
    surface: str
    up_db: float
    down_db: float
    phase_deg: float

    def keeps(self, gain_db: float, phase_deg: float) -> bool:
        """Whether all margins are at least these."""
        return min(self.up_db, self.down_db) >= gain_db and self.phase_deg >= phase_deg


def over_airspeeds(scenario: Scenario) -> list[Margin]:
    """The margins of the default law over the envelope, with actuators, sensors and frame rate of a scenario.

    Raises BadInput for another law.
    """
    refuse_other_laws(scenario)
    return [margin for flight in over_envelope(scenario) for margin in at(flight)]


def over_envelope(scenario: Scenario, count: int = N_AIRSPEEDS) -> Iterator[Scenario]:
    """The scenario at `count` airspeeds, evenly spaced from the slowest to the fastest of the envelope."""
    ends_mps = scenario.airframe.envelope.airspeed_mps
    return (scenario.with_({"initial.airspeed_mps": float(V)}) for V in np.linspace(*ends_mps, count))


def refuse_other_laws(scenario: Scenario) -> None:
    """Raise BadInput unless the scenario flies a law with the loop of the default law."""
    allowed = flown_by("rejecting")
    if scenario.control.law not in allowed:
        raise BadInput(
            f"{scenario.name}: control.law: {scenario.control.law}: margins are known of the default law's "
            f"loop, allowed: {', '.join(allowed)}"
        )


def at(scenario: Scenario) -> Iterator[Margin]:
    """The margins at the flight condition of a scenario; those without a fault come first."""
    plant, point = trimmed(scenario)
    linear = differences(plant, point)
    frame = FrameReadout(Loop(scenario).frames[0])
    y = frame.true_signals
    omega = frequencies(1.0 / scenario.rate_hz)
    for fault, effectiveness in cases(frame.control.main, scenario.airframe.surfaces):
        L = loops(open_loop(scenario, frame, linear, y, effectiveness), omega)
        for s, surface in enumerate(scenario.airframe.surfaces):
            if np.abs(L[:, s]).max() > LEAST_LOOP:
                yield Margin(scenario.initial.airspeed_mps, fault, surface, *map(float, margins(L[:, s])))


def cases(main: np.ndarray, surfaces: tuple[str, ...]) -> Iterator[tuple[str, np.ndarray]]:
    """The name of each fault, and the effectiveness (n,) that it leaves."""
    healthy = np.ones(len(surfaces))
    yield "none", healthy
    for s, remaining in product(main, REMAINING):
        fault = f"{100 * (1 - remaining):.0f} % lost" if remaining else "given up"
        yield f"{surfaces[s]} {fault}", np.where(np.arange(len(surfaces)) == s, remaining, healthy)


def open_loop(
    scenario: Scenario, frame: FrameReadout, linear: LinearModel, y: np.ndarray, effectiveness: np.ndarray
) -> OpenLoop:
    """The loop with this effectiveness (n,), which the law knows. y: measured signals in trim.

    approach = 1 - (1 - share of the way of an actuator in a JSBSim frame)^substeps, in a frame of the loop.
    """
    law = frame.control
    dt = 1.0 / scenario.rate_hz
    _, G, f_x, f_y = jacobian(frame.design, np.zeros(3), y, law.trim_rad)
    lost = 1.0 - effectiveness[law.main[PITCH]] if law.stand_in >= 0 else 0.0
    C = outputs(linear.states, y)
    delay_s, keep = sensors(scenario, len(C), dt)
    Kp, L_rate, L_disturbance = interpolated(law.default_law, y[QDYN], lost)
    return OpenLoop(
        A=linear.A, B=linear.B, C=C, f=np.hstack((f_x, f_y)), G=G * effectiveness,
        effectiveness=effectiveness, approach=1.0 - (1.0 - frame.actuators.approach) ** scenario.substeps,
        delay_s=delay_s, keep=keep, dt_s=dt, Kp=Kp, L_rate=L_rate, L_disturbance=L_disturbance,
        demand=allocation(G * effectiveness, law.main, law.stand_in, lost), lead=law.default_law.lead,
        share=law.default_law.share,
    )  # fmt: skip


def interpolated(law: DefaultLaw, qdyn: float, lost: float) -> np.ndarray:
    """Kp, L_rate and L_disturbance, rows of (3, 3) over the axes, at a dynamic pressure (Pa). lost: share of
    pitch that is handed over to the stand-in, 0 to 1. gain_schedule.py (`schedule`) computes the
    same."""
    schedules = law.Kp, law.L_rate, law.L_disturbance
    values = np.array([[np.interp(qdyn, law.qdyn_pa, row) for row in rows] for rows in schedules])
    values[:, PITCH] += lost * (values[:, STAND_IN] - values[:, PITCH])
    return values[:, :3]


def allocation(G: np.ndarray, main: np.ndarray, stand_in: int, lost: float) -> np.ndarray:
    """Commands for each demanded acceleration, (n, 3) rad per rad/s2, within the travels. G (3, n); main:
    surface of each axis. Aileron and rudder solve roll and yaw together; the stand-in takes the share `lost`
    of pitch, the elevator the rest. If these have no solution, because one of them is given up, each solves
    its own axis. `allocate` in control/allocation.py computes the same."""
    commands = np.zeros((G.shape[1], 3))
    a, e, r = main[[ROLL, PITCH, YAW]]
    flap = lost if stand_in >= 0 else 0.0
    shares = [(PITCH, stand_in, flap), (PITCH, e, 1.0 - flap)]
    lateral = G[np.ix_([ROLL, YAW], [a, r])]
    if np.linalg.det(lateral):
        commands[np.ix_([a, r], [ROLL, YAW])] = np.linalg.inv(lateral)
    else:
        shares += [(ROLL, a, 1.0), (YAW, r, 1.0)]
    for axis, s, share in shares:
        if share and G[axis, s]:
            commands[s, axis] = share / G[axis, s]
    return commands


def outputs(states: tuple[str, ...], y: np.ndarray) -> np.ndarray:
    """C (7 + declared signals, states) of the measured signals: rates, alpha, beta, V, qdyn and the declared
    signals.

    d qdyn / dV = 2 qdyn / V, as qdyn ~ V^2. d dpt / dV = -3 (dpt - DPT_0) / V of the slipstream, the one
    declared signal of the Beaver, as dpt - DPT_0 ~ V^-3; every declared signal is treated like it. The
    dependence on altitude is left out.
    """
    C = np.zeros((3 + len(y), len(states)))
    for row, name in enumerate((*AXES, "alpha", "beta", "airspeed")):
        C[row, states.index(name)] = 1.0
    C_V = C[3:, states.index("airspeed")]  # a view: d y / dV
    C_V[QDYN] = 2.0 * y[QDYN] / y[AIRSPEED]
    C_V[DPT:] = -3.0 * (y[DPT:] - DPT_0) / y[AIRSPEED]
    return C


def sensors(scenario: Scenario, m: int, dt: float) -> np.ndarray:
    """Delay, s, and pole exp(-bandwidth dt) of the lag of each measured signal, (2, m); 0 without one.
    Declared signals have neither."""
    delay_and_pole = np.zeros((2, m))
    for i, name in enumerate((*AXES, "alpha", "beta", "V", "qdyn")):
        sensor = getattr(scenario.sensors, name)
        delay_and_pole[:, i] = (
            sensor.delay_s,
            exp(-sensor.bandwidth_rad_s * dt) if sensor.bandwidth_rad_s else 0.0,
        )
    return delay_and_pole


def as_document(judged: list[Margin], required: tuple[float, float]) -> Document:
    """The document of `--format json`. An infinite margin is null."""
    rows = [all_finite(asdict(margin)) | {"keeps": margin.keeps(*required)} for margin in judged]
    return {"gain_margin_db": required[0], "phase_margin_deg": required[1], "margins": rows}


def as_text(document: Document) -> str:
    """A line for each fault and surface with the smallest margins over the airspeeds; last, how many are too
    small."""
    table = [["fault", "surface", "gain up, dB", "down, dB", "phase, deg", "least at, m/s"]]
    for place, rows in grouped(document["margins"], "fault", "surface").items():
        numbers = {key: [inf if row[key] is None else row[key] for row in rows] for key in NUMBERS}
        worst = rows[int(np.argmin(numbers["phase_deg"]))]
        table.append([*place, *(f"{min(n):.1f}" for n in numbers.values()), f"{worst['airspeed_mps']:.0f}"])
    short = sum(not row["keeps"] for row in document["margins"])
    required = "{gain_margin_db:g} dB or {phase_margin_deg:g} deg".format(**document)
    return f"{aligned(table)}\n\n{len(document['margins'])} loops, {short} with less than {required}"
