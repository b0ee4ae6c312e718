"""The page of an identification: how well the model does where it was not fitted, and what is known of it."""

from base64 import b64encode
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.identification import regressor_names
from beaver_ftc.flights.identify import Stretch, fit_like, fit_order, stretches_of
from beaver_ftc.flights.model import Model
from beaver_ftc.flights.page import template
from beaver_ftc.flights.recording import Floats
from beaver_ftc.flights.regression import Fit, spectrum
from beaver_ftc.flights.samples import Samples
from beaver_ftc.flights.testing import folds, residual_rows, residuals
from beaver_ftc.results.style import SERIES

MARK = '<meta name="generator" content="beaver-ftc identify">'
_SHOWN_S = 40.0
_MOST_PARTS = 3


def check_page(path: Path) -> None:
    """Raise BadInput where the page would take the place of a file that is not a page of ours."""
    if path.exists() and (not path.is_file() or MARK not in path.read_text("utf-8", errors="replace")[:2000]):
        raise BadInput(f"will not replace {path}: it is no page of `identify`, allowed: another --out")


def render_model(flights: Sequence[Samples], model: Model) -> str:
    """The page as HTML text."""
    stretches = stretches_of(flights)
    fit = fit_order(stretches, model.vehicle, model.history, model.lags)
    return template("model.html.j2").render(
        mark=MARK,
        model=model,
        found=model.identified,
        used=sum(int(stretch.use.sum()) for stretch in stretches),
        coefficients=_coefficients(fit, model),
        fits=_encoded(_fits(stretches, model)),
        spectrum=_encoded(_spectrum(stretches, model)),
        correlation=_encoded(_correlation(fit, model)),
    )


def _coefficients(fit: Fit, model: Model) -> list[dict[str, Any]]:
    """Each regressor's coefficient and standard error, an axis."""
    return [
        {"name": name, "value": fit.coefficients[i].tolist(), "sd": fit.standard_errors[i].tolist()}
        for i, name in enumerate(["constant", *regressor_names(model)])
    ]


def _figure(width: float, height: float) -> Any:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained", dpi=110)


def _encoded(figure: Any) -> str:
    buffer = BytesIO()
    figure.savefig(buffer, format="png")
    return b64encode(buffer.getvalue()).decode()


def _fits(stretches: Sequence[Stretch], model: Model) -> Any:
    """Measured and predicted rates over the liveliest part of each flight (or half) that was left out."""
    parts = [(fit_like(fitted, model), kept, name) for fitted, kept, name in folds(stretches)]
    parts = [part for part in parts if part[1].use.any()][:_MOST_PARTS]
    figure = _figure(11, 4.6 * max(len(parts), 1))
    for block, (fitted, kept, name) in zip(
        figure.subfigures(max(len(parts), 1), 1, squeeze=False)[:, 0], parts, strict=False
    ):
        axes = block.subplots(3, 1, sharex=True)
        rows, residual = residual_rows(fitted, kept)
        begin = _liveliest(kept.samples.rates, rows, round(_SHOWN_S * model.rate_hz))
        inside = (rows >= begin) & (rows < begin + round(_SHOWN_S * model.rate_hz))
        t_s, measured = kept.samples.t_s[rows[inside]], kept.samples.rates[rows[inside]]
        for i, axis in enumerate(axes):
            left = np.rad2deg(residual[inside, i])
            axis.plot(t_s, np.rad2deg(measured[:, i]), color="#888888", linewidth=2.2, label="measured")
            axis.plot(
                t_s, np.rad2deg(measured[:, i]) - left, color=SERIES[0], linewidth=0.9, label="predicted"
            )
            axis.plot(t_s, left, color=SERIES[1], linewidth=0.7, label="residual")
            axis.set_ylabel(f"{'pqr'[i]}, deg/s", fontsize=8)
            axis.tick_params(labelsize=8)
            axis.grid(color="#dddddd", linewidth=0.5)
        axes[0].set_title(f"{name}, not fitted: one sample ahead", fontsize=9, loc="left")
        axes[0].legend(loc="upper right", fontsize=7, ncols=3, framealpha=0.8)
        axes[-1].set_xlabel("time, s", fontsize=8)
    return figure


def _liveliest(rates: Floats, rows: NDArray[np.int64], length: int) -> int:
    """First sample of the window in which the rates known moved most."""
    square = np.zeros(len(rates))
    square[rows] = (rates[rows] ** 2).sum(axis=1)
    total = np.concatenate([[0.0], np.cumsum(square)])
    return int(np.argmax(total[length:] - total[:-length])) if len(rates) > length else 0


def _spectrum(stretches: Sequence[Stretch], model: Model) -> Any:
    """Density of the residual, and what white noise of the same variance would have."""
    residual = np.vstack([residuals(model, stretch)[0] for stretch in stretches])
    frequency, density = spectrum(residual, 1.0 / model.rate_hz)
    figure = _figure(7.5, 3.2)
    axis = figure.subplots()
    for i, name in enumerate("pqr"):
        axis.loglog(frequency[1:], density[1:, i], color=SERIES[i], linewidth=1.1, label=name)
        axis.axhline(
            residual[:, i].var() / (0.5 * model.rate_hz), color=SERIES[i], linewidth=0.7, linestyle=":"
        )
    axis.set_xlabel("frequency, Hz", fontsize=8)
    axis.set_ylabel("density, (rad/s)² / Hz", fontsize=8)
    axis.set_title("residual (dotted: white noise of the same variance)", fontsize=9, loc="left")
    axis.tick_params(labelsize=8)
    axis.grid(color="#dddddd", linewidth=0.5, which="both")
    axis.legend(fontsize=8)
    return figure


def _correlation(fit: Fit, model: Model) -> Any:
    """Correlation of the errors of the coefficients."""
    names = ["constant", *regressor_names(model)]
    size = 2.5 + 0.19 * len(names)
    figure = _figure(size + 0.8, size)
    axis = figure.subplots()
    image = axis.imshow(fit.correlation, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    axis.set_xticks(range(len(names)), names, rotation=90, fontsize=6)
    axis.set_yticks(range(len(names)), names, fontsize=6)
    figure.colorbar(image, shrink=0.7).ax.tick_params(labelsize=7)
    return figure
