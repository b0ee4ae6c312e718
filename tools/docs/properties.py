"""The aircraft's properties as a page, read from its XML."""

import re
from collections.abc import Iterable, Sequence
from xml.etree.ElementTree import Element

from beaver_ftc.design.fdc import SURFACES
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import data_root
from beaver_ftc.plant.model_file import with_systems

_XML = "aircraft/beaver/beaver.xml"
_OPERATIONS = ("product", "sum", "max", "ifthen")
_SURFACE = re.compile(rf"({'|'.join(SURFACES)})")

# The XML has no place for what a plain property means: here it is, by the end of its name.
MEANINGS = {
    "cmd-rad": "commanded deflection; JSBSim's own `fcs/<s>-cmd-norm` adds to it, scaled to the travel",
    "position-min-rad": "lower stop",
    "position-max-rad": "upper stop",
    "bandwidth-rad_sec": "first-order lag of the actuator; 0 is none",
    "rate-limit-rad_sec": "rate limit of the actuator; 0 is none",
    "runaway-rate-rad_sec": "rate of a runaway or slowed actuator that has no rate limit of its own",
    "effectiveness": "1 healthy, 0 no control output; 1 + theta of the fault class",
    "stuck": "1 freezes the surface at `stuck-at-rad`",
    "stuck-at-rad": "where a jammed surface stands",
    "hardover": "-1 or 1: the surface runs at its rate limit to that stop",
    "float": "1: the surface trails and gives no moment",
    "bias-rad": "added to the actuator output",
    "rate-scale": "scales the rate limit: a slow actuator is below 1",
    "oscillation-amplitude-rad": "oscillatory failure: amplitude",
    "oscillation-frequency-rad_sec": "oscillatory failure: angular frequency",
    "manifold-pressure-inhg": "engine setting: manifold pressure",
    "speed-rpm": "engine setting: engine speed",
    "ground/present": "1: there is a ground, with wheels upon it and thrust at rest; 0: none anywhere",
    "Cm-alpha3": "extra pitching moment coefficient on alpha cubed; the published case is 10",
    "inertia-coupling/p": "relative error theta_p of Pqr",
    "inertia-coupling/q": "relative error theta_q of Qpr",
    "inertia-coupling/r": "relative error theta_r of Rpq",
    "amplitude-rad_sec2": "sinusoidal angular acceleration: amplitude",
    "frequency-rad_sec": "sinusoidal angular acceleration: angular frequency",
}

_HEAD = """# Properties of the aircraft

Which properties of JSBSim does the aircraft have, and what do they mean? They are read from
[aircraft/beaver/beaver.xml](../aircraft/beaver/beaver.xml). `<s>` is one of aileron, elevator, rudder,
flap. A name ends with its unit; a name without one is dimensionless. Keys in brackets point to
[sources](../REFERENCES.md). Plain JSBSim and its scripts can set and read all of them; scenarios set them
by `faults:`, `uncertainty:` and `actuators:` ([scenarios](reference/scenarios.md))."""


def as_markdown() -> str:
    """The page: what can be set, what can be read, and each aerodynamic term with its scale."""
    root = with_systems(data_root() / _XML)
    inputs, functions = _inputs(root), _functions(root)
    terms = [element for element in functions if _is_term(element)]
    others = [element for element in functions if not _is_term(element)]
    return "\n\n".join([
        _HEAD,
        "## What can be set",
        _table(("property", "default", "meaning"), _input_rows(inputs)),
        "## What can be read",
        _table(("property", "meaning"), _output_rows(others)),
        "## Aerodynamic terms",
        "Each can be read, with its multiplier, and scaled: `uncertainty/<term>-scale`, 1 by default.",
        _table(("term", "value", "meaning"), [_term_row(element) for element in terms]),
    ]) + "\n"  # fmt: skip


def _inputs(root: Element) -> list[tuple[str, float]]:
    """(name, default) of every property with a value, but for the scales of terms, which stand by them."""
    found = [
        (_text(element), float(element.get("value", "nan")))
        for element in root.iter("property")
        if "value" in element.attrib
    ]
    return [(name, value) for name, value in found if not name.endswith("-scale") or "/rate-" in name]


def _functions(root: Element) -> list[Element]:
    """Everything that can be read: functions, components, and operations inside them that have a name."""
    return [e for e in root.iter() if e.get("name") and (e.tag in _OPERATIONS or e.tag.endswith("function"))]


def _is_term(element: Element) -> bool:
    """A term has a multiplier of its own."""
    scale = f"uncertainty/{element.get('name', '').rpartition('/')[2]}-scale"
    return any(_text(part) == scale for part in element.iter("property"))


def _text(element: Element) -> str:
    return " ".join((element.text or "").split())


def _input_rows(inputs: Iterable[tuple[str, float]]) -> list[tuple[str, ...]]:
    """A row a property; those of the four surfaces share one."""
    defaults: dict[str, dict[str, float]] = {}
    for name, value in inputs:
        surface = _SURFACE.search(name)
        defaults.setdefault(_shared(name), {})[surface.group() if surface else ""] = value
    return [(f"`{name}`", _default(values), meaning_of(name)) for name, values in defaults.items()]


def _shared(name: str) -> str:
    return _SURFACE.sub("<s>", name, count=1)


def _default(values: dict[str, float]) -> str:
    if len(set(values.values())) == 1:
        return f"{next(iter(values.values())):g}"
    return ", ".join(f"{surface} {value:g}" for surface, value in values.items())


def meaning_of(name: str) -> str:
    """What a property that can be set means. BadInput for one that MEANINGS lacks."""
    endings = [ending for ending in MEANINGS if name.endswith(ending)]
    if not endings:
        raise BadInput(f"{name}: what it means is missing in tools/docs/properties.py")
    return MEANINGS[max(endings, key=len)]


def _output_rows(elements: Sequence[Element]) -> list[tuple[str, ...]]:
    rows = {_shared(e.get("name", "")): _description(e) for e in elements}
    return [(f"`{name}`", meaning) for name, meaning in rows.items()]


def _term_row(element: Element) -> tuple[str, ...]:
    value = next((_text(part) for part in element.iter("value")), "")
    return f"`{element.get('name')}`", value, _description(element)


def _description(element: Element) -> str:
    said = element.find("description")
    return "" if said is None else _text(said)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
