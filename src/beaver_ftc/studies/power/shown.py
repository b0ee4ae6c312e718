"""The survey as people see it: a table a condition, where ours is better or worse, maps and curves."""

import io
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.results.metrics import as_json
from beaver_ftc.studies.engine.study import Progress, Study, run_study
from beaver_ftc.studies.power.chances import JUDGED_S, SIGNIFICANT, Row, document_of, grouped, limit, summary
from beaver_ftc.studies.power.survey import (
    BUILT_IN,
    WITHIN_S,
    Contender,
    Grid,
    Watched,
    fly_block,
    lost,
)
from beaver_ftc.studies.present.figures import curve_look, heat_map, label_edges, marker, panels
from beaver_ftc.studies.present.page import Files
from beaver_ftc.studies.present.tables import plain, printed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from rich.table import Table

Document = dict[str, Any]
NAME = "power"
WIDTH = 140
OWN = "  as it ships"
TOLD = "(told the fault)"


def as_text(document: Document, colour: bool = False) -> str:
    """Tables, legend, comparison and failures."""
    tables = [_table(document, *condition) for condition in document["grid"]["conditions"]]
    said = [*_legend(document), "", *comparison(document), *_failures(document)]
    return "\n".join([printed(tables, WIDTH, colour), *said])


def _table(document: Document, sensors: str, turbulence: str) -> "Table":
    surfaces = document["grid"]["surfaces"]
    rows = []
    for level in document["levels"]:
        if (level["sensors"], level["turbulence"]) == (sensors, turbulence):
            cells = [_total(document, level, surface) for surface in surfaces]
            rows.append([level["scheme"], _rate(level["calibration"]), _rate(level["before_faults"]), *cells])
            if level["scheme"] in BUILT_IN:
                own = [_total(document, level, surface, own=True) for surface in surfaces]
                rows.append([OWN, _rate(level["own_level"]), "", *own])
    rows.append([TOLD, "", "", *(_limit(document, sensors, turbulence, surface) for surface in surfaces)])
    head = ["scheme", "false alarms/h", "before faults/h", *surfaces]
    return plain(title_of(sensors, turbulence), head, rows)


def title_of(sensors: str, turbulence: str) -> str:
    """A condition in words."""
    air = "still air" if turbulence == "none" else f"{turbulence} turbulence"
    return f"{sensors} sensors, {air}"


def _rate(alarms: Document | None) -> str:
    if alarms is None or alarms["per_h"] is None:
        return "-"
    high = "" if alarms["per_h_high"] is None else f" to {alarms['per_h_high']:.0f}"
    return f"{alarms['per_h']:.0f} ({alarms['per_h_low']:.0f}{high})"


def _limit(document: Document, sensors: str, turbulence: str, surface: str) -> str:
    for found in document["limits"]:
        if (found["sensors"], found["turbulence"], found["surface"]) == (sensors, turbulence, surface):
            return "/".join(f"{100 * share:.0f}" for share in found["within"].values())
    return "-"


def _total(document: Document, level: Document, surface: str, own: bool = False) -> str:
    for total in document["totals"]:
        if total["surface"] == surface and _same(total, level):
            return shares(total["own_level"] if own else total)
    return "-"


def _same(total: Document, level: Document) -> bool:
    return all(total[name] == level[name] for name in ("sensors", "turbulence", "scheme"))


def shares(total: Document) -> str:
    """Per cent found within each delay, and the median delay."""
    if not total["flights"]:
        return "-"
    percent = "/".join(f"{100 * total['within'][f'{within_s:g}']['value']:.0f}" for within_s in WITHIN_S)
    median_s = total["median_delay_s"]
    return f"{percent} {'never' if median_s is None else f'{median_s:.2f} s'}"


def _legend(document: Document) -> list[str]:
    grid = document["grid"]
    hours = [level["calibration"]["hours"] for level in document["levels"]]
    within = "/".join(f"{within_s:g}" for within_s in WITHIN_S)
    chance = document["false_alarms_per_h"] * WITHIN_S[-1] / 36.0
    losses = ", ".join(f"{100 * magnitude:g}" for magnitude in grid["magnitudes"])
    references = ", ".join(f"{excitation:g}" for excitation in grid["excitations_deg_s"])
    return [
        f"per surface: % of losses of {losses} % detected within {within} s, and the median delay, under "
        f"references of {references} deg/s.",
        "false alarms/h: every scheme at the level of its statistic with at most "
        f"{document['false_alarms_per_h']:g} per hour, on the same {min(hours, default=0.0):.2f} h of "
        "healthy flight (95 % limits);",
        f"before faults: the same on other flights. By chance alone {chance:.1f} % are detected within "
        f"{WITHIN_S[-1]:g} s.",
        f"{OWN.strip()}: at the level that follows from what it declares.",
        f"{TOLD}: a test that knows surface, magnitude and instant, made once in that time at the same rate.",
        _shown(grid["vanes"]),
    ]


def _shown(vanes: bool) -> str:
    if vanes:
        return "plug-ins and that test are shown the air as the statistical scheme sees it by the vanes."
    return "plug-ins and that test have the rates alone; the statistical scheme sees the air by its vanes."


def comparison(document: Document) -> list[str]:
    """Where ours finds more or fewer faults than another scheme, and is unlikely to by chance."""
    duels = document["comparison"]
    lines = [
        f"{ours} is {verdict} than {against}: {'; '.join(_places(duels, ours, against, verdict))}"
        for ours in dict.fromkeys(duel["ours"] for duel in duels)
        for verdict in ("worse", "better")
        for against in dict.fromkeys(duel["against"] for duel in duels)
        if _places(duels, ours, against, verdict)
    ]
    return [*lines, *_counts(duels)]


def _places(duels: list[Document], ours: str, against: str, verdict: str) -> list[str]:
    """`surface, surface in condition` for each condition in which that is so."""
    found: dict[str, list[str]] = {}
    for duel in duels:
        if (duel["ours"], duel["against"], duel["verdict"]) == (ours, against, verdict):
            found.setdefault(title_of(duel["sensors"], duel["turbulence"]), []).append(duel["surface"])
    return [f"{', '.join(surfaces)} with {condition}" for condition, surfaces in found.items()]


def _counts(duels: list[Document]) -> list[str]:
    return [
        f"{ours}, faults found within {JUDGED_S:g} s, {len(verdicts)} comparisons: better in "
        f"{verdicts.count('better')}, worse in {verdicts.count('worse')}, no difference at "
        f"p < {SIGNIFICANT:g} in the rest"
        for ours in dict.fromkeys(duel["ours"] for duel in duels)
        for verdicts in [[duel["verdict"] for duel in duels if duel["ours"] == ours]]
    ]


def _failures(document: Document) -> list[str]:
    return [f"could not be judged: {failure}" for failure in document["failures"]]


def run_power(
    out: Path, grid: Grid, schemes: Sequence[Contender], workers: int = 1, progress: Progress | None = None
) -> Document:
    """Write `out/power/` (document, one row a flight and scheme, text, figures); return the document."""
    schemes = tuple(schemes)
    healthy = grid.healthy()
    cases = [*((block, False) for block in healthy), *((block, True) for block in grid.faulted())]
    study = Study(
        NAME, cases, partial(fly_block, grid=grid, schemes=schemes),
        lambda watched: document_of(grid, watched[: len(healthy)], watched[len(healthy) :]), files_of,
        row=Watched, follows_from=(grid, schemes), lost=lost,
    )  # fmt: skip
    return run_study(study, out, workers, progress)[0]


def files_of(survey: tuple[Document, list[Row]]) -> Files:
    """Document, text, one row a flight and scheme, and everything drawn, as PNG and as SVG."""
    document, rows = survey
    return {
        f"{NAME}.json": as_json(document),
        f"{NAME}.txt": as_text(document) + "\n",
        f"{NAME}.parquet": _rows_as_parquet(rows),
        "figures": {
            f"{name}.{kind}": figure for name, figure in _figures(document, rows) for kind in ("png", "svg")
        },
    }


def _rows_as_parquet(rows: Sequence[Row]) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    text, number, flag = pa.string(), pa.float64(), pa.bool_()
    columns = {
        "sensors": text, "turbulence": text, "excitation_deg_s": number, "seed": pa.int64(),
        "surface": text, "magnitude": number, "scheme": text,
        "false_alarm": flag, "delay_s": number, "own_false_alarm": flag, "own_delay_s": number,
        **{f"deflection_{within_s:g}": number for within_s in WITHIN_S},
    }  # fmt: skip
    content = io.BytesIO()
    pq.write_table(pa.Table.from_pylist(list(rows), schema=pa.schema(columns)), content)
    return content.getvalue()


def _figures(document: Document, rows: Sequence[Row]) -> Iterator[tuple[str, "Figure"]]:
    for (scheme,), of in grouped(rows, "scheme").items():
        yield f"map-{scheme.replace(':', '-')}", _maps(document, scheme, of)
    for (sensors,), of in grouped(rows, "sensors").items():
        yield f"schemes-{sensors}", _curves(document, sensors, of)


def _maps(document: Document, scheme: str, rows: Sequence[Row]) -> "Figure":
    """Rows surfaces, columns conditions; in each, magnitude over excitation."""
    grid = document["grid"]
    surfaces, conditions = grid["surfaces"], grid["conditions"]
    title = f"{scheme}: at most {document['false_alarms_per_h']:g} false alarms per hour"
    figure, axes = panels(
        len(surfaces), len(conditions), 2.35 * len(conditions) + 1.9, 2.3 * len(surfaces) + 1.0, title,
        dpi=120, sharex=True, sharey=True,
    )  # fmt: skip
    by_place = grouped(rows, "surface", "sensors", "turbulence")
    for line, surface in zip(axes, surfaces, strict=True):
        for panel, (sensors, turbulence) in zip(line, conditions, strict=True):
            image = _map(panel, grid, by_place.get((surface, sensors, turbulence), []))
    label_edges(
        axes, "reference amplitude, deg/s", [f"{surface}\neffectiveness lost, %" for surface in surfaces],
        [title_of(*condition).replace(", ", ",\n") for condition in conditions],
    )  # fmt: skip
    figure.colorbar(
        image, ax=axes, label=f"detected within {JUDGED_S:g} s, % (below: median delay, s)", shrink=0.7
    )
    return figure


def _map(panel: "Axes", grid: Document, rows: Sequence[Row]) -> "AxesImage":
    magnitudes, excitations = grid["magnitudes"], grid["excitations_deg_s"]
    cells = {key: summary(of) for key, of in grouped(rows, "magnitude", "excitation_deg_s").items()}
    percent, labels = np.full((len(magnitudes), len(excitations)), np.nan), {}
    for i, magnitude in enumerate(magnitudes):
        for j, excitation in enumerate(excitations):
            cell = cells.get((magnitude, excitation))
            if cell is not None and cell["flights"]:
                percent[i, j] = 100.0 * cell["within"][f"{JUDGED_S:g}"]["value"]
                delay = "-" if cell["median_delay_s"] is None else f"{cell['median_delay_s']:.2f}"
                ink = "black" if percent[i, j] > 55.0 else "white"
                labels[i, j] = f"{percent[i, j]:.0f}\n{delay}", ink
    return heat_map(
        panel, percent, labels, [f"{e:g}" for e in excitations], [f"{100 * m:g}" for m in magnitudes],
        origin="lower", cmap="cividis", vmin=0.0, vmax=100.0,
    )  # fmt: skip


def _curves(document: Document, sensors: str, rows: Sequence[Row]) -> "Figure":
    """Rows surfaces, columns air; in each, the share detected over magnitude, a line a scheme."""
    surfaces = document["grid"]["surfaces"]
    air = [turbulence for given, turbulence in document["grid"]["conditions"] if given == sensors]
    schemes = list(dict.fromkeys(row["scheme"] for row in rows))
    title = (
        f"Loss of effectiveness, at most {document['false_alarms_per_h']:g} false alarms per hour, "
        "all references"
    )
    figure, axes = panels(
        len(surfaces), len(air), 3.4 * len(air) + 2.6, 2.5 * len(surfaces) + 0.6, title,
        dpi=120, sharex=True, sharey=True,
    )  # fmt: skip
    by_place = grouped(rows, "surface", "turbulence")
    for line, surface in zip(axes, surfaces, strict=True):
        for panel, turbulence in zip(line, air, strict=True):
            here = by_place.get((surface, turbulence), [])
            _draw(panel, here, schemes)
            _draw_limit(panel, here, document["false_alarms_per_h"])
    label_edges(
        axes, "effectiveness lost, %", [f"{s}\ndetected within {JUDGED_S:g} s, %" for s in surfaces],
        [title_of(sensors, turbulence) for turbulence in air],
    )  # fmt: skip
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", fontsize=8)
    return figure


def _draw_limit(panel: "Axes", rows: Sequence[Row], per_h: float) -> None:
    found = {m: limit(here, per_h) for (m,), here in sorted(grouped(rows, "magnitude").items())}
    share = [100 * within[f"{JUDGED_S:g}"] for within in found.values()]
    panel.plot(
        [100 * m for m in found], share, color="#000000", linewidth=3.5, alpha=0.25, label=TOLD, zorder=0
    )


def _draw(panel: "Axes", rows: Sequence[Row], schemes: Sequence[str]) -> None:
    for (scheme,), of in grouped(rows, "scheme").items():
        place = schemes.index(scheme)
        found = {m: summary(here) for (m,), here in sorted(grouped(of, "magnitude").items())}
        points = [
            (100 * m, 100 * cell["within"][f"{JUDGED_S:g}"]["value"])
            for m, cell in found.items()
            if cell["flights"]
        ]
        panel.plot(
            *zip(*points, strict=True) if points else ([], []),
            label=scheme,
            marker=marker(place),
            **curve_look(place),
            markersize=5,
            linewidth=1.6,
        )
    panel.set_ylim(-4, 104)
    panel.set_xlim(left=0)
    panel.grid(alpha=0.3)
    panel.tick_params(labelsize=8)
