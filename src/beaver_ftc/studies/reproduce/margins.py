"""The sensitivity study as one picture: how far each number stays from its limit, whatever is changed."""

from math import inf
from pathlib import Path

from beaver_ftc.results.looks import BLUE, GREY, VERMILION
from beaver_ftc.results.metrics import Document

NAME = "sensitivity"
_LEAST, _MOST = 1e-3, 10.0  # of the axis: what is smaller is nothing, what is larger never happens


def shares(claim: Document) -> tuple[float, float, float]:
    """(lowest, ours, highest) number as shares of the limit, each at most 1 where the statement holds."""
    found = sorted(
        _share(claim[key], claim["limit"], claim["at_least"]) for key in ("lowest", "number", "highest")
    )
    return found[0], _share(claim["number"], claim["limit"], claim["at_least"]), found[-1]


def _share(number: float | None, limit: float, at_least: bool) -> float:
    if number is None:  # infinite: what never happens, or an error without end
        return 0.0 if at_least else inf
    if not at_least:
        return number / limit
    return limit / number if number else inf


def write_margins(document: Document, folder: Path) -> Path:
    """Draw a row a statement into `folder/sensitivity.png`: its range over the changes, and ours."""
    from matplotlib.figure import Figure

    claims = document["claims"]
    figure = Figure(figsize=(12.0, 0.6 + 0.28 * len(claims)), dpi=110)
    axes = figure.subplots(gridspec_kw={"left": 0.52, "right": 0.98, "top": 0.93, "bottom": 0.1})
    for row, claim in enumerate(claims):
        low, ours, high = (min(max(share, _LEAST), _MOST) for share in shares(claim))
        axes.plot([low, high], [row, row], color=BLUE if high <= 1 else VERMILION, linewidth=3, alpha=0.55)
        axes.plot(ours, row, "o", color=BLUE, markersize=5)
    axes.axvline(1.0, color=GREY, linewidth=1.0)
    axes.set_xscale("log")
    axes.set_xlim(0.8 * _LEAST, 1.25 * _MOST)
    axes.set_ylim(len(claims) - 0.5, -0.5)
    axes.set_yticks(range(len(claims)), [f"{c['where']}  {c['statement']}" for c in claims], fontsize=8)
    axes.tick_params(axis="x", labelsize=8)
    axes.grid(visible=True, axis="x", color="#dddddd", linewidth=0.6)
    axes.set_xlabel("share of what is allowed: dot as flown, bar over all changes", fontsize=9)
    axes.set_title("Left of 1 the statement holds", fontsize=9)
    path = folder / f"{NAME}.png"
    figure.savefig(path, metadata={"Software": "beaver-ftc"})
    return path
