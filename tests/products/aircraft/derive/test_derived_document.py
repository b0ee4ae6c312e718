"""All that a derivation writes and says, from few states: the file, the page, the document.

That what it finds is right other tests say, from many states and known coefficients.
"""

from dataclasses import replace

import pytest
import yaml

from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim
from beaver_ftc.scenario.airframe import find_aircraft
from beaver_ftc_aircraft.derive import derivation, derived, sample
from beaver_ftc_aircraft.derive.outline import usual_start
from trainer import TRAINER

ENVELOPE = "airspeed_mps: [42, 58]\nalpha_deg: [-2, 9]\naltitude_m: 1200\nsideslip_deg: 6\n"


def derive(reference, folder, envelope):
    """(what was found, the steps told), from few states."""
    told = []
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(derivation, "SAMPLES", 300)
        patched.setattr(derivation, "CHECKED", 400)
        patched.setattr(sample, "STARTS_OF_WORST", 16)
        return derivation.derive(reference, folder, envelope, told.append), told


@pytest.fixture(scope="module")
def stranger():
    """An aircraft derived from JSBSim's, as it is kept, and its trim."""
    aircraft = find_aircraft("jsbsim:c172p")
    return aircraft, trim(plant=Plant(100, aircraft=aircraft), **usual_start(aircraft))


@pytest.fixture(scope="module")
def filed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("derived")
    (folder / "envelope.yaml").write_text(ENVELOPE)
    return derive(str(TRAINER), folder, folder / "envelope.yaml")


def parts_of(found_and_told):
    """What was written and said, without the time it took and the folder it went to."""
    found, told = found_and_told
    folder, timed = found.aircraft.folder, replace(found, took_s=1.2345)
    document, page = derived.document_of(timed), derived.page_of(timed)
    assert document.pop("folder") == str(folder)
    assert page.replace("1.2 s", f"{found.took_s:.1f} s") == (folder / "derived.md").read_text()
    file = yaml.safe_load((folder / "aircraft.yaml").read_text())
    return {"file": file, "document": document | {"told": told}, "page": page.splitlines()}


def test_fuel_is_what_the_model_starts_with_however_long_its_engines_have_run(stranger):
    """As its file says: 100 lbs in each of two tanks."""
    aircraft, level = stranger
    plant = Plant(100, aircraft=aircraft)
    plant.start(level)
    for _ in range(50):
        plant.run()
    assert list(plant.tanks_lbs.values()) == [100.0, 100.0]
    assert all(0.0 < plant.read(name) < 100.0 for name in plant.tanks_lbs)


def test_thrust_at_full_power_is_within_the_map(stranger):
    """Its engine stops at high altitudes: it must run again at the next start."""
    aircraft, level = stranger
    plant = Plant(100, aircraft=aircraft)
    plant.start(replace(level, settings={"throttle": 1.0}))
    least, largest = aircraft.file.model_error_map.boxes[-1].signals["thrust"]
    assert least < plant.read(aircraft.signals["thrust"].property) < largest


def test_what_is_derived_of_an_aircraft_with_a_file_over_an_envelope_of_its_own(filed, changed):
    for part, said in parts_of(filed).items():
        assert not changed(said, part=part)
