"""The answers of `detectability` as sentences, one table, figures and files.

There are three kinds of documents, by what they hold: `points` (what is certain, by places), `compared` (the
size found in a share of flights, by variants of a scenario) and `cells` (the share found in a grid of
flights, by schemes). The lines of all three have the columns of HEAD; what no line has is no column.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.results.metrics import NEAR_THRESHOLD_SHARE, as_json
from beaver_ftc.results.model import Document
from beaver_ftc.results.style import SERIES
from beaver_ftc.studies.compare.scores import leader
from beaver_ftc.studies.detectability.certain import upwards
from beaver_ftc.studies.detectability.isolability import DISTINGUISHED_LOSS
from beaver_ftc.studies.detectability.probabilities import (
    JUDGED_S,
    SIGNIFICANT,
    Row,
    limit,
    summary,
    title_of,
)
from beaver_ftc.studies.detectability.schemes import BOTH, BUILT_IN, WATCHED_S, WITHIN_S
from beaver_ftc.studies.present.figures import GRID, draw_estimates, heat_map, label_edges, marker, panels
from beaver_ftc.studies.present.page import Makers, Part, Pictures, Table, study_files
from beaver_ftc.studies.present.tables import grouped, percent, seconds

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAME = "detectability"
SOON = f"found within {'/'.join(f'{s:g}' for s in WITHIN_S)} s, %"
HEAD = (
    "loss of", "taken for", "flown", "scheme", "certain from", "half of onsets from", "delay", "half: delay",
    "doublet", "doublet time", "found in 90 % from", "95 % interval", "flights", "false alarms/h",
    "before faults/h", SOON, "median delay",
)  # fmt: skip
OWN = ", default level"
INFORMED = "informed test"
Line = dict[str, str]  # cells by their column of HEAD


def page_of(document: Document) -> tuple[str, Sequence[Part]]:
    """The title, and the parts of a page: sentences, table and notes; the text has no pictures."""
    if "points" in document:
        return _places(document)
    return _sizes(document) if "compared" in document else _schemes(document)


def table(lines: Sequence[Line]) -> Table:
    """The one table, of the columns that these lines have."""
    head = [name for name in HEAD if any(name in line for line in lines)]
    return Table(head, [[line.get(name, "") for name in head] for line in lines])


# What is certain, by places.

CERTAIN = (
    "From the smallest loss at the best place to that at the worst, of so many places where some loss is\n"
    "certain to be detected and isolated in time, whenever it starts and at half of the start times.\n"
    "Taken for: the same until the other surface alone is excluded. Delay: until a total loss excludes it.\n"
    f"Doublet: the smallest that distinguishes losses of {percent(DISTINGUISHED_LOSS)} in straight flight."
)


def _places(document: Document) -> tuple[str, Sequence[Part]]:
    of_faults = sorted(document["points"], key=itemgetter("fault"))
    points = grouped(of_faults, "fault", "excitation").items()
    lines = [
        {"loss of": fault, "flown": _times(scale)} | _spans(of, "isolated") for (fault, scale), of in points
    ]
    of_pairs = sorted(document["pairs"], key=itemgetter("fault", "other"))
    for (fault, other, scale), of in grouped(of_pairs, "fault", "other", "excitation").items():
        shown = _spans(of, "magnitude") | {
            "delay": _span(of, "longest_s", seconds), "half: delay": _span(of, "median_s", seconds),
            "doublet": _span(of, "doublet_deg", lambda deg: f"{deg:.1f} deg"),
            "doublet time": _span(of, "doublet_s", seconds),
        }  # fmt: skip
        lines.append({"loss of": fault, "taken for": other, "flown": _times(scale), **shown})
    drawn = Pictures([("smallest loss that is distinguished from each other surface", NAME)])
    said = conclusions(document["points"])
    return f"Detectability: {document['scenario']}", [*said, table(lines), CERTAIN, drawn]


def _times(scale: float) -> str:
    return f"{scale:g} x reference"


def _spans(rows: Sequence[Document], key: str) -> Line:
    return {"certain from": _span(rows, key), "half of onsets from": _span(rows, f"{key}_median")}


def _span(rows: Sequence[Document], key: str, form: Callable[[float], str] = percent) -> str:
    """From the least to the largest value over the places that have one, and how many these are."""
    known = [row[key] for row in rows if row[key] is not None]
    ends = dict.fromkeys(map(form, (min(known), max(known)))) if known else ["-"]
    return f"{' to '.join(ends)} ({len(known)}/{len(rows)})"


def conclusions(rows: Sequence[Document]) -> list[str]:
    """One sentence a fault, at the excitation nearest to the scenario's own references."""
    scale = min((row["excitation"] for row in rows), key=lambda of: abs(of - 1.0))
    chosen = [row for row in rows if row["excitation"] == scale]
    return [_conclusion(fault, scale, of) for (fault,), of in grouped(chosen, "fault").items()]


def _conclusion(fault: str, scale: float, rows: Sequence[Document]) -> str:
    certain = [row["isolated"] for row in rows if row["isolated"] is not None]
    reference = "the scenario's references" if scale == 1.0 else f"{scale:g} times the scenario's references"
    if not certain:
        worst = min(rows, key=lambda row: (row["detected"] is not None, row["why"]))
        return f"{fault}: at {reference} no loss is certain to be detected and isolated ({worst['why']})."
    places = "all" if len(certain) == len(rows) else f"{len(certain)} of"
    return (
        f"{fault}: at {reference} a loss of {upwards(max(certain))} or more is certain to be detected and "
        f"isolated at {places} {len(rows)} places."
    )


def draw_pairs(document: Document) -> "Figure":
    """A panel an excitation: rows what loses effectiveness, columns what it could be taken for."""
    pairs = grouped(document["pairs"], "excitation")
    faults = [*dict.fromkeys(row["fault"] for row in document["pairs"])]
    title = (
        f"{document['scenario']}: smallest loss distinguished from that of another surface, and places\n"
        "(upper numbers: at half of the instants; lower numbers: at every instant; hatched: no loss)"
    )
    size = len(pairs) * (1.55 * len(faults) + 0.3) + 1.2, 0.65 * len(faults) + 1.6
    figure, grid = panels(1, len(pairs), *size, title, sharey=True)
    for axes, ((scale,), rows) in zip(grid[0], pairs.items(), strict=True):
        values, texts = np.full((len(faults), len(faults)), np.nan), {}
        for (fault, other), of in grouped(rows, "fault", "other").items():
            at, half = (faults.index(fault), faults.index(other)), [row["magnitude_median"] for row in of]
            values[at] = np.nan if None in half else max(half)
            texts[at] = "\n".join(reversed(_spans(of, "magnitude").values())), "black"
        look: dict[str, Any] = {"cmap": "viridis_r", "vmin": 0.0, "vmax": 1.0, "alpha": 0.6}
        image = heat_map(axes, values, texts, faults, faults, 7, **look)
        axes.set_title(_times(scale), fontsize=9)
    label_edges(grid, "taken for", ["loss of"])
    figure.colorbar(image, ax=grid, label="smallest loss (half), share", shrink=0.6)
    return figure


# The size found in a share of flights, by variants of a scenario.


def _sizes(document: Document) -> tuple[str, Sequence[Part]]:
    lines = [
        {
            "loss of": document["surface"], "flown": row["variant"],
            "certain from": percent(row["certain"]["size"]),
            "found in 90 % from": percent(row["found"]["size"]), "95 % interval": _interval(row["found"]),
            "flights": str(row["found"]["flights"]),
        }
        for row in _variants(document)
    ]  # fmt: skip
    title = f"Detectability: {document['surface']} of {document['scenario']}"
    return title, [*_size_sentences(document), table(lines)]


def _variants(document: Document) -> list[Document]:
    return [document, *document["compared"]]


def _size_sentences(document: Document) -> Iterator[str]:
    """What is certain, what is found, what limits it, and what would help."""
    certain, found, total = (document[key] for key in ("certain", "found", "total_loss"))
    surface, within = document["surface"], f"within {document['within_s']:g} s"
    nothing = f"not even a total loss of {surface}"
    loss = "a loss of {} of the effectiveness of " + surface
    size = nothing if certain["size"] is None else f"{loss.format(percent(certain['size']))} and more"
    yield (
        f"Certain to be detected {within}, whatever the declared uncertainty does: {size} (a total loss: in "
        f"{certain['at_total_loss']} of {certain['flights']} flights)."
    )
    size = nothing if found["size"] is None else loss.format(f"{percent(found['size'])} ({_interval(found)})")
    yield (
        f"Found {within} in {percent(document['share'])} of flights: {size} (a total loss: in "
        f"{percent(total['value'])}, {percent(total['low'], '')} to {percent(total['high'])}; "
        f"{total['count']} of {total['of']} flights). Intervals: 95 %."
    )
    yield from (
        f"Nothing can be concluded in part of these flights: {why}." for why in document["inconclusive"]
    )
    if document["bound_used"] >= NEAR_THRESHOLD_SHARE:
        yield (
            f"Half of these flights use {percent(document['bound_used'])} of the bound or more before the "
            "loss: the size found then measures the uncertainty that the scenario flies with, not the "
            "diagnosis."
        )
    for count, what in (
        (document["false_alarms"], "have an alarm before the loss"),
        (document["failed"], "cannot be flown to the end"),
    ):
        if count:
            yield f"{count} flights with a total loss {what}: these count as not found."
    for lead, tried, references in (
        ("What limits it most", "nothing that was left out alone", False),
        ("Which reference would help", "none of those that were tried", True),
    ):
        best = _best(document, references)
        none = f"{tried} makes a difference outside of the intervals"
        yield f"{lead}: {none if best is None else _effect(best)}."


def _is_better(other: Document, document: Document) -> bool:
    """Whether a variant finds smaller losses, by intervals that do not overlap; where no loss is found often
    enough, whether a total one is found more often."""
    found, base = other["found"], document["found"]
    if base["size"] is None:
        return bool(other["total_loss"]["low"] > document["total_loss"]["high"])
    return found["high"] is not None and base["low"] is not None and bool(found["high"] < base["low"])


def _best(document: Document, references: bool) -> Document | None:
    """The variant that helps most, of those that change a reference, or of the others."""
    some = [
        row
        for row in document["compared"]
        if ("reference" in row["variant"]) is references and _is_better(row, document)
    ]
    return min(some, key=lambda row: (row["found"]["size"] or 2.0, -row["total_loss"]["value"]), default=None)


def _effect(row: Document) -> str:
    found, total = row["found"], row["total_loss"]
    if found["size"] is None:
        return f"{row['variant']}, a total loss is found in {percent(total['value'])} of flights"
    return f"{row['variant']}, it would be {percent(found['size'])} ({_interval(found)})"


def _interval(found: Document) -> str:
    if found["low"] is None:
        return "more than a total loss"
    if found["low"] == found["high"]:
        return percent(found["low"])
    low = percent(found["low"], "")
    return f"{low} % or more" if found["high"] is None else f"{low} to {percent(found['high'])}"


def rows_of_sizes(document: Document) -> list[Document]:
    """The rows of the CSV file."""
    return [
        {
            "variant": row["variant"], "found": row["found"], "certain": row["certain"],
            "total_loss_found": row["total_loss"]["value"],
        }
        for row in _variants(document)
    ]  # fmt: skip


# The share found in a grid of flights, by schemes.


def _schemes(document: Document) -> tuple[str, Sequence[Part]]:
    conditions = document["grid"]["conditions"]
    said = [f"{title_of(*where)}, {one}" for where in conditions for one in who_is_better(document, *where)]
    said += comparison(document)
    said += [f"could not be judged: {failure}" for failure in document["failures"]]
    lines = [line for condition in conditions for line in _scheme_lines(document, *condition)]
    drawn = Pictures([("share of the losses that each scheme detects", NAME)])
    return "Detectability: schemes on the same flights", [*said, drawn, table(lines), *_legend(document)]


def _scheme_lines(document: Document, sensors: str, turbulence: str) -> Iterator[Line]:
    """A line a surface and scheme; ours of both detectors also at its default level."""
    here = {"sensors": sensors, "turbulence": turbulence}
    for surface in document["grid"]["surfaces"]:
        place = {"loss of": surface, "flown": title_of(sensors, turbulence)}
        for level in _those(document["levels"], **here):
            found = next(_those(document["totals"], **here, scheme=level["scheme"], surface=surface), None)
            row = place | {"scheme": level["scheme"], "false alarms/h": _rate(level["calibration"])}
            yield row | {"before faults/h": _rate(level["before_faults"])} | _soon(found)
            if level["scheme"] in BUILT_IN:
                row |= {"scheme": f"{level['scheme']}{OWN}", "false alarms/h": _rate(level["own_level"])}
                yield row | _soon(found and found["own_level"])
        for known in _those(document["limits"], **here, surface=surface):
            shares = "/".join(percent(share, "") for share in known["within"].values())
            yield place | {"scheme": INFORMED, SOON: shares}


def _soon(found: Document | None) -> Line:
    """Per cent found within each delay, and the median delay."""
    if not found or not found["flights"]:
        return {SOON: "-"}
    shares = "/".join(percent(found["within"][f"{within_s:g}"]["value"], "") for within_s in WITHIN_S)
    return {SOON: shares, "median delay": seconds(found["median_delay_s"]), "flights": str(found["flights"])}


def who_is_better(
    document: Document, sensors: str, turbulence: str, within_s: float = WATCHED_S
) -> Iterator[str]:
    """Of a condition, a sentence a surface: who finds most faults so soon."""
    here, soon = {"sensors": sensors, "turbulence": turbulence}, f"{within_s:g}"
    for surface in document["grid"]["surfaces"]:
        place, rows = here | {"surface": surface}, dict[str, Document]()
        for total in _those(document["totals"], **place):
            if total["flights"] and (total["scheme"] == BOTH or total["scheme"] not in BUILT_IN):
                found, duel = total["within"][soon], {"better": 0, "worse": 0, "p": 1.0}
                against = {"against": total["scheme"], "ours": BOTH, "within_s": within_s}
                for one in _those(document["comparison"], **place, **against):
                    duel = {"better": one["seeds_theirs"], "worse": one["seeds_ours"], "p": one["p"]}
                rates = {"rate": found["value"], "rate_low": found["low"], "rate_high": found["high"]}
                rows[total["scheme"]] = rates | {"against_ours": duel}
        if BOTH in rows:
            yield leader(rows, BOTH, "rate", f"{surface}, found within {soon} s", percent, more=True)


def comparison(document: Document) -> list[str]:
    """How often each of our schemes finds more or fewer faults than others, and is unlikely to by chance."""
    return [
        f"{ours}, faults found within {within_s:g} s, {len(duels)} comparisons: better in "
        f"{ends['better']}, worse in {ends['worse']}, no difference at p < {SIGNIFICANT:g} in the rest"
        for (ours, within_s), duels in grouped(document["comparison"], "ours", "within_s").items()
        for ends in [Counter(duel["verdict"] for duel in duels)]
    ]


def _those(lines: Sequence[Document], **where: Any) -> Iterator[Document]:
    return (line for line in lines if where.items() <= line.items())


def _rate(alarms: Document | None) -> str:
    if alarms is None or alarms["per_h"] is None:
        return "-"
    high = "" if alarms["per_h_high"] is None else f" to {alarms['per_h_high']:.0f}"
    return f"{alarms['per_h']:.0f} ({alarms['per_h_low']:.0f}{high})"


def _legend(document: Document) -> list[str]:
    grid, per_h = document["grid"], document["false_alarms_per_h"]
    hours = min((level["calibration"]["hours"] for level in document["levels"]), default=0.0)
    losses = ", ".join(f"{100 * magnitude:g}" for magnitude in grid["magnitudes"])
    references = ", ".join(f"{excitation:g}" for excitation in grid["excitations_deg_s"])
    return [
        f"Losses of {losses} % under references of {references} deg/s. False alarms/h: every scheme at the "
        f"level of its statistic with at most {per_h:g} per hour, on the same {hours:.2f} h of healthy "
        "flight (95 % limits); before faults/h: the same on other flights.",
        f"By chance alone {per_h * WITHIN_S[-1] / 36.0:.1f} % are detected within {WITHIN_S[-1]:g} s. "
        "Default level: the one that follows from what the scheme declares.",
        f"{INFORMED}: knows surface, magnitude and instant, and the gusts that the vanes show; made once in "
        "that time at the same rate. Plug-ins are given every reading that the statistical scheme uses.",
    ]


def draw_schemes(document: Document, rows: Sequence[Row]) -> "Figure":
    """Rows air, columns surfaces; in each, a line of dots a scheme: the share detected, a dot a magnitude."""
    surfaces, conditions = document["grid"]["surfaces"], document["grid"]["conditions"]
    names = [*dict.fromkeys(row["scheme"] for row in rows), INFORMED]
    most = f"at most {document['false_alarms_per_h']:g} false alarms per hour"
    figure, axes = panels(
        len(conditions), len(surfaces), 2.3 * len(surfaces) + 1.7,
        (0.3 * len(names) + 0.6) * len(conditions) + 1.2, f"Loss of effectiveness, {most}, all references",
        dpi=120, sharex=True, sharey=True,
    )  # fmt: skip
    here = grouped(rows, "sensors", "turbulence", "surface")
    for panel, (condition, surface) in zip(axes.flat, product(conditions, surfaces), strict=True):
        _draw(panel, here.get((*condition, surface), []), names, document)
    label_edges(
        axes, f"detected within {JUDGED_S:g} s, %",
        [title_of(*condition).replace(", ", ",\n") for condition in conditions], surfaces,
    )  # fmt: skip
    each = len(document["grid"]["excitations_deg_s"])
    flights = [each * cell["flights"] for cell in document["cells"]]
    figure.legend(
        *axes[0][0].get_legend_handles_labels(), loc="outside lower center",
        ncols=len(document["grid"]["magnitudes"]), fontsize=8, frameon=False, title_fontsize=8,
        title=f"of {min(flights, default=0)} to {max(flights, default=0)} flights, exact 95 % interval",
    )  # fmt: skip
    return figure


def _draw(panel: "Axes", rows: Sequence[Row], names: Sequence[str], document: Document) -> None:
    """Of each scheme the share detected with its exact 95 % interval, magnitudes below one another."""
    magnitudes, within = document["grid"]["magnitudes"], f"{JUDGED_S:g}"
    apart = 0.6 / len(magnitudes)
    for place, magnitude in enumerate(magnitudes):
        here = [row for row in rows if row["magnitude"] == magnitude]
        found = {scheme: summary(of) for (scheme,), of in grouped(here, "scheme").items()}
        shares = {scheme: cell["within"][within] for scheme, cell in found.items() if cell["flights"]}
        if here:
            found_by_it = limit(here, document["false_alarms_per_h"])[within]
            shares[INFORMED] = {"value": found_by_it, "low": found_by_it, "high": found_by_it}
        lines = [names.index(of) + apart * (place - 0.5 * (len(magnitudes) - 1)) for of in shares]
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


OF_PLACES: Makers = study_files(
    NAME, page_of, {NAME: itemgetter("points"), "isolability": itemgetter("pairs")},
    {NAME: draw_pairs},
)  # fmt: skip
OF_SIZES: Makers = study_files(NAME, page_of, {NAME: rows_of_sizes}, {})
# Of the document and of one row a flight and scheme.
OF_SCHEMES: Makers = {
    **study_files(
        NAME, lambda survey: page_of(survey[0]), {NAME: itemgetter(1)},
        {NAME: lambda survey: draw_schemes(*survey)},
    ),
    f"{NAME}.json": lambda survey: as_json(survey[0]),
}  # fmt: skip
FILES = tuple(OF_PLACES)
