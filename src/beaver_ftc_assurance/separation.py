"""The study `separate`: doublets that are certain to distinguish the candidates left, or why there are none.

If the parameter of a fault is constant, the data since the alarm leave an interval for it. At a command u,
the deflection of its surface then lies in an interval too: stuck [c-, c+], floating 0, a loss [e- u, e+ u], a
bias u + [b-, b+]. B (3,) is the bound on the innovation of a frame at the largest rates that the doublet may
reach, G_i the effectiveness of surface i, and M a margin.

Two types on one surface are distinguished by a frame in which, on some axis, their deflections differ by more
than 2 M B / |G_i|, twice what the uncertainty hides. They must differ from the command by as much: a frame
that health explains says nothing about a fault that may end. Two surfaces a and b are distinguished along a
direction d with d.G_b = 0, in which b has no effect, by a frame in which a differs from its command by more
than 2 M |d|.B / |d.G_a|.
"""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import combinations
from math import degrees, inf, radians
from pathlib import Path

import numpy as np

from beaver_ftc.diagnosis import TYPE_NAMES as NAMES
from beaver_ftc.diagnosis import TYPE_ROWS as TYPES
from beaver_ftc.diagnosis import UNANTICIPATED, DiagnosisReadout, type_index_of
from beaver_ftc.documents import BadInput
from beaver_ftc.loop import Stepping, fly
from beaver_ftc.results import Document, MemoryLog, result_folder
from beaver_ftc.scenario import Declared, Scenario
from beaver_ftc.studies import DOUBLET_COLUMNS
from beaver_ftc_assurance.certificates import proved
from beaver_ftc_assurance.certificates.certificate import (
    Certified,
    check_scheme,
    history_of,
    logged_columns,
    row_set_to_end,
)
from beaver_ftc_assurance.certificates.history import History, declared_errors_of
from beaver_ftc_assurance.certificates.inequality import Hypothesis, theta_bounds_by_frame
from beaver_ftc_assurance.certificates.kinds import hypothesis_of_type, travel_rad
from beaver_ftc_assurance.certificates.tape import Recorder, Tape, tape_of_flight_again
from beaver_ftc_assurance.doublet import LONGEST_S, Situation, doublet

FILE = "separation.json"
FLOWN = "flown"
MARGIN = 1.1  # M: G and B are those of the last frame, and change while the doublet is flown
LARGEST_RATE_DEG_S = 20.0
GRID = 801  # deflections tried over the travel
HELD_DEG = 1e-9  # by less no surface is moved
RELATIONS = {
    kind: row.deflection_relation
    for kind, row in enumerate(TYPES)
    if row.has_constant_parameter and row.deflection_relation
}
LOSS = type_index_of("loss_of_effectiveness")  # the only type of the fault class `losses`


@dataclass(frozen=True)
class Candidate:
    """A fault type, one of RELATIONS, on a surface; its parameter lies between low and high."""

    surface: int
    kind: int
    low: float
    high: float

    def deflection(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest deflection, rad, of the surface at commands u (n,) rad."""
        gain, is_share, _ = RELATIONS[self.kind]
        ends = [(gain + end) * u if is_share else gain * u + end for end in (self.low, self.high)]
        return np.minimum(*ends), np.maximum(*ends)

    def off(self, u: np.ndarray) -> np.ndarray:
        """Least distance of the surface from its commands u, (n,) rad."""
        low, high = self.deflection(u)
        return np.asarray(np.maximum(0.0, np.maximum(low - u, u - high)))


def separate(scenario: Scenario, rate_deg_s: float = LARGEST_RATE_DEG_S) -> Document:
    """Fly a scenario, and propose a doublet for each two of the candidates that are left at its end.

    rate_deg_s: largest allowed body rate, deg/s. Raises BadInput if fewer than two candidates are left.
    """
    check_scheme(scenario)
    if scenario.fdi.pairs:
        raise BadInput(f"{scenario.name}: fdi.pairs: two faults leave no one parameter, allowed: false")
    if not Declared.of(scenario).servo_errors.is_none:
        says = "fdi.bounds.actuators: where a doublet brings the surfaces is then not certain"
        raise BadInput(f"{scenario.name}: {says}, allowed with separate: none")
    log = MemoryLog()
    recorder = Recorder(scenario)
    landing = fly(scenario, log, watch=recorder.watch)
    if landing.detection_time_s is None:
        raise BadInput(f"{scenario.name}: no alarm was raised, allowed with separate: a flight with one")
    tape, history = _seen(scenario, log, recorder)
    situation = situation_of(tape, scenario, radians(rate_deg_s))
    left = [*candidates(tape, history)]
    names = scenario.airframe.surfaces
    if len(left) < 2:
        raise BadInput(f"{scenario.name}: one candidate or none is left, allowed with separate: two at least")
    pairs = []
    for both in combinations(left, 2):
        pair = {"candidates": [_words(each, names) for each in both]} | tell_apart(*both, situation, names)
        if scenario.fdi.probing is not None and pair["separates"]:
            pair |= _flown(scenario, pair, both)
        pairs.append(pair)
    return {
        "scenario": scenario.name,
        "time_s": landing.frames / scenario.rate_hz,
        "assumes": "the parameter of the fault stays as it is",
        "largest_rate_deg_s": rate_deg_s,
        "not_constant": open_courses(tape, names),
        "pairs": pairs,
        "passed": all(len(pair.get("left", ())) < 2 for pair in pairs),
    }


def _frames(scenario: Scenario) -> int:
    """Number of frames of a flight."""
    return round(scenario.duration_s * scenario.rate_hz)


def _flown(scenario: Scenario, pair: Document, candidates: Sequence[Candidate]) -> Document:
    """Which of two candidates are left after the flight with the doublet, and how often the doublet led out
    of the envelope."""
    with _longer(scenario, pair) as flight:
        before = 0
        for k in _with_doublet(flight, scenario, pair):
            if k == _frames(scenario) - 1:
                before = flight.readout.envelope_exits
        still = {*_left(flight.readout.diagnosis)}
        both = zip(candidates, pair["candidates"], strict=True)
        left = [words for one, words in both if (one.surface, one.kind) in still]
        return {"left": left, "envelope_exits": flight.readout.envelope_exits - before}


@contextmanager
def _longer(scenario: Scenario, pair: Document) -> Iterator[Stepping]:
    """The flight, with time for the doublet."""
    spare_s = pair["duration_s"] + 10.0 / scenario.rate_hz
    flight = Stepping(scenario.model_copy(update={"duration_s": scenario.duration_s + spare_s}))
    try:
        yield flight
    finally:
        flight.release()


def _with_doublet(flight: Stepping, scenario: Scenario, pair: Document) -> Iterator[int]:
    """Fly to the end of the scenario, then the doublet; yields the number of each frame after it is flown."""
    frames = _frames(scenario)
    names = list(scenario.airframe.surfaces)
    yield 0
    for k in range(1, frames):
        flight.step()
        yield k
    rest = flight.readout.expected_u_rad
    for k in range(round(pair["time_s"] * scenario.rate_hz) + 1):
        command = rest.copy()
        for name, course in pair["commands_rad"].items():
            if k < len(course):
                command[names.index(name)] = course[k]
        flight.step(command)
        yield frames + k


def certified(scenario: Scenario, pair: Document) -> Certified:
    """The certificate of the flight with its doublet."""
    with _longer(scenario, pair) as flight:
        return proved.proved(scenario, flight.records, _with_doublet(flight, scenario, pair))


def write(document: Document, scenario: Scenario, out: Path) -> Path:
    """Write the result folder, and return its path: separation.json, and log and certificate of the flight
    with each doublet that was flown, in flown/N/ for the pair N of the document."""
    name = f"{document['scenario'][:88]}-separation"
    with result_folder(out, name) as folder:
        for place, pair in enumerate(document["pairs"]):
            if "left" in pair:
                (folder / FLOWN / str(place)).mkdir(parents=True)
                certified(scenario, pair).write(folder / FLOWN / str(place))
        (folder / FILE).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return out / name


def _seen(scenario: Scenario, log: MemoryLog, recorder: Recorder) -> tuple[Tape, History]:
    """Tape and history of a flight since its alarm."""
    rows = logged_columns(log)
    detected = rows["detected"]
    alarm = row_set_to_end(detected)
    if alarm >= len(detected) - 1:
        raise BadInput(f"{scenario.name}: the flight ends with its alarm, allowed: a longer duration_s")
    tape = recorder.tape([alarm, len(detected) - 1], len(detected))
    return tape, history_of(scenario, rows, tape)


def situation_of(tape: Tape, scenario: Scenario, rate: float) -> Situation:
    """The aircraft at the end of a flight; rate: largest allowed body rate, rad/s."""
    frame = tape.last
    aircraft = scenario.airframe
    dt = 1.0 / scenario.rate_hz
    bound = frame.diagnosis.declared_bounds
    declared = declared_errors_of(frame)
    actuators = frame.actuators
    coupled = declared.inertia_coupling * rate**2
    return Situation(
        G=frame.mean_G, u=frame.expected_u_rad, x=frame.rates_rad_s, rate=rate,
        bound=bound.eta_bar_rad_s2 + coupled + 2.0 * bound.changing_gyro_error_bound_rad_s / dt,
        stops=np.array([actuators.low_rad, actuators.high_rad]), approach=actuators.approach,
        step=actuators.step_rad, instants=scenario.substeps,
        in_blocks=frame.diagnosis.types_config.frames_per_block > 1, dt=dt,
        alpha=frame.alpha_rad, alpha_range=aircraft.alpha_rad,
    )  # fmt: skip


def candidates(tape: Tape, history: History) -> Iterator[Candidate]:
    """Every fault that is left and has a constant parameter, with the interval of the parameter."""
    last = tape.last.diagnosis
    frames = np.arange(round(last.detected_at_s / tape.last.dt_s), tape.end)  # from the alarm on
    shown = frames[history.is_unexplained(frames)]
    if last.isolated_estimator == UNANTICIPATED or not len(shown):
        return
    for s, kind in _left(last):
        if kind not in RELATIONS:
            continue
        low, high = RELATIONS[kind].theta_span(*travel_rad(tape, s))
        if low < high:
            low, high = _interval(hypothesis_of_type(tape, s, kind), history, shown)
        if low <= high:
            yield Candidate(s, kind, low, high)


def _left(diagnosis: DiagnosisReadout) -> Iterator[tuple[int, int]]:
    """Surface and type of each fault that is not excluded."""
    estimators = diagnosis.estimators
    layout = diagnosis.layout
    for s, surface in enumerate(diagnosis.surface_fault_types):
        if not diagnosis.diagnoses_all_types:
            e = layout.loss_estimator_index_by_surface[s]
            if e >= 0 and not estimators[e].is_excluded:
                yield s, LOSS
        elif not estimators[layout.position_estimator_index_by_surface[s]].is_excluded:
            yield from ((s, kind) for kind in np.flatnonzero(~surface.is_type_excluded).tolist())


def open_courses(tape: Tape, names: Sequence[str]) -> list[str]:
    """The faults left without a constant parameter: only a comparison of many frames distinguishes them."""
    left = _left(tape.last.diagnosis)
    return sorted(f"{names[s]} {NAMES[kind]}" for s, kind in left if kind not in RELATIONS)


def _interval(of: Hypothesis, history: History, frames: np.ndarray) -> tuple[float, float]:
    """The interval of a parameter that is constant in all of these frames."""
    least, most, _ = theta_bounds_by_frame(of, history, frames)
    return max(of.theta_low, float(least.max())), min(of.theta_high, float(most.min()))


def tell_apart(one: Candidate, other: Candidate, at: Situation, names: Sequence[str]) -> Document:
    """A doublet that is certain to distinguish two candidates, or the reason why there is none."""
    targets: dict[int, float] = {}
    needs: Document = {}
    if one.surface == other.surface and at.in_blocks:
        return _none("with noisy gyros types are told by blocks of frames, not by one", needs)
    if one.surface == other.surface:
        asked = [(one.surface, *_types_apart(one, other, at))]
    else:
        asked = [(a.surface, *_surface_shown(a, b, at)) for a, b in ((one, other), (other, one))]
    for s, target, numbers in asked:
        needs[names[s]] = numbers
        if target is None:
            return _none(numbers["because"], needs)
        targets[s] = target
    found = doublet(targets, at)
    if found is None:
        says = f"no doublet within {LONGEST_S:g} s keeps the rates below {degrees(at.rate):g} deg/s"
        return _none(f"{says} and the angle of attack in its range", needs)
    commands, tells = found
    return {
        "separates": True,
        "time_s": (tells + 2) * at.dt,  # a command is in effect a frame later, a frame judged with the next
        "duration_s": len(commands) * at.dt,
        "amplitude_deg": degrees(max(abs(commands[:, [*targets]] - at.u[[*targets]]).max(axis=0))),
        "needs": needs,
        "commands_rad": {names[s]: commands[:, s].tolist() for s in targets},
    }


def _none(because: str, needs: Document) -> Document:
    return {"separates": False, "because": because, "needs": needs}


def _types_apart(one: Candidate, other: Candidate, at: Situation) -> tuple[float | None, Document]:
    """The deflection nearest to the present one at which two types on a surface, and health, all differ."""
    s = one.surface
    room = min(
        (2.0 * MARGIN * B / abs(g) for B, g in zip(at.bound, at.G[:, s], strict=True) if g), default=inf
    )
    u = _deflections(at, s)
    (low, high) = one.deflection(u)
    (low_too, high_too) = other.deflection(u)
    gap = np.maximum(low - high_too, low_too - high)
    gap = np.minimum(gap, np.minimum(one.off(u), other.off(u)))  # else health explains the frame
    return _nearest(u, gap, s, at, room, "apart, and off their command,")


def _surface_shown(one: Candidate, other: Candidate, at: Situation) -> tuple[float | None, Document]:
    """The deflection nearest to the present one at which a fault shows in a direction in which the surface of
    the other one has no effect."""
    a = one.surface
    b = other.surface
    room = min(
        (2.0 * MARGIN * np.abs(d) @ at.bound / abs(d @ at.G[:, a]) for d in _blind_to(b, at, a)), default=inf
    )
    u = _deflections(at, a)
    return _nearest(u, one.off(u), a, at, room, "off its command")


def _deflections(at: Situation, s: int) -> np.ndarray:
    """Deflections to choose from, (GRID + 1,) rad: over the whole travel, and the present one."""
    return np.append(np.linspace(at.stops[0, s], at.stops[1, s], GRID), np.clip(at.u[s], *at.stops[:, s]))


def _blind_to(b: int, at: Situation, a: int) -> Iterator[np.ndarray]:
    """Directions d (3,) with d.G_b = 0, in which surface a has an effect."""
    for i, j in combinations(range(3), 2):
        d = np.zeros(3)
        d[i] = at.G[j, b]
        d[j] = -at.G[i, b]
        for way in (d, *(np.eye(3)[k] for k in (i, j) if at.G[k, b] == 0.0)):
            if abs(way @ at.G[:, a]) > 1e-9 * np.abs(way).max():
                yield way


def _nearest(
    u: np.ndarray, off: np.ndarray, s: int, at: Situation, room: float, what: str
) -> tuple[float | None, Document]:
    """The deflection nearest to the present one among those of u with off > room, None if there is none; and
    the numbers that decide it. off (n,), rad: the difference at each of u."""
    most = degrees(off.max())
    tells = off > room
    numbers: Document = {"at_least_deg": degrees(room) if room < inf else None}
    numbers |= {"at_most_deg": most, "now_deg": degrees(at.u[s])}
    if not tells.any():
        asked = f"more than {degrees(room):.3g} deg" if room < inf else "another direction"
        says = f"they must be {what} by {asked}, and are by {most:.3g} deg at most within the travel"
        return None, numbers | {"because": says}
    target = float(u[tells][np.argmin(np.abs(u[tells] - at.u[s]))])
    return target, numbers | {"target_deg": degrees(target)}


def doublets(scenario: Scenario, after_s: float, loss: float) -> dict[tuple[str, str], Document]:
    """For each two surfaces of the class of losses: the doublet that distinguishes a loss of the share `loss`
    on one from that on the other, `after_s` after the start of a healthy flight, or why there is none."""
    healthy = scenario.model_copy(update={"faults": (), "duration_s": after_s})
    frames = _frames(healthy)
    at = situation_of(
        tape_of_flight_again(healthy, [frames - 1], frames), healthy, radians(LARGEST_RATE_DEG_S)
    )
    names = scenario.airframe.surfaces
    found = {}
    for pair in combinations(scenario.airframe.class_of_losses, 2):
        one, other = (Candidate(names.index(name), LOSS, -loss, -loss) for name in pair)
        apart = tell_apart(one, other, at, names)
        asked = apart.get("amplitude_deg"), apart.get("time_s"), apart.get("because", "")
        found[pair] = found[pair[::-1]] = dict(zip(DOUBLET_COLUMNS, asked, strict=True))
    return found


def _words(one: Candidate, names: Sequence[str]) -> Document:
    """A candidate as in the document: angles in deg, a loss as theta."""
    is_share = RELATIONS[one.kind].theta_is_share
    scale, unit = (1.0, "theta") if is_share else (degrees(1.0), "deg")
    return {"surface": names[one.surface], "type": NAMES[one.kind], unit: [scale * one.low, scale * one.high]}


def as_text(document: Document) -> str:
    """The text for a terminal: a line for each two candidates."""
    lines = [f"{document['scenario']}, {document['time_s']:g} s: if {document['assumes']}"]
    for pair in document["pairs"]:
        one, other = (f"{each['surface']} {each['type']}" for each in pair["candidates"])
        if pair["separates"]:
            by = " and ".join(pair["commands_rad"])
            much = pair["amplitude_deg"]
            moves = f"by {much:.3g} deg" if much > HELD_DEG else "held as now"
            says = f"{by} {moves}, told after {pair['time_s']:.3g} s"
            if "left" in pair:
                words = " and ".join(f"{each['surface']} {each['type']}" for each in pair["left"])
                says += f"; flown, left: {words or 'neither'}"
        else:
            says = f"none: {pair['because']}"
        lines.append(f"  {one} or {other}: {says}")
    if document["not_constant"]:
        lines.append(f"  a course over many frames tells: {', '.join(document['not_constant'])}")
    return "\n".join(lines)
