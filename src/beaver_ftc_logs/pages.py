"""The pages of recorded flights: of an identification and of a diagnosed flight, with its files."""

from base64 import b64encode
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.documents import BadInput
from beaver_ftc.results import SERIES_COLOURS as SERIES
from beaver_ftc.results import Document, as_json, result_folder
from beaver_ftc.studies.present import GRID, panels
from beaver_ftc_logs import orders
from beaver_ftc_logs.diagnose import LogRows
from beaver_ftc_logs.findings import MAX_BRIEF_EVENT_S, MIN_CREDIBLE_SHARE, duration_text, events_to_show
from beaver_ftc_logs.folds import Fold, held_out_folds
from beaver_ftc_logs.least_squares import Regression, spectral_density
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.regression import Parts, regressor_names
from beaver_ftc_logs.runs import true_runs
from beaver_ftc_logs.samples import Samples

if TYPE_CHECKING:
    from jinja2 import Template

_TEMPLATE_FOLDER = Path(__file__).parent / "templates"
_PLOTTED_POINTS = 6000
PAGE_MARK = '<meta name="generator" content="beaver-ftc identify">'
_FIGURE_SPAN_S = 40.0
_MAX_SHOWN_FLIGHTS = 3


@cache
def load_template(name: str) -> "Template":
    """A page's template by its file name."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    files = FileSystemLoader(_TEMPLATE_FOLDER)
    return Environment(loader=files, autoescape=True, undefined=StrictUndefined).get_template(name)


@dataclass(frozen=True)
class Words:
    """What a flight's page says of its diagnosis: of which surfaces, what its bounds are called, what is said
    without an event, and of the model."""

    surfaces: Sequence[str]
    bounds: str
    quiet: str
    predicts: str


def words_of_model(model: Model) -> Words:
    """Of an identified model."""
    return Words(
        list(model.vehicle.surfaces),
        "90 % bounds",
        "The evidence for a fault raised no alarm.",
        f"The model was identified at {model.rate_hz:.3g} Hz; it predicts a sample from past ones, "
        f"{model.history} of the rates and {model.lags} of the commands.",
    )


def words_of_aircraft(aircraft: Aircraft, window_s: float) -> Words:
    """Of an aircraft's own model. window_s: for how long a fault has to stand for its bounds to hold."""
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
        picture=_encode_png(flight_figure(samples, rows, words)),
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
    """The flight on one page: commands, rates, effectiveness with bounds, probability of a fault."""
    surfaces = words.surfaces
    heights = [1.2, 1.2, *[1.0] * (len(surfaces) + 1)]
    height = 3.4 + 1.25 * len(surfaces)
    figure, grid = panels(len(heights), 1, 11, height, sharex=True, height_ratios=heights)
    axes = grid[:, 0]
    _draw_lines(axes[0], samples.t_s, np.rad2deg(samples.rates), ["p", "q", "r"], "rates, deg/s")
    limit = float(np.rad2deg(np.nanpercentile(np.abs(samples.rates), 99.9))) * 1.3
    axes[0].set_ylim(-max(limit, 1.0), max(limit, 1.0))  # a landing's spike does not flatten the flight
    _draw_lines(axes[1], samples.t_s, samples.commands, list(surfaces), "healthy surfaces'\nshare of travel")
    _draw_lines(axes[2], rows.t_s, rows.fault_probability[:, None], ["a fault"], "probability")
    axes[2].set_ylim(-0.05, 1.05)
    for i, surface in enumerate(surfaces):
        _draw_effectiveness(axes[3 + i], rows, i, words.bounds)
        _label_axis(axes[3 + i], f"{surface}\neffectiveness")
    for axis in axes:
        _shade_alarms(axis, rows)
    axes[-1].set_xlabel("time, s")
    axes[-1].set_xlim(samples.t_s[0], samples.t_s[-1])
    return figure


def _label_axis(axis: Any, label: str, **grid_options: Any) -> None:
    """Axis label, ticks and grid."""
    axis.set_ylabel(label, fontsize=8)
    axis.tick_params(labelsize=8)
    axis.grid(color=GRID, linewidth=0.5, **grid_options)


def _draw_lines(axis: Any, t_s: np.ndarray, values: np.ndarray, names: list[str], y_label: str) -> None:
    shown = slice(None, None, max(len(t_s) // _PLOTTED_POINTS, 1))
    for i, name in enumerate(names):
        axis.plot(t_s[shown], values[shown, i], color=SERIES[i % len(SERIES)], linewidth=0.7, label=name)
    axis.legend(loc="upper left", fontsize=7, ncols=4, framealpha=0.8)
    _label_axis(axis, y_label)


def _draw_effectiveness(axis: Any, rows: LogRows, s: int, label: str) -> None:
    shown = slice(None, None, max(len(rows.t_s) // _PLOTTED_POINTS, 1))
    axis.fill_between(
        rows.t_s[shown], rows.effectiveness_low[shown, s],
        rows.effectiveness_high[shown, s],
        color="#9cc4e4", step="post", linewidth=0, label=label,
    )  # fmt: skip
    axis.step(rows.t_s[shown], rows.effectiveness[shown, s], where="post", color="#0b3d66", linewidth=1.1)
    axis.set_ylim(-0.05, 1.08)


def _shade_alarms(axis: Any, rows: LogRows) -> None:
    """Shade the time in which the alarm stands."""
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
    """Write `parent/<name>` whole or not at all: diagnosis.parquet, verdict.json and report.html."""
    import pyarrow as pa
    from pyarrow import parquet

    with result_folder(parent, name) as folder:
        parquet.write_table(pa.table(table), folder / "diagnosis.parquet")
        (folder / "verdict.json").write_text(as_json(verdict), encoding="utf-8")
        if page is not None:
            (folder / "report.html").write_text(page, encoding="utf-8")
        if extra is not None:
            extra(folder)
    return parent / name


def refuse_foreign_file(path: Path) -> None:
    """Raise BadInput where the page would take the place of a file that is not a page of ours."""
    is_page = path.is_file() and PAGE_MARK in path.read_text("utf-8", errors="replace")[:2000]
    if path.exists() and not is_page:
        raise BadInput(f"will not replace {path}: it is no page of `identify`, allowed: another --out")


def render_identification(flights: Sequence[Samples], model: Model) -> str:
    """The page as HTML text."""
    usable = orders.fit_parts(flights)
    fit = orders.fit_order(usable, model.vehicle, model.history, model.lags)
    names = ["constant", *regressor_names(model)]
    return load_template("model.html.j2").render(
        mark=PAGE_MARK,
        model=model,
        found=model.identified,
        used=sum(int(flight.is_usable.sum()) for flight in usable),
        coefficients=list(zip(names, fit.coefficients.tolist(), fit.standard_errors.tolist(), strict=True)),
        fits=_encode_png(_prediction_figure(usable, model)),
        spectrum=_encode_png(_spectrum_figure(usable, model)),
        correlation=_encode_png(_correlation_figure(fit, names)),
    )


def _encode_png(figure: Any) -> str:
    buffer = BytesIO()
    figure.savefig(buffer, format="png")
    return b64encode(buffer.getvalue()).decode()


def _prediction_figure(usable: Parts, model: Model) -> Any:
    """Measured and predicted rates over the liveliest part of each flight (or half) that was left out."""
    from matplotlib.figure import Figure

    used = (fold for fold in held_out_folds(usable, model, None) if fold.held_out.is_usable.any())
    folds = list(islice(used, _MAX_SHOWN_FLIGHTS))
    n = max(len(folds), 1)
    figure = Figure(figsize=(11, 4.6 * n), layout="constrained", dpi=110)
    parts = figure.subfigures(n, squeeze=False)[:, 0]
    for part, fold in zip(parts, folds, strict=False):
        axes = part.subplots(3, 1, sharex=True)
        t_s, rates, residual = _liveliest_window(fold, round(_FIGURE_SPAN_S * model.rate_hz))
        for i, axis in enumerate(axes):
            residuals = np.rad2deg(residual[:, i])
            rate = np.rad2deg(rates[:, i])
            axis.plot(t_s, rate, color="#888888", linewidth=2.2, label="measured")
            axis.plot(t_s, rate - residuals, color=SERIES[0], linewidth=0.9, label="predicted")
            axis.plot(t_s, residuals, color=SERIES[1], linewidth=0.7, label="residual")
            _label_axis(axis, f"{'pqr'[i]}, deg/s")
        axes[0].set_title(f"{fold.name}, not fitted: one sample ahead", fontsize=9, loc="left")
        axes[0].legend(loc="upper right", fontsize=7, ncols=3, framealpha=0.8)
        axes[-1].set_xlabel("time, s", fontsize=8)
    return figure


def _liveliest_window(fold: Fold, n: int) -> tuple[Floats, Floats, Floats]:
    """Times, rates and residual of the window in which the rates known moved most; nan where nothing is
    known, for lines to end."""
    flight = orders.one_step_innovations(fold.model, fold.held_out)
    samples = fold.held_out.samples
    rates, r = np.full((2, *samples.rates.shape), np.nan)
    rates[flight.rows] = samples.rates[flight.rows]
    r[flight.rows] = flight.e
    total = np.concatenate([[0.0], np.cumsum(np.nansum(rates**2, axis=1))])
    first = int(np.argmax(total[n:] - total[:-n])) if len(rates) > n else 0
    window = slice(first, first + n)
    return samples.t_s[window], rates[window], r[window]


def _spectrum_figure(usable: Parts, model: Model) -> Any:
    """Density of the residual, and what white noise of the same variance would have."""
    residual = orders.one_step_residuals(usable, model)
    f_hz, power = spectral_density(residual, model.rate_hz)
    figure, ((axis,),) = panels(1, 1, 7.5, 3.2)
    for i, name in enumerate("pqr"):
        axis.loglog(f_hz[1:], power[1:, i], color=SERIES[i], linewidth=1.1, label=name)
        white = residual[:, i].var() / (0.5 * model.rate_hz)
        axis.axhline(white, color=SERIES[i], linewidth=0.7, linestyle=":")
    axis.set_xlabel("frequency, Hz", fontsize=8)
    axis.set_title("residual (dotted: white noise of the same variance)", fontsize=9, loc="left")
    _label_axis(axis, "density, (rad/s)² / Hz", which="both")
    axis.legend(fontsize=8)
    return figure


def _correlation_figure(fit: Regression, names: list[str]) -> Any:
    """Correlation of the errors of the coefficients."""
    side = 2.5 + 0.19 * len(names)
    figure, ((axis,),) = panels(1, 1, side + 0.8, side)
    image = axis.imshow(fit.coefficient_error_correlation, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    axis.set_xticks(range(len(names)), names, rotation=90, fontsize=6)
    axis.set_yticks(range(len(names)), names, fontsize=6)
    figure.colorbar(image, shrink=0.7).ax.tick_params(labelsize=7)
    return figure
