"""A flight that is replayed on the front page: drawn by what draws a report, and small."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from beaver_ftc.documents.files import read_json
from beaver_ftc.results import report
from beaver_ftc.results.style import MODE_COLOURS, marks
from tools.docs.tables import front

SCENARIO = front.VIEW.name  # that of the picture in whose place the replay is, with its panels
LEAD_S, SPAN_S = 4.0, 30.0  # the replay starts so long before the fault, and shows so much of the curves
VIEW = replace(front.VIEW, name="curves", title="")


def page() -> str:
    """Fly it; the page as HTML that needs no other file."""
    from beaver_ftc.results.model import Metrics
    from beaver_ftc.results.writer import run
    from beaver_ftc.scenario.schema import load_scenario

    with TemporaryDirectory() as out:
        metrics = run(load_scenario(SCENARIO), Path(out), report=False)
        folder = Path(out, metrics["scenario"])
        kept = read_json(folder / "metrics.json")
        return report.template(Path(__file__).with_name("replay.html.j2")).render(
            scenario=SCENARIO,
            modes=MODE_COLOURS,
            marks=marks(Metrics.of(metrics)),
            start_s=metrics["fault"]["at_s"] - LEAD_S,
            span_s=SPAN_S,
            **report.script_style_and_data([folder], [Metrics.of(kept)], shown=[VIEW]),
        )
