"""From what a scenario calls its aircraft to the aircraft, and what is said where there is none."""

import shutil

import pytest

from beaver_ftc.aircraft import aircraft, load
from beaver_ftc.aircraft.aircraft import UnknownAircraft, read
from beaver_ftc.documents.errors import BadInput
from trainer import TRAINER


@pytest.fixture
def beside(tmp_path, monkeypatch):
    """A scenario's folder with an aircraft below it; nothing was looked for yet."""
    monkeypatch.setattr(aircraft, "_SEEN", {})
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    shutil.copytree(TRAINER, tmp_path / "here" / "trainer")
    return tmp_path / "here"


@pytest.mark.parametrize(
    ("reference", "says"),
    [
        (3, "3 is no aircraft, allowed: a built-in name, jsbsim:NAME, or ./FOLDER beside the scenario"),
        (["x" * 90], "['" + "x" * 58 + " is no aircraft"),
        (
            "bever",
            "'bever' is not known, did you mean beaver? allowed: beaver, beaver-split, jsbsim:NAME as",
        ),
        (
            "jsbsim:none",
            "'jsbsim:none' has no design model yet, allowed: what `beaver-ftc derive jsbsim:none`",
        ),
        ("jsbsim:a b", "'jsbsim:a b' is no name, allowed: letters, digits, - and _"),
        (f"jsbsim:{'n' * 61}", f"'jsbsim:{'n' * 60}' is no name"),
        ("./../here/trainer", "'./../here/trainer' is outside, allowed: a folder below the scenario's own"),
        ("./up", "'./up' is outside"),
        ("./nothing", "there is no folder './nothing', allowed: a built-in name"),
        ("./\0", "'./\\x00' is outside"),
    ],
)
def test_what_is_no_aircraft(beside, reference, says):
    (beside / "up").symlink_to(beside.parent)
    with pytest.raises(UnknownAircraft) as caught:
        load(reference, beside)
    assert str(caught.value).startswith(says)


def test_links_stay_below_the_scenario_s_folder(beside):
    (beside / "notes").write_text("n")
    (beside / "trainer" / "notes").symlink_to(beside / "notes")
    assert load("./trainer", beside).name == "trainer"
    (beside.parent / "secret").write_text("s")
    (beside / "trainer" / "Systems" / "link").symlink_to(beside.parent / "secret")
    with pytest.raises(UnknownAircraft, match=r"'./trainer/Systems/link' leads outside"):
        load("./trainer", beside)


@pytest.mark.parametrize(
    ("model", "says"),
    [
        ("none.xml", r":5: jsbsim: 'none.xml' is not there"),
        ("link.xml", r":5: jsbsim: 'link.xml' is outside"),
    ],
)
def test_a_model_stands_beside_its_file(beside, model, says):
    (beside / "trainer" / "link.xml").symlink_to(TRAINER / "trainer.xml")
    file = beside / "trainer" / "aircraft.yaml"
    file.write_text(file.read_text().replace("trainer.xml", model))
    with pytest.raises(BadInput, match=says):
        read(beside / "trainer")


@pytest.mark.parametrize("text", ["", "#" * 1_000_001])
def test_a_file_of_nothing_or_too_much(beside, text):
    (beside / "trainer" / "aircraft.yaml").write_text(text)
    with pytest.raises(
        BadInput, match=r"is empty, allowed: a mapping with the keys of an aircraft|is too large"
    ):
        read(beside / "trainer")
