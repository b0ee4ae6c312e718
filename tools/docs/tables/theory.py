"""Table of the constants, in docs/reference/glossary.md; theory.yaml says which, and what each means."""

from importlib import import_module

import numpy as np

from beaver_ftc.studies.present.tables import markdown_table
from tools.data import beside

SECTIONS = beside(__file__)


def theory_constants() -> str:
    """The constants of the page, by the page that derives them."""
    rows = []
    for section, constants in SECTIONS.items():
        page = section.split("/")[1].split(".")[0]
        for meaning, place, unit in constants:
            module, _, name = place.rpartition(".")
            value = getattr(import_module(f"beaver_ftc.{module}"), name)
            rows.append((meaning, f"`{name}`", _said(value), unit, f"[{page}]({section})"))
    return markdown_table(("constant", "name", "value", "unit", "derived in"), rows)


def _said(value: float | tuple[float, ...] | np.ndarray) -> str:
    if isinstance(value, np.ndarray):
        return f"{value[0]:g} to {value[-1]:g}"
    return ", ".join(f"{one:.5g}" for one in np.atleast_1d(value))
