"""What README shows: the published elevator case, from fault to recovery."""

from pathlib import Path
from tempfile import TemporaryDirectory

from beaver_ftc.results.figures import draw
from beaver_ftc.results.log import StoredLog
from beaver_ftc.results.model import Metrics
from beaver_ftc.results.panels import Panel, Trace, View
from beaver_ftc.results.series import series_of
from beaver_ftc.results.style import marks
from beaver_ftc.results.writer import run
from beaver_ftc.scenario.schema import load_scenario
from tools.docs.tables import picture

SPAN_S = (6.0, 24.0)
VIEW = View(
    "elevator-partial-loss",
    "Elevator loses 40 % of its effectiveness at 12 s",
    (
        Panel(
            "pitch rate q",
            (Trace("q_model_rad_s", "reference", "target"), Trace("q_rad_s", "aircraft", "actual")),
        ),
        Panel(
            "residual of q",
            (
                Trace("q_threshold_rad_s", "± threshold", "bound"),
                Trace("q_threshold_rad_s", "", "bound", -1.0),
                Trace("q_residual_rad_s", "residual", "residual"),
            ),
        ),
        Panel(
            "surfaces",
            (
                Trace("elevator_effective_rad", "elevator", "surface 1"),
                Trace("flap_effective_rad", "flap", "surface 3"),
            ),
        ),
    ),
)


def first_figure() -> str:
    """The picture a newcomer sees first, drawn of a flight flown now."""
    with TemporaryDirectory() as folder:
        metrics = Metrics.of(run(load_scenario(VIEW.name), Path(folder), report=False))
        series = series_of(StoredLog(Path(folder, VIEW.name, "log.parquet")), VIEW.columns, SPAN_S)
    said = "detected, isolated, and pitch handed over to the flap"
    says = "Pitch rate, residual and surfaces of the published elevator case"
    return picture(f"{VIEW.name}.png", says, draw(VIEW, series, marks(metrics), said))
