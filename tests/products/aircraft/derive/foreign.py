"""Models as other authors write them: the Navion of the examples, changed."""

import re
from contextlib import contextmanager
from pathlib import Path

import pytest

from beaver_ftc_aircraft.derive import derivation, sample

NAVION = (Path(__file__).parents[4] / "examples" / "own-aircraft" / "navion.xml").read_text()
ENGINE = """<propulsion> <engine file="{engine}"> <feed> 0 </feed> <thruster file="{thruster}">
  <location unit="IN"> <x> -60 </x> <y> 0 </y> <z> 0 </z> </location>
  <orient unit="DEG"> <roll> 0 </roll> <pitch> 0 </pitch> <yaw> 0 </yaw> </orient> </thruster> </engine>
  <tank type="FUEL"> <location unit="IN"> <x> 0 </x> <y> 0 </y> <z> 0 </z> </location>
    <capacity unit="LBS"> 200 </capacity> <contents unit="LBS"> {fuel} </contents> </tank> </propulsion>"""
LEFT, RIGHT = "fcs/left-aileron-pos-rad", "fcs/right-aileron-pos-rad"


def scale(command, low, high, output):
    """A channel that takes a command to an output, by its own stop on either side."""
    return (
        f'<channel name="{output}"> <aerosurface_scale name="{output}-control"> <input> {command} </input> '
        f"<range> <min> {low} </min> <max> {high} </max> </range> <output> {output} </output> "
        "</aerosurface_scale> </channel>"
    )


def controlled(text, *channels, without=""):
    """A model with these channels, and without that which gives a property."""
    text = re.sub(
        rf'<channel name="[^"]*">((?!</channel>).)*<output> {without or "#"} .*?</channel>',
        "",
        text,
        flags=re.S,
    )
    return text.replace("</flight_control>", f"{''.join(channels)}</flight_control>")


def seen_as(text, name, formula):
    """A model whose aerodynamics read a formula in place of a property."""
    begin = text.index("<aerodynamics>")
    return text[:begin] + text[begin:].replace(f"<property> {name} </property>", formula)


def shares(of):
    """A sum of shares of properties, as aerodynamics have it."""
    parts = (
        f"<product> <value> {by} </value> <property> {name} </property> </product>" for name, by in of.items()
    )
    return f"<sum> {''.join(parts)} </sum>"


def ailerons(left, right, by, right_name=RIGHT):
    """The Navion with two ailerons: the stops of each at either command, and the shares of the moment."""
    channels = (
        scale("fcs/aileron-cmd-norm", *ends, name) for ends, name in ((left, LEFT), (right, right_name))
    )
    text = controlled(NAVION, *channels, without=LEFT)
    return seen_as(text, LEFT, shares(dict(zip((LEFT, right_name), by, strict=True))))


def elevator(low, high, at_stops=(-1, 1)):
    """The Navion whose pitching moment is of a normalised elevator, its lift of the angle."""
    norm = (
        '<channel name="norm"> <aerosurface_scale name="fcs/norm"> <input> fcs/elevator-pos-rad </input> '
        f"<domain> <min> {low} </min> <max> {high} </max> </domain> <range> <min> {at_stops[0]} </min> "
        f"<max> {at_stops[1]} </max> </range> <output> fcs/elevator-pos-norm </output> </aerosurface_scale> "
        "</channel>"
    )
    text = controlled(
        NAVION,
        scale("fcs/elevator-cmd-norm", low, high, "fcs/elevator-pos-rad"),
        norm,
        without="fcs/elevator-pos-rad",
    )
    pitch = text.index('<axis name="PITCH">')
    return text[:pitch] + text[pitch:].replace("fcs/elevator-pos-rad", "fcs/elevator-pos-norm")


def wing():
    """The Navion without a rudder."""
    text = controlled(NAVION, without="fcs/rudder-pos-rad")
    return re.sub(r'<function name="aero/coefficient/C\w*dr">.*?</function>', "", text, flags=re.S)


def powered(engine="electric147kW", thruster="prop_75in2f", fuel=150, text=NAVION):
    """The Navion with an engine."""
    return text.replace("<propulsion/>", ENGINE.format(engine=engine, thruster=thruster, fuel=fuel))


def write(folder, text, name="navion"):
    """A model's file in a folder of its name."""
    path = folder / name / f"{name}.xml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(re.sub(r'<fdm_config name="\w+"', f'<fdm_config name="{name}"', text))
    return path


@contextmanager
def quickly(samples, checked):
    """From few states and short flights, where it does not matter how large the errors are."""
    with pytest.MonkeyPatch.context() as patched:
        for module, name, value in (
            (sample, "STARTS_OF_WORST", 8), (sample, "FRAMES", 200), (sample, "STARTS", 16),
            (derivation, "SAMPLES", samples), (derivation, "CHECKED", checked),
        ):  # fmt: skip
            patched.setattr(module, name, value)
        yield
