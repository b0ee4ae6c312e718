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
        "",
        *_kinds(document["sweep_flights"]),
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


def _kinds(kinds: dict[str, Any]) -> list[str]:
    """A line a kind of flight; the parts are the same for all."""
    parts = list(next(iter(kinds.values()))["parts_ms"])
    head = [*parts, "frames alone", "frames, x", "flight, x", "us added a frame"]
    widths = [max(len(word), 8) + 2 for word in head]
    return [
        "flights of 15 s in a sweep, ms of processor time; x: of what JSBSim alone takes for its frames",
        " " * 32 + "".join(f"{word:>{width}}" for word, width in zip(head, widths, strict=True)),
        *(_kind(kind, of, widths) for kind, of in kinds.items()),
    ]


def _kind(kind: str, of: dict[str, Any], widths: list[int]) -> str:
    figures = (
        *of["parts_ms"].values(), of["bare_ms"], of["frames_ratio"], of["flight_ratio"], of["own_part_us"]
    )  # fmt: skip
    return f"{kind:32}" + "".join(f"{f:{width}.3f}" for f, width in zip(figures, widths, strict=True))


def _line(what: str, figures: dict[str, Any], us: str = "us") -> str:
    low, high = figures[f"{us}_quartiles"]
    return f"{what:42}{figures[us]:9.3f}  [{low:.3f}, {high:.3f}]{figures['ratio']:9.3f} x"
