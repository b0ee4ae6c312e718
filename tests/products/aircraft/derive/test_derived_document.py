"""All that a derivation writes and says, from few states: the file, the page, the document.

That what it finds is right other tests say, from many states and known coefficients.
"""

from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from beaver_ftc.plant.adapter import Plant
from beaver_ftc_aircraft.derive import derivation, derived, sample

TRAINER = Path(__file__).parents[3] / "data" / "aircraft" / "trainer"
ENVELOPE = "airspeed_mps: [42, 58]\nalpha_deg: [-2, 9]\naltitude_m: 1200\nsideslip_deg: 6\n"


def derive(reference, folder, envelope=None):
    """(what was found, the steps told), from few states."""
    told = []
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(derivation, "SAMPLES", 300)
        patched.setattr(derivation, "CHECKED", 400)
        patched.setattr(sample, "STARTS_OF_WORST", 16)
        return derivation.derive(reference, folder, envelope, told.append), told


@pytest.fixture(scope="module")
def stranger(tmp_path_factory):
    return derive("jsbsim:c172p", tmp_path_factory.mktemp("derived"))


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
    found, _ = stranger
    plant = Plant(100, aircraft=found.aircraft)
    plant.start(found.trim)
    for _ in range(50):
        plant.run()
    assert list(plant.tanks_lbs.values()) == [100.0, 100.0]
    assert all(0.0 < plant.read(name) < 100.0 for name in plant.tanks_lbs)


def test_thrust_at_full_power_is_within_the_map(stranger):
    """Its engine stops at high altitudes: it must run again at the next start."""
    found, _ = stranger
    plant = Plant(100, aircraft=found.aircraft)
    plant.start(replace(found.trim, settings={"throttle": 1.0}))
    least, largest = found.error_map.boxes[-1].signals["thrust"]
    assert least < plant.read(found.aircraft.signals["thrust"].property) < largest


def test_what_is_derived_of_an_aircraft_with_a_file_over_an_envelope_of_its_own(filed, changed):
    for part, said in parts_of(filed).items():
        assert not changed(said, part=part)
