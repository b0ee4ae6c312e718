"""A doublet of the surfaces that is certain to distinguish the candidates left, or why there is none.

Of a fault whose parameter stays as it is, the data since the alarm leave an interval. With it the deflection
of its surface at a command u lies in an interval: stuck [c-, c+], floating 0, a loss [e- u, e+ u], a bias
u + [b-, b+]. Two types on one surface are distinguished by a frame in which these are further from each other
than 2 M B / |G_i|, twice what the uncertainty hides and a margin M, on some axis, and from the command: a
frame that health explains says nothing of a fault that may go. Two surfaces a and b are distinguished along
d, d G_b = 0, by a frame in which a is off its command by more than 2 M |d| B / |d G_a|: whatever b does, it
does nothing there. B is the bound on a frame's innovation at the largest rates the doublet may reach.

What the surfaces must reach is then linear, and so are travel, actuators, rates and angle of attack over a
short horizon in which the rates follow dx/dt = G u: a linear programme finds the least amplitude. The horizon
is the shortest of a few that has a solution.
"""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import combinations
from math import degrees, inf, radians
from pathlib import Path
from typing import Any

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

FILE, FLOWN = "separation.json", "flown"
MARGIN = 1.1  # M, on the difference that is asked: the aircraft flies on while the doublet is flown
LONGEST_S = 0.5  # until the frame that tells
LARGEST_RATE_DEG_S = 20.0
GRID = 801  # deflections tried over the travel
HELD_DEG = 1e-9  # by less no surface is moved
RELATIONS = {
    kind: row.deflection_relation
    for kind, row in enumerate(TYPES)
    if row.has_constant_parameter and row.deflection_relation
}
LOSS = type_index_of("loss_of_effectiveness")  # all that the class of losses has


@dataclass(frozen=True)
class Candidate:
    """A type (one of RELATIONS, -1 for any) on a surface, its parameter between low and high."""

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
        """How far it is off its command at least, (n,) rad."""
        low, high = self.deflection(u)
        return np.asarray(np.maximum(0.0, np.maximum(low - u, u - high)))


@dataclass(frozen=True)
class Situation:
    """The aircraft at the end of the flight: columns G (3, n) rad/s2 per rad, surfaces at u, rates x, the
    bound on a frame's innovation (3,) rad/s2 while they stay below `rate`, stops (2, n), and of each actuator
    the share of the way and the longest way it goes in a JSBSim frame, of which a frame has `instants`.
    in_blocks: whether types are examined in blocks of frames."""

    G: np.ndarray
    u: np.ndarray
    x: np.ndarray
    rate: float
    bound: np.ndarray
    stops: np.ndarray
    approach: np.ndarray
    step: np.ndarray
    instants: int
    in_blocks: bool
    dt: float
    alpha: float
    alpha_range: tuple[float, float]

    @property
    def held(self) -> int:
        """Number of frames for which the deflection must hold: 3 if a frame has several JSBSim frames, as
        `History.is_unexplained` then requires the frames before and after too."""
        return 1 if self.instants == 1 else 3


def separate(scenario: Scenario, rate_deg_s: float = LARGEST_RATE_DEG_S) -> Document:
    """Fly it, and propose for each two of the candidates left what is certain to tell them apart.

    Raises BadInput where no candidates remain to be distinguished.
    """
    check_scheme(scenario)
    if scenario.fdi.pairs:
        raise BadInput(f"{scenario.name}: fdi.pairs: two faults leave no one parameter, allowed: false")
    if not Declared.of(scenario).servo_errors.is_none:
        says = "fdi.bounds.actuators: where a doublet brings the surfaces is then not certain"
        raise BadInput(f"{scenario.name}: {says}, allowed with separate: none")
    log, recorder = MemoryLog(), Recorder(scenario)
    landing = fly(scenario, log, watch=recorder.watch)
    if landing.detection_time_s is None:
        raise BadInput(f"{scenario.name}: no alarm was raised, allowed with separate: a flight with one")
    tape, history = _seen(scenario, log, recorder)
    situation, left = situation_of(tape, scenario, radians(rate_deg_s)), [*candidates(tape, history)]
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
    """Which of two candidates are left once the doublet has been flown, and exits from the envelope in it."""
    with _longer(scenario, pair) as flight:
        before = 0
        for k in _with_doublet(flight, scenario, pair):
            if k == _frames(scenario) - 1:
                before = flight.readout.envelope_exits
        still, both = {*_left(flight.readout.diagnosis)}, zip(candidates, pair["candidates"], strict=True)
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
    """Fly on to the scenario's end, then the doublet; yields the frame just flown."""
    frames, names = _frames(scenario), list(scenario.airframe.surfaces)
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
    """Write separation.json into its result folder, and of each doublet that was flown log and certificate,
    flown/PLACE/; returns that."""
    name = f"{document['scenario'][:88]}-separation"
    with result_folder(out, name) as folder:
        for place, pair in enumerate(document["pairs"]):
            if "left" in pair:
                (folder / FLOWN / str(place)).mkdir(parents=True)
                certified(scenario, pair).write(folder / FLOWN / str(place))
        (folder / FILE).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return out / name


def _seen(scenario: Scenario, log: MemoryLog, recorder: Recorder) -> tuple[Tape, History]:
    """What the flight has shown since the alarm."""
    rows = logged_columns(log)
    detected = rows["detected"]
    alarm = row_set_to_end(detected)
    if alarm >= len(detected) - 1:
        raise BadInput(f"{scenario.name}: the flight ends with its alarm, allowed: a longer duration_s")
    tape = recorder.tape([alarm, len(detected) - 1], len(detected))
    return tape, history_of(scenario, rows, tape)


def situation_of(tape: Tape, scenario: Scenario, rate: float) -> Situation:
    """What is known of the aircraft as the flight ends; rate: rad/s at most."""
    frame, aircraft, dt = tape.last, scenario.airframe, 1.0 / scenario.rate_hz
    bound, declared, actuators = frame.diagnosis.declared_bounds, declared_errors_of(frame), frame.actuators
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
    """Every fault that is left and stays as it is, with what is known of its parameter."""
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
    """Surface and type of what is not excluded."""
    estimators, layout = diagnosis.estimators, diagnosis.layout
    for s, surface in enumerate(diagnosis.surface_fault_types):
        if not diagnosis.diagnoses_all_types:
            e = layout.loss_estimator_index_by_surface[s]
            if e >= 0 and not estimators[e].is_excluded:
                yield s, LOSS
        elif not estimators[layout.position_estimator_index_by_surface[s]].is_excluded:
            yield from ((s, kind) for kind in np.flatnonzero(~surface.is_type_excluded).tolist())


def open_courses(tape: Tape, names: Sequence[str]) -> list[str]:
    """What is left whose course over many frames tells, not a frame."""
    left = _left(tape.last.diagnosis)
    return sorted(f"{names[s]} {NAMES[kind]}" for s, kind in left if kind not in RELATIONS)


def _interval(of: Hypothesis, history: History, frames: np.ndarray) -> tuple[float, float]:
    """What all of these frames say of its parameter."""
    least, most, _ = theta_bounds_by_frame(of, history, frames)
    return max(of.theta_low, float(least.max())), min(of.theta_high, float(most.min()))


def tell_apart(one: Candidate, other: Candidate, at: Situation, names: Sequence[str]) -> Document:
    """A doublet that is certain to tell two candidates apart, or the reason why there is none."""
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
    """The deflection nearest to the present at which a surface's two types differ, and from health."""
    s = one.surface
    room = min(
        (2.0 * MARGIN * B / abs(g) for B, g in zip(at.bound, at.G[:, s], strict=True) if g), default=inf
    )
    u = _deflections(at, s)
    (low, high), (low_too, high_too) = one.deflection(u), other.deflection(u)
    gap = np.maximum(low - high_too, low_too - high)
    gap = np.minimum(gap, np.minimum(one.off(u), other.off(u)))  # else health explains the frame
    return _nearest(u, gap, s, at, room, "apart, and off their command,")


def _surface_shown(one: Candidate, other: Candidate, at: Situation) -> tuple[float | None, Document]:
    """The deflection nearest to the present at which a fault shows where the other surface does nothing."""
    a, b = one.surface, other.surface
    room = min(
        (2.0 * MARGIN * np.abs(d) @ at.bound / abs(d @ at.G[:, a]) for d in _blind_to(b, at, a)), default=inf
    )
    u = _deflections(at, a)
    return _nearest(u, one.off(u), a, at, room, "off its command")


def _deflections(at: Situation, s: int) -> np.ndarray:
    """Where a surface can be asked to go, (GRID + 1,) rad: all over its travel, and where it is now."""
    return np.append(np.linspace(at.stops[0, s], at.stops[1, s], GRID), np.clip(at.u[s], *at.stops[:, s]))


def _blind_to(b: int, at: Situation, a: int) -> Iterator[np.ndarray]:
    """Directions in which surface b does nothing, and a does something."""
    for i, j in combinations(range(3), 2):
        d = np.zeros(3)
        d[i], d[j] = at.G[j, b], -at.G[i, b]
        for way in (d, *(np.eye(3)[k] for k in (i, j) if at.G[k, b] == 0.0)):
            if abs(way @ at.G[:, a]) > 1e-9 * np.abs(way).max():
                yield way


def _nearest(
    u: np.ndarray, off: np.ndarray, s: int, at: Situation, room: float, what: str
) -> tuple[float | None, Document]:
    """Of deflections u that are off by more than room, the nearest to the present; and the numbers this rests
    on."""
    most, tells = degrees(off.max()), off > room
    numbers: Document = {"at_least_deg": degrees(room) if room < inf else None}
    numbers |= {"at_most_deg": most, "now_deg": degrees(at.u[s])}
    if not tells.any():
        asked = f"more than {degrees(room):.3g} deg" if room < inf else "another direction"
        says = f"they must be {what} by {asked}, and are by {most:.3g} deg at most within the travel"
        return None, numbers | {"because": says}
    target = float(u[tells][np.argmin(np.abs(u[tells] - at.u[s]))])
    return target, numbers | {"target_deg": degrees(target)}


def doublets(scenario: Scenario, after_s: float, loss: float) -> dict[tuple[str, str], Document]:
    """Of each two surfaces that lead an axis: a doublet that tells losses of this share apart, so long after
    the start of a healthy flight, or why there is none."""
    healthy = scenario.model_copy(update={"faults": (), "duration_s": after_s})
    frames = _frames(healthy)
    at = situation_of(
        tape_of_flight_again(healthy, [frames - 1], frames), healthy, radians(LARGEST_RATE_DEG_S)
    )
    names, found = scenario.airframe.surfaces, {}
    for pair in combinations(scenario.airframe.class_of_losses, 2):
        one, other = (Candidate(names.index(name), LOSS, -loss, -loss) for name in pair)
        apart = tell_apart(one, other, at, names)
        asked = apart.get("amplitude_deg"), apart.get("time_s"), apart.get("because", "")
        found[pair] = found[pair[::-1]] = dict(zip(DOUBLET_COLUMNS, asked, strict=True))
    return found


def doublet(targets: dict[int, float], at: Situation) -> tuple[np.ndarray, int] | None:
    """Commands (frames, n) rad of a doublet that brings surfaces to these deflections, and the frame in which
    they are there; None where no doublet does within the limits.

    Of 1, 4, 16, ... frames on the way, and LONGEST_S, it is the first time that has a doublet, with its least
    amplitude. A wait makes each doublet a longer one: LONGEST_S has one wherever a shorter time has.
    """
    tells, longest = 1, max(int(LONGEST_S / at.dt), 1)
    while (found := _least_amplitude(targets, at, tells)) is None:
        if tells == longest:
            return None
        tells = min(4 * tells, longest)
    return found, tells + at.held - 1


def _least_amplitude(targets: dict[int, float], at: Situation, tells: int) -> np.ndarray | None:
    """The linear programme, with the frame that tells given: commands (frames, n) rad there and back.

    Unknown, frame by frame, a block each: of each surface the command and where it is at the frame's end,
    less the present deflection; the rates p, q, r, less the present ones, and pitch; then the amplitude. A
    row has a few of them, so that many frames stay quick.
    """
    if (np.abs(at.x) > at.rate).any() or not at.alpha_range[0] <= at.alpha <= at.alpha_range[1]:
        return None
    frames, surfaces = 2 * (tells + at.held - 1), [*targets]
    n, there, every = len(surfaces), np.arange(tells - 1, tells + at.held - 1), np.arange(frames)
    arrived = range(n, 2 * n)  # blocks of where the surfaces are; those of the commands come before
    *pqr, pitch = range(2 * n, 2 * n + 4)
    equal, above = _Rows(pitch + 1, frames), _Rows(pitch + 1, frames)
    turning = [{(rate, 0): 1.0, (rate, -1): -1.0} for rate in pqr]
    stops, rates = [(at.stops[:, s] - at.u[s]) for s in surfaces], [(-at.rate - x, at.rate - x) for x in at.x]
    for u, (p, s) in enumerate(zip(arrived, surfaces, strict=True)):
        away, (left, mean_left) = targets[s] - at.u[s], _left_behind(at, s)
        equal.add(every, {(u, 0): left - 1.0, (p, 0): 1.0, (p, -1): -left})
        equal.add(there[1:], {(u, 0): 1.0, (u, -1): -1.0})
        moved = {(u, 0): 1.0 - mean_left, (p, -1): mean_left}
        before = {(u, -1): mean_left - 1.0, (p, -2): -mean_left}
        above.add(there, {k: -np.sign(away) * v for k, v in moved.items()}, -abs(away))
        for sign in (1.0, -1.0):
            above.add(every, {(u, 0): sign}, amplitude=-1.0)
            if np.isfinite(at.step[s]):
                pace = {k: sign * v for k, v in (moved | before).items()}
                above.add(every, pace, at.step[s] * at.instants)
        for row, g in zip(turning, at.G[:, s], strict=True):
            row |= {k: -at.dt * g * v for k, v in moved.items() if g}
    for row in (*turning, {(pitch, 0): 1.0, (pitch, -1): -1.0, (pqr[1], 0): -at.dt}):
        equal.add(every, row)
    ends = [*stops, *[(-inf, inf)] * n, *rates, np.subtract(at.alpha_range, at.alpha)]
    bounds = np.vstack([np.repeat(ends, frames, axis=0), (0.0, inf)])
    bounds[[(rate + 1) * frames - 1 for rate in pqr]] = 0.0
    found = _solved(equal, above, bounds)
    if found is None:
        return None
    commands = np.tile(at.u, (frames, 1))
    commands[:, surfaces] += found[: n * frames].reshape(n, frames).T
    return commands


class _Rows:
    """Rows of a linear programme over blocks of unknowns, of so many frames each, and an amplitude after."""

    def __init__(self, blocks: int, frames: int) -> None:
        self._blocks, self._frames = blocks, frames
        self._parts: list[Any] = []
        self._limits: list[np.ndarray] = []

    def add(
        self,
        at: np.ndarray,
        weights: dict[tuple[int, int], float],
        limit: float = 0.0,
        amplitude: float = 0.0,
    ) -> None:
        """A row for each of these frames: of (block, lag) the weight of the unknown so many frames from it,
        0 before the first; and of the amplitude."""
        from scipy.sparse import csr_array, eye_array, hstack

        parts = [csr_array((len(at), self._frames))] * self._blocks
        for (block, lag), weight in weights.items():
            parts[block] = parts[block] + weight * eye_array(self._frames, k=lag, format="csr")[at]
        self._parts.append(hstack([*parts, csr_array(np.full((len(at), 1), amplitude))]))
        self._limits.append(np.full(len(at), limit))

    @property
    def system(self) -> tuple[Any, np.ndarray]:
        """Matrix, sparse, and limits of all of them."""
        from scipy.sparse import vstack

        return vstack(self._parts, format="csc"), np.concatenate(self._limits)


def _solved(equal: _Rows, above: _Rows, bounds: np.ndarray) -> np.ndarray | None:
    """The unknowns with the least amplitude; None where there are none within the limits."""
    from scipy.optimize import linprog

    weight = np.r_[np.zeros(len(bounds) - 1), 1.0]
    for method in ("highs-ds", "highs-ipm"):  # the second where rounding stops the first
        result = linprog(weight, *above.system, *equal.system, bounds, method=method)
        if result.status in (0, 2):
            break
    return np.asarray(result.x) if result.status == 0 else None


def _left_behind(at: Situation, s: int) -> tuple[float, float]:
    """Of a surface's way to its command, while its rate limit holds nothing back: the share left at the end
    of a frame, and its mean over the frame. Of several instants the first has the surface where it was."""
    stays = 1.0 - at.approach[s]
    if at.instants == 1:
        return stays, stays
    return stays**at.instants, float(np.mean(stays ** np.arange(at.instants)))


def _words(one: Candidate, names: Sequence[str]) -> Document:
    """A candidate as the document has it: angles in deg, a loss as theta."""
    is_share = RELATIONS[one.kind].theta_is_share
    scale, unit = (1.0, "theta") if is_share else (degrees(1.0), "deg")
    return {"surface": names[one.surface], "type": NAMES[one.kind], unit: [scale * one.low, scale * one.high]}


def as_text(document: Document) -> str:
    """A line for each two candidates."""
    lines = [f"{document['scenario']}, {document['time_s']:g} s: if {document['assumes']}"]
    for pair in document["pairs"]:
        one, other = (f"{each['surface']} {each['type']}" for each in pair["candidates"])
        if pair["separates"]:
            by, much = " and ".join(pair["commands_rad"]), pair["amplitude_deg"]
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
