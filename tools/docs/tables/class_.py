"""The answers of docs/tutorials/class.md, flown: a row an exercise."""

from importlib.resources import files

import beaver_ftc as bf
from beaver_ftc.studies.present.tables import markdown_table
from beaver_ftc_live.challenge.grading import tried

LOST = (0.001, 0.002, 0.003, 0.005, 0.007, 0.01, 0.02, 0.03, 0.05, 0.1, 0.3, 1.0)  # as in the notebook


def class_answers() -> str:
    """Every exercise's answer."""
    rows = (*_live(), *_paper(), *_small(), *_detector(), *_sweep())
    return markdown_table(("exercise", "answer"), rows)


def _live() -> list[tuple[str, str]]:
    """Answers of exercise 1."""
    names = ("elevator-partial-loss", "rudder-stuck", "elevator-float")
    weak, jam, trailing = (bf.fly(name, log=False) for name in names)
    modes = " → ".join(change["mode"] for change in weak.metrics["supervisor"])
    found, left = weak.detection, ", ".join(trailing.metrics["isolation"]["candidates"])
    typed = f"type {jam.isolation.type} after {jam.metrics['isolation']['type_delay_s']:.2f} s"
    return [
        ("1a", f"axis {found.axis}, after {found.delay_s:.2f} s; {weak.isolation.fault}; {modes}"),
        ("1b", f"{jam.isolation.fault} after {jam.isolation.delay_s:.2f} s; {typed}"),
        ("1c", f"{trailing.isolation.fault}; remaining types: {left or trailing.isolation.type}"),
    ]


def _paper() -> list[tuple[str, str]]:
    """Answers of exercise 2."""
    ours = bf.fly("elevator-partial-loss")
    nominal = bf.fly("elevator-partial-loss-nominal", log=False)
    errors = [flight.metrics["tracking"]["post_fault_rms_deg_s"]["q"] for flight in (nominal, ours)]
    threshold = ours.log["q_threshold_rad_s"].iloc[-1]
    published = bf.fly(
        bf.load("elevator-partial-loss").with_({"fdi.scheme": "zhang2005", "expect": {}}), log=False
    )
    delay_s = published.detection.delay_s
    return [
        ("2a", f"`nominal` {errors[0]:.2f} deg/s; `fault-tolerant-published` {errors[1]:.2f} deg/s"),
        ("2b", f"{threshold:.4f} rad/s at the last frame of the log"),
        ("2c", f"alarm after {delay_s:.2f} s; {published.isolation.fault}"),
    ]


def _small() -> list[tuple[str, str]]:
    """Answers of exercise 3: the smallest loss that is found."""
    base = bf.load("elevator-partial-loss").with_(
        {"duration_s": 20, "expect": {}, "uncertainty": {}, "faults[0].actuator": "aileron"}
    )

    def smallest(changes: dict[str, float]) -> str:
        flown = base.with_(changes)
        flights = ((lost, bf.fly(flown.with_({"faults[0].magnitude": lost}), log=False)) for lost in LOST)
        return next((f"{100 * lost:g} %" for lost, flight in flights if flight.detection.detected), "none")

    bounds = {b: {f"fdi.bounds.constant_rad_s2.{axis}": b for axis in "pqr"} for b in (0.005, 0.02, 0.05)}
    lively = {a: {"reference.p[0].sine.amplitude_deg_s": a} for a in (1.0, 8.0)}
    return [
        ("3a", "; ".join(f"bound {b:g} rad/s2: {smallest(changes)}" for b, changes in bounds.items())),
        ("3b", "; ".join(f"reference {a:g} deg/s: {smallest(changes)}" for a, changes in lively.items())),
    ]


def _detector() -> list[tuple[str, str]]:
    """Answers of exercise 4."""
    package = "beaver_ftc_live.challenge"
    source = files(package).joinpath("handout/detector.py.txt").read_text(encoding="utf-8")
    handed_out = "memory_s, level = 2.0, 6.0"
    assert handed_out in source
    points = []
    for setting in (handed_out, "memory_s, level = 0.5, 3.0"):
        points.append(tried(source.replace(handed_out, setting), "detector.py")["points"])
    return [
        ("4a", f"{points[0]:g} points"),
        ("4b", f"{points[1]:g} points with `memory_s, level = 0.5, 3.0`"),
    ]


def _sweep() -> list[tuple[str, str]]:
    """Answers of exercise 5."""
    base = bf.load("elevator-partial-loss").with_(
        {"duration_s": 10, "expect": {}, "faults[0].at_s": 4, "uncertainty": {}}
    )
    vary = {
        "faults[0].magnitude": {"loguniform": [0.005, 1.0]},
        "faults[0].actuator": {"choice": ["elevator", "aileron", "rudder"]},
        "initial.airspeed_mps": {"uniform": [38, 52]},
    }
    table = bf.sweep(base, vary=vary, runs=60, seed=7)
    seen = table.groupby("faults[0].actuator")["detection.detected"].agg(["sum", "count"])
    shares = "; ".join(
        f"{surface} {int(row['sum'])} of {int(row['count'])}" for surface, row in seen.iterrows()
    )
    named = table[table["isolation.isolated"].astype(bool)]
    wrong = int((named["isolation.fault"] != named["faults[0].actuator"]).sum())
    return [("5a", shares), ("5b", f"{int(table['false_alarm'].sum())} false alarms, {wrong} wrong names")]
