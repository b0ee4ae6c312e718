"""Names that the diagnosis gave, as sections of the metrics: `isolation`, and the names in each window.

A *finding* is what the diagnosis reports of one fault: name, type, size and their times. `judgement.py`
decides whether a name is right.
"""

from math import degrees
from typing import TYPE_CHECKING

from beaver_ftc.results.judgement import Onset, Truth
from beaver_ftc.results.model import DeclaredFault, Document
from beaver_ftc.results.part import rounded
from beaver_ftc.scenario.faults import acting_at, is_share, size_at

if TYPE_CHECKING:
    from beaver_ftc.loop.outcome import Landing


def isolation_of(flight: "Landing", truth: Truth) -> Document:
    """The section `isolation`: the name at the end, all names, and each of several named faults."""
    return _named(vars(flight), truth, truth.first) | {
        "isolated": flight.isolated is not None,
        "names": _names_given_in_flight(flight, truth),
        "faults": [_named(finding, truth) for finding in flight.faults],
        "types_withdrawn": flight.withdrawn_types or None,
    }


def windows_of(flight: "Landing", truth: Truth) -> list[Document] | None:
    """The alarm and the names in each window; None if one window lasts to the end of the flight."""
    windows = flight.windows
    end_s = flight.frames / truth.rate_hz
    if len(windows) > 1 or any(window["to_s"] < end_s for window in windows):
        return [_window(rounded(window), truth) for window in windows]
    return None


def _window(window: Document, truth: Truth) -> Document:
    """One window. A name that was given before a fault of the window began is counted from the begin of this
    fault."""
    last_frame_s = window["to_s"] - 1.0 / truth.rate_hz
    alarm_s = window["alarm_s"]
    finding = window["found"]
    acting = acting_at(truth.faults, last_frame_s)
    truth_within = truth.within(acting)
    return window | {
        "faults": [i for i, fault in enumerate(truth.faults) if fault in acting],
        "detected": alarm_s is not None,
        "time_s": alarm_s,
        "delay_s": Onset(window["from_s"], truth.rate_hz).delay_s(alarm_s),
        "isolation": [
            _name_in_window(name, truth_within, last_frame_s) for name in finding.get("faults") or (finding,)
        ],
    }


def _name_in_window(finding: Document, truth: Truth, last_frame_s: float) -> Document:
    """A name in the last frame of a window, with the true size. truth: the faults that act in the window."""
    fault = truth.against(finding["isolated"], last_frame_s)
    if fault is not None:
        begins_s = truth.onset_of(fault).first_frame_with_fault_s
        times = {key: finding.get(key) for key in ("isolation_time_s", "type_time_s")}
        finding = finding | {key: max(time, begins_s) for key, time in times.items() if time is not None}
    at_s = finding.get("estimate_at_s") or last_frame_s
    on_place = [fault for fault in truth.faults if fault.actuator == finding["isolated"]]
    has_size = on_place and finding.get("estimate") is not None
    true_size = size_at(finding["isolation_type"], on_place, at_s) if has_size else None
    return _named(finding | {"estimate_at_s": at_s}, truth) | {"true_size": true_size}


def _names_given_in_flight(flight: "Landing", truth: Truth) -> tuple[str, ...]:
    """All names given in flight that were not premature, withdrawn ones included, each once. They are ordered
    by the begin of the fault that they name, then by time."""
    given = [(withdrawn["fault"], withdrawn["from_s"]) for withdrawn in flight.withdrawn]
    given += [(name["isolated"], name["isolation_time_s"]) for name in flight.faults or (vars(flight),)]
    names = []  # at_s of the fault, time of the name, name
    for name, time_s in given:
        fault = next(iter(truth.faults_named_rightly_by(name, time_s)), truth.first)
        if name is not None and not truth.is_premature(name, time_s, fault):
            names.append((fault.at_s if fault else 0.0, time_s, name))
    return tuple(dict.fromkeys(name for _, _, name in sorted(names)))


def _named(finding: Document, truth: Truth, otherwise: DeclaredFault | None = None) -> Document:
    """A named fault, judged by the table of `Truth`. The key `fault` is None while several candidates remain.

    otherwise: the fault with which a wrong or missing name is compared.
    """
    name = finding["isolated"]
    kind = finding["isolation_type"]
    time_s = finding["isolation_time_s"]
    estimate = finding.get("estimate")
    type_time_s = finding.get("type_time_s")
    right = truth.against(name, time_s)
    fault = right or otherwise
    onset = truth.onset_of(fault)
    premature = truth.is_premature(name, time_s, fault)
    type_is_right = truth.is_type_right(fault, kind, type_time_s)
    # only the built-in diagnosis names several faults, by exclusion: their findings have no `so_far`
    return {"so_far": None if name is None else True, **finding} | {
        "fault": name,
        "type": kind,
        "time_s": time_s,
        "delay_s": onset.delay_s(time_s),
        "correct": None if name is None else right is not None and not premature,
        "type_correct": type_is_right and not premature,
        "type_delay_s": onset.delay_s(type_time_s),
        "estimate": estimate if estimate is None else float(estimate),
        "estimate_deg": None if estimate is None or is_share(kind) else degrees(estimate),
        "premature": premature,
    }
