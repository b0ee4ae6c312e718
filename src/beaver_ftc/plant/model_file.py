"""A JSBSim model as one tree: its systems read in where it only names their files."""

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element


def with_systems(model: Path) -> Element:
    """The root of a model; each `<system file="x"/>` of the folder `Systems` beside it is replaced by x."""
    root = ElementTree.parse(model).getroot()
    for place, element in enumerate(list(root)):
        name = element.get("file")
        path = model.parent / "Systems" / f"{name}.xml"
        if element.tag == "system" and name and path.is_file():
            root[place] = ElementTree.parse(path).getroot()
    return root
