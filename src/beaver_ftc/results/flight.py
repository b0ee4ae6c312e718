"""A flight in Python: its log as a table, its metrics as a document and as records, its figures."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from beaver_ftc.documents.errors import BadInput, suggestion
from beaver_ftc.plugins import required
from beaver_ftc.results import model, verdict
from beaver_ftc.results.expectations import expectations_in_words
from beaver_ftc.results.log import Log, MemoryLog, StoredLog, Values
from beaver_ftc.results.metrics import metrics
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.schema import Scenario, ScenarioLike, load

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from beaver_ftc.control import Law
    from beaver_ftc.diagnosis import Detector
    from beaver_ftc.loop.outcome import Landing


class Proof(NamedTuple):
    """The proof of a flight's alarm and exclusions, as `Flight.proof` returns it.

    - `certificate`: the content of certificate.json.
    - `log`: a mapping from the name of a column to its values (frames,). The mapping has the columns of
      log.parquet. It also has the columns from which a check computes the certificate again.
    - `scenario`: the text of scenario.yaml, with all defaults filled in.
    """

    certificate: Document
    log: Values
    scenario: str


@dataclass(frozen=True, eq=False, repr=False)
class Flight:
    """A finished flight.

    - `scenario`: the scenario that was flown.
    - `metrics`: the content of metrics.json.
    - `name`: the scenario's name, which is also the name of the result folder.
    - `log`: a DataFrame with one row for each frame and the columns of log.parquet. Its `attrs` contain
      scenario, seed, verdict and units. Raises BadInput for a flight without a log.
    - `fault`, `detection`, `isolation`, `tracking`, `supervisor`, `departure`, `expectations`: the sections
      of `metrics` as records. `supervisor` is a tuple of `ModeChange` records. `expectations` is a tuple of
      `Expectation` records. `fault` is None if the scenario has no fault. `departure` is None if the aircraft
      was not lost.
    - `false_alarm`: True if an alarm was raised before any fault.
    - `passed`: True if every expectation was met.
    """

    scenario: Scenario
    metrics: Document
    _source: Log | None = field(default=None)

    @classmethod
    def landed(cls, landing: "Landing", log: Log | None) -> "Flight":
        """The flight of a landing."""
        return cls(landing.scenario, metrics(landing), log)

    @cached_property
    def log(self) -> "DataFrame":
        """One row a frame, the columns of log.parquet; `attrs` has scenario, seed, verdict and units.

        Raises BadInput for a flight that kept none.
        """
        from beaver_ftc.results.log import log_dataframe

        return log_dataframe(self._log_or_raise(), self._typed_metrics)

    @property
    def name(self) -> str:
        """The scenario's name, and that of the result folder."""
        return self.scenario.name

    @cached_property
    def _typed_metrics(self) -> model.Metrics:
        return model.Metrics.of(self.metrics)

    @property
    def fault(self) -> model.Fault | None:
        """The declared fault that begins first."""
        return self._typed_metrics.fault

    @property
    def detection(self) -> model.Detection:
        """The alarm."""
        return self._typed_metrics.detection

    @property
    def isolation(self) -> model.Isolation:
        """The fault that the diagnosis named."""
        return self._typed_metrics.isolation

    @property
    def tracking(self) -> model.Tracking:
        """The tracking errors, and the movement of the surfaces."""
        return self._typed_metrics.tracking

    @property
    def supervisor(self) -> tuple[model.ModeChange, ...]:
        """The changes of the mode of the supervisor."""
        return self._typed_metrics.supervisor

    @property
    def departure(self) -> model.Departure | None:
        """When and in which signal the aircraft was lost; None if it was kept."""
        return self._typed_metrics.departure

    @property
    def expectations(self) -> tuple[model.Expectation, ...]:
        """The expectations of the scenario, each with its result."""
        return self._typed_metrics.expectations

    @property
    def false_alarm(self) -> bool:
        """Whether there was an alarm before any fault."""
        return self._typed_metrics.false_alarm

    @property
    def passed(self) -> bool:
        """Whether every expectation was met."""
        return self._typed_metrics.passed

    def views(self) -> tuple[str, ...]:
        """The names of the views that `plot` can draw of this flight."""
        return tuple(self._view_of_name())

    def plot(
        self, view: str = "tracking", *, closeup: bool = False, style: Literal["screen", "paper"] = "screen"
    ) -> "Figure":
        """Draw one view of the flight and return it as a matplotlib Figure.

        - `view`: a name from `views()`.
        - `closeup`: if True, the figure shows only the time around the fault.
        - `style`: "screen" or "paper". A "paper" figure is 8.4 cm wide, and its text has at most 8 points. As
          a bitmap, the figure has 300 dots per inch.

        Raises BadInput for an unknown view or style.
        """
        from beaver_ftc.results.figures import STYLES, draw
        from beaver_ftc.results.series import WHOLE_FLIGHT_S, series_of
        from beaver_ftc.results.style import closeup_window, marks

        view_of_name = self._view_of_name()
        if view not in view_of_name:
            raise BadInput(f"view: {view!r:.60} is not known{suggestion(str(view), view_of_name)}")
        if style not in STYLES:
            raise BadInput(f"style: {style!r:.60} is not known, allowed: {', '.join(STYLES)}")
        event_marks = marks(self._typed_metrics)
        window = (closeup_window(event_marks) if closeup else None) or WHOLE_FLIGHT_S
        series = series_of(self._log_or_raise(), view_of_name[view].columns, window)
        return draw(view_of_name[view], series, event_marks, self.name, style)

    def certificate(self) -> Document:
        """The content of certificate.json: the alarm and the exclusions, each with the inequality that proves
        it.

        The certificate needs columns that the log does not have. To record these columns, the call flies the
        scenario again. Raises BadInput for a flight without a log, and for a scheme that has no certificate.
        """
        return self.proof().certificate

    def proof(self) -> Proof:
        """The certificate, and the data from which you can check the certificate.

        The `Proof` has the fields `certificate`, `log` and `scenario`. The log has more columns than
        log.parquet. The scenario is the text of scenario.yaml.
        """
        proof: Proof = required("proof", "certificate")(self.scenario, self._log_or_raise())
        return proof

    def save(self, out: str | PathLike[str] = "runs", *, report: bool = True) -> Path:
        """Write the result folder `out/<name>/` as `beaver-ftc run` does, and return its path.

        - `out`: the folder that contains the result folders.
        - `report`: if True, the call also writes report.html and the figures.

        If writing fails, no partial folder remains. Raises BadInput for a flight without a log, and
        SimulationFailed if the folder cannot be written.
        """
        from beaver_ftc.results.folder import result_folder
        from beaver_ftc.results.result_files import write_documents, write_report_files

        log = self._log_or_raise()
        with result_folder(Path(out), self.name) as folder:
            log.copy_to(folder / "log.parquet")
            write_documents(folder, self.scenario, self.metrics)
            if report:
                # After Ctrl-C the user waits: figures take seconds, and the report draws curves without them.
                interrupted = self._typed_metrics.interrupted_s is not None
                write_report_files(folder, self.metrics, formats=() if interrupted else ("png",))
        return Path(out) / self.name

    def _log_or_raise(self) -> Log:
        """The log. Raises BadInput for a flight without a log."""
        if self._source is None:
            raise BadInput(f"{self.name}: this flight kept no log, allowed: fly it with log=True")
        return self._source

    def _view_of_name(self) -> dict[str, Any]:
        """The views that the log allows, by name."""
        from beaver_ftc.results.views import views_of_flight

        views = views_of_flight(self._log_or_raise().columns, self._typed_metrics)
        return {view.name: view for view in views}

    def __repr__(self) -> str:
        lines = [f"{name:12} {text}" for name, text in self._verdict_lines()]
        return "\n".join([verdict.title(self._typed_metrics), *(f"  {line}" for line in lines)])

    def _repr_html_(self) -> str:
        cell = "style='text-align:left'"
        rows = "".join(
            f"<tr><th {cell}>{escape(name)}</th><td {cell}>{escape(text)}</td></tr>"
            for name, text in self._verdict_lines()
        )
        return f"<b>{escape(verdict.title(self._typed_metrics))}</b><table>{rows}</table>"

    def _verdict_lines(self) -> list[tuple[str, str]]:
        """(name, text) of each line of the verdict, of the tracking errors and of missed expectations."""
        tracked = [
            ("tracking", f"p {p}  q {q}  r {r} deg/s RMS {when} the fault")
            for when, p, q, r in verdict.tracking_rms_in_words(self._typed_metrics)
        ]
        missed = [
            ("missed", expectation.sentence)
            for expectation in expectations_in_words(self._typed_metrics)
            if not expectation.passed
        ]
        return [*verdict.verdict_lines(self._typed_metrics), *tracked, *missed]


def fly(
    scenario: ScenarioLike,
    *,
    log: bool = True,
    detector: "Detector | None" = None,
    law: "Law | None" = None,
    progress: Callable[[float], None] | None = None,
) -> Flight:
    """Fly a scenario to its end and return the finished flight.

    - `scenario`: a built-in name, the path of a file, a mapping or a `Scenario`.
    - `log`: if True, the log is kept in memory. Each frame adds one row of 0.8 kB.
    - `detector`, `law`: plug-in objects that replace the detector and the law of the scenario.
    - `progress`: a function that is called during the flight. Its argument is the share of the flight that
      has been flown, from 0 to 1.

    Raises BadInput for an unknown name, and if the aircraft cannot be trimmed. Raises SimulationFailed if a
    value becomes infinite or NaN.
    """
    from beaver_ftc.loop.loop import fly as fly_loop

    check_plug_in("detector", detector)
    check_plug_in("law", law)
    sink = MemoryLog() if log else None
    return Flight.landed(fly_loop(load(scenario), sink, progress, detector, law), sink)


def open_run(folder: str | PathLike[str]) -> Flight:
    """Open the flight in a result folder.

    - `folder`: the path of the folder, such as `runs/<name>`.

    The log is read from the file when `log` is first used. Raises BadInput if the folder is not the result of
    a run.
    """
    if not isinstance(folder, str | PathLike):
        raise BadInput(f"{folder!r:.60} is no folder, allowed: the result folder of a run")
    path = Path(folder)
    try:
        document = model.read_metrics(path / "metrics.json")
    except (OSError, ValueError) as error:
        raise BadInput(
            f"{path}: no metrics.json can be read there, allowed: the result folder of a run"
        ) from error
    log_path = path / "log.parquet"
    return Flight(load(path / "scenario.yaml"), document, StoredLog(log_path) if log_path.exists() else None)


def check_plug_in(what: str, plug_in: object) -> None:
    """Raise BadInput unless a plug-in is None or an object with `reset` and `step`. what: `detector` or
    `law`."""
    if plug_in is None:
        return
    lacking = [name for name in ("reset", "step") if not callable(getattr(plug_in, name, None))]
    if isinstance(plug_in, type) or lacking:
        description = (
            "a class" if isinstance(plug_in, type) else f"{plug_in!r:.60} without {' and '.join(lacking)}"
        )
        raise BadInput(f"{what}: this is {description}, allowed: an object with reset and step")
