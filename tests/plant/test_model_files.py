"""Which files a model is made of, which of them is taken, what is wrong with each; instrumented copies."""

from pathlib import Path
from xml.etree import ElementTree

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant import instrumented, model_file
from beaver_ftc.plant.adapter import bare
from beaver_ftc.plant.instrumented import instrument
from beaver_ftc.plant.model_file import check_model_has_no_side_effects, copy_of, files_of, with_systems
from kept import page

FILES = {
    "jet.xml": """<?xml version="1.0"?>
<fdm_config name="jet">
  <!-- what it is -->
  <metrics><location name="CG"><!-- not this --><x>0</x></location></metrics>
  <system file="gain"/>
  <system file="deep/other.xml"/>
  <propulsion> <engine file="turbine"> <thruster file="direct"/> </engine> </propulsion>
  <aerodynamics>
    <axis name="PITCH"> <function name="aero/x"> <product name="p"><!-- first stands for words -->
      <property> fcs/elevator-pos-rad </property> <property> -fcs/elevator-pos-norm </property>
      <property> fcs/mag-elevator-pos-rad </property> <property> fcs/spoiler-pos-norm </property>
      <property> gear/gear-pos-norm </property> <property> /engines/engine/rpm </property>
      <property> fcs/left-aileron-pos-deg </property>
    </product> </function> </axis>
  </aerodynamics>
</fdm_config>
""",
    "Systems/gain.xml": '<system name="gain"><channel file="more"/></system>',
    "gain.xml": '<system name="gain beside"/>',
    "deep/other.xml": "<system/>",
    "Systems/more.xml": "<system><!-- more --></system>",
    "Engines/turbine.xml": '<turbine_engine name="t"/>',
    "engine/turbine.xml": '<turbine_engine name="another"/>',
    "Engine/direct.xml": "<direct/>",
    "unused.xml": "<system/>",
}


@pytest.fixture
def jet(tmp_path, monkeypatch):
    """The model of an aircraft that never was; the jsbsim package has two of its files as well."""
    package = tmp_path / "jsbsim"
    monkeypatch.setattr(model_file, "package", lambda: package)
    for name, text in FILES.items():
        put(tmp_path / "jet" / name, text)
    put(package / "engine" / "direct.xml", "<direct/>")
    put(package / "systems" / "gain.xml", '<system><output name="x"/></system>')
    return tmp_path / "jet" / "jet.xml"


def put(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def below(folder, found):
    return {str(path.relative_to(folder)): str(place) for path, place in found.items()}


def test_every_file_of_a_name_is_found_and_the_first_is_taken(jet):
    assert below(jet.parent, files_of(jet)) == {
        "gain.xml": "gain.xml", "Systems/gain.xml": "Systems/gain.xml", "deep/other.xml": "deep/other.xml",
        "Engines/turbine.xml": "Engines/turbine.xml", "engine/turbine.xml": "engine/turbine.xml",
        "Engine/direct.xml": "Engine/direct.xml", "Systems/more.xml": "Systems/more.xml",
    }  # fmt: skip
    assert list(below(jet.parent, files_of(jet, first=True))) == [
        "gain.xml", "deep/other.xml", "Engines/turbine.xml", "Engine/direct.xml",
    ]  # fmt: skip


def test_the_package_s_files_are_taken_where_there_are_no_own_folders(jet, tmp_path):
    for folder in ("Systems", "Engines", "engine", "Engine"):
        for path in (jet.parent / folder).glob("*"):
            path.unlink()
        (jet.parent / folder).rmdir()
    (jet.parent / "gain.xml").unlink()
    assert below(tmp_path, files_of(jet, first=True)) == {
        "jsbsim/systems/gain.xml": "Systems/gain.xml", "jet/deep/other.xml": "deep/other.xml",
        "jsbsim/engine/direct.xml": "Engines/direct.xml",
    }  # fmt: skip
    check_model_has_no_side_effects(jet)  # what the package's own files do is not looked at
    copied = copy_of(jet, tmp_path / "copy")
    assert sorted(str(path.relative_to(tmp_path / "copy")) for path in copied.parent.rglob("*.xml")) == [
        "Engines/direct.xml", "Systems/gain.xml", "deep/other.xml", "jet.xml",
    ]  # fmt: skip
    assert ElementTree.parse(copied.parent / "Systems" / "gain.xml").getroot().find("output") is None
    assert copied.read_text() == FILES["jet.xml"]


WRONG = {
    "output at the top": '<fdm_config>\n<output name="a" type="CSV"/>\n<input port="1"/><child name="c"/>'
                         "</fdm_config>",
    "output of a component": "<fdm_config><system><output> fcs/x </output></system></fdm_config>",
    "a root that is one": '<output name="a"/>',
    "files elsewhere": '<fdm_config><a file="/etc/x"/><b file="~/x"/><c file="c:x"/><d file="a/../b"/>'
                       "</fdm_config>",
    "a script": '<runscript><use aircraft="a/../b" initialize="ok" other="../x"/></runscript>',
    "writing": '<fdm_config><a>\n simulation/write-state-<!-- -->file </a>'
               '<b c="simulation/do_linearization"/></fdm_config>',
    "writing between": "<fdm_config>do_linear<a/>ization</fdm_config>",
    "a document type": '<!DOCTYPE x [<!ENTITY e "write-state-file">]>\n<x>&e;</x>',
    "no XML": "<fdm_config>\n<a></b>",
    "binary": "<a>\n\0",
    "long": f'<fdm_config><output name="{"n" * 200}"/></fdm_config>',
}  # fmt: skip


def test_what_is_wrong_with_a_file(tmp_path, changed):
    found = {}
    for case, text in WRONG.items():
        put(tmp_path / "m" / "m.xml", text)
        try:
            check_model_has_no_side_effects(tmp_path / "m" / "m.xml")
            found[case] = []
        except BadInput as error:
            found[case] = [line.partition("m.xml:")[2].partition(" (")[0] for line in str(error).splitlines()]
    assert not changed(found)


def test_what_is_beside_an_aircraft_s_file_is_looked_at(jet):
    script = jet.parent / "scripts" / "fly.xml"
    put(script, '<runscript><output name="x"/></runscript>')
    put(jet.parent / "notes.xml", '<notes><output name="x"/></notes>')
    check_model_has_no_side_effects(jet)
    put(jet.parent / "aircraft.yaml", "")
    with pytest.raises(BadInput) as caught:
        check_model_has_no_side_effects(jet)
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"{script}:1: <output name=")
    script.unlink()
    (jet.parent / "link.xml").symlink_to(jet.parent.parent / "jsbsim" / "engine" / "direct.xml")
    with pytest.raises(BadInput, match=r"link.xml:1: is a link out of the folder"):
        check_model_has_no_side_effects(jet)


def test_a_file_that_changed_is_read_again_and_one_that_is_gone_is_said(jet):
    check_model_has_no_side_effects(jet)
    (jet.parent / "Systems" / "more.xml").write_text('<system><input port="3"/></system>')
    with pytest.raises(BadInput, match=r"more.xml:1: <input port="):
        check_model_has_no_side_effects(jet)
    with pytest.raises(BadInput, match=r"none.xml:1: cannot be read, allowed: an XML file"):
        check_model_has_no_side_effects(jet.parent / "none.xml")


def test_systems_are_read_in_and_comments_that_come_first_are_descriptions(jet):
    root = with_systems(jet)
    systems = root.findall("system")
    assert [system.get("name") for system in systems] == ["gain", None]
    assert root.find("metrics/location/description").text == " not this "
    assert root.find(".//product/description").text == " first stands for words "
    assert root.find("description").text == " what it is "


def test_an_instrumented_copy(jet, tmp_path, changed):
    assert instrumented.surfaces_of(jet) == {
        "aileron": ("fcs/left-aileron-pos-deg",),
        "elevator": ("fcs/elevator-pos-norm", "fcs/elevator-pos-rad", "fcs/mag-elevator-pos-rad"),
    }
    ours = [name for names in instrumented.surfaces_of(jet).values() for name in names]
    assert instrumented.others_of(jet, ours) == ("fcs/spoiler-pos-norm", "gear/gear-pos-norm")
    assert instrumented.engines_of(jet) == 1
    glider = tmp_path / "glider.xml"
    glider.write_text("<fdm_config><propulsion/></fdm_config>")
    assert instrumented.engines_of(glider) == 0
    travel = {"aileron": (-0.3, 0.25), "elevator": (-0.4, 0.35)}
    model = instrumented.instrument(
        jet, tmp_path / "copy", travel, ["fcs/spoiler-pos-norm", "gear/gear-pos-norm"]
    )
    assert not changed(page(model.read_text()), part="model")
    assert not changed(page((model.parent / "Systems" / "ftc-elevator.xml").read_text()), part="elevator")
    assert not changed(page((model.parent / "Systems" / "ftc-common.xml").read_text()), part="common")
    told = ("/engines/engine[3]/rpm", "/controls/engines/engine/throttle", "/engines/engine/n1")
    assert not changed([instrumented.is_told(name) for name in told], part="told")


@pytest.mark.parametrize("gear_up", [False, True])
def test_a_copy_has_at_zero_what_nothing_gives_and_a_retracted_gear(jet, tmp_path, gear_up):
    """Its aerodynamics see that in place of the gear of its own flight control."""
    model = instrument(jet, tmp_path / "copy", {}, ["of/one", "of/other"], gear_up=gear_up)
    common = ElementTree.parse(model.parent / "Systems" / "ftc-common.xml").getroot()
    zero = {of.text.strip() for of in common.findall("property") if of.get("value") == "0"}
    gear = "gear/retracted-pos-norm"
    assert zero & {"of/one", "of/other", gear} == {"of/one", "of/other", *([gear] if gear_up else [])}
    seen = [
        of.text.strip() for of in ElementTree.parse(model).getroot().find("aerodynamics").iter("property")
    ]
    assert (gear in seen, "gear/gear-pos-norm" in seen) == (gear_up, not gear_up)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("fdm_config", "system", "jet.xml: is system, allowed: a JSBSim model, fdm_config"),
        ("aerodynamics>", "others>", "jet: has no aerodynamics, allowed: an aircraft that flies"),
        ('"PITCH"', '"ROLL"', "jet: its aerodynamics have no pitch axis, allowed: one that has"),
        ("</fdm_config>", "", "jet.xml: "),
    ],
)
def test_what_cannot_be_instrumented(jet, tmp_path, old, new, says):
    jet.write_text(FILES["jet.xml"].replace(old, new))
    with pytest.raises(BadInput) as caught:
        instrumented.instrument(jet, tmp_path / "copy", {})
    assert str(caught.value).startswith(says)


def test_aerodynamics_in_a_file_of_their_own_are_read_in(jet, tmp_path):
    text = FILES["jet.xml"]
    begin, end = text.index("<aerodynamics>"), text.index("</aerodynamics>") + len("</aerodynamics>")
    put(jet.parent / "aero.xml", text[begin:end])
    jet.write_text(text[:begin] + '<aerodynamics file="aero"/>' + text[end:])
    assert list(instrumented.surfaces_of(jet)) == ["aileron", "elevator"]
    model = instrumented.instrument(jet, tmp_path / "copy", {"elevator": (-0.4, 0.35)})
    assert "fcs/effective-mag-elevator-pos-rad" in model.read_text()


def test_aircraft_of_the_package():
    assert {"c172x", "737", "f16"} <= set(instrumented.names())
    assert instrumented.source_of("c172x").is_file()
    with pytest.raises(
        BadInput, match=r"jsbsim:c172z: the jsbsim package has no such aircraft, did you mean c172"
    ):
        instrumented.source_of("c172z")


def test_a_copy_has_the_files_it_uses_and_no_others(tmp_path):
    """Aerodynamics from a file of their own stand in the model by then, and that file is of no use."""
    source = tmp_path / "own"
    source.mkdir()
    navion = Path(__file__).parents[2] / "examples" / "own-aircraft" / "navion.xml"
    text = navion.read_text(encoding="utf-8")
    start, end = text.index("<aerodynamics>"), text.index("</aerodynamics>") + len("</aerodynamics>")
    (source / "aero.xml").write_text(text[start:end], encoding="utf-8")
    split = text[:start] + '<aerodynamics file="aero.xml"/>' + text[end:]
    (source / "navion.xml").write_text(split, encoding="utf-8")
    for name in ("another.xml", "notes.txt"):
        (source / name).write_text("<fdm_config/>", encoding="utf-8")
    travel = dict.fromkeys(("aileron", "elevator", "rudder"), (-0.3, 0.3))
    model = instrument(source / "navion.xml", tmp_path / "copy", travel)
    there = {str(path.relative_to(tmp_path / "copy")) for path in (tmp_path / "copy").rglob("*.*")}
    systems = {f"Systems/ftc-{name}.xml" for name in (*travel, "common")}
    assert there == {"navion.xml", *systems}
    assert "aero/qbar-psf" in model.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def twin(tmp_path_factory):
    """The jsbsim package's 737, its engines with levers of their own, at 139 m/s while they come to run."""
    folder = tmp_path_factory.mktemp("twin")
    travel = dict.fromkeys(("aileron", "elevator", "rudder"), (-0.3, 0.3))
    fdm = bare(instrument(instrumented.source_of("737"), folder, travel, apart=True))
    fdm["ic/vt-fps"], fdm["ic/alpha-deg"], fdm["ic/beta-deg"], fdm["ic/q-rad_sec"] = 456.0, 3.0, 2.0, 0.05
    fdm["propulsion/set-running"] = -1
    fdm.run_ic()
    return fdm


@pytest.mark.parametrize(
    ("together", "apart", "failed", "levers"),
    [(0.5, (0.2, -0.1), (0, 0), (0.7, 0.4)), (0.9, (0.2, -0.95), (0, 0), (1.0, 0.0)),
     (0.6, (0.1, -0.2), (0, 1), (0.7, 0.0)), (0.6, (0.1, -0.2), (1, 0), (0.0, 0.4))],
)  # fmt: skip
def test_the_lever_of_each_engine_is_that_of_all_and_its_own_difference(
    twin, together, apart, failed, levers
):
    twin["fcs/actuated-throttle-norm"] = together
    for i in range(2):
        twin[f"fcs/actuated-throttle-{i}-difference"] = apart[i]
        twin[f"failures/engine-{i}-at-idle"] = failed[i]
    twin.run()
    assert [twin[f"fcs/throttle-cmd-norm[{i}]"] for i in range(2)] == pytest.approx(levers)


def test_signals_of_engines_and_flow_are_dimensionless_and_of_the_instant(twin):
    """Thrust of both engines over dynamic pressure and area, their moments also over span, chord and span."""
    twin["fcs/actuated-throttle-norm"] = 0.6
    for i, way in enumerate((0.3, -0.3)):
        twin[f"fcs/actuated-throttle-{i}-difference"], twin[f"failures/engine-{i}-at-idle"] = way, 0.0
    for _ in range(200):
        twin.run()
    before = [twin[f"propulsion/engine[{i}]/thrust-lbs"] for i in range(2)]
    moments = [twin[f"moments/{axis}-prop-lbsft"] for axis in "lmn"]
    assert before[0] > 1.2 * before[1] > 0.0
    assert all(moments[1:])
    twin.suspend_integration()
    twin.run()
    twin.run()
    twin.resume_integration()
    force, b, c = (
        twin["aero/qbar-psf"] * twin["metrics/Sw-sqft"],
        twin["metrics/bw-ft"],
        twin["metrics/cbarw-ft"],
    )
    V2 = 2.0 * twin["velocities/vt-fps"]
    wanted = {
        "thrust": sum(twin[f"propulsion/engine[{i}]/thrust-lbs"] for i in range(2)) / force,
        "alpha_rate": twin["aero/alphadot-rad_sec"] * c / V2,
        "beta_rate": twin["aero/betadot-rad_sec"] * b / V2,
        **{
            f"engines_{axis}": twin[f"moments/{axis}-prop-lbsft"] / force / arm
            for axis, arm in zip("lmn", (b, c, b), strict=True)
        },
        "mach": twin["velocities/mach"],
    }
    found = {name: twin[of] for name, of in instrumented.SIGNALS.items()}
    assert found == pytest.approx(wanted, rel=1e-3, abs=1e-9)
    assert instrumented.ENGINE_SIGNALS == ("engines_l", "engines_m", "engines_n")
