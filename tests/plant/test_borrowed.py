"""Aircraft that are lent out and trims that are known, one by one and without a flight."""

from functools import partial
from types import SimpleNamespace

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plant import addresses, conditions
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.conditions import borrowed, give_back
from beaver_ftc.scenario.schema import load


@pytest.fixture(autouse=True)
def none_is_free(monkeypatch):
    monkeypatch.setattr(conditions, "_free", {})
    monkeypatch.setattr(conditions, "_trims", {})


def free():
    return sum(map(len, conditions._free.values()))


def test_what_is_given_back_is_lent_again_once_and_no_more_than_eight_are_kept():
    aircraft = load({}).airframe
    several = [borrowed(100.0, 1, aircraft) for _ in range(9)]
    assert len(set(map(id, several))) == 9
    for plant in (*several, several[0]):
        give_back(plant)
    assert free() == 8
    assert borrowed(50.0, 2, aircraft) is several[7]
    assert (several[7].rate_hz, several[7].substeps, several[7].dt_s) == (50.0, 2, 0.01)
    give_back(Plant(100.0))  # nobody's
    assert free() == 7


def test_what_was_written_is_written_back_and_the_gust_blows_over():
    plant = borrowed(100.0, 1, load({}).airframe)
    usual = plant.read("actuators/flap/position-max-rad")
    plant.write("actuators/flap/position-max-rad", 0.3)
    plant.write("atmosphere/cosine-gust/start", 1.0)
    plant.run()
    noted = {}
    write = plant.write
    plant.write = lambda name, value: (noted.update({name: value}), write(name, value))
    conditions.renew(plant, 50.0, 1)
    gust = "atmosphere/cosine-gust"
    assert noted == {
        f"{gust}/startup-duration-sec": 1e-9, f"{gust}/steady-duration-sec": 1e-9,
        f"{gust}/end-duration-sec": 1e-9, f"{gust}/start": 1.0, "actuators/flap/position-max-rad": usual,
    }  # fmt: skip
    assert plant.read("simulation/sim-time-sec") == 0.0
    assert plant.dt_s == 0.02


def test_an_aircraft_with_engines_is_not_kept():
    plant = borrowed(100.0, 1, load({}).airframe)
    plant.n_engines = 1
    give_back(plant)
    assert free() == 0
    plant.run()
    conditions.renew(plant, 50.0, 1)  # nor made as new
    assert plant.rate_hz == 100.0
    assert plant.read("simulation/sim-time-sec") > 0.0


def test_files_of_a_model_are_looked_at_once_a_second(tmp_path):
    model = tmp_path / "m.xml"
    (tmp_path / "Systems").mkdir()
    (tmp_path / "Systems" / "s.xml").write_text("")
    model.write_text("")
    found = conditions._last_written_ns(model, 1)
    assert found == tuple(path.stat().st_mtime_ns for path in (model, tmp_path / "Systems" / "s.xml"))
    model.touch()
    assert conditions._last_written_ns(model, 1) == found
    assert conditions._last_written_ns(model, 2) == (model.stat().st_mtime_ns, found[1])


def test_a_trim_is_searched_for_once(monkeypatch):
    searched = []
    find = conditions.trim_of
    monkeypatch.setattr(conditions, "trim_of", lambda *of: searched.append(1) or find(*of))
    for wanted, times in (({}, 1), ({"seed": 9}, 1), ({"initial": {"airspeed_mps": 44}}, 2), ({}, 2)):
        plant, point = conditions.ready(load(wanted))
        assert (len(searched), point.airspeed_mps) == (
            times,
            wanted.get("initial", {}).get("airspeed_mps", 45),
        )
        give_back(plant)
    assert free() == 1
    monkeypatch.setattr(conditions, "_MOST_TRIMS", 2)
    give_back(conditions.ready(load({"initial": {"airspeed_mps": 43}}))[0])
    assert (len(conditions._trims), len(searched)) == (1, 3)
    give_back(conditions.ready(load({"initial": {"airspeed_mps": 42}}))[0])
    assert len(conditions._trims) == 2


@pytest.mark.parametrize(
    "wrong", [{"initial": {"airspeed_mps": 20, "altitude_m": 6000}}, {"uncertainty": {"mass": 1.1}}]
)
def test_an_aircraft_that_cannot_fly_so_goes_back(monkeypatch, wrong):
    def refuse(plant, scenario):
        raise BadInput("it has none")

    if "uncertainty" in wrong:
        monkeypatch.setattr(conditions, "configure", refuse)
    with pytest.raises(BadInput):
        conditions.ready(load(wrong))
    assert free() == 1


def test_an_executive_is_run_by_its_address_where_that_is_known(monkeypatch):
    plant = Plant(100.0)
    plant.start(conditions.trim())
    before_s = plant.read("simulation/sim-time-sec")
    found = addresses.executive_address(plant.fdm)
    if addresses.available():
        assert found > 0
        assert plant.read("simulation/sim-time-sec") == pytest.approx(before_s + 0.01)
    monkeypatch.setattr(addresses, "LAYOUT", addresses.LAYOUT._replace(executive_size=48))
    assert addresses.executive_address(plant.fdm) == 0


@pytest.mark.parametrize(("native", "jit", "wanted"), [
    ("1", "0", True), (None, None, True), ("0", "0", False), ("1", "1", False), ("1", "", True),
    ("2", "0", True),
])  # fmt: skip
def test_nodes_are_read_by_address_unless_that_is_not_wanted(monkeypatch, native, jit, wanted):
    monkeypatch.setattr(addresses, "is_proved", lambda layout: True)
    for name, value in (("BEAVER_FTC_NATIVE", native), ("NUMBA_DISABLE_JIT", jit)):
        if value is None:
            monkeypatch.delenv(name, raising=False)
        else:
            monkeypatch.setenv(name, value)
    assert addresses.available() is wanted


def test_an_address_that_there_is_not_is_zero():
    assert addresses.address("_ZNoSuchThing") == 0
    assert len({addresses.address(one) for one in (addresses.GETTER, addresses.SETTER, addresses.RUN)}) == 3
    nodes = addresses._trial_nodes("abc")
    assert [node.get_name() for node in nodes] == ["a", "b", "c"]
    assert len({addresses.pointer(node) for node in nodes}) == 3


@pytest.mark.parametrize(
    ("given", "another"),
    [({"initial": {"altitude_m": 900}}, True), ({"uncertainty": {"coefficients": {"Cm_0": 1.1}}}, True),
     ({"actuators": {"flap": {"travel_deg": [-5, 40]}}}, True), ({"aircraft": "beaver-split"}, True),
     ({"environment": {"wind_mps": [3, 0, 0]}}, False), ({"rate_hz": 50}, False),
     ({"faults": [{"type": "float", "actuator": "flap", "at_s": 1}]}, False)],
)  # fmt: skip
def test_a_trim_is_that_of_the_aircraft_its_errors_its_actuators_and_its_flight_condition(
    given, another, monkeypatch
):
    searched = []
    monkeypatch.setattr(
        conditions, "trim_of", lambda scenario, plant: searched.append(plant) or len(searched)
    )
    usual = conditions.find_trim(load({}))
    assert conditions.find_trim(load(given)) == (usual + 1 if another else usual)
    assert [conditions.find_trim(load({})), len(searched)] == [usual, 1 + another]
    assert free() == 1 + (given.get("aircraft") is not None)  # each was given back


def test_engines_that_have_been_through_a_search_do_not_take_off(monkeypatch):
    """They remember it: the flight has an aircraft of its own, but only where there was a search."""
    lent, plant = [], SimpleNamespace

    def configured(scenario):
        lent.append(plant(origin="file"))
        return lent[-1]

    monkeypatch.setattr(conditions, "_configured", configured)
    monkeypatch.setattr(conditions, "trim_of", lambda scenario, plant: "found")
    for engines, flights in ((2, [1, 0]), (0, [0, 0])):
        conditions._trims.clear()
        plant = partial(SimpleNamespace, n_engines=engines)
        for flown in flights:
            lent.clear()
            assert conditions.ready(load({})) == (lent[flown], "found")
            assert len(lent) == 1 + flown
