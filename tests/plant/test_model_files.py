"""Which files a model is made of, which of them is taken, what is wrong with each; instrumented copies."""

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant import instrumented, model_file
from beaver_ftc.plant.adapter import bare
from beaver_ftc.plant.instrumented import instrument
from beaver_ftc.plant.model_file import check_model_has_no_side_effects

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
