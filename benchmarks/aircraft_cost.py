"""What a frame of the bare aircraft spends, and where.

    python benchmarks/aircraft_cost.py [--rounds N]

Each variant is the Beaver's XML with one feature taken out, flown from the same trimmed state, all of them
side by side in one process. What a feature costs is what its absence saves, round by round.
"""

import argparse
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import numpy as np

from beaver_ftc.aircraft import load
from beaver_ftc.plant.adapter import FlightState, Plant
from beaver_ftc.plant.model_file import with_systems
from beaver_ftc.plant.trim import trim
from beaver_ftc.studies.bench.contenders import interleave, quartiles

SURFACES = ("aileron", "elevator", "rudder", "flap")
FRAMES = 500


def set_component(root: ET.Element, name: str, formula: str) -> None:
    """Let a component of the flight control system compute something else."""
    component = next(each for each in root.iter("fcs_function") if each.get("name") == name)
    inner = component.find("function")
    assert inner is not None
    inner.clear()
    inner.append(ET.fromstring(formula))


def body(function: ET.Element) -> ET.Element:
    """What a function computes."""
    return next(element for element in function if element.tag != "description")


def without_actuators(root: ET.Element) -> None:
    """Ideal actuators only: position is command, with no jam, float, runaway or normalised command."""
    for s in SURFACES:
        set_component(root, f"fcs/{s}-actuator-rad", f"<sum><property>fcs/{s}-cmd-rad</property></sum>")


def without_bias_and_oscillation(root: ET.Element) -> None:
    """No bias and no oscillatory failure."""
    for s in SURFACES:
        set_component(root, f"fcs/{s}-pos-rad", f"<sum><property>fcs/{s}-actuator-rad</property></sum>")


def without_surfaces(root: ET.Element) -> None:
    """No flight control system: the commands go to the aerodynamics."""
    for system in root.findall("system") + root.findall("flight_control"):
        root.remove(system)
    control = ET.SubElement(root, "flight_control")
    for s in SURFACES:
        for name in (f"fcs/{s}-cmd-rad", f"fcs/{s}-pos-rad", f"fcs/{s}-effective-rad"):
            ET.SubElement(control, "property", value="0").text = name


def aerodynamics(root: ET.Element) -> ET.Element:
    """The aerodynamics section."""
    found = root.find("aerodynamics")
    assert found is not None
    return found


def functions(root: ET.Element) -> dict[str, ET.Element]:
    """The functions outside the axes, by name."""
    return {f.get("name", ""): f for f in aerodynamics(root).findall("function")}


def drop_property(root: ET.Element, wanted: Callable[[str], bool]) -> None:
    """Remove factors from every product."""
    for product in root.iter("product"):
        for factor in product.findall("property"):
            if wanted((factor.text or "").strip()):
                product.remove(factor)


def without_term_scales(root: ET.Element) -> None:
    """No `uncertainty/<Coefficient>-scale`."""
    drop_property(
        aerodynamics(root), lambda name: name.startswith("uncertainty/") and name.endswith("-scale")
    )


def without_separate_terms(root: ET.Element) -> None:
    """One function a coefficient: its terms have no name, and cannot be logged one by one."""
    for part in aerodynamics(root).iter("product"):
        part.attrib.pop("name", None)


def without_uncertainty_of_accelerations(root: ET.Element) -> None:
    """No inertia coupling error and no sinusoids."""
    section, named = aerodynamics(root), functions(root)
    for axis in "pqr":
        section.remove(named[f"uncertainty/{axis}dot-rad_sec2"])
    section.remove(named["uncertainty/of-accelerations"])
    for moment in section.iter("function"):
        if (moment.get("name") or "").startswith("aero/moment/"):
            parts = body(moment)
            for extra in list(parts)[1:]:
                parts.remove(extra)


def drop_part(root: ET.Element, wanted: Callable[[str], bool]) -> None:
    """Remove named parts from every sum."""
    for total in root.iter("sum"):
        for part in total.findall("product"):
            if wanted(part.get("name", "")):
                total.remove(part)


def without_turned_betadot(root: ET.Element) -> None:
    """The side force of betadot along body Y."""
    section = aerodynamics(root)
    section.remove(functions(root)["aero/coefficient/CY_betadot-tilted"])
    drop_part(section, lambda name: name.endswith("_turn"))


def without_envelope(root: ET.Element) -> None:
    """No `aero/envelope-valid`."""
    section = aerodynamics(root)
    section.remove(functions(root)["aero/envelope-valid"])
    ET.SubElement(section, "property", value="1").text = "aero/envelope-valid"


def without_engine(root: ET.Element) -> None:
    """A constant slipstream."""
    section, named = aerodynamics(root), functions(root)
    for name in ("engine/power-kw", "aero/dpt", "aero/density-kg_m3"):
        section.remove(named[name])
    for name in ("engine/power-kw", "aero/dpt"):
        ET.SubElement(section, "property", value="0.2").text = name


def without_unanticipated(root: ET.Element) -> None:
    """No unanticipated fault."""
    drop_part(aerodynamics(root), lambda name: name.endswith("Cm_unanticipated"))


def jsbsim_alone(root: ET.Element) -> None:
    """No surfaces and no aerodynamics: a mass on the rotating Earth, in the atmosphere."""
    without_surfaces(root)
    section = aerodynamics(root)
    for part in list(section):
        if part.tag != "property":
            section.remove(part)
    for name in ("engine/power-kw", "aero/dpt", "aero/envelope-valid"):
        ET.SubElement(section, "property", value="0.2").text = name


VARIANTS: dict[str, Callable[[ET.Element], None]] = {
    "actuators: lag, rate limit, jam, float, slow, runaway": without_actuators,
    "bias and oscillatory failure": without_bias_and_oscillation,
    "all four surfaces": without_surfaces,
    "a scale on every term": without_term_scales,
    "every term readable by itself": without_separate_terms,
    "error of inertia coupling, sinusoids": without_uncertainty_of_accelerations,
    "betadot turned across the flight path": without_turned_betadot,
    "unanticipated fault": without_unanticipated,
    "slipstream from the engine": without_engine,
    "validity of the envelope": without_envelope,
    "surfaces and aerodynamics": jsbsim_alone,
}


class Variant:
    """A contender: an aircraft from this model, from a trimmed state, with the surfaces held."""

    def __init__(self, model: Path, state: FlightState) -> None:
        self._plant = Plant(rate_hz=100, model=model)
        self._state = state

    def prepare(self) -> None:
        """Back to trim."""
        self._plant.start(self._state)

    def fly(self, frames: int) -> None:
        """Fly on."""
        run = self._plant.run
        for _ in range(frames):
            run()


def write_variant(folder: Path, change: Callable[[ET.Element], None]) -> Path:
    """The changed model, as one file in a folder of its own."""
    root = with_systems(load().jsbsim)
    change(root)
    folder.mkdir()
    model = folder / load().jsbsim.name
    ET.ElementTree(root).write(model)
    return model


def measure(rounds: int) -> np.ndarray:
    """Microseconds a frame, (rounds, 1 + variants), the whole aircraft first."""
    plant = Plant(rate_hz=100)
    state = trim(45.0, 1828.8, plant=plant)
    with tempfile.TemporaryDirectory() as folder:
        contenders = [Variant(load().jsbsim, state)]
        for i, change in enumerate(VARIANTS.values()):
            contenders.append(Variant(write_variant(Path(folder) / str(i), change), state))
        return interleave(contenders, rounds, FRAMES)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=100)
    us = measure(parser.parse_args().rounds)
    low, median, high = quartiles(us[:, 0])
    print(f"us a frame; medians [quartiles] over {len(us)} rounds of {FRAMES} frames")
    print(f"{'the whole aircraft':48}{median:8.3f}  [{low:.3f}, {high:.3f}]")
    print("\nwhat is saved without")
    for name, variant in zip(VARIANTS, us[:, 1:].T, strict=True):
        low, median, high = quartiles(us[:, 0] - variant)
        print(f"  {name:46}{median:8.3f}  [{low:.3f}, {high:.3f}]")
    return 0


if __name__ == "__main__":
    sys.exit(main())
