"""A flight that is replayed on the front page: drawn by what draws a report, and small."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory

from beaver_ftc.results import report
from beaver_ftc.results.style import MODE_COLOURS, marks
from beaver_ftc.results.views import Panel, Trace, View

SCENARIO = "elevator-partial-loss"  # that of the picture in whose place the replay is
LEAD_S, SPAN_S = 4.0, 30.0  # the replay starts so long before the fault, and shows so much of the curves
VIEW = View(
    "curves",
    "",
    (
        Panel(
            "pitch rate",
            (
                Trace("q_reference_rad_s", "commanded", "target"),
                Trace("q_rad_s", "aircraft", "actual"),
            ),
        ),
        Panel(
            "residual of the pitch rate",
            (
                Trace("q_threshold_rad_s", "threshold", "bound"),
                Trace("q_threshold_rad_s", "", "bound", -1.0),
                Trace("q_residual_rad_s", "residual", "actual"),
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


def page() -> str:
    """Fly it; the page as HTML that needs no other file."""
    from beaver_ftc.results.model import Metrics
    from beaver_ftc.results.writer import run
    from beaver_ftc.scenario.schema import load_scenario

    with TemporaryDirectory() as out:
        metrics = run(load_scenario(SCENARIO), Path(out), report=False)
        folder = Path(out, metrics["scenario"])
        kept = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
        return report.template(Path(__file__).with_name("replay.html.j2")).render(
            scenario=SCENARIO,
            modes=MODE_COLOURS,
            marks=marks(Metrics.of(metrics)),
            start_s=metrics["fault"]["at_s"] - LEAD_S,
            span_s=SPAN_S,
            **report.script_style_and_data([folder], [kept], shown=[VIEW]),
        )
