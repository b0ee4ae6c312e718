"""Tables of docs/results/verification.md: the truth against data of the FDC equations."""

from beaver_ftc.documents.files import data_root
from beaver_ftc.studies.present.tables import markdown_table
from tools.fdc_check import RESPONSE_BAR, Agreement, derivative_agreement, response_agreement

DATA = data_root() / "tests" / "data"


def fdc_derivatives() -> str:
    """RMS error over RMS value of each state derivative, beside its bar."""
    rows = [
        (
            each.signal.partition("_")[0],
            f"{each.error:.1e}",
            "none" if each.bar is None else f"{each.bar:.0e}",
        )
        for each in derivative_agreement(DATA)
    ]
    return markdown_table(("derivative", "error", "limit"), rows)


def fdc_doublets() -> str:
    """Of each doublet the worst signal's largest error over its span, at both frame rates."""
    head = ("doublet", "frame rate, Hz", "worst signal", "error, % of span", "limit, %")
    rows = [
        (surface, f"{rate_hz}", *_worst(response_agreement(DATA, surface, rate_hz)))
        for surface in ("aileron", "elevator")
        for rate_hz in RESPONSE_BAR
    ]
    return markdown_table(head, rows)


def _worst(agreements: list[Agreement]) -> tuple[str, str, str]:
    worst = max(agreements, key=lambda each: each.error)
    return worst.signal.partition("_")[0], f"{100 * worst.error:.2f}", f"{100 * worst.bar:.0f}"
