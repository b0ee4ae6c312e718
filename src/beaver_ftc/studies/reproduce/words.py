"""The reproduction in words: rows of the tables that terminal, Markdown and HTML share."""

from typing import Any

from beaver_ftc.results.metrics import Document

VERDICT_HEAD = ("Published", "Statement", "Our number", "Verdict", "Remark")
SENSITIVITY_HEAD = ("Published", "Statement", "From", "To", "Held")
CHOICES_HEAD = ("Key", "Value", "Reason")


def number(value: float | None, unit: str = "") -> str:
    """A number in three digits with its unit; shares of something in percent."""
    if value is None:
        return "never"
    if unit.startswith("of "):
        return f"{100 * value:.1f} % {unit}"
    return f"{_digits(value)} {unit}".rstrip()


def _digits(value: float) -> str:
    """Three digits without an exponent, nothing after the point where there are three before it."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def limit(claim: Document) -> str:
    """What is asked of a claim's number."""
    percent = claim["unit"].startswith("of ")
    asked = f"{100 * claim['limit']:.0f} %" if percent else _digits(claim["limit"])
    return f"{'at least' if claim['at_least'] else 'at most'} {asked}"


def ours(claim: Document) -> str:
    """Quantity, number, and what is asked of it."""
    return f"{claim['quantity']} {number(claim['number'], claim['unit'])} ({limit(claim)})"


def verdict(claim: Document) -> str:
    """Whether the statement is borne out."""
    return "borne out" if claim["passed"] else "NOT BORNE OUT"


def verdict_rows(document: Document) -> list[tuple[str, ...]]:
    """One row a statement, for VERDICT_HEAD."""
    return [
        (claim["where"], claim["statement"], ours(claim), verdict(claim), claim["remark"])
        for claim in document["claims"]
    ]


def sensitivity_rows(document: Document) -> list[tuple[str, ...]]:
    """One row a statement: its number's range over the variants, for SENSITIVITY_HEAD."""
    count = len(document["sensitivity"])
    return [
        (
            claim["where"],
            claim["statement"],
            number(claim["lowest"], claim["unit"]),
            number(claim["highest"], claim["unit"]),
            f"{claim['held_in']} of {count}",
        )
        for claim in document["claims"]
    ]


def exceptions(document: Document) -> list[str]:
    """One sentence for each statement that a variant does not bear out."""
    return [
        f"{row['variant']}: {missed['where']}, {missed['statement'][:1].lower()}{missed['statement'][1:-1]}: "
        f"{number(missed['number'], missed['unit'])}"
        for row in document["sensitivity"]
        for missed in row["missed"]
    ]


def choice_rows(document: Document) -> list[tuple[str, ...]]:
    """One row a choice, for CHOICES_HEAD."""
    return [(choice["key"], _value(choice["value"]), choice["reason"]) for choice in document["choices"]]


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_value(part)}" for key, part in value.items())
    if isinstance(value, list):
        return "; ".join(_value(part) for part in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def summary(document: Document) -> str:
    """The outcome in a sentence."""
    claims, variants = document["claims"], document["sensitivity"]
    held = sum(claim["passed"] for claim in claims)
    always = sum(claim["held_in"] == len(variants) for claim in claims)
    return (
        f"{held} of {len(claims)} published statements are borne out; {always} of them under every one of "
        f"{len(variants)} changes to what the paper leaves open."
    )
