"""The table of docs/results/validation.md against the literature: the truth and data of the FDC equations."""

from collections.abc import Iterable

from beaver_ftc.studies.present.tables import markdown_table
from tools.fdc_check import RESPONSE_BAR, Agreement, derivative_agreement, response_agreement

HEAD = ("compared", "frame rate, Hz", "worst signal", "error, %", "limit, %")


def fdc() -> str:
    """The derivative with the largest error of those with a bar; of each doublet the worst signal."""
    derivatives = (each for each in derivative_agreement() if each.bar is not None)
    doublets = [
        (f"{surface} doublet", f"{rate_hz}", *_worst(response_agreement(surface, rate_hz)))
        for surface in ("aileron", "elevator")
        for rate_hz in RESPONSE_BAR
    ]
    return markdown_table(HEAD, [("derivatives", "", *_worst(derivatives)), *doublets])


def _worst(agreements: Iterable[Agreement]) -> tuple[str, str, str]:
    worst = max(agreements, key=lambda each: each.error)
    return worst.signal.partition("_")[0], f"{100 * worst.error:.2f}", f"{100 * worst.bar:g}"
