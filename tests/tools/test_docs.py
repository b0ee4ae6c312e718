import re
from pathlib import Path

import pytest
from tools.docs import first_figure
from tools.docs.pictures import lighten
from tools.docs.properties import as_markdown, meaning_of, shared, texts

from beaver_ftc.commands import registered as registered_commands
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.model_file import with_systems
from beaver_ftc.results.style import LOOKS
from beaver_ftc.studies.reproduce.claims import CLAIMS
from beaver_ftc.studies.reproduce.published_figures import FIGURES

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]


def test_the_first_picture_can_be_drawn():
    roles = {trace.role for panel in first_figure.VIEW.panels for trace in panel.traces}
    assert roles <= set(LOOKS)


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


def test_all_words_of_properties_are_used():
    names = re.findall(r"^\| `([^`]+)` \|", as_markdown(), re.MULTILINE)
    assert set(texts()["read"]) <= set(names)
    assert [ending for ending in texts()["set"] if not any(name.endswith(ending) for name in names)] == []


def test_terms_of_the_aircraft_have_their_factors():
    rows = re.findall(r"^\| `aero/coefficient/(\w+)` \| ([^|]+) \| ([^|]*) \|$", as_markdown(), re.MULTILINE)
    factors = {name: times.strip() for name, _, times in rows}
    assert factors["CZ_debe2"] == "elevator, beta^2"
    assert factors["Cm_q"] == "q-hat"
    assert factors["Cn_0"] == ""


def test_property_without_a_meaning_is_refused():
    with pytest.raises(BadInput, match="fcs/no-such-thing"):
        meaning_of("fcs/no-such-thing")


HEADLINE = re.compile(
    r"The paper has (\d+) statements\. (\d+) of them can be tested: (\d+) hold, (\d+) do not hold, and "
    r"(\d+) hold even without .*? (\d+) of the \d+ also hold in each of (\d+) settings .*? "
    r"(\d+) other statements follow from .*?\. All \d+ hold .*? The last (\d+) statements contain "
    r"nothing"
)
COUNTED = (
    "all", "statements", "hold", "do not", "unsettled", "elsewhere", "settings", "built", "background",
)  # fmt: skip


def test_reproduction_page_counts_every_statement_and_shows_what_it_promises():
    text = (DOCS / "results/reproduction.md").read_text()
    counts = dict(zip(COUNTED, map(int, re.search(HEADLINE, text).groups()), strict=True))
    tested = sum(claim.testable for claim in CLAIMS)
    assert counts["statements"] == tested == counts["hold"] + counts["do not"] + counts["unsettled"]
    assert counts["built"] == len([c for c in CLAIMS if c.construction])
    assert tested + counts["built"] + counts["background"] == len(CLAIMS) == counts["all"]
    parts = {head: part for head, _, part in (s.partition("\n") for s in text.split("\n## "))}
    shown = {head: [c for c in CLAIMS if c.statement.rstrip(".") in part] for head, part in parts.items()}
    not_borne_out = [claim for claim in shown["Statements that do not hold"] if claim.because]
    assert len(not_borne_out) == counts["do not"]
    assert all(claim.because in parts["Statements that do not hold"] for claim in not_borne_out)
    assert len(shown["Statements that hold without the mechanism"]) == counts["unsettled"]
    assert len(shown["Statements that hold in some settings"]) == counts["hold"] - counts["elsewhere"]
    assert (
        5 < len(shown["Statements that hold in every setting"]) < counts["elsewhere"]
    )  # those read off a figure alone
    assert all(claim.where.startswith("Fig.") for claim in shown["Statements that hold in every setting"])
    for view, _, _ in FIGURES:
        assert f"../images/reproduction/{view.name}.png" in text


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)  # code has no links
    links = re.findall(r"\]\(([^)#\s]+)", re.sub(r"`[^`\n]*`", "", text))
    lost = [link for link in links if "://" not in link and not (page.parent / link).exists()]
    assert lost == []


def test_every_command_answers_a_question():
    questions = (DOCS / "README.md").read_text()
    assert [name for name in registered_commands() if f"`{name}" not in questions] == []


def test_every_box_of_the_diagram_leads_to_a_page_and_its_heading():
    links = re.findall(r'href="\.\./([\w/-]+)\.html(?:#([\w-]+))?"', (DOCS / "images/loop.svg").read_text())
    assert len(links) > 12
    for page, place in links:
        headings = re.findall(r"^#+ (.+)$", (DOCS / f"{page}.md").read_text(), re.MULTILINE)
        anchors = {re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}
        assert not place or place in anchors, f"{page}#{place}"


def test_lightened_picture_is_smaller_and_looks_the_same(tmp_path):
    import matplotlib.image
    import numpy as np
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4, 3))
    figure.subplots().plot(np.sin(np.linspace(0, 20, 500)))
    figure.savefig(tmp_path / "a.png")
    figure.savefig(tmp_path / "b.png")
    lighten(tmp_path / "b.png")
    assert (tmp_path / "b.png").stat().st_size < 0.7 * (tmp_path / "a.png").stat().st_size
    before, after = (matplotlib.image.imread(tmp_path / f"{name}.png")[..., :3] for name in "ab")
    assert np.abs(before - after).mean() < 0.01


@pytest.mark.parametrize("name", ["README.md", "docs/tutorials/start.md", "docs/results/reproduction.md"])
def test_a_delay_of_one_frame_stands_beside_its_conditions_and_one_with_real_sensors(name):
    """In the same paragraph: what the flight had, and the delay of a flight with declared errors."""
    text = (ROOT / name).read_text()
    (paragraph,) = (part for part in text.split("\n\n") if "<!--=air detection.delay_s" in part)
    said = paragraph.replace("\n", " ")
    for words in ("exact", "ideal", "still", "one frame", "tactical-grade sensors", "turbulence"):
        assert words in said, words
