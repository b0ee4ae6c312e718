"""What `beaver-ftc bench` prints for people."""

from typing import Any

_ALTERNATIVES = {
    "straightforward": "properties by name, estimators in NumPy",
    "python_detector": "a detector in Python plugged in",
    "python_law": "a law in Python plugged in",
    "python_detector_and_law": "both",
    "properties_through_python": "properties through JSBSim's Python binding",
}


def text_of(document: dict[str, Any]) -> str:
    """The document of `bench` as text."""
    return "\n".join([
        "{processor}, {cores} cores, Python {python}, JSBSim {jsbsim}".format(**document["machine"]),
        "us a frame: medians [quartiles] over {rounds} rounds of {frames_a_round} frames".format(**document),
        "",
        "after the alarm: every estimator, the network and the fault-tolerant law at work",
        *_phase(document),
        "",
        "before the alarm",
        *_phase(document["before_alarm"]),
        "",
        "other ways, after the alarm",
        *(_line(_ALTERNATIVES[name], figures) for name, figures in document["alternatives"].items()),
        "",
        *_flights(document["whole_flight"]),
    ])  # fmt: skip


def _phase(phase: dict[str, Any]) -> list[str]:
    parts = phase["parts"].items()
    return [
        _line("bare aircraft", {**phase, "ratio": 1.0}, "bare_us"),
        *(_line(f"  + {name}", part) + f"{part['adds_us']:+10.3f}" for name, part in parts),
        _line("closed loop", phase, "closed_loop_us"),
    ]


def _flights(flights: dict[str, Any]) -> list[str]:
    with_file = {**flights, "ratio": flights["with_log_file_ratio"]}
    return [
        f"whole flights of {flights['frames']} frames, loading and trim included",
        _line("bare aircraft", {**flights, "ratio": 1.0}, "bare_us"),
        _line("closed loop", flights, "closed_loop_us"),
        _line("with a log file", with_file, "with_log_file_us"),
    ]


def _line(what: str, figures: dict[str, Any], us: str = "us") -> str:
    low, high = figures[f"{us}_quartiles"]
    return f"{what:42}{figures[us]:9.3f}  [{low:.3f}, {high:.3f}]{figures['ratio']:9.3f} x"
