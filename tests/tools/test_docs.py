import re
from pathlib import Path

import pytest
from tools.docs.properties import as_markdown, shared

from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.model_file import with_systems

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]


def test_every_property_on_the_page_is_one_the_aircraft_has():
    plant = Plant(100)
    names = re.findall(r"^\| `([^`]+)` \|", as_markdown(), re.MULTILINE)
    assert len(names) > 90
    for name in names:
        for surface in ("aileron", "elevator", "rudder", "flap"):
            for axis, coefficient in zip("pqr", ("CX", "Cm", "Cn"), strict=True):
                made = name.replace("<s>", surface).replace("<a>", axis).replace("<c>", coefficient)
                plant.node(made)


def test_every_named_property_of_the_xml_is_on_the_page():
    root = with_systems(ROOT / "aircraft/beaver/beaver.xml")
    named = {e.get("name") for e in root.iter() if e.tag in ("function", "fcs_function") and e.get("name")}
    valued = {e.text.strip() for e in root.iter("property") if "value" in e.attrib}
    page = as_markdown()
    for name in named | valued:
        term = re.fullmatch(r"uncertainty/(\w+)-scale", name)
        shown = f"aero/coefficient/{term[1]}" if term else shared(name)
        assert f"`{shown}`" in page, name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)  # code has no links
    links = re.findall(r"\]\(([^)#\s]+)", re.sub(r"`[^`\n]*`", "", text))
    lost = [link for link in links if "://" not in link and not (page.parent / link).exists()]
    assert lost == []
