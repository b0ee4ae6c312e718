"""The map of isolability: from which size on a loss of one surface excludes another surface, and how soon.

A pair is a surface that loses effectiveness and another surface that could explain the innovation. For each
pair the map has, along a flight: the smallest loss for which the other surface is excluded in time, and the
time until a total loss excludes it; for every instant at which the loss may begin, and for half of them. It
also has the smallest doublet that is certain to distinguish losses of the two surfaces in straight flight,
which `separate` finds.
"""

from collections.abc import Sequence
from itertools import permutations, product
from math import inf

import numpy as np

from beaver_ftc.plugins import offered
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.engine.statistics import quantile

LOSS_COLUMNS = ("magnitude", "magnitude_median", "longest_s", "median_s")
DOUBLET_COLUMNS = ("doublet_deg", "doublet_s", "why")
WITHOUT_DOUBLETS = dict(
    zip(DOUBLET_COLUMNS, (None, None, "no installed package offers 'doublets'"), strict=True)
)
TABLE_HEAD = (
    "loss of", "other surface", "reference scale", "half of onsets: loss", "delay", "all onsets: places",
    "loss", "delay", "doublet",
)  # fmt: skip
DISTINGUISHED_LOSS = 0.5  # share of effectiveness lost: of both losses that a doublet distinguishes
TABLE_CAPTION = (
    "Loss: the smallest loss for which the other surface is excluded within a second. Delay: the time\n"
    "until a total loss excludes it. Both for half of the possible start times, and for all of them at\n"
    "so many places. Doublet: the smallest one in straight flight that is certain to distinguish losses\n"
    f"of {100 * DISTINGUISHED_LOSS:.0f} %. All values are those of the worst place."
)


def loss_limits(excluded: np.ndarray, frames: int, dt: float) -> Document:
    """Limits of one pair along a flight, by LOSS_COLUMNS; None for a limit that no loss reaches.

    excluded (n,): smallest loss, a share of 1, for which the frame alone excludes the other surface; inf
    where no loss does. frames: number of frames within which the other surface has to be excluded. dt s: of a
    frame. A delay includes the frame in which the loss begins.
    """
    least = np.sort(np.lib.stride_tricks.sliding_window_view(excluded, frames).min(axis=1))
    n = len(excluded)
    next_exclusion = np.where(excluded <= 1.0, np.arange(n), n)
    next_exclusion = np.minimum.accumulate(next_exclusion[::-1])[::-1]
    delay_s = np.where(next_exclusion < n, (next_exclusion - np.arange(n) + 1) * dt, inf)
    delay_s = np.sort(delay_s[: len(least)])
    found = least[-1], quantile(least, 0.5), delay_s[-1], quantile(delay_s, 0.5)
    return {name: float(x) if x < inf else None for name, x in zip(LOSS_COLUMNS, found, strict=True)}


def smallest_doublets(scenario: Scenario, after_s: float) -> dict[tuple[str, str], Document]:
    """By pair of surfaces: the smallest doublet, flown after_s into a healthy flight, that distinguishes
    losses of DISTINGUISHED_LOSS of the two; or why there is none."""
    find = offered("doublets")
    pairs = permutations(scenario.airframe.class_of_losses, 2)
    return find(scenario, after_s, DISTINGUISHED_LOSS) if find else dict.fromkeys(pairs, WITHOUT_DOUBLETS)


def rows_without_result(faults: Sequence[str], why: str) -> list[Document]:
    """The rows, one a pair of surfaces, of a place that has no result, with the reason `why`."""
    none = dict.fromkeys((*LOSS_COLUMNS, *DOUBLET_COLUMNS)) | {"why": why}
    return [{"fault": fault, "other": other, **none} for fault, other in permutations(faults, 2)]


def _largest(rows: Sequence[Document], key: str) -> float | None:
    """The largest value over these places; None if a place has no value, or if there are no places."""
    values = [row[key] for row in rows]
    return None if None in values or not values else max(values)


def _worst_of_places(rows: Sequence[Document]) -> Document:
    """Worst values of a pair over all places with one excitation; `always`: over the places where a loss is
    excluded at every instant, whose number is `at`."""
    certain = [row for row in rows if row["magnitude"] is not None]
    return {
        "half": (_largest(rows, "magnitude_median"), _largest(rows, "median_s")),
        "always": (_largest(certain, "magnitude"), _largest(certain, "longest_s")),
        "at": f"{len(certain)}/{len(rows)}",
        "doublet": (_largest(rows, "doublet_deg"), _largest(rows, "doublet_s")),
    }


def worst_by_pair(rows: Sequence[Document]) -> dict[tuple[str, str, float], Document]:
    """(fault, other, excitation) -> worst values over the places, in the order of the rows."""
    pairs = dict.fromkeys((row["fault"], row["other"]) for row in rows)
    found = {}
    for pair, scale in product(pairs, sorted({row["excitation"] for row in rows})):
        of = [row for row in rows if (row["fault"], row["other"], row["excitation"]) == (*pair, scale)]
        found[*pair, scale] = _worst_of_places(of)
    return found


def table(rows: Sequence[Document]) -> list[tuple[str, ...]]:
    """The rows below TABLE_HEAD: one for each pair and excitation."""
    cells: list[tuple[str, ...]] = []
    for (fault, other, scale), of in worst_by_pair(rows).items():
        half, always = (loss_and_delay(*of[how]) for how in ("half", "always"))
        cells.append((fault, other, f"{scale:g}", *half, of["at"], *always, _doublet_cell(*of["doublet"])))
    return cells


def loss_and_delay(magnitude: float | None, seconds: float | None) -> tuple[str, str]:
    return "-" if magnitude is None else f"{magnitude:.2f}", "-" if seconds is None else f"{seconds:.2f} s"


def _doublet_cell(amplitude_deg: float | None, seconds: float | None) -> str:
    return "-" if amplitude_deg is None else f"{amplitude_deg:.1f} deg, {seconds:.2f} s"


def cell_line(how: str, of: Document) -> str:
    """The line of a cell for `half` or `always` (how) of the instants."""
    found = "none" if of[how][0] is None else ", ".join(loss_and_delay(*of[how]))
    return f"{how}: {found}" + (f" ({of['at']})" if how == "always" else "")
