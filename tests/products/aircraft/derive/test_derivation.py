"""Which aircraft is meant, where it goes, and how many terms there is room for."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from beaver_ftc.aircraft import aircraft as loading
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc_aircraft.derive import derivation, outline
from beaver_ftc_aircraft.derive.derivation import Source, source_of

from .known import TRAINER


@pytest.mark.parametrize(
    ("room", "tried"), [(26, [26]), (19, [26, 22, 18]), (6, [26, 22, 18, 14, 10, 6]), (5, None)]
)
def test_there_are_as_many_terms_as_the_evaluator_has_room_for(room, tried, monkeypatch):
    asked = []

    def fitted(samples, aircraft, most, weight):
        assert weight is None
        asked.append(most)
        return {"Cl": [{"name": "Cl_any", "value": 1.0, "surface": "aileron"}], "most": most}

    def design_record(of):
        if of > room:
            raise ValueError("too many products")

    def aircraft_of(data, folder):
        assert "model_error_map" not in data
        return data["moments"].get("most", SimpleNamespace(name="trainer"))

    monkeypatch.setattr(derivation, "fitted", fitted)
    monkeypatch.setattr(derivation, "design_record", design_record)
    monkeypatch.setattr(outline, "aircraft_of", aircraft_of)
    data = {"surfaces": {"aileron": {}}, "model_error_map": {}}
    if tried is None:
        with pytest.raises(BadInput, match=r"^trainer: its terms need more than \d+ products of signals"):
            derivation._moments(None, data, Path(), None)
        assert asked == [26, 22, 18, 14, 10, 6]
    else:
        assert derivation._moments(None, data, Path(), None)["most"] == tried[-1]
        assert asked == tried


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


def test_what_a_model_lacks_is_given_until_it_flies(monkeypatch):
    """One property after the other; a property that is given and still missed, or the 21st, is too much."""
    lacking = [f"of/{i}" for i in range(20)]

    def failure(source, absent):
        left = [name for name in lacking if name not in absent]
        return f"The property {left[0]} does not exist" if left else None

    monkeypatch.setattr(derivation, "_failure", failure)
    source = Source("mine", Path("mine.xml"))
    assert derivation.try_out(source) == tuple(lacking)
    lacking.append("of/20")
    with pytest.raises(SimulationFailed, match=r"^mine: The property of/20 does not exist"):
        derivation.try_out(source)
    monkeypatch.setattr(derivation, "_failure", lambda source, absent: "The property of/0 does not exist")
    with pytest.raises(SimulationFailed, match="of/0"):
        derivation.try_out(source)


def test_a_copy_of_the_model_is_put_on_trial(monkeypatch):
    asked = []
    monkeypatch.setattr(
        derivation, "failure_of_trial", lambda model, absent: asked.append((model, absent)) or "no"
    )
    assert derivation._failure(Source("mine", TRAINER / "trainer.xml"), ["of/0"]) == "no"
    ((model, absent),) = asked
    assert (model.name, model.parent.name, absent) == ("trainer.xml", "mine", ["of/0"])
    assert model.parent != TRAINER


def test_the_envelope_is_about_trim_unless_somebody_says_where():
    """0.1 rad are 5.73 deg."""
    trim = SimpleNamespace(alpha_rad=0.05, airspeed_mps=47.123456)
    data = {"envelope": {"airspeed_mps": [40.123456, 60], "alpha_deg": None}, "start": {}}
    derivation._set_envelope(data, trim, outline.EnvelopeFile())
    assert data == {
        "envelope": {"airspeed_mps": [40.12, 60.0], "alpha_deg": [-2.865, 8.594]},
        "start": {"airspeed_mps": 47.12},
    }  # fmt: skip
    derivation._set_envelope(data, trim, outline.EnvelopeFile(alpha_deg=(-3.0, 9.0)))
    assert data["envelope"]["alpha_deg"] == [-3.0, 9.0]


def test_regions_are_the_whole_envelope_or_parts_each_about_a_trim_of_its_own(monkeypatch):
    trim = SimpleNamespace(altitude_m=700.0, settings={"flap_deg": 5.0})
    of = {"alpha_deg": [-9.0, 18.0], "airspeed_mps": [31.0, 47.0], "altitude_m": [60.0, 1900.0]}
    (whole,) = derivation._regions({"envelope": of}, "plant", trim, 0.3, ())
    assert whole.trim is trim
    assert whole.envelope.alpha_rad == pytest.approx((-0.15707963, 0.31415927))
    assert (whole.envelope.airspeed_mps, whole.envelope.beta_rad) == ((31.0, 47.0), 0.3)
    assert whole.envelope.altitude_m == (0.0, 2000.0)  # 100 m beyond either end, none below the ground
    above = derivation._regions({"envelope": of | {"altitude_m": [300, 800]}}, "plant", trim, 0.3, ())
    assert above[0].envelope.altitude_m == (200, 900)
    monkeypatch.setattr(derivation, "trim_at", lambda *of, **settings: (of, settings))
    parts = [derivation.Envelope(ends, (0.0, 0.1), 0.2) for ends in ((30.0, 37.0), (36.0, 50.0))]
    assert derivation._regions({"envelope": of}, "plant", trim, 0.3, parts) == [
        derivation.Region(part, ((middle, 700.0, "plant"), {"flap_deg": 5.0}))
        for part, middle in zip(parts, (33.5, 43.0), strict=True)
    ]


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


def test_a_wish_for_speed_and_altitude_is_in_every_outline_that_is_tried(monkeypatch, tmp_path):
    """One speed that is wished for is tried alone; without, five."""
    tried = []
    names = "surfaces_of", "instrument_model"
    monkeypatch.setattr(derivation, names[0], lambda model: ["aileron", "elevator", "rudder"])
    monkeypatch.setattr(derivation, names[1], lambda *of, **how: Path("copy.xml"))
    monkeypatch.setattr(derivation, "is_known_to_jsbsim", lambda name: name == "of/told")
    monkeypatch.setattr(derivation, "try_out", lambda source: ("of/told", "of/other"))
    monkeypatch.setattr(outline, "travel_of", lambda *of: {})
    monkeypatch.setattr(outline, "own_control", lambda *of: ["note of its control"])
    monkeypatch.setattr(
        outline, "outline", lambda name, model, travel, lift: {"lift": lift, "start": {}, "envelope": {}}
    )
    level = None, None, SimpleNamespace(gamma_rad=0.0)
    monkeypatch.setattr(outline, "level_flight", lambda of, folder, notes: tried.append(of) or level)
    source, folder, told = Source("mine", Path("mine.xml")), tmp_path / "new" / "mine", []
    notes = []
    derivation._prepared(source, folder, outline.EnvelopeFile(), notes, told.append)
    wish = outline.EnvelopeFile(airspeed_mps=(42.0, 58.0), altitude_m=300.0)
    derivation._prepared(source, folder, wish, [], told.append)
    assert tried == [
        [{"lift": lift, "start": {}, "envelope": {}} for lift in (0.45, 0.3, 0.2, 0.12, 0.7)],
        [{"lift": 0.45, "start": {"altitude_m": 300.0}, "envelope": {"airspeed_mps": [42.0, 58.0]}}],
    ]
    assert notes == ["JSBSim alone gives it no of/other: 0 in the copy", "note of its control"]
    assert told == ["instrument", "trim"] * 2
    for seen, says in ((["aileron", "rudder"], "only on aileron, rudder"), ([], "on no surface")):
        monkeypatch.setattr(derivation, names[0], lambda model, seen=seen: seen)
        with pytest.raises(BadInput, match=f"^mine: its aerodynamics depend {says}, allowed: aileron"):
            derivation._prepared(source, folder, wish, [], told.append)
