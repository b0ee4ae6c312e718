"""Tables of docs/results/robustness.md: losses under each kind of error, and with sensors in doubt."""

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.sweeps import load_sweep
from beaver_ftc.studies.engine.statistics import share_within, wilson
from beaver_ftc.studies.engine.study import fly_all
from beaver_ftc.studies.matrix.informed import columns_of, informed_row
from beaver_ftc.studies.present.tables import markdown_table
from beaver_ftc.studies.sweep.one_flight import fly_one, scenario_of
from beaver_ftc.studies.sweep.sampling import Assignment, Plan

Document = dict[str, Any]
Rows = list[dict[str, Any]]

# Losses under each kind of error.
CONDITIONS = ("sensors", "servo", "coefficients", "air", "all", "all-published")
SOON_S = 0.5
LOSSES_HEAD = (
    "errors", "within 0.5 s, %", "from, %", "to, %", "median, s", "95 %, s", "99 %, s", "detected",
    "rightly named", "false alarms",
)  # fmt: skip

# Losses and biased instruments, with sensors in doubt.
DOUBT_HEAD = (
    "part", "sensors", "detected", "rightly named", "wrongly named", "median time to the name, s",
)  # fmt: skip
DOUBTED_SWEEP = "robust-elevator-all"
DOUBTED_S = 30.0  # the attitude needs some seconds to refute a gyro error
DOUBTED_FLIGHTS, TOLD_FLIGHTS = 60, 12
DOUBTED = ("elevator", "rudder", "aileron")
OF_DOUBT = {
    "sound": {"sensor_monitor": "never"},
    "in doubt": {"sensor_monitor": "always"},
    "in doubt, all fault types": {"fault_class": "all"},
}
BIASED = {"gyro, bias of 0.5 deg/s": ("pqr", 0.5), "vane, bias of 2 deg": (("alpha", "beta"), 2.0)}


def robustness_losses() -> str:
    """Elevator losses under each kind of error."""
    return markdown_table(LOSSES_HEAD, [
        (condition, *_of_losses(_flown(f"robust-elevator-{condition}", 500))) for condition in CONDITIONS
    ])  # fmt: skip


def robustness_losses_probe() -> str:
    """A few of these flights, to more digits: the delay, and how near the residual came to its threshold."""
    return "\n".join(
        f"robust-elevator-{condition}: " + ", ".join(
            f"{row['detection.delay_s']} {row['worst_residual_ratio']:.6g}"
            for row in _flown(f"robust-elevator-{condition}", 3, workers=1)
        )
        for condition in CONDITIONS
    )  # fmt: skip


def _flown(name: str, count: int, workers: int = 2) -> Rows:
    """The first flights of a built-in sweep, a row each."""
    sweep = load_sweep(name)
    return fly_all(partial(fly_one, sweep), list(Plan(sweep).assignments(range(count))), workers)


def _of_losses(rows: Rows) -> Iterator[str]:
    """The cells of LOSSES_HEAD, but for the first."""
    delays = [row["detection.delay_s"] for row in rows]
    found = [row for row in rows if row["detection.delay_s"] is not None]
    soon = wilson(sum(row["detection.delay_s"] <= SOON_S + 1e-9 for row in found), len(rows))
    yield from (f"{100 * share:.1f}" for share in (soon.value, soon.low, soon.high))
    for share in (0.5, 0.95, 0.99):
        within = share_within(delays, share)
        yield f"{within:.3f}" if np.isfinite(within) else "never"
    yield str(len(found))
    yield str(sum(bool(row["isolation.correct"]) for row in found))
    yield str(sum(bool(row["false_alarm"]) for row in rows))


def robustness_doubt() -> str:
    """Losses with all errors together, sensors assumed sound and in doubt; then biased instruments."""
    rows = [_of_doubt(surface, sensors) for surface in DOUBTED for sensors in OF_DOUBT]
    rows += [_of_doubt(part, "in doubt") for part in BIASED]
    return markdown_table(DOUBT_HEAD, rows)


def robustness_doubt_bound() -> str:
    """What a test that is told a loss of Table 4 has to tell it from the error of any gyro."""
    return markdown_table(
        ("surface", "flights", "least deflection, standard deviations", "chance, %"), map(_told, DOUBTED)
    )


def _told(surface: str) -> tuple[str, ...]:
    """The row of a surface: the least deflection of a few flights, and their mean chance."""
    seen = []
    for one in _doubted(surface, {"sensor_monitor": "always"}, TOLD_FLIGHTS):
        scenario = scenario_of(load_sweep(DOUBTED_SWEEP), one)
        kept = columns_of(scenario.airframe)
        fly(scenario, kept)
        seen.append(informed_row(scenario, kept, surface))
    least = min(each["told_deflection"] for each in seen)
    chance = np.mean([each["told_chance"] for each in seen])
    return surface, str(TOLD_FLIGHTS), f"{least:.0f}", f"{100 * chance:.0f}"


def _of_doubt(part: str, sensors: str) -> tuple[str, ...]:
    """The row of DOUBT_HEAD for a surface or BIASED instruments, with the settings OF_DOUBT."""
    rows = fly_all(
        partial(fly_one, load_sweep(DOUBTED_SWEEP)), _doubted(part, OF_DOUBT[sensors], DOUBTED_FLIGHTS), 2
    )
    right = [row for row in rows if row["isolation.correct"]]
    named = [row for row in rows if row["isolation.isolated"]]
    median_s = f"{np.median([row['isolation.delay_s'] for row in right]):.2f}" if right else "-"
    found = sum(row["detection.delay_s"] is not None for row in rows)
    counts = (found, len(right), len(named) - len(right))
    return (part, sensors, *(f"{count} of {DOUBTED_FLIGHTS}" for count in counts), median_s)


def _doubted(part: str, fdi: dict[str, str], count: int) -> list[Assignment]:
    """The first flights of DOUBTED_SWEEP, with this part at fault."""
    keys = {f"fdi.{key}": value for key, value in fdi.items()}
    drawn = Plan(load_sweep(DOUBTED_SWEEP)).assignments(range(count))
    return [one._replace(values=_with_fault(one, part) | keys) for one in drawn]


def _with_fault(one: Assignment, part: str) -> Document:
    """What varies in a long flight, with the loss on another surface, or a biased instrument instead."""
    if part in DOUBTED:
        return {**one.values, "faults[0].actuator": part, "duration_s": DOUBTED_S}
    (sensors, size), at_s = BIASED[part], one.values["faults[0].at_s"]
    fault = {"sensor": sensors[one.run % len(sensors)], "type": "bias", "magnitude": size, "at_s": at_s}
    kept = {key: value for key, value in one.values.items() if not key.startswith("faults")}
    return kept | {"faults": [fault], "duration_s": DOUBTED_S}
