"""The public Python names: which there are, in the order of the page, and what each docstring says."""

import inspect
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel

import beaver_ftc as bf

HEAD = """# Python names

Which names does `import beaver_ftc as bf` give, and what does each take and return? Use this page to look
up a name; [Python](reference/python.md) shows the names at work.

Each name has its signature, then its text. The text has the shape of each array, such as (3,) for three
values or (3, surfaces) for three rows and a column for each surface, and the unit of each number. The
arguments after `*` are given by name. `beaver_ftc.` is left out before every name. The fields of the records
of a flight have the same names as the columns of a study, which [columns](reference/columns.md) explains:
`isolation.withdrawn` is the field `withdrawn` of `Isolation`."""
NEXT = """## Next

[Detectors and laws](reference/plugins.md) explains the classes `Detector` and `Law` with examples."""

RECORDS = "results.model"
_MODULES = re.compile(r"\b(?:[a-z_]+\.)+(?=\w)")  # before a name in a signature
_SHORT = {  # types of NumPy that are written out as a line of their parts
    _MODULES.sub("", inspect.formatannotation(written)): short
    for written, short in (
        (ArrayLike | None, "ArrayLike | None"), (ArrayLike, "ArrayLike"), (NDArray[np.float64], "ndarray"),
    )
}  # fmt: skip

# Headings, the names below each as after `beaver_ftc.`, and the members that are shown where not all are.
NAMES: dict[str, dict[str, tuple[str, ...]]] = {
    "Scenarios and flights": {
        "load": (), "scenarios": (), "Scenario": ("with_", "warnings"), "fly": (), "Flight": (),
        "open_run": (),
    },
    "What the records of a flight hold": {
        f"{RECORDS}.{name}": ()
        for name in (
            "Fault", "Detection", "Isolation", "Tracking", "Rates", "ModeChange", "Departure", "Expectation",
        )
    },
    "Step by step": {"Simulation": (), "Diagnosis": ()},
    "Many flights": {"sweep": ()},
    "The aircraft, trim and linear models": {
        "aircraft.load": (), "aircraft.Aircraft": (), "trim": (), "plant.trim.TrimPoint": (), "linearise": (),
        "plant.linear.LinearModel": (),
    },
    "Plug-ins": dict.fromkeys(("Detector", "Law", "Measured", "Reference", "Verdict", "Context"), ()),
    "What can go wrong": {"BadInput": (), "SimulationFailed": ()},
}  # fmt: skip


def page() -> str:
    """The page, for a terminal or a reader of Markdown."""
    parts = [HEAD]
    for heading, names in NAMES.items():
        parts.append(f"## {heading}")
        parts += [part for name, members in names.items() for part in _described(name, members)]
    return "\n\n".join([*parts, NEXT]) + "\n"


def directives() -> str:
    """The page for a generator that reads docstrings by itself: a directive a name."""
    parts = [HEAD]
    for heading, names in NAMES.items():
        parts.append(f"## {heading}")
        parts += [_directive(name, members) for name, members in names.items()]
    return "\n\n".join([*parts, NEXT]) + "\n"


def _directive(name: str, members: tuple[str, ...]) -> str:
    options = [f"      members: [{', '.join(members)}]"] if members else []
    options += ["      inherited_members: false"] if name.startswith(RECORDS) else []
    return "\n".join([f"::: beaver_ftc.{name}", *(["    options:"] if options else []), *options])


def found(name: str) -> Any:
    """What a name of the page stands for."""
    from importlib import import_module

    module, _, last = f"beaver_ftc.{name}".rpartition(".")
    return getattr(bf, name) if hasattr(bf, name) else getattr(import_module(module), last)


def _described(name: str, members: tuple[str, ...]) -> Iterator[str]:
    """Signature and docstring, of a class those of its methods too; of a record, its own methods alone."""
    what = found(name)
    own = vars(what) if name.startswith(RECORDS) else None
    yield f"### {name}"
    yield f"```python\n{_signature(name.rpartition('.')[2], what)}\n```"
    yield _text(what)
    if inspect.isclass(what):
        for member, of in inspect.getmembers(what, inspect.isfunction):
            shown = member in members if members else not member.startswith("_")
            if (
                shown
                and (own is None or member in own)
                and (of.__doc__ or "").strip()
                and of.__module__.startswith("beaver_ftc")
            ):
                yield f"`{_signature(f'{name}.{member}', of)}`\n\n{_text(of)}"


def _signature(name: str, what: Any) -> str:
    contract = getattr(what, "_is_protocol", False)  # its class needs no arguments
    if contract or (inspect.isclass(what) and issubclass(what, BaseModel | Exception)):
        return name
    signature = _MODULES.sub("", str(inspect.signature(what)))
    for written, short in _SHORT.items():
        signature = signature.replace(written, short)
    return name + signature


def _text(what: Any) -> str:
    return inspect.getdoc(what) or ""
