"""The checker by itself, on a log made by hand: each condition by a statement that breaks this one alone.

What its sums are, flights say: writer and checker have them from separate code.
"""

import copy
from hashlib import sha256
from math import erfc, radians, sqrt
from typing import Any

import numpy as np
import pytest
import yaml

from beaver_ftc_assurance.certificates import check_certificate as checker
from beaver_ftc_assurance.certificates.check_certificate import Declared, Frames, Refused
from telling import numbers

ROWS, DT, EARTH = 13, 0.02, 0.3
DECLARED_BY_LETTER = {
    "c": [0.21, 0.23, 0.29], "b": [0.43, 0.47, 0.53], "g": [1.1, 1.3, 1.7], "o": [0.03, 0.05, 0.07],
    "B": [0.01, 0.02, 0.04], "m": [0.11, 0.13, 0.17],
}  # fmt: skip
DOCUMENT = {
    "omega_E": EARTH,
    "declared": {name: dict(zip("pqr", of, strict=True)) for name, of in DECLARED_BY_LETTER.items()},
}
LOW, HIGH = -0.6, 0.35  # of theta
TRAVEL = -0.4, 0.5
ALARM = 4


def made_log(healthy=(1, 2)):
    """All of a flap, in no two rows alike; in the rows `healthy` the rates follow the design model."""
    x, model = 0.3 * numbers(ROWS, 3, seed=1), numbers(ROWS, 3, seed=2)
    for k in healthy:
        x[k] = x[k - 1] + DT * model[k]
    by_axis = {
        "{}_measured_rad_s": x, "{}_design_rad_s2": model, "{}_eta_bar_rad_s2": 4 + abs(numbers(ROWS, 3)),
    } | {
        f"{name}_{{}}_{of}": abs(values) if "spread" in of else values
        for seed, name in ((10, "fie_flap"), (20, "fie_flap_position"))
        for of, values in (("offset_rad_s2", numbers(ROWS, 3, seed=seed)),
                           ("slope", numbers(ROWS, 3, seed=seed + 1)),
                           ("spread_rad_s2", 0.1 * numbers(ROWS, 3, seed=seed + 2)))
    }  # fmt: skip
    log = {name.format(axis): of[:, i] for name, of in by_axis.items() for i, axis in enumerate("pqr")}
    ends = {"fie_flap_theta": (LOW, HIGH), "flap_travel": TRAVEL}
    for name, (low, high) in ends.items():
        unit = "_rad" if name == "flap_travel" else ""
        log |= {f"{name}_low{unit}": np.full(ROWS, low), f"{name}_high{unit}": np.full(ROWS, high)}
    flags = {"detected": ALARM, "fie_flap_excluded": 9, "flap_stuck_excluded": 12}
    log |= {name: (np.arange(ROWS) >= k).astype(float) for name, k in flags.items()}
    return log | {"t_s": DT * np.arange(ROWS)}


SCENARIO: dict[str, Any] = {
    "fdi": {"fault_profile": "abrupt", "thresholds": "adaptive", "slowest_oscillation_rad_s": 25.0,
            "statistical": {"false_alarms_per_h": 0.1}},
    "actuators": {"flap": {"rate_limit_deg_s": 80.0}},
}  # fmt: skip


def declared(instants=1, **changes):
    given = {"dt": DT, "instants": instants, "gyro_errors": {}, "constant_bounds": {}, "inertia_shares": {},
             "start_row": 0, "scenario": SCENARIO}  # fmt: skip
    return Declared(**(given | changes))


def frames_of(log, instants=1, block=None, **changes):
    return Frames(DOCUMENT, log, declared(instants, **changes), block)


D = [0.7, -0.2, 0.5]


def made_term(log, instants=1, d=D, block=None, **fields):
    """A term with all that the log has of its frames; fields: among them first and frame."""
    seen, rows = frames_of(log, instants, block), slice(fields["first"], fields["frame"] + 1)
    logged = {"x": seen.rates_rad_s, "F": seen.model_rad_s2, "eta_bar": seen.eta_bar_rad_s2}
    logged["rest"] = seen.eta_bar_rad_s2 - seen.stated_bound_rad_s2
    return {"weight": 1.0, "d": d, **{name: of[rows].tolist() for name, of in logged.items()}, **fields}


def of_terms(log, changes=None, instants=1, block=None, **given):
    """A statement of one frame, 9, unless it says otherwise; of the fault's past no more than it can be."""
    span = {"first": 9, "frame": 9} | {name: given.pop(name) for name in (
        "first", "frame", "since", "pole_per_s", "fault", "h", "d") if name in given}  # fmt: skip
    term = made_term(log, instants, block=block, **span)
    said = {"what": "flap", "theta": "any", "frame": 9, "terms": [term | (changes or {})], **given}
    return said | ({"block": list(block)} if block else {})


PAST = {"pole_per_s": 5.0, "since": 6, "first": 9, "fault": 50.0}
SUMS: dict[str, tuple[dict[str, Any], str]] = {  # a statement; why it is refused, "" if it is right
    "right": ({}, ""),
    "with a past": (PAST, ""),
    "ends": ({"least": LOW, "most": HIGH}, ""),
    "another end": ({"least": LOW - 0.1}, "least is not the end of theta's range in the log"),
    "another most": ({"most": HIGH + 0.1}, "most is not the end of theta's range in the log"),
    "a course": ({"what": "flap bias"}, "a sum of frames says nothing of this type"),
    "one number": ({"theta": "constant"}, ""),
    "one number, from the alarm on": (
        {"theta": "constant", "pole_per_s": 5.0, "since": ALARM, "first": 5, "fault": 0.0}, "",
    ),
    "one number, before the alarm": (
        {"theta": "constant", "pole_per_s": 5.0, "since": ALARM - 1, "first": 4},
        "a frame before the alarm may be healthy",
    ),
    "one number of health": (
        {"what": None, "theta": "constant"}, "the scenario does not declare a constant parameter",
    ),
    "one number where it shows": ({"what": "flap stuck", "theta": "constant while it shows"}, ""),
    "one number of no type": (
        {"theta": "constant while it shows"}, "only a fault type is at fault where health fails",
    ),
    "one number that varies": (
        {"what": "flap loss_of_effectiveness that varies", "theta": "constant while it shows"},
        "theta of this type is not one number",
    ),
    "where health explains": (
        {"what": "flap stuck", "theta": "constant while it shows", "first": 2, "frame": 2},
        "health explains a frame",
    ),
    "any where health explains": ({"what": "flap stuck", "first": 2, "frame": 2}, ""),
    "a frame after the event": ({"frame": 10, "first": 10}, "a frame after the event cannot have caused it"),
    "the last frame of the log": ({"said": {"frame": 12}, "frame": 12, "first": 12}, ""),
    "since the first frame written": ({**PAST, "since": 9}, "the frames of a term are not in order"),
    "without a pole": ({"first": 8}, "the frames of a term are not in order"),
    "a fault of health": ({"what": None, "h": [0.0]}, "an alarm has no effect of a fault"),
    "another rate": ({"changes": {"x": [[0.1, 0.2, 0.3]]}}, "x is not that of the log"),
    "a rest below zero": ({"changes": {"rest": [[-1.0, 0.0, 0.0]]}}, "rest: a part of a bound is below zero"),
    "another rest": ({"changes": {"rest": [[0.1, 0.2, 0.3]]}}, "the declared bounds are not the log's"),
    "another h": ({"h": [7.0]}, "h is not that of the log"),
}  # fmt: skip


@pytest.mark.parametrize("name", SUMS)
def test_a_sum_is_refused_in_words_where_one_thing_is_wrong(name):
    given, says = copy.deepcopy(SUMS[name])
    more, log = given.pop("said", {}), made_log()
    said = of_terms(log, **given) | more
    refused_with(says, lambda: checker.sides_of_terms(said, frames_of(log), declared()))


def refused_with(says, call):
    """Refused with these words at the beginning; accepted if there are none."""
    if not says:
        call()
        return
    with pytest.raises(Refused) as refused:
        call()
    assert str(refused.value).startswith(says)


CHANCE: dict[str, Any] = {
    "what": None, "likelihood": "flap_likelihood_share", "level": 5.5, "first": 3, "frame": 4,
    "frames": [{}, {}],
}  # fmt: skip


# --- Instruments, events, the whole document


GYRO = {"noise_std_deg_s": 0.1, "bias_deg_s": 0.2, "quantum_deg_s": 0.4, "scale_error": 0.05}
TEXT = yaml.safe_dump({
    "rate_hz": 50.0, "substeps": 1, "changes": [], **SCENARIO,
    "fdi": SCENARIO["fdi"] | {"bounds": {
        "sensors": dict.fromkeys("pqr", GYRO),
        "constant_rad_s2": dict.fromkeys("pqr", 0.3), "inertia_coupling": dict.fromkeys("pqr", 0.4)}},
})  # fmt: skip
HEAD: dict[str, Any] = {
    "format": 5, "scenario": "hand", "scenario_sha256": sha256(TEXT.encode()).hexdigest(), "rows": ROWS,
    "statements": [], "without": [],
    "declared": {name: {} for name in "cbgB"} | {
        "o": dict.fromkeys("pqr", radians(0.4 + 0.2 + 0.2)), "m": dict.fromkeys("pqr", 0.05)},
}  # fmt: skip


def refused_in(log, *said, text=TEXT, **head):
    document = HEAD | {"statements": [*said]} | head
    document |= {"digest": checker.digest(document)}
    return checker.failures(document, log, text)


MISSING = {"what": None, "column": "detected", "frame": ALARM, "missing": [3], "sides": [1.0, 0.0]}
NOT_TOGETHER = "certificate, log and scenario do not fit together: "


@pytest.mark.parametrize(("log", "said", "head", "says"), [
    ({}, MISSING, {}, ""), ({}, MISSING, {"text": "a: 1"}, "SHA-256 of scenario.yaml does not match: it"),
    ({}, MISSING, {"text": "a: 1", "scenario_sha256": sha256(b"a: 1").hexdigest()},
     "the scenario is no scenario"),
    ({}, MISSING, {"text": "[1", "scenario_sha256": sha256(b"[1").hexdigest()}, f"{NOT_TOGETHER}ParserError"),
    ({"t_s": 1.001 * DT * np.arange(ROWS)}, MISSING, {}, "dt_s: the log's rows are not that far apart"),
    ({"t_s": DT * np.arange(ROWS + 1)}, MISSING, {}, f"the log has {ROWS + 1} rows, not {ROWS}: the certif"),
    ({}, MISSING, {"format": 4}, "this checker reads format 5, not 4"),
    ({}, MISSING | {"frame": 4.5}, {}, "statement: the field frame is missing, or no row"),
    ({}, MISSING | {"frame": True}, {}, "statement: the field frame is missing, or no row"),
    ({}, MISSING, {"declared": []}, "certificate: declared is not allowed, allowed: A mapping."),
    ({"watch_missing": np.full(ROWS, 4.0)}, MISSING, {}, "alarm: the log says that another reading is"),
    ({"watch_missing": "none"}, MISSING, {}, "alarm: the numbers do not fit the log: ValueError"),
])  # fmt: skip
def test_a_document_is_refused_in_words_where_one_thing_is_wrong(log, said, head, says):
    seen = made_log() | {"watch_missing": np.full(ROWS, 3.0)} | log
    found = [*refused_in(seen, said, **head)]
    assert [one[: len(says)] for one in found] == [says] * bool(says)


def test_a_level_is_that_of_a_test_in_each_frame_at_the_declared_rate():
    """A normal variable is beyond 4.7 so many times in an hour of frames."""
    rate_per_h = 0.5 * erfc(4.7 / sqrt(2.0)) * 3600.0 / DT
    its = declared(scenario={"fdi": {"statistical": {"false_alarms_per_h": rate_per_h}}})
    for level, says in ((4.7 * (1 + 1e-6), ""), (4.7 * (1 - 1e-6), "level: the declared rate allows")):
        refused_with(says, lambda level=level: checker.check_level(CHANCE | {"level": level}, its))
