"""The report of one diagnosed flight: one HTML file that needs nothing else."""

from base64 import b64encode
from io import BytesIO
from typing import Any

import numpy as np

from beaver_ftc.flights.diagnose import Rows
from beaver_ftc.flights.model import Model
from beaver_ftc.flights.page import template
from beaver_ftc.flights.samples import Samples
from beaver_ftc.flights.verdict import BRIEF_S, lasting, looked_at
from beaver_ftc.results.style import SERIES

_MOST_POINTS = 6000


def render(samples: Samples, model: Model, rows: Rows, verdict: dict[str, Any]) -> str:
    """The report as HTML text."""
    return template("flight.html.j2").render(
        verdict=verdict,
        looked_at=looked_at(verdict),
        events=lasting(verdict["events"]),
        brief_s=BRIEF_S,
        model=model,
        picture=b64encode(picture(samples, model, rows)).decode(),
        ages=samples.age_s,
        notes=_notes(samples, model),
    )


def _notes(samples: Samples, model: Model) -> list[str]:
    gaps = int(samples.run[-1])
    said = [f"{len(samples.t_s)} samples at {1.0 / samples.dt_s:.3g} Hz, {gaps} gaps in the log."]
    said += [
        f"{name} has its own stamps: its last value is held, {age:.2f} s old on average."
        for name, age in samples.age_s.items()
    ]
    said += samples.notes
    said.append(
        f"The model was identified at {model.rate_hz:.3g} Hz; it predicts a sample from past ones, "
        f"{model.history} of the rates and {model.lags} of the commands."
    )
    return said


def picture(samples: Samples, model: Model, rows: Rows) -> bytes:
    """The flight on one page, PNG: commands, rates, effectiveness with bounds, probability of a fault."""
    from matplotlib.figure import Figure

    surfaces = list(model.vehicle.surfaces)
    figure = Figure(figsize=(11, 3.4 + 1.25 * len(surfaces)), layout="constrained", dpi=110)
    axes = figure.subplots(
        3 + len(surfaces),
        1,
        sharex=True,
        squeeze=False,
        height_ratios=[1.2, 1.2, *[1.0] * (len(surfaces) + 1)],
    )[:, 0]
    _lines(axes[0], samples.t_s, np.rad2deg(samples.rates), ["p", "q", "r"], "rates, deg/s")
    limit = float(np.rad2deg(np.nanpercentile(np.abs(samples.rates), 99.9))) * 1.3
    axes[0].set_ylim(-max(limit, 1.0), max(limit, 1.0))  # a landing's spike does not flatten the flight
    _lines(axes[1], samples.t_s, samples.commands, surfaces, "healthy surfaces'\nshare of travel")
    _lines(axes[2], rows.t_s, rows.probability[:, None], ["a fault"], "probability")
    axes[2].set_ylim(-0.05, 1.05)
    for i, surface in enumerate(surfaces):
        _effectiveness(axes[3 + i], rows, i, surface)
    for axis in axes:
        _shade(axis, rows)
        axis.grid(color="#dddddd", linewidth=0.5)
    axes[-1].set_xlabel("time, s")
    axes[-1].set_xlim(samples.t_s[0], samples.t_s[-1])
    buffer = BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def _thin(n: int) -> slice:
    return slice(None, None, max(n // _MOST_POINTS, 1))


def _lines(axis: Any, t_s: np.ndarray, values: np.ndarray, names: list[str], label: str) -> None:
    kept = _thin(len(t_s))
    for i, name in enumerate(names):
        axis.plot(t_s[kept], values[kept, i], color=SERIES[i % len(SERIES)], linewidth=0.7, label=name)
    axis.set_ylabel(label, fontsize=8)
    axis.legend(loc="upper left", fontsize=7, ncols=4, framealpha=0.8)
    axis.tick_params(labelsize=8)


def _effectiveness(axis: Any, rows: Rows, surface: int, name: str) -> None:
    kept = _thin(len(rows.t_s))
    axis.fill_between(
        rows.t_s[kept], rows.low[kept, surface], rows.high[kept, surface], color="#9cc4e4", step="post",
        linewidth=0, label="90 % bounds",
    )  # fmt: skip
    axis.step(rows.t_s[kept], rows.estimate[kept, surface], where="post", color="#0b3d66", linewidth=1.1)
    axis.set_ylim(-0.05, 1.08)
    axis.set_ylabel(f"{name}\neffectiveness", fontsize=8)
    axis.tick_params(labelsize=8)


def _shade(axis: Any, rows: Rows) -> None:
    """Where the alarm stands."""
    edges = np.flatnonzero(np.diff(rows.faulty, prepend=0, append=0))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        axis.axvspan(
            rows.t_s[begin], rows.t_s[min(end, len(rows.t_s) - 1)], color="#f4d6cc", alpha=0.45, lw=0
        )
