"""A new fault type is a row of two tables, what happens and what tells it: the package with both."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import beaver_ftc
from beaver_ftc.diagnosis.types import contract, registry
from beaver_ftc.documents.paths import data_root
from fault_kinds import DOWN, UP

HERE = Path(__file__).parent

# A surface that follows its command with the sign reversed: p = -u.
REVERSED = '''
"""A surface rigged the wrong way round: p = -u."""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types.contract import ANYTHING, NOTHING, FaultType


@kernel
def judge(config, surface, kind, k):
    """Whether the mirrored command explains this frame."""
    return ANYTHING if surface.low_then <= -surface.command_then <= surface.high_then else NOTHING


@kernel
def deflection(config, surface, kind, k):
    """The mirrored command."""
    return -surface.command, -surface.command


def estimate(fdi, s, kind):
    """It has none but itself."""
    return -1.0


TYPES = (FaultType(name="reversed", constant=True, judge=judge, deflection=deflection, estimate=estimate),)
'''
# What happens to the surface: all of its moment, the other way round.
HAPPENS = '''
"""A surface rigged the wrong way round."""

from typing import Literal

from pydantic import Field

from beaver_ftc.scenario.faults.base import Button, Past, Properties, Switched
from beaver_ftc.scenario.airframe import Actuator


class Reversed(Switched):
    """The surface goes the wrong way."""

    size = ("by", "deg")
    examples = (("rigged wrongly", {}),)
    button = Button(8, "reverse", {})

    type: Literal["reversed"]
    actuator: Actuator = Field(description="the surface that fails")

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["effectiveness"] *= 1.0 - 2.0 * share
'''
# Who has to know of it beside the diagnosis: scenario and schema, documents, `matrix`, `list`, the live page.
KNOWN = """
import json
from beaver_ftc.cli.catalogue import _available
from beaver_ftc_live.page.session import fault_types
from beaver_ftc.results.metrics import faults_of
from beaver_ftc.scenario.loader import load
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.matrix.fault_matrix import FaultCase, scenario_of
schema = Scenario.model_json_schema()["$defs"]
fault = scenario_of(FaultCase("rigged wrongly", "rudder", 45.0), "nominal", 0.0).faults[0]
expected = load({"name": "r", "faults": [fault.model_dump()], "expect": {"isolated_type": "reversed"}})
of = {"effectiveness": 1.0}
fault.strike(of, 1.0, None)
said = [schema["Reversed"]["description"], expected.expect.isolated_type, fault.type, of["effectiveness"]]
said.append(faults_of(expected)[0]["type"])
said.append("reversed" in [entry["name"] for entry in _available()["faults"]])
live = fault_types()
print(json.dumps([*said, live["breaks"][-1], live["sizes"]["reversed"]]))
"""
FLIGHT = """
import sys
sys.path.insert(0, {folder!r})
from design_plant import UNCERTAINTIES, DesignPlant
from beaver_ftc.diagnosis.types.findings import found
SURFACES = ("aileron", "elevator", "rudder", "flap")
reverse = lambda k, u: -u if k >= 20 else u
plant = DesignPlant(4, 50.0, surface=2, position=reverse, fault_class="all")
plant.fly(220, UNCERTAINTIES["random"], until=lambda plant: found(plant.fdi, SURFACES)["isolation_type"])
said = found(plant.fdi, SURFACES)
print(said["isolated"], said["isolation_type"], said["estimate"])
"""


@pytest.fixture(scope="module")
def in_a_copy(tmp_path_factory):
    """A copy of the package with the new type: what a text prints there."""
    root = tmp_path_factory.mktemp("copy")
    package = root / "beaver_ftc"
    shutil.copytree(beaver_ftc.__path__[0], package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(data_root() / "aircraft", package / "data" / "aircraft")
    shutil.copytree(data_root() / "scenarios", package / "data" / "scenarios")
    (package / "scenario" / "faults" / "backwards.py").write_text(HAPPENS)
    (package / "diagnosis" / "types" / "table" / "backwards.py").write_text(REVERSED)

    def printed(text):
        done = subprocess.run(
            [sys.executable, "-c", text],
            env={**os.environ, "PYTHONPATH": str(root), "NUMBA_DISABLE_JIT": "1"},
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout

    return printed


def test_a_new_type_is_found_and_named(in_a_copy):
    assert in_a_copy(FLIGHT.format(folder=str(HERE))).split() == ["rudder", "reversed", "-1.0"]


def test_scenario_documents_matrix_list_and_live_page_know_it(in_a_copy):
    assert json.loads(in_a_copy(KNOWN)) == [
        "The surface goes the wrong way.", "reversed", "reversed", -1.0, "reversed", True,
        ["reverse", {"type": "reversed"}], ["by", "deg"],
    ]  # fmt: skip


def test_every_type_keeps_the_contract():
    for row in registry.TYPES:
        assert callable(row.judge)
        assert row.deflection is not contract.anywhere or not row.constant
        assert bool(row.memory) == bool(row.record)


def test_types_of_a_constant_parameter_come_first():
    constant = [row.constant for row in registry.TYPES]
    assert constant == sorted(constant, reverse=True)
    assert sum(constant) == registry.N_CONSTANT


def test_types_stand_by_their_rank_those_of_a_constant_parameter_first():
    """The order of every array of types, of lists and of candidates in a verdict."""
    assert [(row.name, row.constant) for row in registry.TYPES] == [
        ("loss_of_effectiveness", True), ("stuck", True), ("float", True), ("hardover", True),
        ("hardover", True), ("bias", True), ("loss_of_effectiveness", False), ("oscillatory", False),
        ("rate_limit", False), ("bias", False),
    ]  # fmt: skip
    assert (UP, DOWN) == (3, 4)
