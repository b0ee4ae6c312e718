"""What docs/results/mechanisms.md shows of the study that `beaver-ftc mechanisms` flies."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from beaver_ftc.studies.mechanisms import shown
from beaver_ftc.studies.mechanisms.command import run_mechanisms
from beaver_ftc.studies.mechanisms.survey import Flight, fly_one
from beaver_ftc.studies.mechanisms.systems import DIAGNOSIS, LAW
from beaver_ftc.studies.present.tables import markdown_table, number
from tools.docs.tables import shared

Document = dict[str, Any]
SEED = 1
SEEDS = (SEED,)  # of all results on the page
PROBED = (
    Flight("loss 40 %", "high", 0.0, "exact sensors", 1),
    Flight("unanticipated", "low", 0.02, "real sensors", 0),
)
_PICTURED = (
    "Net share of flights that are worse without each mechanism, by four criteria, with 95 % intervals"
)


@shared
def _flown() -> tuple[Document, bytes]:
    with TemporaryDirectory() as name:
        document = run_mechanisms(Path(name), seed=SEED, workers=2)
        return document, Path(document["folder"], f"{shown.NAME}.png").read_bytes()


def mechanisms_findings() -> str:
    """What each mechanism is worth, in sentences; and the figure."""
    document, drawn = _flown()
    Path("images").mkdir(exist_ok=True)
    Path("images/mechanisms.png").write_bytes(drawn)
    says = "\n".join(f"- {sentence}" for sentence in shown.sentences(document))
    return f"{says}\n\n![{_PICTURED}](images/mechanisms.png)"


def mechanisms_systems() -> str:
    """Both systems with all of their mechanisms."""
    return markdown_table(shown.SYSTEM_HEAD, shown.system_rows(_flown()[0]))


def mechanisms_net() -> str:
    """Net shares of flights that are worse without each mechanism."""
    return _rows(shown.NET_HEAD, shown.net_row)


def mechanisms_same() -> str:
    """In how many flights a mechanism changes nothing."""
    return _rows(shown.SAME_HEAD, shown.same_row)


def mechanisms_medians() -> str:
    """Delay and tracking with and without each mechanism."""
    return _rows(shown.MEDIAN_HEAD, shown.median_row)


def _rows(head: tuple[str, ...], row_of: Any) -> str:
    return markdown_table(head, [row_of(row) for row in _flown()[0]["mechanisms"]])


def mechanisms_by_instruments() -> str:
    """Late alarms without each mechanism of the diagnosis, by instruments."""
    return _by("instruments", "late", DIAGNOSIS)


def mechanisms_by_error() -> str:
    """Names lost without each mechanism of the diagnosis, by undeclared error."""
    return _by("error", "names", DIAGNOSIS)


def mechanisms_by_fault() -> str:
    """Worse tracking without each mechanism of the law, by fault."""
    return _by("fault", "tracking", LAW)


def mechanisms_by_bandwidth() -> str:
    """Worse tracking without each mechanism of the law, by bandwidth."""
    return _by("bandwidth", "tracking", LAW)


def _by(factor: str, criterion: str, serves: str) -> str:
    document = _flown()[0]
    return markdown_table(
        shown.level_head(document, factor), shown.level_rows(document, factor, criterion, serves)
    )


def mechanisms_alarms() -> str:
    """False alarms, and how many of them are explained."""
    return markdown_table(shown.ALARM_HEAD, shown.alarm_rows(_flown()[0]))


def mechanisms_margins() -> str:
    """Margins of the healthy loops."""
    return markdown_table(shown.MARGIN_HEAD, shown.margin_rows(_flown()[0]))


def mechanisms_probe() -> str:
    """A few flights of the survey, to more digits."""
    return "\n".join(
        f"{key}: {outcome['verdict']} {number(outcome['tracking_deg_s'], none='lost', digits=6)}"
        for flight in PROBED
        for key, outcome in fly_one(SEED, flight).items()
    )
