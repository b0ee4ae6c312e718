"""What `fdi.bounds` declares is asked of one object: who takes part, and that nobody reads the section."""

import ast

import numpy as np
import pytest

from beaver_ftc.design import SEVERITIES, Dryden
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import Bounds
from beaver_ftc.scenario.schema import load
from flying import declared_in
from test_architecture import PRODUCTS, modules, tree

ALL = {"fault_class": "all", "statistical": {}}
# They make other bounds of those given, and ask nothing of them.
WRITE = {"beaver_ftc:studies.mismatch.bound", "beaver_ftc:scenario.interventions"}


def test_nobody_but_declared_reads_the_bounds():
    """`fdi.bounds.turbulence` and its like, anywhere in the core or a product."""
    readers = {
        f"{package}:{name}: {node.attr}"
        for package in ("beaver_ftc", *PRODUCTS)
        for name, file in modules(package).items()
        if f"{package}:{name}" not in WRITE and ".bounds." in file.read_text(encoding="utf-8")
        for node in ast.walk(tree(name, package))
        if isinstance(node, ast.Attribute) and node.attr in Bounds.model_fields
        if isinstance(node.value, ast.Attribute) and node.value.attr == "bounds"
    }
    own = {
        "beaver_ftc:scenario.diagnosis: sensors",
        "beaver_ftc:scenario.pairs: sensors",
    }  # where it is refused
    assert readers <= own


@pytest.mark.parametrize(
    ("keys", "used"),
    [
        ({}, True), ({"statistical": None}, False), ({"authority": "worst-case"}, False),
        ({"fault_class": "published"}, False), ({"scheme": "observer-constant"}, False),
    ],
)  # fmt: skip
def test_who_reads_accelerometers(keys, used):
    """The Beaver's elevator and flap both pitch it: their lift separates them."""
    for substeps in (1, 2):
        scenario = load({"name": "x", "substeps": substeps, "fdi": {**ALL, **keys}})
        assert Declared.of(scenario).uses_accelerometers is (used and substeps == 1)


@pytest.mark.parametrize("severity", SEVERITIES)
def test_still_air_is_none_of_the_severities_but_none(severity):
    declared = declared_in(Bounds(turbulence=severity))
    assert declared.air == Dryden(severity)
    assert declared.air.moves is (severity != "none") is not declared.is_noise_free


def test_coefficients_have_one_share_or_each_its_own():
    one, each = (
        declared_in(Bounds(coefficients=c)).coefficients for c in (0.1, {"Cm_alpha": 0.2, "Cn_r": 0.3})
    )
    assert (one.of("Cm_alpha"), one.largest) == (0.1, 0.1)
    assert (each.of("Cm_alpha"), each.of("Cm_q"), each.largest) == (0.2, 0.0, 0.3)
    aircraft = declared_in(Bounds()).aircraft
    values = np.linspace(-2.0, 2.0, len(aircraft.moments) + 3)
    wanted = [0.2 if t.name == "Cm_alpha" else 0.3 if t.name == "Cn_r" else 0.0 for t in aircraft.moments]
    found = each.absolute(aircraft.moments, values)
    assert found == pytest.approx(np.array(wanted) * np.abs(values[: len(aircraft.moments)]))


def test_a_declared_object_cannot_be_changed():
    declared = declared_in(Bounds())
    with pytest.raises(AttributeError):
        declared.inertia = 0.1
