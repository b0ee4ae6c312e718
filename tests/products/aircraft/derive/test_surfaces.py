"""A copy turns as the model of its author does, whatever his ailerons and elevators are called and do."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant import instrumented
from beaver_ftc.plant.adapter import bare
from beaver_ftc.plant.instrumented import usual_view
from beaver_ftc.plant.model_file import copy_of
from beaver_ftc_aircraft.derive import derivation
from beaver_ftc_aircraft.derive.surfaces import Difference, differences, find_surfaces

from . import foreign
from .foreign import LEFT, RIGHT

SAME, OPPOSITE = ((-0.3, 0.3), (-0.3, 0.3)), ((-0.3, 0.3), (0.3, -0.3))
DIFFERENTIAL = (-0.15, 0.3), (0.3, -0.15)
MODELS = {
    "the sum of equal signs": foreign.ailerons(*SAME, (0.5, 0.5)),
    "shares of equal signs": foreign.ailerons(*SAME, (0.75, 0.25)),
    "opposite signs": foreign.ailerons(*OPPOSITE, (0.5, -0.5)),
    "differential": foreign.ailerons(*DIFFERENTIAL, (0.5, -0.5)),
    "differential, not by halves": foreign.ailerons(*DIFFERENTIAL, (0.7, -0.3)),
    "each to one side": foreign.ailerons((-0.0, 0.3), (0.3, -0.0), (0.5, -0.5)),
    "a gain of its own": foreign.ailerons((-0.3, 0.3), (-0.12, 0.12), (0.6, 0.4)),
    "one in degrees": foreign.ailerons((-0.3, 0.3), (-17.0, 9.0), (0.5, 0.01), "fcs/right-aileron-pos-deg"),
    "one does not move": foreign.ailerons((-0.3, 0.3), (0.0, 0.0), (0.5, -0.5)),
    "normalised by two stops": foreign.elevator(-0.45, 0.35),
    "normalised otherwise": foreign.elevator(-0.3, 0.4, (-0.5, 1.0)),
    "equal stops": foreign.elevator(-0.4, 0.4),
}


def written(folder, text):
    """The file of a model, and what nothing fails in."""
    path = foreign.write(folder, text)
    return path, instrumented.instrument(path, folder / "own" / "navion", {})


def pair_of(folder, text, views=True):
    """(model, copy, what is known of the surfaces)."""
    path, own = written(folder, text)
    found = find_surfaces(path, own, {})
    if not views:
        by_name = {
            s: {name: usual_view(name, found.travel[s]) for name in of} for s, of in found.seen.items()
        }
        found = replace(found, views=by_name)
    copy = instrumented.instrument(path, folder / "copy" / "navion", found.travel, views=found.views)
    return own, copy, found


def turned(fdm, given):
    """Angular accelerations once all is where it is put."""
    fdm["ic/h-sl-ft"], fdm["ic/vt-fps"], fdm["ic/alpha-deg"] = 4900.0, 185.0, 2.0
    for name, value in given.items():
        fdm[name] = value
    for k in range(60):
        if k % 5 == 0:
            fdm.run_ic()
        fdm.run()
    return np.array([fdm[f"accelerations/{axis}dot-rad_sec2"] for axis in "pqr"])


@pytest.mark.parametrize("case", MODELS)
def test_the_copy_turns_as_the_model_does_and_the_comparison_finds_nothing(case, tmp_path):
    """Commands of the plain model against the deflections that its stops are; both from JSBSim alone."""
    pair = _, copy, found = pair_of(tmp_path, MODELS[case])
    plain, copied = bare(copy_of(tmp_path / "navion" / "navion.xml", tmp_path / "plain")), bare(copy)
    for surface in ("aileron", "elevator"):
        low, high = found.travel[surface]
        for command, deflection in ((-1.0, low), (1.0, high), (0.0, 0.0)):
            own = turned(plain, {f"fcs/{surface}-cmd-norm": command})
            ours = turned(copied, {f"fcs/actuated-{surface}-cmd-rad": deflection})
            assert ours == pytest.approx(own, abs=1e-3 * 6.0), (surface, command)
    said = differences(*pair, (44.0, 68.0))
    assert [of.surface for of in said] == [*found.travel, " and ".join(found.travel)]
    assert max(of.share for of in said) < 1e-3


WRONG = {
    "the sum of equal signs": ("aileron", "roll", 0.4, RIGHT),
    "shares of equal signs": ("aileron", "roll", 0.2, RIGHT),
    "differential, not by halves": ("aileron", "roll", 0.05, RIGHT),
    "normalised by two stops": ("elevator", "acceleration downward", 0.05, "fcs/elevator-pos-rad"),
}


@pytest.mark.parametrize("case", WRONG)
def test_the_comparison_finds_a_copy_that_takes_names_at_their_word(case, tmp_path):
    surface, axis, least, because = WRONG[case]
    found = {
        of.surface: of for of in differences(*pair_of(tmp_path, MODELS[case], views=False), (44.0, 68.0))
    }
    of = found[surface]
    assert (of.axis, because in of.because) == (axis, True)
    assert of.share > least
    others = {"aileron", "elevator", "rudder"} - {surface}
    assert all(found[other].share < 1e-6 for other in others)


def test_a_rudder_of_another_name_is_not_left_out_in_silence(tmp_path):
    text = foreign.NAVION.replace("fcs/rudder-pos-rad", "fcs/posRud_rad")
    path, own = written(tmp_path, text)
    with pytest.raises(BadInput, match=r"only aileron, elevator; .*surfaces: \{rudder: fcs/posRud_rad\}"):
        find_surfaces(path, own, {})


def test_one_property_by_two_commands_is_no_surface(tmp_path):
    """An elevon mixes aileron and elevator."""
    mix = '<channel name="mix"> <summer name="fcs/elevon"> <input> fcs/aileron-cmd-norm </input> <input> fcs/elevator-cmd-norm </input> </summer> </channel>'  # noqa: E501
    text = foreign.controlled(foreign.NAVION, mix)
    for name in (LEFT, "fcs/elevator-pos-rad"):
        text = foreign.seen_as(text, name, "<property> fcs/elevon </property>")
    path, own = written(tmp_path, text)
    with pytest.raises(
        BadInput, match="aileron and elevator commands both move fcs/elevon, allowed: one surface"
    ):
        find_surfaces(path, own, {})


@pytest.mark.parametrize(("name", "off"), [("787-8", 0.0), ("X15", 0.0), ("T38", 0.0), ("f16", 0.5)])
def test_copies_of_the_package_s_aircraft_fly_as_they_do(name, off, tmp_path):
    """Of aircraft with dampers, schedules and normalised ailerons; but for the flaperon of one."""
    source = derivation.source_of(f"jsbsim:{name}")
    own, absent = derivation._own(source, tmp_path / "own")
    found = find_surfaces(source.model, own, {})
    copy = instrumented.instrument(source.model, tmp_path / name, found.travel, absent, views=found.views)
    most = max(differences(own, copy, found, (60.0, 120.0)), key=lambda of: of.share)
    assert most.share == pytest.approx(off, abs=0.1 * off + 1e-4)
    assert most.because == (("fcs/flaperon-mix-rad",) if name == "f16" else ())


def test_an_airship_is_trimmed_as_far_as_rounding_lets_it(tmp_path):
    with pytest.raises(BadInput, match=r"Submarine_Scout: its copy would fly otherwise.* in acceleration"):
        derivation.derive("jsbsim:Submarine_Scout", tmp_path)


def test_a_model_whose_accelerations_are_no_numbers_is_told_so(tmp_path, monkeypatch):
    """As with a turboprop whose thrust is not finite in some runs of JSBSim."""
    broken = Difference("aileron", np.nan, "acceleration forward", -0.35, ())
    monkeypatch.setattr(derivation, "differences", lambda *given: [broken])
    path, _ = written(tmp_path / "author", MODELS["equal stops"])
    with pytest.raises(BadInput, match="its acceleration forward is no finite number"):
        derivation.derive(str(path), tmp_path / "out")


def test_a_property_is_that_of_one_surface(tmp_path):
    path, own = written(tmp_path, MODELS["equal stops"])
    named = dict.fromkeys(("elevator", "aileron"), ("fcs/elevator-pos-rad",))
    with pytest.raises(BadInput, match=r"surfaces\.aileron: 'fcs/elevator-pos-rad' is that of elevator"):
        find_surfaces(path, own, named)
