"""Relations that need no expected value: the diagnosis and the law do not depend on what they are not told.

- No function of theirs takes a scenario or a section of the truth.
- Their records are equal to the byte when only the truth changes.
- A flight is equal to the bit up to the instant at which it begins to differ from another.
"""

import ast
import pickle
from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.loop.loop import Loop
from beaver_ftc.loop.plugin_context import context_of
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import load
from beaver_ftc.scenario.truth import Truth
from beaver_ftc.studies.sensitivity.beyond import Flight, scenario_of
from beaver_ftc.studies.sensitivity.errors import errors_of
from flying import SINES
from given import given
from test_architecture import modules, tree

GIVEN = given(__file__)

TOLD_NOTHING = ("diagnosis", "control", "design")
# Names of scenarios and of the truth's sections, as parameters and as types.
OF_THE_TRUTH = {"scenario", "truth", "faults", "environment", "uncertainty", "seed"}
TYPES_OF_THE_TRUTH = {"Scenario", "ScenarioLike", "Environment", "Uncertainty", "Fault", "SurfaceFault"}
# The record of the faults that the oracle law receives has the name of what it holds: see control/laws.
OF_THE_ORACLE = "faults"
HAS_THE_SECTIONS = {
    "beaver_ftc.scenario.schema", "beaver_ftc.scenario.faults", "beaver_ftc.scenario.builtin",
    "beaver_ftc.plant.conditions", "beaver_ftc.plant.true_aircraft", "beaver_ftc.plant.adapter",
}  # fmt: skip


def told_nothing():
    return [name for name in modules() if name.partition(".")[0] in TOLD_NOTHING]


def given(function):
    """(name, annotation) of each parameter."""
    of = function.args
    for one in (*of.posonlyargs, *of.args, *of.kwonlyargs, *filter(None, (of.vararg, of.kwarg))):
        yield one.arg, "" if one.annotation is None else ast.unparse(one.annotation)


def is_kernel(function):
    return any(ast.unparse(each).startswith(("kernel", "apart", "lazy")) for each in function.decorator_list)


@pytest.mark.parametrize("name", told_nothing())
def test_no_function_takes_a_scenario_or_a_section_of_the_truth(name):
    for node in ast.walk(tree(name)):
        if isinstance(node, ast.FunctionDef):
            for parameter, annotation in given(node):
                oracle = parameter == OF_THE_ORACLE and is_kernel(node)
                assert parameter not in OF_THE_TRUTH or oracle, node.name
                words = set(ast.unparse(ast.parse(annotation.strip("\"'"))).replace("|", " ").split())
                assert not words & TYPES_OF_THE_TRUTH, node.name
        if isinstance(node, ast.ImportFrom):
            assert node.module not in HAS_THE_SECTIONS, node.module


def test_the_two_worlds_share_what_both_are_told_alone():
    declared, truth = ({field.name for field in fields(half)} for half in (Declared, Truth))
    assert not declared & OF_THE_TRUTH
    assert declared & truth == {"aircraft", "rate_hz", "substeps", "initial"}


def test_the_plant_is_configured_from_the_truth_alone():
    assert "Scenario" not in {
        name for node in ast.walk(tree("plant.true_aircraft")) for name in names_in(node)
    }


def names_in(node):
    return [one.name for one in node.names] if isinstance(node, ast.ImportFrom) else [getattr(node, "id", "")]


LATE = 1.0  # s: until then the two flights of a pair are the same
SURFACE_FAULTS = (
    {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.6},
    {"actuator": "rudder", "type": "stuck"}, {"actuator": "aileron", "type": "hardover", "direction": 1},
    {"actuator": "flap", "type": "oscillatory", "amplitude_deg": 3, "frequency_rad_s": 6},
    {"actuator": "elevator", "type": "float"}, {"type": "unanticipated", "Cm_alpha3": 10},
)  # fmt: skip
SENSOR_FAULTS = (
    {"sensor": "q", "type": "bias", "magnitude": 2}, {"sensor": "alpha", "type": "lost"},
    {"sensor": "altitude", "type": "freeze"}, {"sensor": "az", "type": "scale", "magnitude": 0.3},
    {"sensor": "engine_rpm", "type": "bias", "magnitude": 80},
    {"sensor": "V", "type": "noise", "magnitude": 2},
)  # fmt: skip
LATER = GIVEN["later"]  # fmt: skip
NOISY = {
    "sensors": "tactical-grade", "environment": {"turbulence": "dryden", "severity": "light"},
    "fdi.bounds.sensors": "tactical-grade", "fdi.bounds.turbulence": "light",
}  # fmt: skip
DECLARED = GIVEN["declared"]  # fmt: skip


def declared(name):
    base = {"name": "x", "duration_s": 1.4, "rate_hz": 50, "seed": 5, "reference": SINES}
    return load(base | {"aircraft": DECLARED[name].get("aircraft", "beaver")}).with_(DECLARED[name])


PAIRS = [(name, later) for name in DECLARED for later in LATER]


def changed(scenario, later):
    """The scenario with what begins later; surfaces as the aircraft has them."""
    names = scenario.airframe.surfaces
    for fault in later.get("faults", ()):
        if fault.get("actuator", names[0]) not in names:
            return None
    return scenario.with_(later)


@cache
def log_of(name):
    return bf.fly(declared(name)).log


@pytest.mark.parametrize(("name", "later"), PAIRS, ids=str)
def test_the_past_does_not_depend_on_the_future(name, later):
    other = changed(declared(name), LATER[later])
    if other is None:
        pytest.skip(f"{name}: has no such surface")
    log, otherwise = log_of(name), bf.fly(other).log
    before = round((LATE if later != "longer" else 1.4) * 50)
    if later != "law":  # a law to come has columns, which the declaration says
        assert list(otherwise.columns) == list(log.columns)
    for column in log.columns:
        assert np.array_equal(log[column][:before], otherwise[column][:before], equal_nan=True), column


@pytest.mark.parametrize("sensor", ["V", "qdyn", "engine_rpm", "manifold_pressure"])
def test_an_instrument_that_breaks_by_nothing_shows_nothing(sensor):
    broken = {"sensor": sensor, "type": "bias", "magnitude": 1e-300, "at_s": LATE}
    assert bf.fly(declared("published").with_({"faults": [broken]})).log.equals(log_of("published"))


TRUTHS = GIVEN["truths"]  # fmt: skip
OF_THE_COMMAND = {
    "prediction.u", "prediction.u_lo", "prediction.u_hi", "prediction.commanded",
    "control.layout.trim", "control.allocation.output.command",
}  # fmt: skip
CONFIGURED = ["prediction", "fdi", "assessment", "supervisor", "control", "autopilot"]


def configured(scenario):
    """What the diagnosis, the law and plug-ins are configured with, as bytes by field."""
    loop = Loop(scenario)
    found = dict(leaves(loop.frames[CONFIGURED][0]))
    context = context_of(loop.frames, scenario, loop.trimmed, {})
    found["context"] = pickle.dumps(replace(context, model=None, trim_rad=None))
    loop.release()
    return found


def leaves(record):
    """(name, bytes) of each field, fields of fields included."""
    for name in record.dtype.names:
        inner = record[name]
        if inner.dtype.names is None:
            yield name, inner.tobytes()
            continue
        for place in np.ndindex(inner.shape):
            within = ".".join((name, *map(str, place)))
            yield from ((f"{within}.{field}", value) for field, value in leaves(inner[place]))


@pytest.mark.parametrize("truth", TRUTHS)
@pytest.mark.parametrize("name", DECLARED)
def test_nothing_is_configured_by_the_truth(name, truth):
    """Another truth may be trimmed by another command, which is known."""
    scenario = declared(name)
    known = scenario.model_dump(include={"actuators", "sensors"})
    scenario = scenario.with_({f"design_model.{key}": value for key, value in known.items()})
    other = changed(scenario, TRUTHS[truth])
    if other is None:
        pytest.skip(f"{name}: has no such surface")
    found, otherwise = configured(scenario), configured(other)
    assert {field for field in found if found[field] != otherwise[field]} <= OF_THE_COMMAND


def test_the_design_follows_the_servos_that_the_designer_knows():
    known = {"bandwidth_rad_s": 12.0, "rate_limit_deg_s": 40.0, "rudder": {"travel_deg": [-14, 13]}}
    base = declared("servos")
    of_designer = configured(base.with_({"design_model.actuators": known}))
    assert of_designer == configured(base.with_({"actuators": known})) != configured(base)


@pytest.mark.parametrize(
    ("term", "field"),
    {
        "CY_beta": "fdi.statistical.gust.memory.table.value",
        "CY_dr": "fdi.statistical.forces.component.0.G_trim",
        "CX_dpt": "autopilot.thrust", "Cl_beta": "autopilot.dihedral",
        "Cn_beta": "autopilot.sideslip_dpt_cubed", "Cn_dr": "control.power.config.highest_dpt",
        "Cl_da_left": "control.layout.authority",
    }.items(),
)  # fmt: skip
def test_each_stage_takes_the_terms_of_the_design_model(term, field):
    base = declared("split").with_(DECLARED["all, noisy"] | DECLARED["oracle"])
    other = base.with_({f"design_model.coefficients.{term}": 0.7})
    assert configured(other)[field] != configured(base)[field]


def test_the_designers_trim_is_that_of_a_truth_as_declared():
    nominal = declared("published")
    off = nominal.with_({"uncertainty": {"coefficients": {"Cm_0": 1.2}, "inertia": {"Iy": 1.1}}})
    as_declared, flown = Loop(nominal).trimmed, Loop(off).trimmed
    assert (flown.y == as_declared.y).all()
    assert (flown.u == as_declared.command).all()
    assert np.abs(flown.command - flown.u).max() > 1e-3


TOLD = {"control.law": "oracle", "faults": [{**SURFACE_FAULTS[0], "at_s": 0.3}], "changes": []}


def test_the_diagnosis_of_a_flight_by_the_oracle_expects_what_it_has_found_itself():
    sim = bf.Simulation(declared("published").with_(TOLD))
    while not sim.verdict.detected:
        sim.step()
    sim.step()
    prediction, found = sim.records[0]["prediction"], sim.records[0]["assessment"]
    lost = prediction["means"]["Gu"] @ (1.0 - found["effectiveness"])
    assert prediction["F_known"] == pytest.approx(prediction["means"]["F"] - lost, abs=1e-9)
    assert (found["effectiveness"] == 1.0).all()  # so early nothing is named, and the oracle knows it


@pytest.mark.parametrize("law", ["fault-tolerant", "zhang2005", "adaptive"])
def test_a_law_after_the_oracle_is_not_told_what_the_oracle_knew(law):
    change = {"changes": [{"at_s": 0.6, "law": law}], "fdi.scheme": "none"}
    sim = bf.Simulation(declared("published").with_(TOLD | change))
    sim.step(frames=round(0.6 * 50) + 1)
    surfaces = sim.records[0]["control"]["surfaces"]["output"]
    assert (surfaces["effectiveness"] == 1.0).all()
    assert not surfaces["offset"].any()
    assert not sim.records[0]["faults"]["effectiveness"].any()
    given = sim.records[0]["control"]["allocation"]["output"]
    assert given["hand_over"] == given["lost_share"] == given["transfer_share"] == 0.0


def test_a_diagnosis_goes_on_when_the_sensors_change_of_which_it_is_not_told():
    """The same errors as before, under another name."""
    grade = {"sensors": "tactical-grade", "fdi.bounds.sensors": "tactical-grade"}
    lost = {"faults": [{**SURFACE_FAULTS[0], "at_s": 0.3}], "duration_s": 2.0, "changes": []}
    scenario = declared("published").with_(grade | lost)
    log = bf.fly(scenario).log
    swapped = bf.fly(scenario.with_({"changes": [{"at_s": 1.2, "sensors": "tactical-grade"}]})).log
    assert log["detected"].iloc[round(1.2 * 50) - 1] == 1.0
    for column in log.columns:
        assert np.array_equal(log[column], swapped[column], equal_nan=True), column


def test_a_law_after_a_change_of_the_sensors_knows_those_before_it():
    """In its gains and in all else."""
    other = [{"at_s": 0.2, "sensors": "consumer-grade"}, {"at_s": 0.4, "law": "adaptive"}]
    other.append({"at_s": 0.6, "law": "fault-tolerant"})
    laws = []
    for changes in (other, other[1:]):
        sim = bf.Simulation(declared("published").with_({"changes": changes}))
        sim.step(frames=round(0.6 * 50) + 1)
        laws.append(sim.records[0]["control"]["rejecting"]["config"].tobytes())
    assert laws[0] == laws[1]


def test_beyond_the_declaration_the_law_does_not_know_by_how_much():
    scenario = load("elevator-loss-in-turbulence")
    laws = set()
    for factor in (0.0, 1.0, 4.0):
        flight = Flight("sensor errors", factor, 0)
        found = configured(scenario_of(scenario, errors_of(scenario), 1, flight))
        laws.add(b"".join(value for name, value in found.items() if name.startswith("control.rejecting")))
    assert len(laws) == 1
