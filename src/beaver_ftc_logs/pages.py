"""The page of a diagnosed flight, and the folder of its results."""

from base64 import b64encode
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.results import SERIES_COLOURS as SERIES
from beaver_ftc.results import Document, as_json, result_folder
from beaver_ftc.studies.present import GRID, panels, write_files
from beaver_ftc_logs.findings import MAX_BRIEF_EVENT_S, MIN_CREDIBLE_SHARE, duration_text, events_to_show
from beaver_ftc_logs.log_rows import LogRows
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.runs import true_runs
from beaver_ftc_logs.samples import Samples

if TYPE_CHECKING:
    from jinja2 import Template

_TEMPLATE_FOLDER = Path(__file__).parent / "templates"
_PLOTTED_POINTS = 6000  # a drawn line has about this many points, and fewer than twice as many


@cache
def load_template(name: str) -> "Template":
    """A page's template by its file name."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    files = FileSystemLoader(_TEMPLATE_FOLDER)
    return Environment(loader=files, autoescape=True, undefined=StrictUndefined).get_template(name)


@dataclass(frozen=True)
class Words:
    """Words of a page that depend on the kind of model.

    surfaces: names of the surfaces. bounds: label of the bounds. quiet: sentence for a flight without an
    event. predicts: sentence about the model.
    """

    surfaces: Sequence[str]
    bounds: str
    quiet: str
    predicts: str


def words_of_model(model: Model) -> Words:
    """The words for an identified model."""
    return Words(
        list(model.vehicle.surfaces),
        "90 % bounds",
        "The evidence for a fault raised no alarm.",
        f"The model was identified at {model.rate_hz:.3g} Hz; it predicts a sample from past ones, "
        f"{model.history} of the rates and {model.lags} of the commands.",
    )


def words_of_aircraft(aircraft: Aircraft, window_s: float) -> Words:
    """The words for the design model of an aircraft. window_s: time for which a fault must last so that its
    bounds hold, s.
    """
    return Words(
        aircraft.surfaces,
        "bounds",
        "No residual left the bound of the errors declared.",
        f"The model is that of {aircraft.name}; the bounds hold while one surface alone is at fault, has "
        f"stood for {window_s:g} s, and the errors declared hold.",
    )


def render_diagnosis(samples: Samples, rows: LogRows, verdict: Document, words: Words) -> str:
    """The report of a flight as HTML text."""
    return load_template("flight.html.j2").render(
        verdict=verdict,
        duration_text=duration_text(verdict),
        events=events_to_show(verdict["events"]),
        brief_s=MAX_BRIEF_EVENT_S,
        min_share=MIN_CREDIBLE_SHARE,
        words=words,
        picture=encode_png(flight_figure(samples, rows, words)),
        notes=[*_log_notes(samples), words.predicts],
    )


def _log_notes(samples: Samples) -> list[str]:
    """Sentences about the samples of a log: rate, gaps, held values."""
    n_gaps = int(samples.stretch_number[-1])
    gaps = "1 gap" if n_gaps == 1 else f"{n_gaps} gaps"
    return [
        f"{len(samples.t_s)} samples at {1.0 / samples.dt_s:.3g} Hz, {gaps} in the log.",
        *(
            f"{name} has its own stamps: its last value is held, {age_s:.2f} s old on average."
            for name, age_s in samples.held_age_s.items()
        ),
        *samples.notes,
    ]


def flight_figure(samples: Samples, rows: LogRows, words: Words) -> Any:
    """The flight in panels, from the top: rates, commands, probability of a fault, and for each surface its
    effectiveness with bounds."""
    surfaces = words.surfaces
    heights = [1.2, 1.2, *[1.0] * (len(surfaces) + 1)]
    height = 3.4 + 1.25 * len(surfaces)
    figure, grid = panels(len(heights), 1, 11, height, sharex=True, height_ratios=heights)
    axes = grid[:, 0]
    _draw_lines(axes[0], samples.t_s, np.rad2deg(samples.rates), ["p", "q", "r"], "rates, deg/s")
    limit = float(np.rad2deg(np.nanpercentile(np.abs(samples.rates), 99.9))) * 1.3
    # The limits leave out a tenth of a percent, so that a spike at landing does not flatten the rest
    axes[0].set_ylim(-max(limit, 1.0), max(limit, 1.0))
    _draw_lines(axes[1], samples.t_s, samples.commands, list(surfaces), "healthy surfaces'\nshare of travel")
    _draw_lines(axes[2], rows.t_s, rows.fault_probability[:, None], ["a fault"], "probability")
    axes[2].set_ylim(-0.05, 1.05)
    for i, surface in enumerate(surfaces):
        _draw_effectiveness(axes[3 + i], rows, i, words.bounds)
        label_axis(axes[3 + i], f"{surface}\neffectiveness")
    for axis in axes:
        _shade_alarms(axis, rows)
    axes[-1].set_xlabel("time, s")
    axes[-1].set_xlim(samples.t_s[0], samples.t_s[-1])
    return figure


def label_axis(axis: Any, label: str, **grid_options: Any) -> None:
    """Set the label, the size of the ticks and the grid of an axis."""
    axis.set_ylabel(label, fontsize=8)
    axis.tick_params(labelsize=8)
    axis.grid(color=GRID, linewidth=0.5, **grid_options)


def _draw_lines(axis: Any, t_s: np.ndarray, values: np.ndarray, names: list[str], y_label: str) -> None:
    """Draw a line for each column of values (n, k), with about _PLOTTED_POINTS points each."""
    shown = slice(None, None, max(len(t_s) // _PLOTTED_POINTS, 1))
    for i, name in enumerate(names):
        axis.plot(t_s[shown], values[shown, i], color=SERIES[i % len(SERIES)], linewidth=0.7, label=name)
    axis.legend(loc="upper left", fontsize=7, ncols=4, framealpha=0.8)
    label_axis(axis, y_label)


def _draw_effectiveness(axis: Any, rows: LogRows, s: int, label: str) -> None:
    """Draw the effectiveness of surface s, and its bounds as an area with this label."""
    shown = slice(None, None, max(len(rows.t_s) // _PLOTTED_POINTS, 1))
    axis.fill_between(
        rows.t_s[shown], rows.effectiveness_low[shown, s],
        rows.effectiveness_high[shown, s],
        color="#9cc4e4", step="post", linewidth=0, label=label,
    )  # fmt: skip
    axis.step(rows.t_s[shown], rows.effectiveness[shown, s], where="post", color="#0b3d66", linewidth=1.1)
    axis.set_ylim(-0.05, 1.08)


def _shade_alarms(axis: Any, rows: LogRows) -> None:
    """Shade the times at which the alarm stands."""
    for begin, end in true_runs(rows.faulty == 1):
        end_s = rows.t_s[min(end, len(rows.t_s) - 1)]
        axis.axvspan(rows.t_s[begin], end_s, color="#f4d6cc", alpha=0.45, linewidth=0)


def write_results(
    parent: Path,
    name: str,
    table: Document,
    verdict: Document,
    page: str | None = None,
    extra: Callable[[Path], None] | None = None,
) -> Path:
    """Write the folder `parent/<name>` whole or not at all: diagnosis.parquet, verdict.json, report.html if
    there is a page, and the files that `extra` writes. Returns the folder.
    """
    import pyarrow as pa
    from pyarrow import parquet

    with result_folder(parent, name) as folder:
        parquet.write_table(pa.table(table), folder / "diagnosis.parquet")
        write_files(folder, {"verdict.json": as_json(verdict), "report.html": page})
        if extra is not None:
            extra(folder)
    return parent / name


def encode_png(figure: Any) -> str:
    """A figure as PNG in base64, for a page."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png")
    return b64encode(buffer.getvalue()).decode()
