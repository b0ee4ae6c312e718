"""The public Python names: which there are, in the order of the page, and what each docstring says."""

import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any

from pydantic import BaseModel

import beaver_ftc as bf
from beaver_ftc.studies.present.tables import markdown_table

HEAD = """# Python names

Which names does `import beaver_ftc as bf` give, and what does each take and return? This page lists every
public function, class and record, for readers who write Python. [Python](reference/python.md) shows how to
use the names in programs. The [glossary](reference/glossary.md) explains the terms of the diagnosis."""
READING = """## How to read an entry

The name stands without `beaver_ftc.` in front. Arguments after `*` must be given by name. This page has
the first sentence of each entry. The whole text, with types, defaults, fields, shapes, units and errors, is
in the docstring: the web site shows it on this page, and Python prints it by `help(bf.fly)`. The records of a
flight have the fields of `metrics.json`; [columns](reference/columns.md) lists them with their units."""
NEXT = """## Next

[Detectors and laws](reference/plugins.md) explains the classes `Detector` and `Law` with examples."""

RECORDS = "results.model"
_CONTENTS = "*Table 1. The sections of this page, and the names in each.*"
# Headings, the names below each as after `beaver_ftc.`, and the members that are shown where not all are.
NAMES: dict[str, dict[str, tuple[str, ...]]] = {
    "Scenarios and flights": {
        "load": (), "scenarios": (), "Scenario": ("with_", "warnings"), "fly": (), "Flight": (),
        "open_run": (), "results.flight.Proof": (),
    },
    "Records of a flight": {
        f"{RECORDS}.{name}": ()
        for name in (
            "Fault", "Detection", "Statistical", "Inconclusive", "Isolation", "Named", "Withdrawn",
            "Tracking", "Rates", "ModeChange", "Departure", "Expectation",
        )
    },
    "Step by step": {
        "Simulation": (), "results.simulation.Snapshot": (), "results.log.MemoryLog": (), "Diagnosis": (),
    },
    "Many flights": {"sweep": ()},
    "Aircraft, trim and linear models": {
        "aircraft.load": (), "aircraft.Aircraft": (), "trim": (), "plant.trim.TrimPoint": (), "linearise": (),
        "plant.linear.LinearModel": (),
    },
    "Plug-ins": dict.fromkeys(
        (
            "Detector", "Law", "Measured", "Reference", "Verdict", "Context", "design.model.DesignFunctions",
            "design.context.DeclaredErrors",
        ), (),
    ),
    "Errors": {"BadInput": (), "SimulationFailed": ()},
}  # fmt: skip
SAYS = {
    "Scenarios and flights": "Load or write a scenario, fly it, and read the result:\n\n```python\n"
    "import beaver_ftc as bf\n\n"
    'scenario = bf.load("elevator-partial-loss").with_({"faults[0].magnitude": 0.2})\n'
    "flight = bf.fly(scenario)\n"
    "print(flight.detection.delay_s, flight.isolation.fault)  # 0.01 elevator\n```",
    "Records of a flight": "The attributes of a `Flight` are records. This section lists their fields.",
    "Step by step": "Advance a flight with `Simulation`, or diagnose your own data with `Diagnosis`.",
    "Many flights": "Fly variations of a scenario:\n\n```python\n"
    "import beaver_ftc as bf\n\n"
    'losses = {"faults[0].magnitude": {"linspace": [0.2, 0.8, 4]}}\n'
    'rows = bf.sweep("elevator-partial-loss", losses)\n'
    'print(rows["detection.delay_s"])\n```',
    "Aircraft, trim and linear models": "Read an aircraft file, trim the aircraft, and linearise it:\n\n"
    "```python\nimport beaver_ftc as bf\n\n"
    "point = bf.trim(airspeed_mps=40)\n"
    "model = bf.linearise(airspeed_mps=40)\n"
    "print(point.elevator_rad, model.states)\n```\n\n"
    "`bf.aircraft(NAME)` calls `aircraft.load`, and does more: it derives an aircraft `jsbsim:NAME` at the "
    "first use, and it checks an aircraft `./FOLDER` against the JSBSim model in the folder.",
    "Plug-ins": "This section has the two classes that you can write, and the records that these classes "
    "receive and return.",
    "Errors": "Both errors have a message for the user, and an `exit_code` for a script: "
    "2 for `BadInput`, 3 for `SimulationFailed`. `BadInput` has "
    "these subclasses:\n\n"
    "- `ScenarioError`: a file has mistakes. The message has one line for each mistake.\n"
    "- `UnknownAircraft`: there is no aircraft of this name.\n"
    "- `NotDerived`, a subclass of `UnknownAircraft`: the aircraft is one of JSBSim, and its design model is "
    "not derived yet.",
}


def page() -> str:
    """The page for a terminal or a reader of Markdown: signatures, and the first words of each docstring."""
    return _joined(_described)


def directives() -> str:
    """The page for a generator that reads docstrings by itself: a directive a name."""
    return _joined(lambda name, members: iter((_directive(name, members),)))


def _joined(described: Callable[[str, tuple[str, ...]], Iterator[str]]) -> str:
    parts = [HEAD, "## Contents", _contents(), READING]
    for heading, names in NAMES.items():
        parts += [f"## {heading}", SAYS[heading]]
        parts += [part for name, members in names.items() for part in described(name, members)]
    return "\n\n".join([*parts, NEXT]) + "\n"


def _contents() -> str:
    """A row for each section, which links to it."""
    rows = [
        (f"[{heading}](#{anchor(heading)})", ", ".join(f"`{_listed(name)}`" for name in names))
        for heading, names in NAMES.items()
    ]
    return f"{_CONTENTS}\n\n{markdown_table(('section', 'names'), rows)}"


def _listed(name: str) -> str:
    """A name without its module, unless the package itself has another thing of this name."""
    last = name.rpartition(".")[2]
    return name if last != name and hasattr(bf, last) else last


def _directive(name: str, members: tuple[str, ...]) -> str:
    options = [f"      members: [{', '.join(members)}]"] if members else []
    options += ["      inherited_members: false"] if name.startswith(RECORDS) else []
    return "\n".join([f"::: beaver_ftc.{name}", *(["    options:"] if options else []), *options])


def anchor(heading: str) -> str:
    """The place of a heading in a link."""
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


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
    yield f"`{_signature(name.rpartition('.')[2], what)}`: {_first(what)}"
    if inspect.isclass(what):
        for member, of in inspect.getmembers(what, inspect.isfunction):
            shown = member in members if members else not member.startswith("_")
            if (
                shown
                and (own is None or member in own)
                and (of.__doc__ or "").strip()
                and of.__module__.startswith("beaver_ftc")
            ):
                called = f"{name.rpartition('.')[2]}.{member}"
                yield f"`{_signature(called, of)}`: {_first(of)}"


def _signature(name: str, what: Any) -> str:
    """The call with the names of its arguments; of a record, the name alone."""
    contract = getattr(what, "_is_protocol", False)  # its class needs no arguments
    if contract or (inspect.isclass(what) and issubclass(what, BaseModel | Exception)):
        return name
    shown = [
        one.replace(annotation=inspect.Parameter.empty, default=inspect.Parameter.empty)
        for one in inspect.signature(what).parameters.values()
        if one.name != "self" and not one.name.startswith("_")
    ]
    return name + str(inspect.Signature(shown))


def _first(what: Any) -> str:
    """The first paragraph of the docstring."""
    return (inspect.getdoc(what) or "").partition("\n\n")[0]
