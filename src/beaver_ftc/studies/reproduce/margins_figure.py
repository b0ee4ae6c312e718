"""The sensitivity as a figure: the ratio of each number and its limit over all settings."""

from math import inf
from textwrap import fill
from typing import TYPE_CHECKING, Any

from beaver_ftc.results.model import Document
from beaver_ftc.results.style import BLACK, BLUE, GREY, VERMILION
from beaver_ftc.studies.engine.statistics import or_never
from beaver_ftc.studies.reproduce.claims import BORNE_OUT, CANNOT_BE_JUDGED, NOT_BORNE_OUT, STRONGER

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEAST, _MOST = 1e-3, 10.0  # ends of the axis; a published ratio beyond is drawn at the end as an arrow
# Verdicts in the order of the rows from above. Testable statements that cannot be judged hold in their
# ablation.
_GROUPS = (NOT_BORNE_OUT, CANNOT_BE_JUDGED, BORNE_OUT, STRONGER)
_LINE = 60  # characters of a line of a label
# Looks of the range of a ratio over all settings, and of the ratio in the published setting.
_KEPT: Any = {"color": BLUE, "linewidth": 2.5, "alpha": 0.55}
_NOT_KEPT: Any = {"color": VERMILION, "linewidth": 6.0, "alpha": 0.55}
_PUBLISHED: Any = {"color": BLACK, "markersize": 5}
_CLIPPED = {_LEAST: "<", _MOST: ">"}  # marker of a ratio at an end of the axis


def shares(claim: Document) -> tuple[float, float, float]:
    """The lowest ratio, the ratio in the published setting, and the highest ratio of number and limit; at
    most 1 where the statement holds. If the number must be at least the limit, its lowest value has the
    highest ratio."""
    low, published, high = (_share(claim, claim[key]) for key in ("lowest", "number", "highest"))
    return min(low, published, high), published, max(low, published, high)


def _share(claim: Document, number: float | None) -> float:
    """number / limit, or limit / number if the number is to be at least the limit: 1 or less keeps the limit.
    0 / 0 is 0, a larger number / 0 infinite. A number that is None never comes, and counts as infinite."""
    size = or_never(number)
    limit = claim["limit"]
    numerator, denominator = (limit, size) if claim["at_least"] else (size, limit)
    if denominator:
        return numerator / denominator
    return inf if numerator > 0.0 else 0.0


def margins_figure(document: Document) -> "Figure":
    """A row for each testable statement, ordered by verdict: the range of its ratio over all settings in
    which it is flown, and the ratio in the published setting."""
    from matplotlib.figure import Figure

    claims = [claim for claim in document["claims"] if not claim["reason"] and not claim["construction"]]
    claims.sort(key=lambda claim: (_GROUPS.index(claim["verdict"]), -shares(claim)[1]))
    figure = Figure(figsize=(9.0, 1.2 + 0.31 * len(claims)), dpi=110)
    axes = figure.subplots(gridspec_kw={"left": 0.5, "right": 0.97, "top": 0.97, "bottom": 0.075})
    for row, claim in enumerate(claims):
        low, published, high = (min(max(share, _LEAST), _MOST) for share in shares(claim))
        axes.plot([low, high], [row, row], **(_KEPT if high <= 1 else _NOT_KEPT))
        axes.plot(published, row, _CLIPPED.get(published, "o"), **_PUBLISHED)
        if row and claim["verdict"] != claims[row - 1]["verdict"]:
            axes.axhline(row - 0.5, color=GREY, linewidth=1.0)
    axes.axvline(1.0, color=BLACK, linewidth=1.0)
    axes.set(xscale="log", xlim=(0.8 * _LEAST, 1.25 * _MOST), ylim=(len(claims) - 0.5, -0.5))
    axes.set_yticks(range(len(claims)), [_label(claim) for claim in claims], fontsize=8)
    axes.tick_params(axis="x", labelsize=8)
    axes.grid(axis="x", color="#dddddd", linewidth=0.6)
    axes.set_xlabel("ratio of number and limit (arrow: beyond the axis)", fontsize=9)
    axes.set_title("left of 1 the number keeps its limit", fontsize=9)
    axes.plot([], [], "o", label="as published", **_PUBLISHED)
    axes.plot([], [], label="all settings: always kept", **_KEPT)
    axes.plot([], [], label="all settings: not always kept", **_NOT_KEPT)
    axes.legend(
        loc="upper right", bbox_to_anchor=(1.0, -0.045), ncols=3, fontsize=8
    )  # below: no corner is free
    return figure


def _label(claim: Document) -> str:
    """The place of a statement in the paper, and its words, in at most two lines."""
    return fill("{where}: {statement}".format(**claim), _LINE, max_lines=2, placeholder=" ...")
