"""The guarantees of the theory, tested in one random flight within all that the diagnosis declares.

    G1    no false alarm
    G2    the true fault is not excluded, and no wrong fault is named
    G3    the alarm comes at most a frame later than guaranteed

A healthy flight tests G1. A faulty flight is flown with each scheme, and tests all three.
"""

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import Document
from beaver_ftc.loop.loop import fly
from beaver_ftc.loop.outcome import Landing
from beaver_ftc.results.judgement import Truth, is_late
from beaver_ftc.results.metrics import fault_free_s
from beaver_ftc.scenario.faults import LossOfEffectiveness
from beaver_ftc.scenario.instants import grown_share
from beaver_ftc.studies.random_flights import Draw

PUBLISHED, SHARPENED = "published", "sharpened"
_CONSTANT_ONLY = "constant"  # this step declares faults of constant size, and is not flown with growing ones
_OFF = {"pole_bank": False, "memory": False, "shared_effectiveness": False}
SCHEMES: dict[str, Document] = {PUBLISHED: {"thresholds": "published"}, SHARPENED: {}}
# The steps from the published scheme to the default one; the last step needs a further declaration.
STEPS: dict[str, Document] = {
    PUBLISHED: SCHEMES[PUBLISHED],
    "interval": {"sharpen": _OFF},
    "pole bank": {"sharpen": {**_OFF, "pole_bank": True}},
    "memory": {"sharpen": {"shared_effectiveness": False}},
    SHARPENED: SCHEMES[SHARPENED],
    _CONSTANT_ONLY: {"fault_profile": "abrupt"},
}

Row = Document
Schemes = dict[str, Document]


def fly_draw(draw: Draw, schemes: Schemes) -> Row:
    """The row of a flight. A flight with a fault is flown once with each scheme."""
    try:
        return _faulty(draw, schemes) if draw.kind == "faulty" else _healthy(draw)
    except BadInput as error:  # a draw without a trim is reported, but not counted
        return {"index": draw.index, "skipped": str(error)}


def _healthy(draw: Draw) -> Row:
    """The row of a flight without a fault. One flight tests both schemes, since the first filter of the
    sharpened scheme is that of the published one. closest: largest |residual| / threshold of each scheme."""
    flight = fly(draw.scenario())
    of_filters = flight.closest_approach
    return {
        "index": draw.index,
        "watched_s": fault_free_s(flight),
        "alarm": flight.detection_time_s is not None,
        "departed": flight.departure is not None,
        "outside_s": flight.outside_s,
        "closest": {PUBLISHED: of_filters[0], SHARPENED: max(of_filters)},
    }


def _faulty(draw: Draw, schemes: Schemes) -> Row:
    """The row of a flight with a fault: an outcome for each scheme, then the fault. A growing fault has the
    outcome of the sharpened scheme under _CONSTANT_ONLY, so that all steps count the same faults."""
    row: Row = {"index": draw.index}
    for scheme, fdi in schemes.items():
        scenario = draw.scenario(fdi)
        abrupt = scenario.faults[0].profile == "abrupt"
        row[scheme] = judge(fly(scenario)) if abrupt or scheme != _CONSTANT_ONLY else row[SHARPENED]
    frame = {"rate_hz": scenario.rate_hz, "substeps": scenario.substeps}
    return row | frame | scenario.faults[0].model_dump(exclude_none=True)


def judge(flight: Landing) -> Row:
    """The outcome of a flight with one fault. Delays are in s from the first frame with the fault;
    false_alarm, late, excluded, wrong: whether a guarantee is violated."""
    truth = Truth.of(flight.scenario)
    guaranteed_s = flight.guaranteed_delay_s
    alarm_s = flight.detection_time_s
    delay_s = truth.onset.delay_s(alarm_s)
    is_false = alarm_s is not None and truth.onset.is_false(alarm_s)
    not_excluded = (*flight.candidates, flight.isolated)
    rightly_named = truth.faults_named_rightly_by(flight.isolated, flight.isolation_time_s)
    return {
        "delay_s": delay_s,
        "false_alarm": is_false,
        "guaranteed_s": guaranteed_s,
        "late": guaranteed_s is not None
        and not is_false
        and (delay_s is None or is_late(delay_s, guaranteed_s, 1.0 / flight.scenario.rate_hz)),
        "isolation_delay_s": truth.onset.delay_s(flight.isolation_time_s),
        "excluded": alarm_s is not None
        and not any(truth.faults[0].is_named_by(name) for name in not_excluded),
        "wrong": flight.isolated is not None and not rightly_named,
        "estimate_error": _estimate_error(flight) if rightly_named else None,
    }


def _estimate_error(flight: Landing) -> float | None:
    """|theta_estimated - theta| at the end of the flight, theta = -magnitude times the share to which the
    loss has grown; None without an estimate, and for another fault."""
    fault = flight.scenario.faults[0]
    if flight.estimate is None or not isinstance(fault, LossOfEffectiveness):
        return None
    grown = grown_share(fault, flight.frames / flight.scenario.rate_hz)
    return abs(flight.estimate + fault.magnitude * grown)
