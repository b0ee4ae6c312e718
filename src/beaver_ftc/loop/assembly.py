"""Turns a scenario into the frame record that the compiled loop works on."""

import numpy as np

from beaver_ftc.compiled import record, sized
from beaver_ftc.control import state as control
from beaver_ftc.control.outer.state import AUTOPILOT, COLUMNS
from beaver_ftc.control.supervisor import SUPERVISOR
from beaver_ftc.diagnosis import scheme
from beaver_ftc.diagnosis.assessment import assessment_dtype
from beaver_ftc.diagnosis.belief import expectation
from beaver_ftc.diagnosis.detection.parity import USUAL_SIZE, Size, size_for
from beaver_ftc.diagnosis.isolation.estimators import estimator_names
from beaver_ftc.loop import instrument_records, memory
from beaver_ftc.loop.accounts import accounts_dtype, true_faults_dtype
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.instruments import MEASURED, N_SAMPLED, USUAL_LINE, instruments_dtype
from beaver_ftc.plant.native import RUNNING
from beaver_ftc.plant.sensing import truth_dtype
from beaver_ftc.scenario.dump import texts_of
from beaver_ftc.scenario.schema import Scenario

# How many columns the log has for estimators, the watch, sensors with rates of their own, the engine,
# statistical tests.
LOGGED = record(estimators=int, watch=int, sampled=int, power=int, tests=int)


@sized
def frame_dtype(n: int, size: Size = USUAL_SIZE, line: int = USUAL_LINE) -> np.dtype:
    """All that a flight of an aircraft with n surfaces remembers between frames; size: of its statistics;
    line: of its delay lines."""
    return record(
        k=int, row=int, dt=float, t=float,  # frame, row of the log, s, s
        running=RUNNING,
        since=int, logged=LOGGED,  # the frame with which this diagnosis has begun
        truth=truth_dtype(n), instruments=instruments_dtype(line), measured=MEASURED,
        belief=expectation.belief_dtype(n), fdi=scheme.diagnosis_dtype(n, size),
        assessment=assessment_dtype(n), faults=true_faults_dtype(n), supervisor=SUPERVISOR,
        control=control.control_dtype(n), autopilot=AUTOPILOT,
        held=int, held_rad=n,  # whether another than the law commands, and what
        accounts=accounts_dtype(n), departed=int,
    )  # fmt: skip


_DESIGN = ("fdi", "control", "design_model", "actuators", "sensors")
_MOST_DESIGNS = 32
_designs: dict[tuple[object, ...], np.ndarray] = {}


def assemble(scenario: Scenario, trim: np.ndarray, travel: np.ndarray) -> np.ndarray:
    """The frame record, shape (1,), of a flight about to start.

    trim (4,) rad: the surfaces in trim; travel (2, 4) rad: lower and upper stops. The truth's nodes are
    attached by the loop. A copy of the record of its design, which is assembled once.
    """
    initial = tuple(scenario.initial.model_dump(exclude={"airspeed_mps"}).values())
    rates, failing = (scenario.rate_hz, scenario.substeps), instrument_records.breaks_instruments(scenario)
    line = instrument_records.line_for(scenario)
    key = scenario.airframe, texts_of(scenario, _DESIGN), rates, failing, line, initial, travel.tobytes()
    if key not in _designs:
        if len(_designs) >= _MOST_DESIGNS:
            _designs.clear()
        _designs[key] = _assemble_design(scenario, travel, line)
    frames = memory.copied(_designs[key])
    frame = frames[0]
    frame["belief"]["u"] = frame["belief"]["commanded"] = trim
    frame["control"]["layout"]["trim"] = frame["control"]["allocation"]["output"]["command"] = trim
    instrument_records.seed(frame["instruments"], scenario.seed)
    return frames


def _assemble_design(scenario: Scenario, travel: np.ndarray, line: int) -> np.ndarray:
    """What does not depend on the trim, the seed and the truth: each stage fills in its own record."""
    aircraft, dt = scenario.airframe, 1.0 / scenario.rate_hz
    frames = memory.taken_empty((1,), frame_dtype(aircraft.n, size_for(aircraft), line))
    frame, instant_s = frames[0], dt / scenario.substeps
    frame["dt"], frame["accounts"]["guarantee"]["certain_after_s"] = dt, -1.0
    truth, channels = frame["truth"], instrument_records.truth_read(scenario)
    truth["n"], truth["declared"] = len(channels), len(aircraft.signals)
    truth["factor"][: len(channels)] = [factor for _, _, factor in channels]
    instrument_records.configure(frame, scenario, instant_s)
    instrument_records.configure_watch(frame["fdi"]["watch"], scenario, instant_s)
    expectation.configure(frame["belief"], scenario, travel)
    scheme.configure(frame["fdi"], frame["belief"], scenario, travel)
    control.configure(frame["control"], scenario, travel)
    return frames


def y_places(frame: np.void) -> list[int]:
    """Where in the truth the measured signals beside the rates are: y without noise, (4 + declared,)."""
    first = ch.POS + 3 * frame["belief"]["u"].size
    return [ch.ALPHA, ch.BETA, ch.AIRSPEED, ch.QDYN, *range(first, first + int(frame["truth"]["declared"]))]


def lay_out(frame: np.void, scenario: Scenario, diagnoses_itself: bool) -> tuple[str, ...]:
    """Note in a flight's record what there are columns for; returns their names."""
    fdi, logged, profile = frame["fdi"], frame["logged"], bool(frame["autopilot"]["enabled"])
    aircraft, tests = scenario.airframe, fdi["statistical"]["tests"]
    estimators = estimator_names(scenario.fdi.fault_class, aircraft) if diagnoses_itself else ()
    logged["estimators"] = fdi["isolation"]["config"]["n"] if diagnoses_itself else 0
    watched = logged["watch"] = instrument_records.columns_of_the_watch(scenario)
    sampled = instrument_records.reads_further(scenario)
    logged["sampled"] = N_SAMPLED if sampled else 0
    moved = frame["control"]["power"]["config"]["enabled"] or (profile and aircraft.airspeed_by == "power")
    moved |= bool(frame["control"]["engines"]["config"]["n"])
    power = aircraft.power_setting if moved else ""
    logged["power"] = 1 + len(aircraft.effectors) if power else 0
    logged["tests"] = tests["n_columns"] if tests["enabled"] else 0
    tested, columns = bool(tests["enabled"]), COLUMNS if profile else ()
    return ch.log_columns(aircraft, estimators, watched, power, columns, tested, sampled)
