"""The outcome of one flight: its alarm, name and tracking error, and the reason of a false alarm."""

from collections.abc import Callable
from functools import partial
from math import hypot

from beaver_ftc.documents.errors import BeaverFtcError
from beaver_ftc.loop.loop import Loop, fly
from beaver_ftc.loop.readout import withhold_from_law
from beaver_ftc.plugins import required
from beaver_ftc.results.log import MemoryLog
from beaver_ftc.results.metrics import measure
from beaver_ftc.results.model import Document, Metrics
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.undeclared import undeclared

# The outcome of a flight that cannot be flown to its end.
FAILED: Document = {
    "failed": True, "false_alarm": False, "delay_s": None, "named": False, "tracking_deg_s": None,
    "verdict": None, "reason": None,
}  # fmt: skip


def withhold(withheld: str, loop: Loop) -> Callable[[], None]:
    """Watch a flight, as an argument of `fly`: withhold something from its law at the begin. At the end of
    the flight, the returned function has nothing to do."""
    if withheld:
        withhold_from_law(loop.frames[0], withheld)
    return lambda: None


def outcome_of(scenario: Scenario, withheld: str = "") -> Document:
    """The outcome of a flight. withheld: what is withheld from the law, as in `withhold_from_law`."""
    try:
        metrics = measure(fly(scenario, watch=partial(withhold, withheld)))
    except BeaverFtcError as error:
        return FAILED | {"error": str(error)}
    detection = metrics.detection
    isolation = metrics.isolation
    return {
        "failed": False,
        "false_alarm": metrics.false_alarm,
        "delay_s": metrics.fault_found_s,
        "named": metrics.fault_named,
        "tracking_deg_s": _tracking(metrics),
        "verdict": [detection.time_s, isolation.fault, isolation.time_s],
        "reason": reason_of(scenario) if metrics.false_alarm else None,
    }


def _tracking(metrics: Metrics) -> float | None:
    """Root of the sum of the squared RMS tracking errors of the axes after the fault, deg/s; None for a lost
    aircraft."""
    rms = metrics.tracking.post_fault_rms_deg_s
    return None if metrics.departure or rms is None else hypot(rms.p or 0.0, rms.q or 0.0, rms.r or 0.0)


def reason_of(scenario: Scenario) -> Document:
    """The reason of a false alarm. undeclared: number of undeclared errors of the truth. certified: whether a
    certificate proves that the data are outside of the declaration; None for a scheme without
    certificates."""
    n_undeclared = sum(1 for _ in undeclared(scenario))
    if not scenario.fdi.is_ours:
        return {"undeclared": n_undeclared, "certified": None}
    log = MemoryLog()
    fly(scenario, log)
    statements = required("proof", "mechanisms")(scenario, log).certificate["statements"]
    # the statement that no healthy aircraft within the declaration gives these data
    certified = any(statement["column"] == "detected" and "sides" in statement for statement in statements)
    return {"undeclared": n_undeclared, "certified": certified}
