"""The survey as people see it: a table a condition, where ours is better or worse, maps and dots; and the
command `power`."""

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.commands import (
    AirspeedOption,
    AltitudeOption,
    Reporter,
    StudyCommand,
    TurbulenceName,
    WorkersOption,
    listed,
)
from beaver_ftc.results.metrics import as_json
from beaver_ftc.results.model import Document
from beaver_ftc.results.style import SERIES
from beaver_ftc.studies.compare.scores import leader
from beaver_ftc.studies.engine.study import Progress, Study, run_study
from beaver_ftc.studies.power import probabilities, survey
from beaver_ftc.studies.power.probabilities import (
    JUDGED_S,
    SIGNIFICANT,
    Row,
    document_of,
    limit,
    summary,
    title_of,
)
from beaver_ftc.studies.power.survey import (
    BOTH,
    BUILT_IN,
    GRIDS,
    WATCHED_S,
    WITHIN_S,
    Grid,
    Watched,
    fly_block,
    lost,
)
from beaver_ftc.studies.present.figures import GRID, heat_map, label_edges, marker, panels
from beaver_ftc.studies.present.page import Files, Makers
from beaver_ftc.studies.present.tables import grouped, percent, plain, printed, seconds

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from rich.table import Table

NAME = "power"
WIDTH = 140
OWN = "  as it ships"
INFORMED = "informed test"


def as_text(document: Document, colour: bool = False) -> str:
    """Tables, legend, comparison and failures."""
    shown = []
    for condition in document["grid"]["conditions"]:
        shown += [
            printed([_table(document, *condition)], WIDTH, colour),
            *who_is_better(document, *condition),
            "",
        ]
    said = [*_legend(document), "", *comparison(document)]
    said += [f"could not be judged: {failure}" for failure in document["failures"]]
    return "\n".join([*shown, *said])


def who_is_better(
    document: Document, sensors: str, turbulence: str, within_s: float = WATCHED_S
) -> Iterator[str]:
    """Below the table of a condition, a sentence a surface: who finds most faults so soon."""
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


def _table(document: Document, sensors: str, turbulence: str) -> "Table":
    here, surfaces = {"sensors": sensors, "turbulence": turbulence}, document["grid"]["surfaces"]

    def of_each(what: str, **where: Any) -> list[Document | None]:
        return [next(_those(document[what], **here, **where, surface=surface), None) for surface in surfaces]

    rows = []
    for level in _those(document["levels"], **here):
        totals = of_each("totals", scheme=level["scheme"])
        alarms = _rate(level["calibration"]), _rate(level["before_faults"])
        rows.append([level["scheme"], *alarms, *map(shares, totals)])
        if level["scheme"] in BUILT_IN:
            own = [total and total["own_level"] for total in totals]
            rows.append([OWN, _rate(level["own_level"]), "", *map(shares, own)])
    limits = [limit["within"].values() if limit else [] for limit in of_each("limits")]
    informed = ["/".join(f"{100 * share:.0f}" for share in within) or "-" for within in limits]
    head = ["scheme", "false alarms/h", "before faults/h", *surfaces]
    return plain(title_of(sensors, turbulence), head, [*rows, [INFORMED, "", "", *informed]])


def _those(lines: Sequence[Document], **where: Any) -> Iterator[Document]:
    return (line for line in lines if where.items() <= line.items())


def _rate(alarms: Document | None) -> str:
    if alarms is None or alarms["per_h"] is None:
        return "-"
    high = "" if alarms["per_h_high"] is None else f" to {alarms['per_h_high']:.0f}"
    return f"{alarms['per_h']:.0f} ({alarms['per_h_low']:.0f}{high})"


def shares(total: Document | None) -> str:
    """Per cent found within each delay, and the median delay."""
    if not total or not total["flights"]:
        return "-"
    percent = "/".join(f"{100 * total['within'][f'{within_s:g}']['value']:.0f}" for within_s in WITHIN_S)
    return f"{percent} {seconds(total['median_delay_s'])}"


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
        f"{INFORMED}: knows surface, magnitude and instant; made once in that time at the same rate.",
        "plug-ins are given every reading that the statistical scheme uses; that test knows the gusts "
        "that the vanes show.",
    ]


def comparison(document: Document) -> list[str]:
    """Where ours finds more or fewer faults than another scheme, and is unlikely to by chance."""
    lines, counts = [], []
    for (ours, within_s), duels in grouped(document["comparison"], "ours", "within_s").items():
        verdicts = [duel["verdict"] for duel in duels]
        counts.append(
            f"{ours}, faults found within {within_s:g} s, {len(verdicts)} comparisons: better in "
            f"{verdicts.count('better')}, worse in {verdicts.count('worse')}, no difference at "
            f"p < {SIGNIFICANT:g} in the rest"
        )
        for verdict in ("worse", "better"):
            for (against,), those in grouped(duels, "against").items():
                so = grouped(_those(those, verdict=verdict), "sensors", "turbulence")
                places = [
                    f"{', '.join(duel['surface'] for duel in here)} with {title_of(*condition)}"
                    for condition, here in so.items()
                ]
                if places:
                    lines.append(
                        f"{ours} is {verdict} than {against} within {within_s:g} s: {'; '.join(places)}"
                    )
    return [*lines, *counts]


def run_power(
    out: Path, grid: Grid, schemes: Sequence[str], workers: int = 1, progress: Progress | None = None
) -> Document:
    """Write `out/power/` (document, one row a flight and scheme, text, figures); return the document."""
    schemes = tuple(schemes)
    healthy = grid.healthy()
    cases = [*((block, False) for block in healthy), *((block, True) for block in grid.faulted())]
    study = Study(
        NAME, cases, partial(fly_block, grid=grid, schemes=schemes),
        lambda watched: document_of(grid, watched[: len(healthy)], watched[len(healthy) :]), FILES,
        row=Watched, follows_from=(grid, schemes), lost=lost,
    )  # fmt: skip
    return run_study(study, out, workers, progress)[0]


def rows_as_parquet(rows: Sequence[Row]) -> bytes:
    """One row a flight and scheme."""
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


def figures_of(document: Document, rows: Sequence[Row]) -> Files:
    """Everything drawn, as PNG and as SVG."""
    drawn = _figures(document, rows)
    return {f"{name}.{kind}": figure for name, figure in drawn for kind in ("png", "svg")}


# Of the document and of one row a flight and scheme.
FILES: Makers = {
    f"{NAME}.json": lambda survey: as_json(survey[0]),
    f"{NAME}.txt": lambda survey: as_text(survey[0]) + "\n",
    f"{NAME}.parquet": lambda survey: rows_as_parquet(survey[1]),
    "figures": lambda survey: figures_of(*survey),
}


def _figures(document: Document, rows: Sequence[Row]) -> Iterator[tuple[str, "Figure"]]:
    for (scheme,), of in grouped(rows, "scheme").items():
        yield f"map-{scheme.replace(':', '-')}", _maps(document, scheme, of)
    for (sensors,), of in grouped(rows, "sensors").items():
        yield f"schemes-{sensors}", _dots(document, sensors, of)


def _maps(document: Document, scheme: str, rows: Sequence[Row]) -> "Figure":
    """Rows surfaces, columns conditions; in each, magnitude over excitation."""
    grid = document["grid"]
    surfaces, conditions = grid["surfaces"], grid["conditions"]
    title = f"{scheme}: at most {document['false_alarms_per_h']:g} false alarms per hour"
    figure, axes = panels(
        len(surfaces), len(conditions), 2.35 * len(conditions) + 1.9, 2.3 * len(surfaces) + 1.0, title,
        dpi=120, sharex=True, sharey=True,
    )  # fmt: skip
    for panel, here in _by_place(axes, surfaces, conditions, rows):
        image = _map(panel, grid, here)
    label_edges(
        axes, "reference amplitude, deg/s", [f"{surface}\neffectiveness lost, %" for surface in surfaces],
        [title_of(*condition).replace(", ", ",\n") for condition in conditions],
    )  # fmt: skip
    figure.colorbar(
        image, ax=axes, label=f"detected within {JUDGED_S:g} s, % (below: median delay, s)", shrink=0.7
    )
    return figure


def _by_place(
    axes: np.ndarray, surfaces: list[str], conditions: list[tuple[str, str]], rows: Sequence[Row]
) -> Iterator[tuple["Axes", list[Row]]]:
    """Each panel (surfaces, conditions) with its rows."""
    groups = grouped(rows, "surface", "sensors", "turbulence")
    for panel, (surface, condition) in zip(axes.flat, product(surfaces, conditions), strict=True):
        yield panel, groups.get((surface, *condition), [])


def _map(panel: "Axes", grid: Document, rows: Sequence[Row]) -> "AxesImage":
    magnitudes, excitations = grid["magnitudes"], grid["excitations_deg_s"]
    percent, labels = np.full((len(magnitudes), len(excitations)), np.nan), {}
    for (magnitude, excitation), of in sorted(grouped(rows, "magnitude", "excitation_deg_s").items()):
        cell, place = summary(of), (magnitudes.index(magnitude), excitations.index(excitation))
        if cell["flights"]:
            percent[place] = 100.0 * cell["within"][f"{JUDGED_S:g}"]["value"]
            delay = "-" if cell["median_delay_s"] is None else f"{cell['median_delay_s']:.2f}"
            labels[place] = f"{percent[place]:.0f}\n{delay}", "black" if percent[place] > 55.0 else "white"
    return heat_map(
        panel, percent, labels, [f"{e:g}" for e in excitations], [f"{100 * m:g}" for m in magnitudes],
        origin="lower", cmap="cividis", vmin=0.0, vmax=100.0,
    )  # fmt: skip


def _dots(document: Document, sensors: str, rows: Sequence[Row]) -> "Figure":
    """Rows air, columns surfaces; in each, a line of dots a scheme: the share detected, a dot a magnitude."""
    surfaces = document["grid"]["surfaces"]
    conditions = [condition for condition in document["grid"]["conditions"] if condition[0] == sensors]
    names = [*dict.fromkeys(row["scheme"] for row in rows), INFORMED]
    most = f"at most {document['false_alarms_per_h']:g} false alarms per hour"
    figure, axes = panels(
        len(conditions), len(surfaces), 2.3 * len(surfaces) + 1.7,
        (0.3 * len(names) + 0.6) * len(conditions) + 1.2, f"Loss of effectiveness, {most}, all references",
        dpi=120, sharex=True, sharey=True,
    )  # fmt: skip
    for panel, here in _by_place(axes.T, surfaces, conditions, rows):
        _draw(panel, here, names, document)
    label_edges(
        axes, f"detected within {JUDGED_S:g} s, %",
        [title_of(*condition).replace(", ", ",\n") for condition in conditions], surfaces,
    )  # fmt: skip
    handles, labels = axes[0][0].get_legend_handles_labels()
    each = len(document["grid"]["excitations_deg_s"])
    flights = [each * cell["flights"] for cell in document["cells"] if cell["sensors"] == sensors]
    figure.legend(
        handles, labels, loc="outside lower center", ncols=len(labels), fontsize=8, frameon=False,
        title=f"of {min(flights, default=0)} to {max(flights, default=0)} flights, exact 95 % interval",
        title_fontsize=8,
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
        percent = 100.0 * np.array([[of["value"], of["low"], of["high"]] for of in shares.values()])
        values, lows, highs = percent.reshape(-1, 3).T
        panel.errorbar(
            values, [names.index(of) + apart * (place - 0.5 * (len(magnitudes) - 1)) for of in shares],
            xerr=(np.maximum(values - lows, 0.0), np.maximum(highs - values, 0.0)), linestyle="none",
            marker=marker(place), markersize=4.5, color=SERIES[place], elinewidth=1.0, clip_on=False,
            label=f"{100 * magnitude:g} % lost",
        )  # fmt: skip
    panel.set_yticks(range(len(names)), names)
    panel.set_ylim(len(names) - 0.5, -0.5)
    panel.set_xlim(-2, 102)
    panel.grid(axis="x", alpha=0.3)
    panel.hlines(np.arange(len(names) - 1) + 0.5, -2, 102, color=GRID, linewidth=0.6)
    panel.tick_params(labelsize=8)


GridName = StrEnum("GridName", ["quick", "full"])
SensorsName = StrEnum("SensorsName", {"ideal": "ideal", "tactical_grade": "tactical-grade"})


@dataclass(frozen=True)
class Power(StudyCommand):
    """Estimate the probability and the delay of fault detection.

    The command varies the surface, the size of its loss of effectiveness, the reference, the sensors and the
    turbulence.

    All schemes diagnose the same flights. The alarm level of each scheme is chosen on healthy flights, so
    that all schemes have the same rate of false alarms. The command writes power.json, power.parquet,
    power.txt, and figures in PNG and SVG.

    If the command is interrupted, the same command resumes it.

    Examples:
      beaver-ftc power --surface elevator --sensors tactical-grade --turbulence none

    grid: Number of variations: `quick` takes about 1 min of processor time, `full` about 10 min.
    schemes: Names of schemes to compare, separated by commas. Default: all registered schemes.
    sensors: Fly only these sensors. Default: all sensors of the grid.
    turbulence: Fly only this severity of turbulence. Default: all severities of the grid.
    airspeed: Airspeed, m/s. Default: that of a scenario without this key.
    altitude: Altitude above sea level, m. Default: that of a scenario without this key.
    aircraft: Aircraft: built-in name, jsbsim:NAME, or ./FOLDER. Default: beaver.
    surface: Fly only losses of this surface.
    out: Folder for the results.
    """

    grid: GridName = GridName.quick
    schemes: str | None = None
    sensors: SensorsName | None = None
    turbulence: TurbulenceName | None = None
    airspeed: AirspeedOption = None
    altitude: AltitudeOption = None
    aircraft: str | None = None
    surface: str | None = None
    workers: WorkersOption = None
    out: Path = Path("runs")

    FILES = FILES

    @property
    def label(self) -> str:
        """The words before the progress bar."""
        return f"power, {self.grid.value} grid"

    def run(self, reporter: Reporter) -> Document:
        """Fly the grid; of one surface with the answers in words."""
        chosen = survey.contenders(None if self.schemes is None else listed(self.schemes))
        grid = GRIDS[self.grid].only(self.sensors, self.turbulence)
        grid = grid.elsewhere(self.aircraft, self.airspeed, self.altitude, self.surface)
        document = run_power(self.out, grid, chosen, self.processes, reporter.progress)
        said = probabilities.answers(document, self.surface) if self.surface else []
        return document | ({"answers": said} if said else {}) | {"folder": str(self.out / NAME)}

    def as_text(self, document: Document, colour: bool) -> str:
        """The answers in words, else the tables; and where the files are."""
        text = "\n".join(document.get("answers", ())) or as_text(document)
        return f"{text}\n\nresults: {document['folder']}"
