"""What is learnt in healthy flight, and whether it hides a fault that grows slowly.

    python benchmarks/known_unknowns.py [flights]

The statistical detector forgets what is constant, and its drift follows what changes slowly. First, errors
that nobody has declared: an offset of the trim, more weight, more inertia; false alarms within half a minute.
Then elevator losses of 40 % and more that grow as 1 - exp(-kappa (t - T0)), with the real errors of
`robust-elevator-all` and with those of `robust-elevator-sensors` in still air; with the worst-case detector
in charge, with the statistical one, and with either. Prints how many are detected within a minute, and how
large the loss has grown by then.
"""

import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sweeps import load_sweep
from beaver_ftc.studies.sweep.sampling import Plan, flight_seed

CONDITIONS = ("all", "sensors")
KAPPAS_PER_S = (0.02, 0.05, 0.1, 0.3, 1.0, 3.0)
AUTHORITIES = ("worst-case", "statistical", "either")
WATCHED_S, HEALTHY_S = 60.0, 30.0
UNDECLARED: dict[str, dict[str, Any]] = {
    "Cm_0 30 % larger": {"coefficients": {"Cm_0": 1.3}},
    "mass 15 % larger": {"mass": 1.15},
    "Iy 15 % larger": {"inertia": {"Iy": 1.15}},
}
FLIGHTS = 20


def scenarios(condition: str, kappa_per_s: float, count: int) -> Iterator[Scenario]:
    """The first flights of the sweep, their fault growing."""
    sweep = load_sweep(f"robust-elevator-{condition}")
    growing = {"faults[0].profile": "incipient", "faults[0].kappa_per_s": kappa_per_s}
    for run, values in Plan(sweep).assignments(range(count)):
        seed = flight_seed(sweep.file.seed, run)
        yield sweep.scenario(values | growing | {"duration_s": 8.0 + WATCHED_S}, seed=seed)


def found(scenario: Scenario, authority: str) -> tuple[float, bool]:
    """The loss at the alarm, infinite if there was none, and whether it was named rightly if at all."""
    fdi = scenario.fdi.model_copy(update={"authority": authority})
    flight = fly(scenario.model_copy(update={"fdi": fdi}))
    fault = scenario.faults[0]
    if flight.detection_time_s is None:
        return np.inf, True
    grown = 1.0 - np.exp(-fault.kappa_per_s * (flight.detection_time_s - fault.at_s))
    return fault.magnitude * grown, flight.isolated in (None, "elevator")


def false_alarms(condition: str, error: dict[str, Any], authority: str, count: int) -> str:
    """How many healthy flights end in an alarm, of how many."""
    sweep = load_sweep(f"robust-elevator-{condition}")
    alarms = 0
    for run, values in Plan(sweep).assignments(range(count)):
        place = {key: value for key, value in values.items() if key.startswith("initial")}
        healthy = place | {"uncertainty": error, "duration_s": HEALTHY_S, "faults": []}
        scenario = sweep.scenario(healthy, seed=flight_seed(sweep.file.seed, run))
        fdi = scenario.fdi.model_copy(update={"authority": authority})
        alarms += fly(scenario.model_copy(update={"fdi": fdi})).detection_time_s is not None
    return f"{alarms} of {count}"


def constants(count: int) -> Table:
    """False alarms by error and authority."""
    table = Table("condition", "nobody declared", *AUTHORITIES[:2])
    for condition in CONDITIONS:
        for name, error in UNDECLARED.items():
            cells = [false_alarms(condition, error, authority, count) for authority in AUTHORITIES[:2]]
            table.add_row(condition, name, *cells)
    return table


def cell(condition: str, kappa_per_s: float, authority: str, count: int) -> str:
    """One cell of the table."""
    outcomes = [found(scenario, authority) for scenario in scenarios(condition, kappa_per_s, count)]
    losses = np.array([loss for loss, _ in outcomes])
    wrong = sum(not right for _, right in outcomes)
    share = f"{np.mean(np.isfinite(losses)):.0%}, {np.median(losses):.2f}"
    return share + (f", {wrong} wrong" if wrong else "")


def main(count: int) -> None:
    """Print the table."""
    table = Table("condition", "kappa, 1/s", *AUTHORITIES)
    for condition in CONDITIONS:
        for kappa_per_s in KAPPAS_PER_S:
            cells = [cell(condition, kappa_per_s, authority, count) for authority in AUTHORITIES]
            table.add_row(condition, f"{kappa_per_s:g}", *cells)
    console = Console(width=110)
    console.print(f"false alarms within {HEALTHY_S:g} s of healthy flight")
    console.print(constants(count))
    console.print(f"detected within {WATCHED_S:g} s, median loss by then; {count} flights a line")
    console.print(table)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else FLIGHTS)
