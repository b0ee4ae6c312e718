"""Write built-in aircraft whose surfaces are parts of the Beaver's: `beaver-split`, with halves by side.

python -m tools.split

A part has its share of every term of the whole surface, and what the parts of both sides take from one
another besides: a normal force at its arm rolls, a longitudinal one yaws, and the lift of an aileron comes
with the pitching moment of its section. Positive is trailing edge down, of the left aileron too: its share is
negative. All parts moved as the whole moves them are the whole surface, term by term.

The wing is rectangular and its whole trailing edge hinged, flaps inboard, ailerons outboard
(pilotfriend.com, de Havilland DHC 2; the cabin is 1.22 m wide). A section hinged at E of the chord from its
trailing edge has c_l = 2 (pi - t + sin t) and, about the quarter chord, c_m = -1/2 sin t (1 - cos t) per rad,
with cos t = 2 E - 1 [Glauert1927]. Ours, for no source gives them: where flap and aileron meet, 55 % of the
half-span, and E, a quarter.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import acos, cos, pi, sin
from pathlib import Path

import yaml

from beaver_ftc.aircraft import Aircraft, Term, load
from beaver_ftc.aircraft.aircraft import FORCES, MOMENTS
from beaver_ftc.plant.instrumented import actuator_system
from tools.data import yaml_of

SPAN_M, CABIN_M, JOINT, HINGE = 14.63, 1.22, 0.55, 0.25
HALF_SPAN_M = SPAN_M / 2
AILERON_M = 0.5 * (JOINT + 1.0) * HALF_SPAN_M  # where the middle of an aileron is, from the plane of symmetry
FLAP_M = 0.5 * (CABIN_M / 2 + JOINT * HALF_SPAN_M)
SIGNALS = {"alpha": "aero/alpha-rad", "beta": "aero/beta-rad"}
NAME = "beaver-split"
FIRST_LINES = """# Written by `python -m tools.split`, which says more.
# Each part has its share of the terms of the whole [TM88]; the force of one side rolls and yaws at its arm.
# An aileron's lift follows from its roll, with the pitching moment of a hinged section [Glauert1927].
# Positive is trailing edge down, left and right.
"""


@dataclass(frozen=True)
class Part:
    """A part of a surface. share: of its terms, negative where it moves against the whole; arm_m: of its
    lift, to the right, or None in the middle."""

    name: str
    share: float
    arm_m: float | None = None

    @property
    def short(self) -> str:
        """What its terms are called by, after the name of the whole surface's."""
        return self.name.partition("_")[2]


Parts = Mapping[str, Sequence[Part]]


HALVES = {
    "aileron": (Part("aileron_left", -0.5, -AILERON_M), Part("aileron_right", 0.5, AILERON_M)),
    "flap": (Part("flap_left", 0.5, -FLAP_M), Part("flap_right", 0.5, FLAP_M)),
}
GROUPS = {
    "pitch": ["elevator", "flap_left", "flap_right"],
    "lateral": ["aileron_left", "aileron_right", "rudder"],
}


def section_moment() -> float:
    """c_m over c_l of a hinged aerofoil [Glauert1927]."""
    t = acos(2.0 * HINGE - 1.0)
    return -0.5 * sin(t) * (1.0 - cos(t)) / (2.0 * (pi - t + sin(t)))


def terms_of(whole: Aircraft, surface: str, part: Part) -> Iterator[Term]:
    """Its share of the terms, and what its side does besides."""
    for term in whole.terms.values():
        if term.surface == surface:
            ending = f"{term.name.removeprefix(term.coefficient)}_{part.short}"
            own = replace(
                term, name=f"{term.coefficient}{ending}", value=part.share * term.value, surface=part.name,
                source=f"{term.source}, shared", description=f"{term.description}: this part",
            )  # fmt: skip
            yield own
            for coefficient, value, says in of_a_side(own, part.arm_m / SPAN_M) if part.arm_m else ():
                yield replace(
                    own, name=f"{coefficient}{ending}", coefficient=coefficient, value=value,
                    source="strip theory", description=says,
                )  # fmt: skip


def of_a_side(own: Term, arm: float) -> Iterator[tuple[str, float, str]]:
    """What the other side takes back: coefficient, value, and what it is; arm: of its lift, in spans."""
    if own.coefficient == "Cl":  # an aileron: its lift follows from its roll
        lift = -own.value / arm
        yield "CZ", -lift, "normal force of one side"
        yield "Cm", section_moment() * lift, "pitching moment of its section"
    if own.coefficient == "CZ":
        yield "Cl", own.value * arm, "rolling moment of its normal force"
    if own.coefficient == "CX":
        yield "Cn", -own.value * arm, "yawing moment of its longitudinal force"


def model(whole: Aircraft, parts: Parts, made: Sequence[Term], name: str) -> str:
    """The JSBSim model: that of the whole with its surfaces' terms and actuators replaced. made: the terms of
    all parts."""
    text = whole.jsbsim.read_text(encoding="utf-8")
    for surface in parts:
        for term in (t for t in whole.terms.values() if t.surface == surface):
            pattern = rf'        <product name="aero/coefficient/{term.name}">.*?</product>\n'
            text = re.sub(pattern, "", text, flags=re.S)
            text = text.replace(f'    <property value="1"> uncertainty/{term.name}-scale </property>\n', "")
        systems = "".join(f'  <system file="{part.name}"/>\n' for part in parts[surface])
        text = re.sub(rf'  <system file="{surface}"/>[^\n]*\n', systems, text)
    scales = "".join(f'    <property value="1"> uncertainty/{t.name}-scale </property>\n' for t in made)
    coupling = '    <property value="0"> uncertainty/inertia-coupling/p'
    text = text.replace(coupling, scales + coupling, 1)
    for coefficient in (*FORCES, *MOMENTS):
        products = "".join(_product(t) for t in made if t.coefficient == coefficient)
        start = text.index(f'<function name="aero/coefficient/{coefficient}">')
        at = text.index("      </sum>", start)
        text = text[:at] + products + text[at:]
    return text.replace('name="DHC-2 Beaver"', f'name="{name}"', 1)


def _product(term: Term) -> str:
    signals = "".join(f" <property> {SIGNALS[signal]} </property>" for signal in term.factors[1:])
    return (
        f'        <product name="aero/coefficient/{term.name}">\n'
        f"          <!-- {term.description} -->\n"
        f"          <value> {term.value:.10g} </value>"
        f" <property> fcs/{term.surface}-effective-rad </property>"
        f"{signals} <property> uncertainty/{term.name}-scale </property>\n"
        "        </product>\n"
    )


def files(
    whole: Aircraft, parts: Parts, groups: Mapping[str, list[str]], name: str, says: str
) -> dict[str, str]:
    """The files of the folder, by their names."""
    filed = yaml_of(whole.folder / "aircraft.yaml")
    filed |= {"name": name, "description": says, "jsbsim": f"{name}.xml", "groups": dict(groups)}
    surfaces = {}
    for surface, of in filed["surfaces"].items():
        for part in parts.get(surface, ()):
            keys = {key: f"fcs/{part.name}-{end}" for key, end in _ENDS.items()}
            surfaces[part.name] = keys | {"travel_rad": of["travel_rad"]}
        if surface not in parts:
            surfaces[surface] = of
    filed["surfaces"] = surfaces
    made = [t for surface, of_it in parts.items() for part in of_it for t in terms_of(whole, surface, part)]
    for section in ("moments", "forces"):
        for coefficient, given in filed[section].items():
            kept = [term for term in given if term.get("surface") not in parts]
            filed[section][coefficient] = kept + [_filed(t) for t in made if t.coefficient == coefficient]
    filed = json.loads(json.dumps(filed))  # what is there twice is written twice
    text = yaml.safe_dump(filed, sort_keys=False, default_flow_style=None, width=200)
    written = {f"{name}.xml": model(whole, parts, made, name), "aircraft.yaml": FIRST_LINES + text}
    for surface, of in filed["surfaces"].items():
        written[f"Systems/{surface}.xml"] = actuator_system(surface, *of["travel_rad"])
    return written


_ENDS = {"command": "cmd-rad", "position": "pos-rad", "effective": "effective-rad"}


def _filed(term: Term) -> dict:
    value = float(f"{term.value:.10g}")
    keys = {"name": term.name, "value": value, "of": dict(term.of), "surface": term.surface}
    return keys | {"source": term.source, "description": term.description}


def write(folder: Path, of_it: Mapping[str, str]) -> None:
    """Write the files of an aircraft into a folder of its name."""
    for name, text in of_it.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def split_beaver() -> dict[str, str]:
    """The files of `beaver-split`."""
    says = "DHC-2 Beaver with halves of aileron and flap by side"
    return files(load(), HALVES, GROUPS, NAME, says)


def main() -> None:
    """Write it."""
    write(load().folder.parent / NAME, split_beaver())


if __name__ == "__main__":
    main()
