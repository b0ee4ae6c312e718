"""The pictures of a flight: which views are drawn, over which time, and each as a PNG, PDF or SVG file."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from beaver_ftc.results.figures import Options, draw
from beaver_ftc.results.log import StoredLog, Values
from beaver_ftc.results.model import Metrics
from beaver_ftc.results.panels import View
from beaver_ftc.results.series import WHOLE_FLIGHT_S, series_of
from beaver_ftc.results.style import SOFTWARE_MARK, Mark, closeup_window, marks
from beaver_ftc.results.views import views_of_flight


@dataclass(frozen=True)
class Picture:
    """A view to be drawn into a file: its series (points,) by column, the event marks and the subtitle."""

    path: Path
    view: View
    series: Values
    event_marks: Sequence[Mark]
    subtitle: str


def pictures_of(
    log_path: Path, metrics: Metrics, folder: Path, formats: Sequence[str] = ("png",)
) -> list[Picture]:
    """All pictures of a log: every view over the whole flight, and those with `closeup` also around the
    events (`closeup_window`).

    formats: png, pdf, svg; PDF and SVG are drawn in the style of a paper.
    """
    source = StoredLog(log_path)
    views = views_of_flight(source.columns, metrics)
    event_marks = marks(metrics)
    window = closeup_window(event_marks)
    groups = [(views, WHOLE_FLIGHT_S, "")]
    if window:
        groups.append((tuple(view for view in views if view.closeup), window, "-closeup"))
    pictures = []
    for group, span, ending in groups:
        series = series_of(source, [name for view in group for name in view.columns], span)
        for view in group:
            view_series = {name: series[name] for name in ("t_s", *view.columns)}
            for kind in formats:
                path = folder / f"{view.name}{ending}.{kind}"
                pictures.append(Picture(path, view, view_series, event_marks, metrics.scenario))
    return pictures


def save(picture: Picture) -> None:
    """Draw a picture into its file; vector graphics in the style of a paper. The same flight gives the same
    bytes."""
    from matplotlib import rc_context

    kind = picture.path.suffix.removeprefix(".")
    style = "screen" if kind == "png" else "paper"
    figure = draw(picture.view, picture.series, picture.event_marks, picture.subtitle, style)
    with rc_context({"svg.hashsalt": SOFTWARE_MARK}):  # without it, the ids of elements in an SVG are random
        figure.savefig(picture.path, **_SAVE_OPTIONS_OF_FORMAT[kind])


# No date: it would differ in every run.
_SAVE_OPTIONS_OF_FORMAT: Options = {
    # level 1 of zlib: files are a tenth larger than with level 6, in two thirds of the time
    "png": {"metadata": {"Software": SOFTWARE_MARK}, "pil_kwargs": {"compress_level": 1}},
    "pdf": {"metadata": {"Creator": SOFTWARE_MARK, "CreationDate": None}},
    "svg": {"metadata": {"Creator": SOFTWARE_MARK, "Date": None}},
}
