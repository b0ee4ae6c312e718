"""A user's own aircraft: checked as a scenario names it, by the core alone, once for a state of its files."""

import os
import shutil

import pytest

from beaver_ftc.aircraft.aircraft import read
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.plant import admission
from beaver_ftc.scenario import airframe
from trainer import TRAINER, change


@pytest.fixture
def trainer(tmp_path, monkeypatch):
    """A copy of the trainer to change, and a cache of its own; no product is installed."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(airframe, "offered", lambda service: None)
    shutil.copytree(TRAINER, tmp_path / "trainer")
    return tmp_path / "trainer"


@pytest.mark.parametrize(
    ("old", "new"),
    [("fcs/elevator-pos-rad", "fcs/no-such-rad"),
     ("moments:", "damage:\n  off: {property: fcs/no-such-rad}\nmoments:")],
)  # fmt: skip
def test_a_property_that_the_model_lacks_is_said_at_its_line(trainer, old, new, monkeypatch):
    monkeypatch.setattr(admission, "failure", lambda model: None)  # it flies
    file = trainer / "aircraft.yaml"
    change(file, old, new)
    line = 1 + next(i for i, text in enumerate(file.read_text().splitlines()) if "no-such" in text)
    with pytest.raises(ScenarioError, match=f"aircraft.yaml:{line}: .*'fcs/no-such-rad' is no property of"):
        airframe.find_aircraft("./trainer", trainer.parent)


def test_the_digest_of_an_aircraft_is_of_paths_and_contents_of_any_name(trainer):
    found = [admission.digest_of_aircraft(trainer)]
    for name in (b"\xff.xml", b"a.xml", b"b.xml"):
        (trainer / os.fsdecode(name)).write_text("<a/>")
        found.append(admission.digest_of_aircraft(trainer))
    (trainer / "b.xml").rename(trainer / "Engines.xml")
    assert len({*found, admission.digest_of_aircraft(trainer)}) == 5


def test_a_model_that_would_write_is_refused_each_time_whatever_the_cache_has(trainer):
    admission.admit(read(trainer))
    assert len(list(trainer.parent.rglob("admitted/*"))) == 1
    change(trainer / "trainer.xml", "</fdm_config>", '<output name="/tmp/x.csv" type="CSV"/></fdm_config>')
    (trainer / "aircraft.yaml").touch()
    with pytest.raises(BadInput, match="output"):
        admission.admit.__wrapped__(read(trainer))
