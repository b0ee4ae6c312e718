"""Which aircraft is meant, where it goes, and where it is sampled."""

from pathlib import Path

import pytest

from beaver_ftc.aircraft import aircraft as loading
from beaver_ftc.documents.errors import BadInput
from beaver_ftc_aircraft.derive import derivation, outline
from beaver_ftc_aircraft.derive.derivation import Source, source_of

from .known import TRAINER


def test_an_aircraft_is_found_by_its_name_its_folder_or_its_model(tmp_path, monkeypatch):
    stranger = source_of("jsbsim:c172p")
    assert (stranger.name, stranger.folder, stranger.says) == ("c172p", None, "jsbsim:c172p")
    assert stranger.target == loading.derived_folder("c172p")
    beaver = source_of("beaver")
    assert (beaver.name, beaver.folder, beaver.target, beaver.says) == (
        "beaver", loading.load("beaver").folder, None, "beaver"
    )  # fmt: skip
    trainer = source_of(str(TRAINER))
    assert (trainer.name, trainer.model, trainer.folder) == ("trainer", TRAINER / "trainer.xml", TRAINER)
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "mine.xml").write_text((TRAINER / "trainer.xml").read_text())
    (folder / "other.txt").write_text("")
    for reference in (folder, folder / "mine.xml"):
        assert source_of(str(reference)) == Source("mine", folder / "mine.xml")
    (folder / "mine.xml").rename(folder / "yours.xml")
    for wrong in (folder, folder / "mine.xml", folder / "other.txt", "x" * 90):
        with pytest.raises(BadInput, match="cannot be derived, allowed: jsbsim:NAME, a built-in name"):
            source_of(str(wrong))


def test_only_what_was_derived_is_written_over(tmp_path):
    source = Source("mine", Path("mine.xml"))
    assert derivation._target(source, tmp_path) == tmp_path / "mine"
    target = tmp_path / "mine"
    target.mkdir()
    for text in (None, "name: mine\n"):
        if text:
            (target / loading.FILE).write_text(text)
        with pytest.raises(BadInput, match="is there already and was not derived"):
            derivation._target(source, tmp_path)
    (target / loading.FILE).write_text(loading.first_line() + "name: mine\n")
    assert derivation._target(source, tmp_path) == target
    assert derivation._target(Source("a", Path(), target=tmp_path / "b"), None) == tmp_path / "b"
    with pytest.raises(BadInput, match=r"^mine: give --out DIR"):
        derivation._target(source, None)


def test_where_to_sample_is_read_from_a_file(tmp_path):
    (tmp_path / "envelope.yaml").write_text("airspeed_mps: [42, 58]\n")
    read = outline.read_envelope(tmp_path / "envelope.yaml")
    assert (read.airspeed_mps, read.alpha_deg) == ((42.0, 58.0), None)
    assert outline.read_envelope(None) == outline.EnvelopeFile()
    for key, ends in (("altitude_m", (0, 15000)), ("sideslip_deg", (0.1, 45))):
        for value in ends:
            (tmp_path / "envelope.yaml").write_text(f"{key}: {value}\n")
            assert getattr(outline.read_envelope(tmp_path / "envelope.yaml"), key) == value
        for value in (-0.1 if key == "altitude_m" else 0, ends[1] + 0.1):
            (tmp_path / "envelope.yaml").write_text(f"{key}: {value}\n")
            with pytest.raises(BadInput, match=key):
                outline.read_envelope(tmp_path / "envelope.yaml")
