"""The aircraft's properties as a page: names and values from its XML, words from properties.yaml."""

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from xml.etree.ElementTree import Element

from beaver_ftc.design.fdc import SURFACES
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import data_root
from beaver_ftc.plant.model_file import with_systems
from beaver_ftc.studies.present.tables import markdown_table
from tools.data import yaml_of

_XML = "aircraft/beaver/beaver.xml"
_OPERATIONS = ("product", "sum", "max", "ifthen")
_SURFACE = re.compile(rf"({'|'.join(SURFACES)})")
_AXIS = re.compile(r"(?<=inertia-coupling/)[pqr]|(?<=sinusoid/)[pqr]|(?<=uncertainty/)[pqr](?=dot)")
_COEFFICIENT = re.compile(r"(?<=aero/coefficient/)C[XYZlmn]$")

_TEXTS = Path(__file__).with_suffix(".yaml")

_HEAD = """# Properties of the aircraft

Which JSBSim properties does the Beaver have, and what does each of them mean? A scenario contains none: its
sections `faults`, `uncertainty` and `actuators` set them. In JSBSim alone, write
`fdm["failures/elevator/effectiveness"] = 0.6`. *Example.* This program flies 1 s and prints the position of
the elevator in rad:

```python
import beaver_ftc as bf

sim = bf.Simulation("fault-free")
sim.step(frames=100)
print(sim["fcs/elevator-pos-rad"])
```

Names and values are those of [beaver.xml](../aircraft/beaver/beaver.xml) and of its actuators:

- `<s>` stands for aileron, elevator, rudder or flap, `<a>` for p, q or r, `<c>` for CX, CY, CZ, Cl, Cm or Cn.
- A name ends with its unit: `rad_sec` is rad/s, `mps` is m/s, `lbs` is pound-force, `lbsft` is pound-force
  times foot. Otherwise it is dimensionless.
- The body axes are X forward, Y to the right and Z down. A force is its coefficient (CX, CY, CZ) times the
  dynamic pressure times the wing area S; a moment (Cl, Cm, Cn) also times the span b, in pitch the chord c.
- p, q, r: body rates. V: airspeed. rho: air density. Ix, Iy, Iz, Jxz:
  [moments of inertia](results/validation.md#data-sheet-of-the-beaver). n: engine speed, rpm. pz: manifold
  pressure, inHg. P: shaft power, kW. [TM88]: [source](../REFERENCES.md).
- The *command* is the position that the law requires. The *demand* is the command, limited to the stops: the
  input of the actuator."""
_TILTED = "aero/coefficient/CY_betadot-tilted"
_PARTS = tuple(f"aero/coefficient/{force}_turn" for force in ("CX", "CY", "CZ"))
_TERMS = """Each coefficient is the sum of its terms. A term is the product of its value [TM88], the
quantities in the column "times" in rad, with `fcs/<s>-effective-rad` of a surface, and its scale
`uncertainty/<term>-scale`, which is 1 and can be set."""
_NEXT = """## Next

The [data sheet](results/validation.md#data-sheet-of-the-beaver) has mass, travel and trim of the Beaver.
[Other tools](reference/python.md#other-tools) shows how to fly the model in plain JSBSim."""


def as_markdown() -> str:
    """The page: what can be set, what can be read, and each aerodynamic term with its scale."""
    root = with_systems(data_root() / _XML)
    inputs, functions = _inputs(root), _functions(root)
    terms = [element for element in functions if _is_term(element)]
    others = [element for element in functions if not _is_term(element)]
    return "\n\n".join([
        _HEAD,
        "## Properties that can be set",
        "With the defaults, a surface follows its command.",
        markdown_table(("property", "default", "meaning"), _input_rows(inputs)),
        "## Properties that JSBSim computes",
        markdown_table(("property", "meaning"), _output_rows(others)),
        "## Aerodynamic terms",
        _TERMS,
        markdown_table(("term", "value", "times"), [_term_row(element) for element in terms]),
        _NEXT,
    ]) + "\n"  # fmt: skip


def _inputs(root: Element) -> list[tuple[str, float]]:
    """(name, default) of every property with a value, but for the scales of terms, which stand by them."""
    found = [
        (_text(element), float(element.get("value", "nan")))
        for element in root.iter("property")
        if "value" in element.attrib
    ]
    return [(name, value) for name, value in found if not _is_scale(name)]


def _is_scale(name: str) -> bool:
    """Whether a property is the scale of a term."""
    return name.startswith("uncertainty/") and name.endswith("-scale")


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
        defaults.setdefault(shared(name), {})[surface.group() if surface else ""] = value
    return [(f"`{name}`", _default(values), meaning_of(name)) for name, values in defaults.items()]


def shared(name: str) -> str:
    """A name with what stands for a surface, an axis or a coefficient."""
    return _COEFFICIENT.sub("<c>", _AXIS.sub("<a>", _SURFACE.sub("<s>", name, count=1)))


def _default(values: dict[str, float]) -> str:
    if len(set(values.values())) == 1:
        return f"{next(iter(values.values())):g}"
    return ", ".join(f"{surface} {value:g}" for surface, value in values.items())


@cache
def texts() -> Mapping[str, Mapping[str, str]]:
    """Words of properties that can be set, by the end of the name, and of others, by name."""
    return yaml_of(_TEXTS)


def meaning_of(name: str) -> str:
    """What a property that can be set means. BadInput for one without words."""
    meanings = texts()["set"]
    endings = [ending for ending in meanings if name.endswith(ending)]
    if not endings:
        raise BadInput(f"{name}: what it means is missing in tools/docs/{_TEXTS.name}")
    return meanings[max(endings, key=len)]


def _output_rows(elements: Sequence[Element]) -> list[tuple[str, ...]]:
    """A row for each output; the parts of one correction stand together."""
    rows = {shared(e.get("name", "")): _description(e) for e in elements}
    first = list(rows).index(_TILTED)  # the parts of one correction stand together
    names = sorted(rows, key=lambda name: first if name in _PARTS else list(rows).index(name))
    return [(f"`{name}`", texts()["read"].get(name, rows[name])) for name in names]


def _term_row(element: Element) -> tuple[str, ...]:
    value = next((_text(part) for part in element.iter("value")), "")
    return f"`{element.get('name')}`", value, ", ".join(_factors(element))


def _factors(element: Element) -> list[str]:
    """What a term multiplies, each once with its power: `alpha^2`, `dpt`."""
    names = [_text(part) for part in element.iter("property")]
    found = [
        re.sub("-effective-rad|-rad$", "", name.rpartition("/")[2]) for name in names if not _is_scale(name)
    ]
    return [f"{name}^{n}" if (n := found.count(name)) > 1 else name for name in dict.fromkeys(found)]


def _description(element: Element) -> str:
    said = element.find("description")
    return "" if said is None else _text(said)
