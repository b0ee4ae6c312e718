"""The columns of the log and of every table that a command writes: from the code that writes them."""

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path

import numpy as np

from beaver_ftc.aircraft import load
from beaver_ftc.control.profile import COLUMNS as PROFILE
from beaver_ftc.diagnosis.isolation import estimator_names
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant.channels import log_columns
from beaver_ftc.results.units import unit_of
from beaver_ftc.studies.detectability import levels, places
from beaver_ftc.studies.detectability.grid import WITHIN_S
from beaver_ftc.studies.mismatch import documents, split
from beaver_ftc.studies.mismatch.sources import SOURCES
from beaver_ftc.studies.present.tables import markdown_table
from beaver_ftc.studies.sweep.columns import columns_of
from beaver_ftc.studies.sweep.one_flight import FIXED
from beaver_ftc_logs.log_rows import LogRows
from tools.data import yaml_of

TEXTS = Path(__file__).with_name("columns.yaml")
NUMBER, TEXT, FLAG = "number", "text", "flag"
_KINDS = {"float": NUMBER, "double": NUMBER, "int": "count", "int64": "count", "text": TEXT,
          "string": TEXT, "flag": FLAG, "bool": FLAG}  # fmt: skip
_WORDS = {
    "AXIS": "[pqr]",
    "SURFACE": "|".join((*load().surfaces, "SURFACE")),
    "ESTIMATOR": "|".join(estimator_names("all", load())),
    "SIGNAL": "|".join(load().signals),
    "SOURCE": "|".join(SOURCES),
    "WITHIN": "[0-9.]+",
    "MODE": "adaptive|reallocated|unanticipated",
    "QUANTITY": "altitude_m|airspeed_mps|heading_deg|bank_deg",
    "END": "lower|upper|low|high|from|to|lowest|highest",
}

Columns = Mapping[str, str]  # name -> type


# Columns that are no numbers.
_OTHERS = {
    **dict.fromkeys(("sensors", "turbulence", "surface", "scheme", "fault", "confused_with", "other", "why",
                     "named", *documents.PLACE), TEXT),
    **dict.fromkeys(("false_alarm", "own_false_alarm", "faulty"), FLAG), "seed": "count",
}  # fmt: skip


@cache
def tables() -> dict[str, Columns]:
    """The columns of each table."""
    aircraft, of_sweep = load(), FIXED | columns_of(load().surfaces)
    no_rows, no_surfaces = np.empty(0), np.empty((0, 1))
    rows = LogRows(no_rows, no_rows, no_rows, no_surfaces, no_surfaces, no_surfaces, no_rows, no_rows)
    names = {
        "detectability-grid": levels.COLUMNS,
        "detectability": (*places.POINT_COLUMNS, *places.PAIR_COLUMNS),
        "mismatch": (*documents.PLACE, *documents.FIGURES),
        "mismatch-frames": split.COLUMNS,
        "diagnosis": rows.table(["SURFACE"], with_probability=True),
    }
    estimators = estimator_names("all", aircraft)
    log = log_columns(aircraft, estimators, 3, aircraft.power_setting, PROFILE, True)
    return {
        "log": dict.fromkeys(log, NUMBER),
        "sweep": {name: _KINDS[kind] for name, kind in of_sweep.items()},
        **{table: {name: _OTHERS.get(name, NUMBER) for name in of} for table, of in names.items()},
    }


_SAYS = """Which columns do the log of a flight and the tables of studies have? *Example.* This program prints
when the residual of the pitch axis first exceeds its threshold, 12.01 s:

```python
import beaver_ftc as bf

log = bf.fly("elevator-partial-loss").log
ratio = (log.q_alarm_residual_rad_s / log.q_alarm_threshold_rad_s).abs()
print(log.t_s[ratio > 1].iloc[0])
```

The unit `1` is a pure number, a "flag" is true or false, a "count" a whole number. The
[glossary](reference/glossary.md) has terms and signs. In a name, a word in capitals stands for:

| word | stands for |
| --- | --- |
| AXIS | `p`, `q`, `r` |
| SURFACE | each surface, for example `elevator` |
| ESTIMATOR | each isolation estimator: a surface, or a surface and a fault type |
| SIGNAL | each signal that the aircraft file declares, for example `dpt` |
| END | `lower`, `upper`, `low`, `high`, `lowest`, `highest`; `from`, `to` |
| MODE | `adaptive`, `reallocated`, `unanticipated` |
| QUANTITY | `altitude_m`, `airspeed_mps`, `heading_deg`, `bank_deg` |
| SOURCE | each source of the mismatch: {sources} |
| WITHIN | a number of seconds: {within} |"""
_NEXT = """## Next

[Open a flight in other tools](reference/python.md#other-tools) shows how to read the files."""


def page() -> str:
    """The page."""
    texts = yaml_of(TEXTS)
    return (
        "\n\n".join(["# Columns", _said(), *(_table(name, texts[name]) for name in tables()), _NEXT]) + "\n"
    )


def _said() -> str:
    sources, within = (
        ", ".join(f"`{name}`" for name in names) for names in (SOURCES, (f"{s:g}" for s in WITHIN_S))
    )
    return _SAYS.replace("{sources}", sources).replace("{within}", within)


def _table(name: str, text: Mapping[str, str]) -> str:
    rows = markdown_table(("column", "unit or type", "meaning"), list(_rows(name, text["columns"])))
    return f"## {text['title']}\n\n{text['says']}\n\n{rows}"


def _unit(pattern: str, name: str) -> str:
    if pattern.endswith("QUANTITY"):
        return "in the name"
    either = pattern in ("isolation.estimate", "isolation.estimate_interval.END")
    return "1 or rad" if either else unit_of(name)


def _rows(table: str, meanings: Mapping[str, str]) -> Iterator[tuple[str, ...]]:
    """A row a pattern, where the first column of it stands."""
    done = set()
    for name, kind in tables()[table].items():
        pattern = pattern_of(name, meanings)
        if pattern not in done:
            done.add(pattern)
            yield f"`{pattern}`", _unit(pattern, name) if kind == NUMBER else kind, meanings[pattern]


def pattern_of(name: str, patterns: Iterable[str]) -> str:
    """The pattern that a column's name follows, the plainest if several. BadInput for a name with none."""
    fitting = [pattern for pattern in patterns if re.fullmatch(_regular(pattern), name)]
    if not fitting:
        raise BadInput(f"{name}: what this column means is missing in {TEXTS.name}")
    return min(fitting, key=lambda pattern: sum(word in pattern for word in _WORDS))


def _regular(pattern: str) -> str:
    pattern = re.escape(pattern)
    for word, names in _WORDS.items():
        pattern = pattern.replace(word, f"(?:{names})")
    return pattern
