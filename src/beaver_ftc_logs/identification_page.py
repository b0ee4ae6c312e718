"""The page of an identification: how well a model predicts, its residual, its coefficients."""

from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.results import SERIES_COLOURS as SERIES
from beaver_ftc.studies.present import panels
from beaver_ftc_logs import orders
from beaver_ftc_logs.fit_checks import regressor_names
from beaver_ftc_logs.fit_parts import Parts, fit_parts, one_step_residuals
from beaver_ftc_logs.folds import Fold, held_out_folds
from beaver_ftc_logs.least_squares import Regression, spectral_density
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.pages import encode_png, label_axis, load_template
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.samples import Samples

PAGE_MARK = '<meta name="generator" content="beaver-ftc identify">'
_FIGURE_SPAN_S = 40.0  # length of the part of a flight that is drawn
_MAX_SHOWN_FLIGHTS = 3


def refuse_foreign_file(path: Path) -> None:
    """Raise BadInput if the page would replace a file that is no page of `identify`."""
    is_page = path.is_file() and PAGE_MARK in path.read_text("utf-8", errors="replace")[:2000]
    if path.exists() and not is_page:
        raise refusal(f"will not replace {path}", "it is no page of `identify`", "another --out")


def render_identification(flights: Sequence[Samples], model: Model) -> str:
    """The page as HTML text."""
    usable = fit_parts(flights)
    # The model keeps the standard errors of its responses only. The page shows those of all coefficients and
    # their correlation, in a fit to the flights as they are, not whitened.
    fit = orders.fit_order(usable, model.vehicle, model.history, model.lags)
    names = ["constant", *regressor_names(model)]
    return load_template("model.html.j2").render(
        mark=PAGE_MARK,
        model=model,
        found=model.identified,
        used=sum(int(flight.is_usable.sum()) for flight in usable),
        coefficients=list(zip(names, fit.coefficients.tolist(), fit.standard_errors.tolist(), strict=True)),
        fits=encode_png(_prediction_figure(usable, model)),
        spectrum=encode_png(_spectrum_figure(usable, model)),
        correlation=encode_png(_correlation_figure(fit, names)),
    )


def _prediction_figure(usable: Parts, model: Model) -> Any:
    """Measured and predicted rates of up to _MAX_SHOWN_FLIGHTS flights (or halves) left out, each over the
    part in which the rates move most.
    """
    from matplotlib.figure import Figure

    used = (fold for fold in held_out_folds(usable, model, None) if fold.held_out.is_usable.any())
    folds = list(islice(used, _MAX_SHOWN_FLIGHTS))
    n = max(len(folds), 1)  # without a fold: an empty figure
    figure = Figure(figsize=(11, 4.6 * n), layout="constrained", dpi=110)
    parts = figure.subfigures(n, squeeze=False)[:, 0]
    for part, fold in zip(parts, folds, strict=False):  # one part more where there is no fold
        axes = part.subplots(3, 1, sharex=True)
        t_s, rates, residual = _liveliest_window(fold, round(_FIGURE_SPAN_S * model.rate_hz))
        for i, axis in enumerate(axes):
            measured = np.rad2deg(rates[:, i])
            error = np.rad2deg(residual[:, i])
            axis.plot(t_s, measured, color="#888888", linewidth=2.2, label="measured")
            axis.plot(t_s, measured - error, color=SERIES[0], linewidth=0.9, label="predicted")
            axis.plot(t_s, error, color=SERIES[1], linewidth=0.7, label="residual")
            label_axis(axis, f"{'pqr'[i]}, deg/s")
        axes[0].set_title(f"{fold.name}, not fitted: one sample ahead", fontsize=9, loc="left")
        axes[0].legend(loc="upper right", fontsize=7, ncols=3, framealpha=0.8)
        axes[-1].set_xlabel("time, s", fontsize=8)
    return figure


def _liveliest_window(fold: Fold, n: int) -> tuple[Floats, Floats, Floats]:
    """Times (n,), s, rates and residual (n, 3), rad/s, of the n samples with the largest sum of squared known
    rates; NaN where a rate is not known: the drawn line ends there. The whole flight if it is shorter."""
    samples = fold.held_out.samples
    known = fold.held_out.one_step_innovations(fold.model)
    rates, residual = np.full((2, *samples.rates.shape), np.nan)
    rates[known.rows] = samples.rates[known.rows]
    residual[known.rows] = known.e
    energy = np.concatenate([[0.0], np.cumsum(np.nansum(rates**2, axis=1))])
    first = int(np.argmax(energy[n:] - energy[:-n])) if len(rates) > n else 0
    window = slice(first, first + n)
    return samples.t_s[window], rates[window], residual[window]


def _spectrum_figure(usable: Parts, model: Model) -> Any:
    """Density of the residual by frequency, and that of white noise of the same variance."""
    residual = one_step_residuals(usable, model)
    f_hz, power = spectral_density(residual, model.rate_hz)
    figure, ((axis,),) = panels(1, 1, 7.5, 3.2)
    for i, name in enumerate("pqr"):
        axis.loglog(f_hz[1:], power[1:, i], color=SERIES[i], linewidth=1.1, label=name)
        white = residual[:, i].var() / (0.5 * model.rate_hz)
        axis.axhline(white, color=SERIES[i], linewidth=0.7, linestyle=":")
    axis.set_xlabel("frequency, Hz", fontsize=8)
    axis.set_title("residual (dotted: white noise of the same variance)", fontsize=9, loc="left")
    label_axis(axis, "density, (rad/s)² / Hz", which="both")
    axis.legend(fontsize=8)
    return figure


def _correlation_figure(fit: Regression, names: list[str]) -> Any:
    """Correlation of the errors of the coefficients of a fit; names: of the coefficients."""
    side = 2.5 + 0.19 * len(names)
    figure, ((axis,),) = panels(1, 1, side + 0.8, side)
    image = axis.imshow(fit.coefficient_error_correlation, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    axis.set_xticks(range(len(names)), names, rotation=90, fontsize=6)
    axis.set_yticks(range(len(names)), names, fontsize=6)
    figure.colorbar(image, shrink=0.7).ax.tick_params(labelsize=7)
    return figure
