"""A new fault type is a row of two tables, what happens and what tells it: the packages with both, in a copy.

Two are added that are not like those there: one of a constant parameter, and one with memory. That the latter
is excluded has a certificate, which the checker of the checkout accepts if it is true.
"""

import json
import os
import shutil
import subprocess
import sys
from filecmp import dircmp
from pathlib import Path

import numpy as np
import pytest

import beaver_ftc
import needs
from beaver_ftc.documents.files import data_root

HERE = Path(__file__).parent
IN_FAULTS, IN_TABLE = "scenario/faults/{}.py", "diagnosis/types/table/{}.py"

# A surface that follows its command with the sign reversed: p = -u.
REVERSED = '''
"""A surface rigged the wrong way round: p = -u."""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.sets import EMPTY_SET, UNLIMITED_SET
from beaver_ftc.diagnosis.types import FaultType


@kernel
def consistent_interval(config, surface, type_index, k):
    """Whether the mirrored command explains this frame."""
    seen = surface.judged
    return UNLIMITED_SET if seen.lo <= -seen.u <= seen.hi else EMPTY_SET


@kernel
def deflection(config, surface, type_index, k):
    """The mirrored command."""
    return -surface.last.u, -surface.last.u


def estimate(fdi, s, kind):
    """It has none but itself."""
    return -1.0


TYPES = (
    FaultType(
        name="reversed", has_constant_parameter=True, consistent_interval=consistent_interval,
        deflection_range=deflection, estimate_parameter=estimate,
    ),
)  # fmt: skip
'''
# A servo whose feedback wears: both the fault and the set of its parameter have a memory.
WEARS = '''
"""A servo whose feedback wears: its surface moves too far, the more so the more it has moved."""

from math import degrees
from typing import Literal

from beaver_ftc.documents.document import Number, entry, number
from beaver_ftc.scenario.airframe import Actuator
from beaver_ftc.scenario.faults import Button, Past, Properties, Switched, constant


class Overdrive(Switched):
    """The surface moves too far, the more so the more it has moved."""

    follows_surface, size = True, ("by", "%")
    in_words = constant(growth_per_deg=lambda value: f"{100 * value:g} % more with each degree")
    examples = (("worn feedback", {"growth_per_deg": 0.01}),)
    button = Button(8, "wear", {"growth_per_deg": 0.02})

    type: Literal["overdrive"]
    actuator: Actuator = entry(..., "the surface that fails")
    growth_per_deg: Number = number(..., "share of 1", "more with each degree", gt=0, le=1, examples=[0.02])

    def follow(self, past: Past, position_rad: float) -> None:
        was_rad = past.kept.get("was_rad", position_rad)
        past.kept["travel_rad"] = past.kept.get("travel_rad", 0.0) + abs(position_rad - was_rad)
        past.kept["was_rad"] = position_rad

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of["effectiveness"] *= 1.0 + min(self.growth_per_deg * degrees(past.kept["travel_rad"]), 1.0)
'''
WORN = '''
"""A surface that moves further than it is told, by a factor that never becomes smaller: p = g u, g >= 1."""

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.sets import EMPTY_SET, UNLIMITED_SET, explain
from beaver_ftc.diagnosis.types import SUBTRACT_OFFSET, DeflectionRelation, FaultType

MOST = 2.0


@kernel
def reset_memory(surface, type_index):
    """It does what it is told."""
    surface.overdrive.least = 1.0


@kernel
def consistent_interval(config, surface, type_index, k):
    """A factor explains this frame that is no smaller than one that was needed before."""
    seen, worn = surface.judged, surface.overdrive
    low, high = seen.lo, seen.hi
    middle, slack = 0.5 * (low + high), 0.5 * (high - low)
    low, high = explain(middle, slack, seen.u, worn.least, MOST)
    if low > high:
        return EMPTY_SET
    worn.least = max(worn.least, low)
    return UNLIMITED_SET


def estimate(fdi, s, kind):
    """By how much too far, share of 1."""
    return float(fdi["types"]["surface"][s]["overdrive"]["least"]) - 1.0


TYPES = (
    FaultType(
        name="overdrive", has_constant_parameter=False, sort_rank=5, reset_memory=reset_memory,
        consistent_interval=consistent_interval, memory_record_name="overdrive",
        memory_dtype=record(least=float), accommodation_mode=SUBTRACT_OFFSET, estimate_parameter=estimate,
        deflection_relation=DeflectionRelation(
            1.0, theta_is_share=True, theta_span=lambda low, high: (0.0, MOST - 1.0)
        ),
    ),
)  # fmt: skip
'''
# Who has to know of it beside the diagnosis: scenario and schema, documents, `matrix`, `list`, the live page.
KNOWN = """
import json
from beaver_ftc.cli.catalogue import _available
from beaver_ftc.results.metrics import faults_of
from beaver_ftc.scenario.faults import Past
from beaver_ftc.scenario.schema import load
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.matrix.fault_matrix import FaultCase, scenario_of
schema = Scenario.model_json_schema()["$defs"]
fault = scenario_of(FaultCase("worn feedback", "rudder", 45.0), "nominal", 0.0).faults[0]
expected = load({"name": "r", "faults": [fault.model_dump()], "expect": {"isolated_type": "overdrive"}})
of, past = {"effectiveness": 1.0}, Past()
for place in (0.0, 0.5, -0.1, -0.1):
    fault.follow(past, place)
fault.strike(of, 1.0, past)
said = [schema["Overdrive"]["description"], expected.expect.isolated_type, fault.type, of["effectiveness"]]
said.append(faults_of(expected)[0]["type"])
said.append("overdrive" in [entry["name"] for entry in _available()["faults"]])
print(json.dumps(said))
"""
PAGE = """
import json
from beaver_ftc_live.page.session import fault_types
live = fault_types()
print(json.dumps([live["breaks"][-1], live["sizes"]["overdrive"]]))
"""
# A jam, which excludes the type.
CERTIFIED = """
import json
import beaver_ftc as bf
jam = dict(
    name="jam", duration_s=1.2, rate_hz=50, fdi=dict(fault_class="all", sensor_monitor="never"),
    reference={axis: [dict(sine=dict(amplitude_deg_s=3, frequency_hz=0.3))] for axis in "pqr"},
    faults=[dict(actuator="aileron", type="stuck", position_deg=5, at_s=0.5)],
)
proof = bf.fly(jam).proof()
log = {name: [float(value) for value in column] for name, column in proof.log.items()}
print(json.dumps([proof.certificate, log, proof.scenario]))
"""
FLIGHT = """
import sys
sys.path.insert(0, {folder!r})
from design_plant import UNCERTAINTIES, DesignPlant
from beaver_ftc.diagnosis.types.findings import fault_finding_dict
SURFACES = ("aileron", "elevator", "rudder", "flap")
reverse = lambda k, u: -u if k >= 20 else u
plant = DesignPlant(4, 50.0, surface=2, position=reverse, fault_class="all")
found = lambda plant: fault_finding_dict(plant.fdi, SURFACES)
plant.fly(220, UNCERTAINTIES["random"], until=lambda plant: found(plant)["isolation_type"])
said = found(plant)
print(said["isolated"], said["isolation_type"], said["estimate"])
"""
# Whether the type is excluded, frame by frame, on the surface that has it: against every uncertainty; and on
# one whose excess shrinks again.
PROMISE = """
import sys, json
sys.path.insert(0, {folder!r})
from design_plant import UNCERTAINTIES, DesignPlant
from beaver_ftc.diagnosis.types.registry import TYPE_NAMES
KIND = TYPE_NAMES.index("overdrive")

def worn(sign):
    past = dict(travel=0.0, last=0.0)
    def position(k, u):
        if k < 20:
            return u
        past["travel"], past["last"] = past["travel"] + abs(u - past["last"]), u
        grown = min(past["travel"] / 4.0, 1.0)
        return u * (1.0 + 0.25 * (grown if sign > 0 else 1.0 - grown))
    return position

def flown(name, sign):
    plant, excluded, judged = DesignPlant(4, 50.0, surface=0, position=worn(sign), fault_class="all"), 0, 0
    for _ in range(130):
        plant.fly(1, UNCERTAINTIES[name])
        surface = plant.fdi["types"]["surface"][0]
        excluded += surface["sets"]["excluded"][KIND] or plant.position_excluded(0)
        judged = int(surface["evidence"]["n_anomalous"])
    return int(excluded), judged

print(json.dumps(dict(worn=[flown(name, 1.0) for name in UNCERTAINTIES], heals=flown("random", -1.0))))
"""
SCENARIO = """
import json
import beaver_ftc as bf
def flown(law, duration_s):
    return bf.fly(dict(
        name="worn", duration_s=duration_s, rate_hz=25, control=dict(law=law),
        fdi=dict(fault_class="all", sensor_monitor="never"),
        reference=dict(p=[dict(sine=dict(amplitude_deg_s=6, frequency_hz=0.3))]),
        faults=[dict(actuator="aileron", type="overdrive", growth_per_deg=0.02, at_s=2)],
        expect=dict(isolated_as="aileron", isolated_type="overdrive"),
    ))
flights = [flown("fault-tolerant", 10.5), flown("nominal", 5.0)]
print(json.dumps([flights[0].metrics, flights[1].metrics, str(flights[0])]))
"""


def copied(root, **modules):
    """A copy of the packages with a module more in each of the two tables; runs texts there as one."""
    for package in PACKAGES:
        shutil.copytree(SOURCE / package, root / package)
    for folder in ("aircraft", "scenarios"):
        shutil.copytree(data_root() / folder, root / "beaver_ftc" / "data" / folder)
    for place, text in modules.items():
        (root / "beaver_ftc" / place).write_text(text)

    def printed(*texts):
        done = subprocess.run(
            [sys.executable, "-c", "\n".join(texts)],
            env={**os.environ, "PYTHONPATH": str(root), "NUMBA_DISABLE_JIT": "1"},
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.splitlines()

    return printed


SOURCE = Path(beaver_ftc.__path__[0]).parent
ALL_PACKAGES = "beaver_ftc", "beaver_ftc_live", "beaver_ftc_assurance"
PACKAGES = [name for name in ALL_PACKAGES if (SOURCE / name).is_dir()]
OVERDRIVE = {IN_FAULTS.format("wear"): WEARS, IN_TABLE.format("wear"): WORN}


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return tmp_path_factory.mktemp("copy")


@pytest.fixture(scope="module")
def in_a_copy(root):
    """The copy with the type that has a memory."""
    return copied(root, **OVERDRIVE)


@pytest.fixture(scope="module")
def found(in_a_copy):
    """What the texts find in that copy."""
    texts = {"flights": SCENARIO, "known": KNOWN}
    if "beaver_ftc_live" in PACKAGES:
        texts["page"] = PAGE
    if "beaver_ftc_assurance" in PACKAGES:
        texts["certified"] = CERTIFIED
    return dict(zip(texts, map(json.loads, in_a_copy(*texts.values())), strict=True))


def differing(one, other):
    """Files below `one` that `other` has not, or not the same."""

    def below(compared, place=""):
        yield from (place + name for name in (*compared.left_only, *compared.diff_files))
        for name, folder in compared.subdirs.items():
            yield from below(folder, f"{place}{name}/")

    return sorted(below(dircmp(one, other, ignore=["__pycache__", "data"])))


def test_a_type_with_memory_is_two_files(in_a_copy, root):
    assert differing(root / "beaver_ftc", SOURCE / "beaver_ftc") == sorted(OVERDRIVE)
    for package in PACKAGES[1:]:
        assert differing(root / package, SOURCE / package) == []
    assert len(OVERDRIVE) <= 2


def test_it_is_injected_named_accommodated_and_put_in_words(found):
    tolerant, nominal, said = found["flights"]
    isolation = tolerant["isolation"]
    assert (isolation["fault"], isolation["type"]) == ("aileron", "overdrive")
    assert isolation["correct"] is isolation["type_correct"] is True
    assert [each["passed"] for each in tolerant["expectations"]] == [True, True]
    assert 0.0 < isolation["estimate"] < 1.0
    assert isolation["estimate_deg"] is None  # it is a share, no angle
    off = [flight["tracking"]["post_fault_rms_deg_s"]["p"] for flight in (tolerant, nominal)]
    assert off[0] < 0.7 * off[1]
    assert "aileron overdrive (2 % more with each degree) at 2.00 s" in said
    assert f"correct, overdrive, estimated {isolation['estimate']:.3g}" in said


def test_it_is_never_excluded_while_it_acts(in_a_copy):
    """And is, where the excess over the command shrinks: the set has a memory."""
    found = json.loads(*in_a_copy(PROMISE.format(folder=str(HERE))))
    assert [excluded for excluded, _ in found["worn"]] == [0] * len(found["worn"])
    assert sum(judged > 20 for _, judged in found["worn"]) > 2  # some uncertainties hide it
    assert found["heals"][0] > 0


def test_a_type_of_a_constant_parameter_is_found_and_named(tmp_path):
    printed = copied(tmp_path, **{IN_TABLE.format("backwards"): REVERSED})
    assert printed(FLIGHT.format(folder=str(HERE))) == ["rudder reversed -1.0"]


def test_scenario_documents_matrix_and_list_know_it(found):
    *said, known = found["known"]
    assert known is True
    assert said == [
        "The surface moves too far, the more so the more it has moved.", "overdrive",
        "overdrive", pytest.approx(1.0 + 0.01 * 1.1 * 57.29577951), "overdrive",
    ]  # fmt: skip


@needs.command("live")
def test_the_live_page_knows_it(found):
    button = ["wear", {"type": "overdrive", "growth_per_deg": 0.02}]
    assert found["page"] == [button, ["by", "%"]]


@pytest.fixture(scope="module")
def certified(found):
    """Certificate, log and text of the scenario of a flight in which the new type is excluded."""
    certificate, log, scenario = found["certified"]
    return certificate, {name: np.array(column) for name, column in log.items()}, scenario


def check_certificate():
    """The checker, which is not of the copy."""
    from beaver_ftc_assurance.certificates import check_certificate

    return check_certificate


def refused(certificate, log, scenario):
    """Why the checker refuses it."""
    from beaver_ftc_assurance.certificates.certified import with_digest

    return [*check_certificate().failures(with_digest(certificate), log, scenario)]


def statement(certificate, what):
    (said,) = (said for said in certificate["statements"] if said["what"] == what)
    return said


@needs.service("proof")
def test_that_it_is_excluded_is_certified(certified):
    """The checker does not know the type: the log says what it is, and its effect is (0 to 1) times G u."""
    certificate, log, _ = certified
    said = statement(certificate, "aileron overdrive")
    assert refused(*certified) == []
    (line,) = (line for line in check_certificate().sentences(certificate, log) if "overdrive" in line)
    assert line.startswith("aileron overdrive excluded at")
    assert "overdrive being what the log defines" in line
    assert log["aileron_overdrive_excluded"][said["frame"]] == 1.0
    defined = {name: set(log[f"aileron_overdrive_{name}"]) for name in (
        "gain", "theta_is_share", "theta_is_constant", "theta_low", "theta_high",
    )}  # fmt: skip
    assert defined == {
        "gain": {1.0}, "theta_is_share": {1.0}, "theta_is_constant": {0.0}, "theta_low": {0.0},
        "theta_high": {1.0},
    }  # fmt: skip
    (term,) = said["terms"]
    k, d = term["frame"], np.array(term["d"])
    x, model, of_position = (
        np.array([log[column.format(axis)] for axis in "pqr"])
        for column in ("{}_measured_rad_s", "{}_design_rad_s2", "fie_aileron_position_{}_offset_rad_s2")
    )
    innovation = d @ ((x[:, k] - x[:, k - 1]) * 50.0 - model[:, k])
    assert innovation > max(0.0, d @ -of_position[:, k])
