"""The share found in a grid of flights, by schemes: as sentences, a table, a figure and files."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import product
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.results.model import Document
from beaver_ftc.results.style import SERIES
from beaver_ftc.studies.compare.rivals import leader
from beaver_ftc.studies.detectability.probabilities import (
    JUDGED_S,
    SIGNIFICANT,
    Row,
    informed_shares,
    summary,
    title_of,
)
from beaver_ftc.studies.detectability.schemes import BOTH, BUILT_IN, WATCHED_S, WITHIN_S
from beaver_ftc.studies.detectability.shown import NAME, SOON, Line, table
from beaver_ftc.studies.present.figures import GRID, draw_estimates, label_edges, marker, panels
from beaver_ftc.studies.present.page import Part, Pictures, Summary, study_files
from beaver_ftc.studies.present.tables import bare_percent, grouped, percent, seconds

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OWN = ", default level"
INFORMED = "informed test"
_NO_DUEL = {"seeds_theirs": 0, "seeds_ours": 0, "p": 1.0}


def page_of(document: Document) -> tuple[str, Sequence[Part]]:
    """The title, and the parts of the page: sentences, picture, table and notes."""
    conditions = document["grid"]["conditions"]
    sentences = [
        f"{title_of(*where)}, {sentence}"
        for where in conditions
        for sentence in who_is_better(document, *where)
    ]
    sentences += comparison(document)
    sentences += [f"could not be judged: {failure}" for failure in document["failures"]]
    lines = [line for condition in conditions for line in _scheme_lines(document, *condition)]
    picture = Pictures([("share of the losses that each scheme detects", NAME)])
    return "Detectability: schemes on the same flights", [
        *sentences,
        picture,
        table(lines),
        *_legend(document),
    ]


def _scheme_lines(document: Document, sensors: str, turbulence: str) -> Iterator[Line]:
    """A line for each surface and scheme under a condition, our schemes also at their default level; then the
    informed test."""
    condition = {"sensors": sensors, "turbulence": turbulence}
    for surface in document["grid"]["surfaces"]:
        place = {"loss of": surface, "flown": title_of(sensors, turbulence)}
        for level in _matching(document["levels"], **condition):
            total = next(
                _matching(document["totals"], **condition, scheme=level["scheme"], surface=surface), None
            )
            row = place | {"scheme": level["scheme"], "false alarms/h": _rate(level["calibration"])}
            yield row | {"before faults/h": _rate(level["before_faults"])} | _share_cells(total)
            if level["scheme"] in BUILT_IN:
                row |= {"scheme": f"{level['scheme']}{OWN}", "false alarms/h": _rate(level["own_level"])}
                yield row | _share_cells(total and total["own_level"])
        for informed in _matching(document["limits"], **condition, surface=surface):
            shares = "/".join(map(bare_percent, informed["within"].values()))
            yield place | {"scheme": INFORMED, SOON: shares}


def _share_cells(total: Document | None) -> Line:
    """The shares found within each of WITHIN_S in per cent, the median delay and the number of flights."""
    if not total or not total["flights"]:
        return {SOON: "-"}
    shares = "/".join(bare_percent(total["within"][f"{within_s:g}"]["value"]) for within_s in WITHIN_S)
    return {SOON: shares, "median delay": seconds(total["median_delay_s"]), "flights": str(total["flights"])}


def who_is_better(
    document: Document, sensors: str, turbulence: str, within_s: float = WATCHED_S
) -> Iterator[str]:
    """A sentence for each surface under a condition: the scheme that finds most faults within `within_s`. Of
    our schemes, only BOTH is compared."""
    condition = {"sensors": sensors, "turbulence": turbulence}
    soon = f"{within_s:g}"
    for surface in document["grid"]["surfaces"]:
        place = condition | {"surface": surface}
        rows = dict[str, Document]()
        for total in _matching(document["totals"], **place):
            scheme = total["scheme"]
            if total["flights"] and (scheme == BOTH or scheme not in BUILT_IN):
                estimate = total["within"][soon]
                pair = {"against": scheme, "ours": BOTH, "within_s": within_s}
                line = next(_matching(document["comparison"], **place, **pair), _NO_DUEL)
                duel = {"better": line["seeds_theirs"], "worse": line["seeds_ours"], "p": line["p"]}
                rates = {
                    "rate": estimate["value"],
                    "rate_low": estimate["low"],
                    "rate_high": estimate["high"],
                }
                rows[scheme] = rates | {"against_ours": duel}
        if BOTH in rows:
            yield leader(rows, BOTH, "rate", f"{surface}, found within {soon} s", percent)


def comparison(document: Document) -> list[str]:
    """In how many comparisons each of our schemes finds significantly more or fewer faults than another
    scheme."""
    sentences = []
    for (ours, within_s), duels in grouped(document["comparison"], "ours", "within_s").items():
        n = Counter(duel["verdict"] for duel in duels)
        sentences.append(
            f"{ours}, faults found within {within_s:g} s, {len(duels)} comparisons: better in "
            f"{n['better']}, worse in {n['worse']}, no difference at p < {SIGNIFICANT:g} in the rest"
        )
    return sentences


def _matching(lines: Sequence[Document], **where: Any) -> Iterator[Document]:
    """The lines that have all these values."""
    return (line for line in lines if where.items() <= line.items())


def _rate(alarms: Document | None) -> str:
    """A rate of false alarms with its interval, 1/h."""
    if alarms is None or alarms["per_h"] is None:
        return "-"
    high = "" if alarms["per_h_high"] is None else f" to {alarms['per_h_high']:.0f}"
    return f"{alarms['per_h']:.0f} ({alarms['per_h_low']:.0f}{high})"


def _legend(document: Document) -> list[str]:
    """The notes below the table."""
    grid = document["grid"]
    per_h = document["false_alarms_per_h"]
    hours = min((level["calibration"]["hours"] for level in document["levels"]), default=0.0)
    losses = ", ".join(f"{100 * magnitude:g}" for magnitude in grid["magnitudes"])
    references = ", ".join(f"{excitation:g}" for excitation in grid["excitations_deg_s"])
    return [
        f"Losses of {losses} % under references of {references} deg/s. False alarms/h: every scheme at the "
        f"level of its statistic with at most {per_h:g} per hour, on the same {hours:.2f} h of healthy "
        "flight (95 % limits); before faults/h: the same on other flights.",
        f"By chance alone {100.0 * per_h * WATCHED_S / 3600.0:.1f} % are detected within {WATCHED_S:g} s. "
        "Default level: the one that follows from what the scheme declares.",
        f"{INFORMED}: knows surface, magnitude and instant, and the gusts that the vanes show; made once in "
        "that time at the same rate. Plug-ins are given every reading that the statistical scheme uses.",
    ]


def draw_schemes(document: Summary) -> "Figure":
    """A row of panels for each condition, a column for each surface. In a panel, each scheme has a line of
    dots: the share detected of each magnitude."""
    rows: Sequence[Row] = document.behind
    surfaces = document["grid"]["surfaces"]
    conditions = document["grid"]["conditions"]
    names = [*dict.fromkeys(row["scheme"] for row in rows), INFORMED]
    rate = f"at most {document['false_alarms_per_h']:g} false alarms per hour"
    figure, axes = panels(
        len(conditions), len(surfaces), 2.3 * len(surfaces) + 1.7,
        (0.3 * len(names) + 0.6) * len(conditions) + 1.2, f"Loss of effectiveness, {rate}, all references",
        dpi=120, sharex=True, sharey=True,
    )  # fmt: skip
    rows_of_panel = grouped(rows, "sensors", "turbulence", "surface")
    for panel, (condition, surface) in zip(axes.flat, product(conditions, surfaces), strict=True):
        _draw(panel, rows_of_panel.get((*condition, surface), []), names, document)
    label_edges(
        axes, f"detected within {JUDGED_S:g} s, %",
        [title_of(*condition).replace(", ", ",\n") for condition in conditions], surfaces,
    )  # fmt: skip
    n_excitations = len(document["grid"]["excitations_deg_s"])
    flights = [n_excitations * cell["flights"] for cell in document["cells"]]
    figure.legend(
        *axes[0][0].get_legend_handles_labels(), loc="outside lower center",
        ncols=len(document["grid"]["magnitudes"]), fontsize=8, frameon=False, title_fontsize=8,
        title=f"of {min(flights, default=0)} to {max(flights, default=0)} flights, exact 95 % interval",
    )  # fmt: skip
    return figure


def _draw(panel: "Axes", rows: Sequence[Row], names: Sequence[str], document: Document) -> None:
    """The share that each scheme detects, with its exact 95 % interval, and that of the informed test.
    Magnitudes are drawn below one another, `apart` from line to line."""
    magnitudes = document["grid"]["magnitudes"]
    within = f"{JUDGED_S:g}"
    apart = 0.6 / len(magnitudes)
    for place, magnitude in enumerate(magnitudes):
        rows_of_magnitude = [row for row in rows if row["magnitude"] == magnitude]
        cells = {scheme: summary(group) for (scheme,), group in grouped(rows_of_magnitude, "scheme").items()}
        shares = {scheme: cell["within"][within] for scheme, cell in cells.items() if cell["flights"]}
        if rows_of_magnitude:
            informed = informed_shares(rows_of_magnitude, document["false_alarms_per_h"])[within]
            shares[INFORMED] = {"value": informed, "low": informed, "high": informed}
        lines = [names.index(name) + apart * (place - 0.5 * (len(magnitudes) - 1)) for name in shares]
        draw_estimates(
            panel, lines, [*shares.values()], 100.0, across=True, linestyle="none", marker=marker(place),
            markersize=4.5, color=SERIES[place], elinewidth=1.0, clip_on=False,
            label=f"{100 * magnitude:g} % lost",
        )  # fmt: skip
    panel.set_yticks(range(len(names)), names)
    panel.set_ylim(len(names) - 0.5, -0.5)
    panel.set_xlim(-2, 102)
    panel.grid(axis="x", alpha=0.3)
    panel.hlines(np.arange(len(names) - 1) + 0.5, -2, 102, color=GRID, linewidth=0.6)
    panel.tick_params(labelsize=8)


FILES = study_files(NAME, page_of, {NAME: attrgetter("behind")}, {NAME: draw_schemes})
