"""Tables of docs/results/verification-fdc.md: the truth against data of the FDC equations."""

from beaver_ftc.documents.paths import data_root
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
    return markdown_table(("derivative", "error", "bar"), rows)


def fdc_doublets() -> str:
    """Of each doublet the worst signal's largest error over its span, at both frame rates."""
    head = ("doublet", *(f"error at {rate_hz} Hz" for rate_hz in RESPONSE_BAR))
    rows = [
        (surface, *(_worst(response_agreement(DATA, surface, rate_hz)) for rate_hz in RESPONSE_BAR))
        for surface in ("aileron", "elevator")
    ]
    return markdown_table(head, rows)


def _worst(agreements: list[Agreement]) -> str:
    worst = max(agreements, key=lambda each: each.error)
    return f"{worst.error:.2%} of {worst.bar:.0%} ({worst.signal.partition('_')[0]})"
