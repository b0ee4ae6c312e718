"""The pages of recorded flights: of an identification and of a diagnosed flight, with its files."""

from base64 import b64encode
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents import BadInput
from beaver_ftc.results import SERIES_COLOURS as SERIES
from beaver_ftc.results import as_json, result_folder
from beaver_ftc_logs import fitting
from beaver_ftc_logs.diagnose import DiagnosisRows
from beaver_ftc_logs.findings import MAX_BRIEF_EVENT_S, diagnosed_duration_text, lasting_or_else_all_events
from beaver_ftc_logs.identification import regressor_names
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.regression import RateRegression, power_spectral_density
from beaver_ftc_logs.replay import diagnosis_columns
from beaver_ftc_logs.samples import Samples

if TYPE_CHECKING:
    from jinja2 import Template

_TEMPLATE_FOLDER = Path(__file__).parent / "templates"
_TARGET_PLOTTED_POINTS = 6000
IDENTIFICATION_PAGE_MARK = '<meta name="generator" content="beaver-ftc identify">'
_PREDICTION_FIGURE_SPAN_S = 40.0
_MAX_SHOWN_FLIGHTS = 3


@cache
def load_template(name: str) -> "Template":
    """A page's template by its file name."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(_TEMPLATE_FOLDER), autoescape=True, undefined=StrictUndefined
    )
    return environment.get_template(name)


def render_diagnosis(samples: Samples, model: Model, rows: DiagnosisRows, verdict: dict[str, Any]) -> str:
    """The report as HTML text."""
    no_alarm_text = (
        "The probability of a fault stayed below the alarm level of "
        f"{model.settings.fault_probability_for_alarm}."
    )
    model_text = (
        f"The model was identified at {model.rate_hz:.3g} Hz; it predicts a sample from past ones, "
        f"{model.n_rate_lags} of the rates and {model.n_command_lags} of the commands."
    )
    wording = {"bounds": "90 % bounds", "quiet": no_alarm_text, "predicts": model_text}
    return _render_flight_page(samples, list(model.vehicle.surfaces), rows, verdict, wording)


def _render_flight_page(
    samples: Samples,
    surfaces: Sequence[str],
    rows: DiagnosisRows,
    verdict: dict[str, Any],
    wording: dict[str, str],
) -> str:
    """A flight's page. wording: what its bounds are called, what is said without an event, and of the
    model."""
    return load_template("flight.html.j2").render(
        verdict=verdict,
        diagnosed_duration_text=diagnosed_duration_text(verdict),
        events=lasting_or_else_all_events(verdict["events"]),
        brief_s=MAX_BRIEF_EVENT_S,
        words=wording,
        picture=_encode_png(flight_figure(samples, surfaces, rows, wording["bounds"])),
        ages=samples.mean_age_s_by_held_column,
        notes=[*_log_notes(samples), wording["predicts"]],
    )


def _log_notes(samples: Samples) -> list[str]:
    n_gaps = int(samples.stretch_number[-1])
    gap_count_text = "1 gap" if n_gaps == 1 else f"{n_gaps} gaps"
    notes = [f"{len(samples.t_s)} samples at {1.0 / samples.dt_s:.3g} Hz, {gap_count_text} in the log."]
    notes += [
        f"{name} has its own stamps: its last value is held, {mean_held_value_age_s:.2f} s old on average."
        for name, mean_held_value_age_s in samples.mean_age_s_by_held_column.items()
    ]
    return [*notes, *samples.notes]


def flight_figure(
    samples: Samples, surfaces: Sequence[str], rows: DiagnosisRows, bounds_label: str = "90 % bounds"
) -> Any:
    """The flight on one page: commands, rates, effectiveness with bounds, probability of a fault.
    bounds_label: what they are called."""
    figure = _new_figure(11, 3.4 + 1.25 * len(surfaces))
    panel_heights = [1.2, 1.2, *[1.0] * (len(surfaces) + 1)]
    axes = figure.subplots(len(panel_heights), sharex=True, height_ratios=panel_heights)
    _draw_lines(axes[0], samples.t_s, np.rad2deg(samples.rates), ["p", "q", "r"], "rates, deg/s")
    rate_axis_limit_deg_s = float(np.rad2deg(np.nanpercentile(np.abs(samples.rates), 99.9))) * 1.3
    axes[0].set_ylim(
        -max(rate_axis_limit_deg_s, 1.0), max(rate_axis_limit_deg_s, 1.0)
    )  # a landing's spike does not flatten the flight
    _draw_lines(axes[1], samples.t_s, samples.commands, list(surfaces), "healthy surfaces'\nshare of travel")
    _draw_lines(axes[2], rows.t_s, rows.fault_probability[:, None], ["a fault"], "probability")
    axes[2].set_ylim(-0.05, 1.05)
    for i, surface in enumerate(surfaces):
        _draw_effectiveness(axes[3 + i], rows, i, bounds_label)
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
    axis.grid(color="#dddddd", linewidth=0.5, **grid_options)


def _draw_lines(axis: Any, t_s: np.ndarray, values: np.ndarray, names: list[str], y_label: str) -> None:
    shown_rows = slice(None, None, max(len(t_s) // _TARGET_PLOTTED_POINTS, 1))
    for i, name in enumerate(names):
        axis.plot(
            t_s[shown_rows], values[shown_rows, i], color=SERIES[i % len(SERIES)], linewidth=0.7, label=name
        )
    axis.legend(loc="upper left", fontsize=7, ncols=4, framealpha=0.8)
    _label_axis(axis, y_label)


def _draw_effectiveness(axis: Any, rows: DiagnosisRows, surface_index: int, bounds_label: str) -> None:
    shown_rows = slice(None, None, max(len(rows.t_s) // _TARGET_PLOTTED_POINTS, 1))
    axis.fill_between(
        rows.t_s[shown_rows], rows.effectiveness_low[shown_rows, surface_index],
        rows.effectiveness_high[shown_rows, surface_index],
        color="#9cc4e4", step="post", linewidth=0, label=bounds_label,
    )  # fmt: skip
    axis.step(
        rows.t_s[shown_rows],
        rows.effectiveness[shown_rows, surface_index],
        where="post",
        color="#0b3d66",
        linewidth=1.1,
    )
    axis.set_ylim(-0.05, 1.08)


def _shade_alarms(axis: Any, rows: DiagnosisRows) -> None:
    """Shade the time in which the alarm stands."""
    alarm_edges = np.flatnonzero(np.diff(rows.faulty, prepend=0, append=0))
    alarm_edge_times_s = rows.t_s[np.minimum(alarm_edges, len(rows.t_s) - 1)]
    for begin_s, end_s in zip(alarm_edge_times_s[::2], alarm_edge_times_s[1::2], strict=True):
        axis.axvspan(begin_s, end_s, color="#f4d6cc", alpha=0.45, linewidth=0)


def diagnosis_column_names(surfaces: Iterable[str]) -> tuple[str, ...]:
    """Columns of diagnosis.parquet, by the vehicle's surfaces."""
    effectiveness_column_names = (
        f"{surface}_{suffix}" for surface in surfaces for suffix in ("effectiveness", "low", "high")
    )
    return ("t_s", "faulty", "named", *effectiveness_column_names, "fault_probability", "credible")


def write_diagnosis(
    parent_folder: Path, samples: Samples, model: Model, rows: DiagnosisRows, verdict: dict[str, Any]
) -> Path:
    """Write the folder `parent_folder/<flight>` whole or not at all; returns it."""
    effectiveness_columns = (
        column
        for columns_of_surface in zip(
            rows.effectiveness.T, rows.effectiveness_low.T, rows.effectiveness_high.T, strict=True
        )
        for column in columns_of_surface
    )
    columns_in_order = (
        rows.t_s,
        rows.faulty,
        rows.isolated_surfaces.tolist(),
        *effectiveness_columns,
        rows.fault_probability,
        rows.credible,
    )
    values_by_column_name = dict(
        zip(diagnosis_column_names(model.vehicle.surfaces), columns_in_order, strict=True)
    )
    return write_results(
        parent_folder,
        samples.name,
        values_by_column_name,
        verdict,
        render_diagnosis(samples, model, rows, verdict),
    )


def write_diagnosis_with_aircraft_model(
    parent_folder: Path,
    samples: Samples,
    surfaces: Sequence[str],
    rows: DiagnosisRows,
    verdict: dict[str, Any],
    write_extra_files: Callable[[Path], None] | None = None,
) -> Path:
    """The same of a flight that an aircraft's own model diagnosed; write_extra_files: writes into the folder,
    too."""
    from beaver_ftc_logs.stepped import EFFECTIVENESS_BOUND_WINDOW_S

    wording = {
        "bounds": "bounds",
        "quiet": "No residual left the bound of the errors declared.",
        "predicts": f"The model is that of {verdict['aircraft']}; the bounds hold while one surface alone "
        f"is at fault, has stood for {EFFECTIVENESS_BOUND_WINDOW_S:g} s, and the errors declared hold.",
    }
    page = _render_flight_page(samples, surfaces, rows, verdict, wording)
    return write_results(
        parent_folder, samples.name, diagnosis_columns(rows, surfaces), verdict, page, write_extra_files
    )


def write_results(
    parent_folder: Path,
    name: str,
    values_by_column_name: dict[str, Any],
    verdict: dict[str, Any],
    page: str | None = None,
    write_extra_files: Callable[[Path], None] | None = None,
) -> Path:
    """Write `parent_folder/<name>` whole or not at all: diagnosis.parquet, verdict.json and report.html."""
    import pyarrow as pa
    from pyarrow import parquet

    with result_folder(parent_folder, name) as folder:
        parquet.write_table(pa.table(values_by_column_name), folder / "diagnosis.parquet")
        (folder / "verdict.json").write_text(as_json(verdict), encoding="utf-8")
        if page is not None:
            (folder / "report.html").write_text(page, encoding="utf-8")
        if write_extra_files is not None:
            write_extra_files(folder)
    return parent_folder / name


def refuse_to_replace_foreign_file(path: Path) -> None:
    """Raise BadInput where the page would take the place of a file that is not a page of ours."""
    if path.exists() and (
        not path.is_file() or IDENTIFICATION_PAGE_MARK not in path.read_text("utf-8", errors="replace")[:2000]
    ):
        raise BadInput(f"will not replace {path}: it is no page of `identify`, allowed: another --out")


def render_identification(flights: Sequence[Samples], model: Model) -> str:
    """The page as HTML text."""
    flights_with_usable_mask = fitting.flights_with_usable_rows(flights)
    rate_regression = fitting.fit_least_squares_of_order(
        flights_with_usable_mask, model.vehicle, model.n_rate_lags, model.n_command_lags
    )
    coefficient_names = ["constant", *regressor_names(model)]
    return load_template("model.html.j2").render(
        mark=IDENTIFICATION_PAGE_MARK,
        model=model,
        found=model.identification_results,
        used=sum(
            int(flight_with_usable_mask.is_usable.sum())
            for flight_with_usable_mask in flights_with_usable_mask
        ),
        coefficients=list(
            zip(
                coefficient_names,
                rate_regression.coefficients.tolist(),
                rate_regression.standard_errors.tolist(),
                strict=True,
            )
        ),
        fits=_encode_png(_prediction_figure(flights_with_usable_mask, model)),
        spectrum=_encode_png(_spectrum_figure(flights_with_usable_mask, model)),
        correlation=_encode_png(_coefficient_correlation_figure(rate_regression, coefficient_names)),
    )


def _new_figure(width: float, height: float) -> Any:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained", dpi=110)


def _encode_png(figure: Any) -> str:
    buffer = BytesIO()
    figure.savefig(buffer, format="png")
    return b64encode(buffer.getvalue()).decode()


def _prediction_figure(flights_with_usable_mask: Sequence[fitting.FlightWithUsableRows], model: Model) -> Any:
    """Measured and predicted rates over the liveliest part of each flight (or half) that was left out."""
    fold_models_flights_names = [
        (fitting.fit_with_same_order(flights_fitted_in_fold, model), held_out, name)
        for flights_fitted_in_fold, held_out, name in fitting.validation_folds(flights_with_usable_mask)
    ]
    fold_models_flights_names = [
        fold_model_flight_name
        for fold_model_flight_name in fold_models_flights_names
        if fold_model_flight_name[1].is_usable.any()
    ][:_MAX_SHOWN_FLIGHTS]
    n_subfigures = max(len(fold_models_flights_names), 1)
    figure = _new_figure(11, 4.6 * n_subfigures)
    subfigures = figure.subfigures(n_subfigures, squeeze=False)[:, 0]
    for subfigure, (fold_model, held_out, name) in zip(subfigures, fold_models_flights_names, strict=False):
        axes = subfigure.subplots(3, 1, sharex=True)
        t_s, measured_rates, residual = _times_rates_residual_in_liveliest_window(
            fold_model, held_out, round(_PREDICTION_FIGURE_SPAN_S * model.rate_hz)
        )
        for i, axis in enumerate(axes):
            residual_deg_s, rate_deg_s = np.rad2deg(residual[:, i]), np.rad2deg(measured_rates[:, i])
            axis.plot(t_s, rate_deg_s, color="#888888", linewidth=2.2, label="measured")
            axis.plot(t_s, rate_deg_s - residual_deg_s, color=SERIES[0], linewidth=0.9, label="predicted")
            axis.plot(t_s, residual_deg_s, color=SERIES[1], linewidth=0.7, label="residual")
            _label_axis(axis, f"{'pqr'[i]}, deg/s")
        axes[0].set_title(f"{name}, not fitted: one sample ahead", fontsize=9, loc="left")
        axes[0].legend(loc="upper right", fontsize=7, ncols=3, framealpha=0.8)
        axes[-1].set_xlabel("time, s", fontsize=8)
    return figure


def _times_rates_residual_in_liveliest_window(
    model: Model, held_out: fitting.FlightWithUsableRows, window_samples: int
) -> tuple[Floats, Floats, Floats]:
    """Times, rates and residual of the liveliest window; nan where nothing is known, for lines to end."""
    rows, residual = fitting.rows_and_one_step_residuals(model, held_out)
    rates_or_nan = np.full_like(held_out.samples.rates, np.nan)
    residual_or_nan = np.full_like(held_out.samples.rates, np.nan)
    rates_or_nan[rows], residual_or_nan[rows] = held_out.samples.rates[rows], residual
    first_row = _first_row_of_liveliest_window(rates_or_nan, rows, window_samples)
    window_rows = slice(first_row, first_row + window_samples)
    return held_out.samples.t_s[window_rows], rates_or_nan[window_rows], residual_or_nan[window_rows]


def _first_row_of_liveliest_window(
    measured_rates: Floats, rows: NDArray[np.int64], window_samples: int
) -> int:
    """First sample of the window in which the rates known moved most."""
    squared_rate_norms = np.zeros(len(measured_rates))
    squared_rate_norms[rows] = (measured_rates[rows] ** 2).sum(axis=1)
    cumulated_squares = np.concatenate([[0.0], np.cumsum(squared_rate_norms)])
    return (
        int(np.argmax(cumulated_squares[window_samples:] - cumulated_squares[:-window_samples]))
        if len(measured_rates) > window_samples
        else 0
    )


def _spectrum_figure(flights_with_usable_mask: Sequence[fitting.FlightWithUsableRows], model: Model) -> Any:
    """Density of the residual, and what white noise of the same variance would have."""
    residual = np.vstack(
        [
            fitting.rows_and_one_step_residuals(model, flight_with_usable_mask)[1]
            for flight_with_usable_mask in flights_with_usable_mask
        ]
    )
    frequency_hz, residual_power_densities = power_spectral_density(residual, 1.0 / model.rate_hz)
    figure = _new_figure(7.5, 3.2)
    axis = figure.subplots()
    for i, name in enumerate("pqr"):
        axis.loglog(
            frequency_hz[1:], residual_power_densities[1:, i], color=SERIES[i], linewidth=1.1, label=name
        )
        white_noise_density = residual[:, i].var() / (0.5 * model.rate_hz)
        axis.axhline(white_noise_density, color=SERIES[i], linewidth=0.7, linestyle=":")
    axis.set_xlabel("frequency, Hz", fontsize=8)
    axis.set_title("residual (dotted: white noise of the same variance)", fontsize=9, loc="left")
    _label_axis(axis, "density, (rad/s)² / Hz", which="both")
    axis.legend(fontsize=8)
    return figure


def _coefficient_correlation_figure(rate_regression: RateRegression, coefficient_names: list[str]) -> Any:
    """Correlation of the errors of the coefficients."""
    side_inches = 2.5 + 0.19 * len(coefficient_names)
    figure = _new_figure(side_inches + 0.8, side_inches)
    axis = figure.subplots()
    image = axis.imshow(rate_regression.coefficient_error_correlation, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    axis.set_xticks(range(len(coefficient_names)), coefficient_names, rotation=90, fontsize=6)
    axis.set_yticks(range(len(coefficient_names)), coefficient_names, fontsize=6)
    figure.colorbar(image, shrink=0.7).ax.tick_params(labelsize=7)
    return figure
