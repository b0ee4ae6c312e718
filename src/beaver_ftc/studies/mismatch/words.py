"""Names and numbers as people read them."""


def label(source: str) -> str:
    """A source's name in words."""
    return source.replace("_", " ")


def percent(share: float | None) -> str:
    """A share as a percentage; None is a share of nothing."""
    if share is None:
        return "no bound"
    value = 100.0 * share
    if 0.0 < value < 0.001:
        return "<0.001 %"
    return f"{value:.0f} %" if value >= 9.95 else f"{value:.2g} %"
