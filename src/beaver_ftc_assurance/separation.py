"""The study `separate`: doublets that are certain to distinguish the remaining candidates, or why there are
none.

A *pair* is an entry of the document: two candidates with the doublet, or with the reason why there is none.
"""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import combinations, islice
from math import degrees, radians
from pathlib import Path

from beaver_ftc.diagnosis import TYPE_NAMES as NAMES
from beaver_ftc.documents import BadInput
from beaver_ftc.loop import Stepping, fly
from beaver_ftc.results import Document, MemoryLog, result_folder
from beaver_ftc.scenario import Declared, Scenario
from beaver_ftc.studies import DOUBLET_COLUMNS
from beaver_ftc_assurance.candidates import (
    LOSS,
    RELATIONS,
    Candidate,
    candidates,
    distinguish,
    faults_left,
    situation_of,
)
from beaver_ftc_assurance.certificates import proved
from beaver_ftc_assurance.certificates.certificate import (
    check_scheme,
    history_of,
    logged_columns,
    row_set_to_end,
)
from beaver_ftc_assurance.certificates.certified import Certified
from beaver_ftc_assurance.certificates.history import History
from beaver_ftc_assurance.certificates.tape import Recorder, Tape, tape_of_flight_again

FILE = "separation.json"
FLOWN = "flown"
LARGEST_RATE_DEG_S = 20.0  # largest body rate during a doublet
HELD_DEG = 1e-9  # a doublet of a smaller amplitude moves no surface


def separate(scenario: Scenario, rate_deg_s: float = LARGEST_RATE_DEG_S) -> Document:
    """Fly a scenario, and propose a doublet for each two of the candidates that remain at its end. With
    `fdi.probing`, fly each doublet. A pair without a doublet, or whose doublet is not flown, passes.

    rate_deg_s: largest allowed body rate, deg/s. Raises BadInput if the scheme is not ours, if no alarm was
    raised or the flight ends with it, if fewer than two candidates remain, or if the scenario declares pairs
    of faults or errors of the servos.
    """
    check_scheme(scenario)
    if scenario.fdi.pairs:
        raise BadInput(f"{scenario.name}: fdi.pairs: two faults leave no one parameter, allowed: false")
    if not Declared.of(scenario).servo_errors.is_none:
        text = "fdi.bounds.actuators: where a doublet brings the surfaces is then not certain"
        raise BadInput(f"{scenario.name}: {text}, allowed with separate: none")
    log = MemoryLog()
    recorder = Recorder(scenario)
    landing = fly(scenario, log, watch=recorder.watch)
    if landing.detection_time_s is None:
        raise BadInput(f"{scenario.name}: no alarm was raised, allowed with separate: a flight with one")
    history = _history(scenario, log, recorder)
    situation = situation_of(history.tape, scenario, radians(rate_deg_s))
    left = [*candidates(history)]
    names = scenario.airframe.surfaces
    if len(left) < 2:
        raise BadInput(f"{scenario.name}: one candidate or none is left, allowed with separate: two at least")
    pairs = []
    for both in combinations(left, 2):
        pair = {"candidates": [_words(candidate, names) for candidate in both]} | distinguish(
            *both, situation, names
        )
        if scenario.fdi.probing is not None and pair["separates"]:
            pair |= _flown(scenario, pair, both)
        pairs.append(pair)
    return {
        "scenario": scenario.name,
        "time_s": landing.frames / scenario.rate_hz,
        "assumes": "the parameter of the fault stays as it is",
        "largest_rate_deg_s": rate_deg_s,
        "not_constant": open_courses(history.tape, names),
        "pairs": pairs,
        "passed": all(len(pair.get("left", ())) < 2 for pair in pairs),
    }


def _frames(scenario: Scenario) -> int:
    """Number of frames of a flight."""
    return round(scenario.duration_s * scenario.rate_hz)


def _flown(scenario: Scenario, pair: Document, candidates: Sequence[Candidate]) -> Document:
    """The candidates of a pair that remain after the flight with the doublet, and how often the aircraft left
    its envelope in the part of the doublet that is flown (`_with_doublet`)."""
    with _longer(scenario, pair) as flight:
        frames = _with_doublet(flight, scenario, pair)
        list(islice(frames, _frames(scenario)))  # fly to the doublet
        exits_before = flight.readout.envelope_exits
        list(frames)  # fly the doublet
        remaining = {*faults_left(flight.readout.diagnosis)}
        both = zip(candidates, pair["candidates"], strict=True)
        left = [words for candidate, words in both if (candidate.surface, candidate.kind) in remaining]
        return {"left": left, "envelope_exits": flight.readout.envelope_exits - exits_before}


@contextmanager
def _longer(scenario: Scenario, pair: Document) -> Iterator[Stepping]:
    """The flight of a scenario, with time for the whole doublet and ten frames more. `_with_doublet` ends it
    before."""
    spare_s = pair["duration_s"] + 10.0 / scenario.rate_hz
    flight = Stepping(scenario.model_copy(update={"duration_s": scenario.duration_s + spare_s}))
    try:
        yield flight
    finally:
        flight.release()


def _with_doublet(flight: Stepping, scenario: Scenario, pair: Document) -> Iterator[int]:
    """Fly to the end of the scenario, and then the doublet for its `time_s`, after which the pair must be
    distinguished: the way back of a longer doublet is not flown. Yields the number of each frame once the
    record holds it. held_rad: where the surfaces are at the end of the scenario, the command of those that
    the doublet does not move (any more)."""
    frames = _frames(scenario)
    names = list(scenario.airframe.surfaces)
    yield 0  # `records`, or else the first step, flies it
    for k in range(1, frames):
        flight.step()
        yield k
    held_rad = flight.readout.expected_u_rad
    for k in range(round(pair["time_s"] * scenario.rate_hz) + 1):
        command = held_rad.copy()
        for name, deflections in pair["commands_rad"].items():
            if k < len(deflections):
                command[names.index(name)] = deflections[k]
        flight.step(command)
        yield frames + k


def certified(scenario: Scenario, pair: Document) -> Certified:
    """The certificate of the flight with the doublet of a pair."""
    with _longer(scenario, pair) as flight:
        return proved.proved(scenario, flight.records, _with_doublet(flight, scenario, pair))


def write(document: Document, scenario: Scenario, out: Path) -> Path:
    """Write the result folder, and return its path. It has separation.json and, for each pair N whose doublet
    was flown, log and certificate of this flight in flown/N/."""
    name = f"{document['scenario'][:88]}-separation"
    with result_folder(out, name) as folder:
        for place, pair in enumerate(document["pairs"]):
            if "left" in pair:
                (folder / FLOWN / str(place)).mkdir(parents=True)
                certified(scenario, pair).write(folder / FLOWN / str(place))
        (folder / FILE).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return out / name


def _history(scenario: Scenario, log: MemoryLog, recorder: Recorder) -> History:
    """History of a flight, its tape from the alarm to the end. Raises BadInput if it ends with the alarm."""
    rows = logged_columns(log)
    detected = rows["detected"]
    alarm = row_set_to_end(detected)
    if alarm >= len(detected) - 1:
        raise BadInput(f"{scenario.name}: the flight ends with its alarm, allowed: a longer duration_s")
    tape = recorder.tape([alarm, len(detected) - 1], len(detected))
    return history_of(scenario, rows, tape)


def open_courses(tape: Tape, names: Sequence[str]) -> list[str]:
    """Words for the remaining faults that are not in RELATIONS: only a comparison of many frames
    distinguishes them."""
    left = faults_left(tape.last.diagnosis)
    return sorted(f"{names[s]} {NAMES[kind]}" for s, kind in left if kind not in RELATIONS)


def doublets(scenario: Scenario, after_s: float, loss: float) -> dict[tuple[str, str], Document]:
    """For each two surfaces of the fault class `losses`, in either order: amplitude and time of the doublet
    that distinguishes the loss of the share `loss` on one from that on the other, `after_s` after the start
    of a healthy flight, or the reason why there is none."""
    healthy = scenario.model_copy(update={"faults": (), "duration_s": after_s})
    frames = _frames(healthy)
    at = situation_of(
        tape_of_flight_again(healthy, [frames - 1], frames), healthy, radians(LARGEST_RATE_DEG_S)
    )
    names = scenario.airframe.surfaces
    doublets_of_pairs = {}
    for pair in combinations(scenario.airframe.class_of_losses, 2):
        first, second = (Candidate(names.index(name), LOSS, -loss, -loss) for name in pair)
        result = distinguish(first, second, at, names)
        numbers = result.get("amplitude_deg"), result.get("time_s"), result.get("because", "")
        doublets_of_pairs[pair] = doublets_of_pairs[pair[::-1]] = dict(
            zip(DOUBLET_COLUMNS, numbers, strict=True)
        )
    return doublets_of_pairs


def _words(candidate: Candidate, names: Sequence[str]) -> Document:
    """A candidate for the document. The interval of its parameter is in deg, that of a loss as theta."""
    is_share = RELATIONS[candidate.kind].theta_is_share
    scale, unit = (1.0, "theta") if is_share else (degrees(1.0), "deg")
    return {
        "surface": names[candidate.surface],
        "type": NAMES[candidate.kind],
        unit: [scale * candidate.low, scale * candidate.high],
    }


def as_text(document: Document) -> str:
    """The text for a terminal, with a line for each pair."""
    lines = [f"{document['scenario']}, {document['time_s']:g} s: if {document['assumes']}"]
    for pair in document["pairs"]:
        if pair["separates"]:
            surfaces = " and ".join(pair["commands_rad"])
            amplitude_deg = pair["amplitude_deg"]
            moves = f"by {amplitude_deg:.3g} deg" if amplitude_deg > HELD_DEG else "held in place"
            text = f"{surfaces} {moves}, distinguished after {pair['time_s']:.3g} s"
            if "left" in pair:
                text += f"; flown, left: {' and '.join(_names(pair['left'])) or 'neither'}"
        else:
            text = f"none: {pair['because']}"
        lines.append(f"  {' or '.join(_names(pair['candidates']))}: {text}")
    if document["not_constant"]:
        lines.append(f"  only a course over many frames distinguishes: {', '.join(document['not_constant'])}")
    return "\n".join(lines)


def _names(candidates: Sequence[Document]) -> list[str]:
    """Surface and type of candidates of the document, in words."""
    return [f"{words['surface']} {words['type']}" for words in candidates]
