"""Models that would end, fill or hold up the process that loads them: refused in a line, or run where errors
are caught."""

import shutil

import pytest

import beaver_ftc as bf
import needs
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import data_root
from beaver_ftc.plant import adapter
from beaver_ftc.plant.model_file import check_model_has_no_side_effects

ROOT = '<fdm_config name="m" version="2.0" release="BETA">{}</fdm_config>'


def model(tmp_path, inside):
    path = tmp_path / "m" / "m.xml"
    path.parent.mkdir()
    path.write_text(ROOT.format(inside))
    return path


def test_elements_in_elements_are_bounded(tmp_path):
    """The root is one of them."""
    path = model(tmp_path, "<a>" * 99 + "</a>" * 99)
    check_model_has_no_side_effects(path)
    path.write_text(ROOT.format("<a>" * 100_000 + "</a>" * 100_000))
    with pytest.raises(BadInput) as caught:
        check_model_has_no_side_effects(path)
    (line,) = str(caught.value).splitlines()
    assert line == f"{path}:1: <a> is in more than 100 elements, allowed: up to 100"


@pytest.mark.parametrize("name", ["simulation/reset", "simulation/do_simple_trim", "simulation/do_trim"])
def test_a_model_does_not_start_jsbsim_anew_from_within_a_frame(tmp_path, name):
    path = model(tmp_path, f"<system><output> {name} </output></system>")
    with pytest.raises(BadInput, match=f"m.xml:1: {name} controls JSBSim itself, allowed: other properties"):
        check_model_has_no_side_effects(path)


def beaver_with(tmp_path, component):
    """A copy of the built-in aircraft that has one flight-control component more; its scenario."""
    shutil.copytree(data_root() / "aircraft" / "beaver", tmp_path / "own")
    path = tmp_path / "own" / "beaver.xml"
    system = f'<system name="x"><channel name="x">{component}</channel></system>'
    path.write_text(path.read_text().replace("</fdm_config>", f"{system}</fdm_config>"))
    scenario = tmp_path / "s.yaml"
    scenario.write_text("name: s\nduration_s: 1\naircraft: ./own\n")
    return path, scenario


@needs.service("compare")
def test_a_model_that_takes_all_memory_is_refused_and_this_process_goes_on(tmp_path):
    path, scenario = beaver_with(
        tmp_path,
        '<pure_gain name="x/y"><input>velocities/p-rad_sec</input><gain>1</gain><delay>1e9</delay></pure_gain>',  # noqa: E501
    )
    says = (
        "jsbsim: JSBSim needs more than 1 GB of memory for it, allowed: a model that JSBSim loads and flies"
    )
    with pytest.raises(BadInput) as caught:
        bf.load(scenario)
    assert str(caught.value) == f"{path.parent}/aircraft.yaml:14: {says}"


# 7 at 0.7 s; a constant index would be refused at loading
LATER = "<product><property>simulation/sim-time-sec</property><value>10</value></product>"


@pytest.mark.parametrize(
    ("bad", "says"),
    [("<property>no/such</property>", "The property no/such does not exist"),
     (f"<switch>{LATER}<value>1</value><value>2</value></switch>", "switch function index")],
)  # fmt: skip
def test_an_error_that_a_model_raises_in_flight_ends_the_flight_alone(tmp_path, bad, says):
    early = "<lt><property>simulation/sim-time-sec</property><value>0.7</value></lt>"
    function = f"<function><ifthen>{early}<value>0</value>{bad}</ifthen></function>"
    _, scenario = beaver_with(tmp_path, f'<fcs_function name="x/y">{function}</fcs_function>')
    with pytest.raises(adapter.SimulationFailed, match=f"JSBSim cannot fly own/beaver.xml: .*{says}"):
        bf.fly(bf.load(scenario))
