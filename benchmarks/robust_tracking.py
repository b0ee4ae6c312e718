"""How well the aircraft is flown after an elevator loss under real errors, beside one that is told the fault.

    python benchmarks/robust_tracking.py [flights]

Flies the first flights of each `robust-elevator-*` sweep three times, in the same air with the same noise:
with the fault-tolerant law, the oracle and the nominal law. Prints the RMS tracking error after the fault
over the oracle's, per axis of all flights together, in pitch flight by flight, and the elevator's path.
"""

import sys
from collections.abc import Iterator

import numpy as np
from rich.console import Console
from rich.table import Table

from beaver_ftc.loop.loop import fly
from beaver_ftc.loop.outcome import Landing
from beaver_ftc.scenario.sweeps import Sweep, load_sweep
from beaver_ftc.studies.sweep.sampling import Plan, flight_seed

CONDITIONS = ("sensors", "servo", "coefficients", "air", "all", "all-published")
LAWS = ("fault-tolerant", "oracle", "nominal")
FLIGHTS = 100


def flights(sweep: Sweep, count: int) -> Iterator[dict[str, Landing]]:
    """The same flight with each law, flight by flight."""
    for run, values in Plan(sweep).assignments(range(count)):
        scenario = sweep.scenario(values, seed=flight_seed(sweep.file.seed, run))
        yield {
            law: fly(
                scenario.model_copy(update={"control": scenario.control.model_copy(update={"law": law})})
            )
            for law in LAWS
        }


def row(condition: str, count: int) -> list[str]:
    """One line of the table."""
    flown = list(flights(load_sweep(f"robust-elevator-{condition}"), count))
    rms = {law: np.array([flight[law].post_fault_rms_rad_s for flight in flown]) for law in LAWS}
    together = np.sqrt((rms["fault-tolerant"] ** 2).mean(0) / (rms["oracle"] ** 2).mean(0))
    nominal = np.sqrt((rms["nominal"][:, 1] ** 2).mean() / (rms["oracle"][:, 1] ** 2).mean())
    one_by_one = rms["fault-tolerant"][:, 1] / rms["oracle"][:, 1]
    travel = {
        law: np.degrees([flight[law].surface_travel_rad["elevator"] for flight in flown]).mean()
        for law in LAWS
    }
    return [
        condition,
        *(f"{ratio:.2f}" for ratio in together),
        f"{np.median(one_by_one):.2f}",
        f"{np.quantile(one_by_one, 0.9):.2f}",
        f"{nominal:.1f}",
        f"{travel['fault-tolerant']:.0f}",
        f"{travel['oracle']:.0f}",
    ]


def main(count: int) -> None:
    """Print the table."""
    table = Table(
        "condition", "p", "q", "r", "q, median", "q, 90 %", "q, nominal", "elevator, deg", "oracle's, deg"
    )
    for condition in CONDITIONS:
        table.add_row(*row(condition, count))
    console = Console(width=120)
    console.print(f"RMS tracking error after the fault over the oracle's, {count} flights a condition")
    console.print(table)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else FLIGHTS)
