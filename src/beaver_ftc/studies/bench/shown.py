"""The document of `beaver-ftc bench` as text."""

from beaver_ftc.results.model import Document
from beaver_ftc.studies.bench.sweep_flights import STAGES
from beaver_ftc.studies.present.tables import aligned

_KIND_HEAD = ["", *STAGES, "frames alone", "frames, x", "flight, x", "us added a frame"]
_ALTERNATIVES = {
    "straightforward": "properties by name, estimators in NumPy",
    "python_detector": "a detector in Python plugged in",
    "python_law": "a law in Python plugged in",
    "python_detector_and_law": "both",
    "properties_through_python": "properties through JSBSim's Python binding",
}


def text_of(document: Document) -> str:
    """The document of `bench` as text."""
    whole_flights = document["whole_flight"]
    sections = {
        "after the alarm: every estimator, the network and the fault-tolerant law at work": _rows(document),
        "before the alarm": _rows(document["before_alarm"]),
        "other ways, after the alarm, in a sixth of the rounds, at least 3": [
            _row(_ALTERNATIVES[name], figures) for name, figures in document["alternatives"].items()
        ],
        f"whole flights of {whole_flights['frames']} frames, loading and trim included, in a tenth of the "
        "rounds, at least 3": [
            *_rows(whole_flights),
            _row(
                "with a log file",
                whole_flights | {"ratio": whole_flights["with_log_file_ratio"]},
                "with_log_file_us",
            ),
        ],
        "flights of 15 s in a sweep, ms of processor time; x: of what JSBSim alone takes for its frames": [
            _KIND_HEAD,
            *(_kind_row(kind, figures) for kind, figures in document["sweep_flights"].items()),
        ],
    }
    return "\n".join([
        "{processor}, {cores} cores, Python {python}, JSBSim {jsbsim}".format(**document["machine"]),
        "us a frame: medians [quartiles] over {rounds} rounds of {frames_a_round} frames, unless a "
        "title has others".format(**document),
        *(f"\n{title}\n{aligned(rows)}" for title, rows in sections.items()),
    ])  # fmt: skip


def _rows(phase: Document) -> list[list[str]]:
    """The bare aircraft, the parts of the loop if they were timed, and the loop."""
    return [
        _row("bare aircraft", phase | {"ratio": 1.0}, "bare_us"),
        *(_row(f"  + {name}", part) for name, part in phase.get("parts", {}).items()),
        _row("closed loop", phase, "closed_loop_us"),
    ]


def _row(name: str, figures: Document, us: str = "us") -> list[str]:
    """A row: name, median and quartiles of the time under the key `us`, ratio to the bare aircraft, added
    time."""
    low, high = figures[f"{us}_quartiles"]
    adds = f"{figures['adds_us']:+.3f}" if "adds_us" in figures else ""
    return [name, f"{figures[us]:.3f}", f"[{low:.3f}, {high:.3f}]", f"{figures['ratio']:.3f} x", adds]


def _kind_row(kind: str, figures: Document) -> list[str]:
    """A row below _KIND_HEAD. figures: of `by_kind`."""
    others = (figures[key] for key in ("bare_ms", "frames_ratio", "flight_ratio", "own_part_us"))
    return [kind, *map("{:.3f}".format, (*figures["parts_ms"].values(), *others))]
