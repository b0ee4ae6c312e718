"""JSBSim's own XML schema judges every aircraft, system and script here, and what `derive` writes.

The schema is JSBSim's, and is not copied: it is looked for beside the checkout.
"""

import os
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.plant.instrumented import instrument, names, source_of, surfaces_of
from beaver_ftc.plant.model_file import copy_of

etree = pytest.importorskip("lxml.etree", reason="wants lxml, of the extra `dev`")
REPOSITORY = Path(__file__).parents[2]
WHERE = "BEAVER_FTC_JSBSIM_SCHEMA"
SCHEMAS = {"fdm_config": "JSBSim", "system": "JSBSimSystem", "runscript": "JSBSimScript"}
NO_SCHEMA = {"initialize", "output", "instrumented"}  # roots it does not have; of the last, copies are judged
SHIPPED = [
    path
    for folder in ("aircraft", "examples", "tests/data")
    for path in sorted((REPOSITORY / folder).rglob("*.xml"))
]
TRAVEL = {"aileron": (-0.3, 0.3), "elevator": (-0.4, 0.3), "rudder": (-0.3, 0.3)}


@cache
def schema(root):
    folder = Path(os.environ.get(WHERE) or REPOSITORY.parent / "shared" / "reference" / "jsbsim-schema")
    if not folder.is_dir():
        pytest.skip(f"no schema of JSBSim at ../shared/reference beside the checkout, nor at ${WHERE}")
    return etree.XMLSchema(etree.parse(folder / f"{SCHEMAS[root]}.xsd"))


def mistakes(path):
    """What the schema says of a file; None of one whose root it does not have. Of aerodynamics in a file of
    their own, which has no schema, it judges the whole."""
    tree = etree.parse(path)
    for part in tree.getroot().findall("aerodynamics[@file]"):
        named = (path.parent / part.get("file")).with_suffix(".xml")
        part.getparent().replace(part, etree.parse(named).getroot())
    if tree.getroot().tag not in SCHEMAS:
        return None
    judge = schema(tree.getroot().tag)
    judge.validate(tree)
    return [f"{path.name}:{error.line}: {error.message}" for error in judge.error_log]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: str(path.relative_to(REPOSITORY)))
def test_what_is_shipped_is_valid(path):
    found = mistakes(path)
    assert found == [] or (found is None and etree.parse(path).getroot().tag in NO_SCHEMA)


def test_the_schema_is_not_asleep(tmp_path):
    """It sees a description within an operation, and a point mass's location with a name."""
    text = load().jsbsim.read_text()
    for old, new in (
        ('<product name="aero/coefficient/Cm_q">', '<product name="x"><description>no</description>'),
        ("<location unit=", '<location name="mass" unit='),
    ):
        assert old in text
        (tmp_path / "beaver.xml").write_text(text.replace(old, new, 1))
        assert len(mistakes(tmp_path / "beaver.xml")) == 1


def test_what_derive_writes_is_valid_wherever_its_source_was(tmp_path):
    """Every aircraft of the jsbsim package that can be instrumented, with engines and without."""
    valid = []
    for name in names():
        source = source_of(name)
        if mistakes(source) or mistakes(source) is None or len(surfaces_of_or_none(source)) < 3:
            continue
        plain = copy_of(source, tmp_path / "plain" / name).parent
        wrong = {path.name for path in plain.rglob("*.xml") if mistakes(path)}
        model = instrument(source, tmp_path / name, TRAVEL, absent=["fcs/nobody-gives-it"])
        found = [mistakes(path) for path in model.parent.rglob("*.xml") if path.name not in wrong]
        assert [lines for lines in found if lines] == [], name
        valid.append(len(ElementTree.parse(source).findall("propulsion/engine")))
    assert len(valid) > 30
    assert 0 in valid
    assert max(valid) >= 4


def surfaces_of_or_none(source):
    try:
        return surfaces_of(source)
    except Exception:  # no aerodynamics
        return ()
