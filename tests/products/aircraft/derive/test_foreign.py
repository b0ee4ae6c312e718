"""Other authors' aircraft as a user has them: where their files lie, what their engines lack, wings alone."""

import re

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.loop import fly
from beaver_ftc.plant.adapter import bare
from beaver_ftc.plant.instrumented import instrument
from beaver_ftc.plant.model_file import copy_of
from beaver_ftc.scenario.schema import load_text
from beaver_ftc_aircraft.derive import derivation
from beaver_ftc_aircraft.derive.derivation import source_of

from . import foreign

MOTOR = '<electric_engine name="motor"> <power unit="WATTS"> {} </power> </electric_engine>'


@pytest.fixture
def prepared(tmp_path, monkeypatch):
    """What comes of a model up to where it is sampled, its notes, and how to prepare one."""

    def ends(*of):
        raise StopIteration

    monkeypatch.setattr(derivation, "_derived", ends)
    compared = derivation._compared

    def prepare(path, envelope=None):
        seen = {}

        def keep(source, pair, airspeed_mps, notes, tell):
            seen.update(pair=pair, notes=notes, off=compared(source, pair, airspeed_mps, notes, tell))
            seen["power_hp"] = of_full_power(pair.copy)
            return seen["off"]

        monkeypatch.setattr(derivation, "_compared", keep)
        with pytest.raises(StopIteration):
            derivation.derive(str(path), tmp_path / "out", envelope)
        return seen

    return prepare


def of_full_power(model):
    fdm = bare(model)
    if fdm.get_propulsion().get_num_engines() == 0:
        return None
    fdm["fcs/actuated-throttle-norm"] = 1.0
    for _ in range(3):
        fdm.run()
    return fdm["propulsion/engine/power-hp"]


PLACES = {
    "beside aircraft/": ("my_motor", {"engine/my_motor.xml": 14000}, 14000),
    "of the package's name": ("electric147kW", {"engine/electric147kW.xml": 14000}, 14000),
    "named like the model": ("navion", {"aircraft/navion/Engines/navion.xml": 14000}, 14000),
    "its own before the shared": (
        "m", {"engine/m.xml": 9000, "aircraft/navion/Engines/m.xml": 14000}, 14000,
    ),
    "none beside the model itself": ("electric147kW", {"aircraft/navion/electric147kW.xml": 14000}, 147000),
    "of the package": ("electric147kW", {}, 147000),
}  # fmt: skip


def of_another_author(folder, case, apart=False):
    """The folder of a Navion with that engine; apart: the propulsion is in a file of its own."""
    engine, motors, _ = PLACES[case]
    for place, power in motors.items():
        file = folder / place
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(MOTOR.format(power))
    text = foreign.powered(engine)
    if apart:
        section = re.search(r"<propulsion>.*</propulsion>", text, re.S).group(0)
        text = text.replace(section, '<propulsion file="Propulsion"/>')
        (folder / "aircraft" / "navion").mkdir(parents=True, exist_ok=True)
        (folder / "aircraft" / "navion" / "Propulsion.xml").write_text(section)
    return foreign.write(folder / "aircraft", text).parent


@pytest.mark.parametrize("case", PLACES)
@pytest.mark.parametrize("apart", [False, True])
def test_the_authors_engine_is_the_one_that_runs(case, apart, tmp_path):
    """Where JSBSim looks, in its order."""
    model = source_of(str(of_another_author(tmp_path, case, apart))).model
    gathered = copy_of(model, tmp_path / "read" / "navion", layout=True)
    power_hp = of_full_power(instrument(gathered, tmp_path / "copy", {}))
    assert power_hp == pytest.approx(PLACES[case][2] / 745.7, rel=1e-3)


def test_the_aircraft_that_is_derived_has_it(tmp_path, prepared):
    found = prepared(of_another_author(tmp_path, "its own before the shared", apart=True))
    assert found["power_hp"] == pytest.approx(14000 / 745.7, rel=1e-3)


def test_a_file_of_the_layout_does_not_leave_it(tmp_path):
    path = foreign.write(tmp_path / "mine" / "aircraft", foreign.powered("my_motor"))
    (tmp_path / "elsewhere.xml").write_text(MOTOR.format(1000))
    (tmp_path / "mine" / "engine").mkdir()
    (tmp_path / "mine" / "engine" / "my_motor.xml").symlink_to(tmp_path / "elsewhere.xml")
    with pytest.raises(BadInput, match=r"my_motor.xml:1: is a link out of the folder"):
        source_of(str(path))


ACTING = '<output name="{}" type="CSV" rate="10"/> <input port="1137"/>'


def test_what_writes_or_listens_is_left_out_of_the_copy_and_said(tmp_path, prepared):
    text = foreign.NAVION.replace("</fdm_config>", f"\n{ACTING.format(tmp_path / 'log.csv')}</fdm_config>")
    found = prepared(foreign.write(tmp_path, text))
    copied = found["pair"].own.read_text() if found["pair"].own.is_file() else ""
    assert "<output name" not in copied
    line = text[: text.index("<output name")].count("\n") + 1
    where = f"of navion.xml, line {line} is left out of the copy"
    assert [note for note in found["notes"] if "left out" in note] == [
        f'<output name="{tmp_path}/log.csv" type="CSV" rate="10"> {where}',
        f'<input port="1137"> {where}',
    ]
    assert not (tmp_path / "log.csv").exists()
    child = text.replace("</fdm_config>", '<child name="drone"/></fdm_config>')
    with pytest.raises(BadInput, match='<child name="drone"> loads another aircraft'):
        source_of(str(foreign.write(tmp_path, child)))


GEAR = {
    "property": "<product> <property> gear/gear-pos-norm </property> <value> 0.35 </value> </product>",
    "p": "<product> <p> gear/gear-pos-norm[0] </p> <v> 0.35 </v> </product>",
    "table": """<table> <independentVar lookup="row"> gear/gear-pos-norm </independentVar>
      <tableData> 0 0
      1 0.35 </tableData> </table>""",
}  # fmt: skip


@pytest.mark.parametrize("how", GEAR)
def test_a_gear_is_retracted_however_it_is_read(how, tmp_path, prepared):
    drag = f"""<axis name="DRAG"> <function name="aero/gear"> <product> <property> aero/qbar-psf </property>
      <property> metrics/Sw-sqft </property> {GEAR[how]} </product> </function>"""
    found = prepared(foreign.write(tmp_path, foreign.powered().replace('<axis name="DRAG">', drag)))
    assert [note for note in found["notes"] if "gear" in note or "sinks" in note] == [
        "its landing gear is retracted in the copy: with it, its power does not hold it level"
    ]
    assert found["off"].share < 1e-3


@pytest.fixture(scope="module")
def wing(tmp_path_factory):
    """An aircraft without a rudder, derived from few states."""
    folder = tmp_path_factory.mktemp("wing")
    path = foreign.write(folder, foreign.powered(text=foreign.wing()), "wing")
    with foreign.quickly(300, 400):
        return derivation.derive(str(path), folder / "out"), folder / "out"


def test_a_wing_without_a_rudder_is_an_aircraft(wing):
    made, folder = wing
    assert made.aircraft.surfaces == ("aileron", "elevator")
    assert "it has no rudder: its command moves nothing that its aerodynamics read" in made.notes
    assert 0.0 < abs(made.trim.phi_rad) < 0.05  # what its propeller turns it, a little bank holds
    assert max(map(abs, made.trim.residual)) < 1e-8
    text = "name: w\naircraft: ./wing\nduration_s: 14\nreference: {p: [{doublet: {amplitude_deg_s: 4, start_s: 2, width_s: 2}}]}\n"  # noqa: E501
    healthy = fly(load_text(text, folder=folder))
    assert (healthy.detection_time_s, healthy.departure) == (None, None)
    for surface in made.aircraft.surfaces:
        loss = {"actuator": surface, "type": "loss_of_effectiveness", "magnitude": 0.6, "at_s": 8}
        faulty = fly(load_text(text, folder=folder).with_({"faults": [loss]}))
        assert (faulty.isolated, faulty.departure) == (surface, None)


@pytest.mark.parametrize(
    ("key", "name"), [("control.law", "indi"), ("control.law", "lqr"), ("fdi.scheme", "multiple-models")]
)
def test_laws_and_schemes_that_need_a_surface_for_each_axis_say_so(key, name, wing):
    _, folder = wing
    section, _, word = key.partition(".")
    text = f"name: w\naircraft: ./wing\n{section}: {{{word}: {name}}}\n"
    says = f"{key}: {name} needs a surface for each of roll, pitch and yaw, wing has aileron, elevator"
    with pytest.raises(BadInput, match=says):
        load_text(text, folder=folder)
    changed = f"name: w\naircraft: ./wing\nchanges: [{{at_s: 3, {word}: {name}}}]\n"
    with pytest.raises(BadInput, match=rf"changes\[0\].{word}: {name} needs a surface for each"):
        load_text(changed, folder=folder)
