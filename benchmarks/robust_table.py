"""The tables of docs/robustness.md, from the folders that the `robust-*` sweeps have left.

beaver-ftc sweep robust-elevator-all --out runs    # and so on
python benchmarks/robust_table.py [runs]
"""

import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from beaver_ftc.studies.engine.statistics import poisson, wilson

SOON_S = 0.5
FAULTS = ("sensors", "servo", "coefficients", "air", "all", "all-published")
HEALTHY = ("sensors", "servo", "coefficients", "air", "all")


def column(path: Path, name: str) -> np.ndarray:
    """One column of a sweep's results, None as NaN where it holds numbers."""
    values = pq.read_table(path, columns=[name]).column(0).to_pylist()
    if all(value is None or isinstance(value, float | int) for value in values):
        return np.array([np.nan if value is None else float(value) for value in values])
    return np.array(["" if value is None else value for value in values])


def fault_row(path: Path, condition: str) -> str:
    """Detection and isolation of one condition."""
    delay = np.nan_to_num(column(path, "detection.delay_s"), nan=np.inf)
    found = np.isfinite(delay)
    soon = delay <= SOON_S + 1e-9
    rate = wilson(int(soon.sum()), len(delay))
    right = column(path, "isolation.correct") == 1.0
    times = [np.quantile(delay, share, method="higher") for share in (0.5, 0.95, 0.99)]
    cells = [
        condition,
        f"{found.mean():.1%}",
        f"{rate.value:.1%} ({rate.low:.1%} to {rate.high:.1%})",
        *(f"{time:.3f} s" if np.isfinite(time) else "never" for time in times),
        f"{int((right & found).sum())} of {int(found.sum())}",
        f"{int(column(path, 'false_alarm').sum())}",
    ]
    return f"| {' | '.join(cells)} |"


def healthy_row(path: Path, condition: str) -> str:
    """False alarms of one condition."""
    hours = column(path, "fault_free_s").sum() / 3600.0
    alarms = int(column(path, "false_alarm").sum())
    high = poisson(alarms, hours).high
    closest = column(path, "worst_residual_ratio").max()
    return f"| {condition} | {hours:.1f} | {alarms} | {high:.3f} | {closest:.2f} |"


def main(folder: Path) -> None:
    """Print what there is."""
    print(
        "| condition | detected | within 0.5 s (95 %) | median | 95 % | 99 % | named rightly | false alarms |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for condition in FAULTS:
        path = folder / f"robust-elevator-{condition}" / "results.parquet"
        if path.is_file():
            print(fault_row(path, condition))
    print("\n| condition | hours | false alarms | at most, per hour (95 %) | closest approach |")
    print("|---|---|---|---|---|")
    for condition in HEALTHY:
        path = folder / f"robust-healthy-{condition}" / "results.parquet"
        if path.is_file():
            print(healthy_row(path, condition))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("runs"))
