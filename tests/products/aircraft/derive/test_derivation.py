"""Which aircraft is meant, where it goes, and how many terms there is room for."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from beaver_ftc.aircraft import THRUST_TERM
from beaver_ftc.aircraft import aircraft as loading
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc_aircraft.derive import derivation, outline
from beaver_ftc_aircraft.derive.derivation import Source, source_of
from beaver_ftc_aircraft.derive.sample import AGES_OF_WORST, EVERY_AGE, FRESH, Moves
from beaver_ftc_aircraft.derive.surfaces import Surfaces
from telling import numbers

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


def test_a_copy_of_the_model_is_put_on_trial(monkeypatch):
    asked = []
    monkeypatch.setattr(derivation, "lacking_in_trial", lambda model: asked.append(model) or ["of/0", "of/1"])
    source = Source("mine", TRAINER / "trainer.xml")
    assert derivation.try_out(source) == ("of/0", "of/1")
    (model,) = asked
    assert (model.name, model.parent.name) == ("trainer.xml", "mine")
    assert model.parent != TRAINER

    def fails(model):
        raise SimulationFailed("no")

    monkeypatch.setattr(derivation, "lacking_in_trial", fails)
    with pytest.raises(SimulationFailed, match=r"^mine: no$"):
        derivation.try_out(source)


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
    surfaces = Surfaces({}, {}, {}, {}, ("note of a surface",))
    monkeypatch.setattr(derivation, "instrument_model", lambda *of, **how: Path("copy.xml"))
    monkeypatch.setattr(derivation, "_own", lambda source, folder: (folder / "own.xml", ("of/other",)))
    monkeypatch.setattr(derivation, "find_surfaces", lambda source, own, named: surfaces)
    monkeypatch.setattr(outline, "own_control", lambda *of: (["note of its control"], {"of/tab"}))
    monkeypatch.setattr(
        outline, "outline", lambda name, model, travel, lift: {"lift": lift, "start": {}, "envelope": {}}
    )
    level = None, None, SimpleNamespace(gamma_rad=0.0)
    monkeypatch.setattr(outline, "level_flight", lambda of, folder, notes: tried.append(of) or level)
    source, folder, told = Source("mine", Path("mine.xml")), tmp_path / "new" / "mine", []
    notes = []
    _, pair = derivation._prepared(source, folder, outline.EnvelopeFile(), notes, told.append)
    assert pair == derivation.Pair(tmp_path / "own" / "own.xml", Path("copy.xml"), surfaces, {"of/tab"})
    wish = outline.EnvelopeFile(airspeed_mps=(42.0, 58.0), altitude_m=300.0)
    derivation._prepared(source, folder, wish, [], told.append)
    assert tried == [
        [{"lift": lift, "start": {}, "envelope": {}} for lift in (0.45, 0.3, 0.2, 0.12, 0.7)],
        [{"lift": 0.45, "start": {"altitude_m": 300.0}, "envelope": {"airspeed_mps": [42.0, 58.0]}}],
    ]
    of_control = "note of a surface", "note of its control"
    assert notes == ["JSBSim alone gives it no of/other: 0 in the copy", *of_control]
    assert told == ["instrument", "trim"] * 2


@pytest.mark.parametrize("regions", [1, 3])
@pytest.mark.parametrize("effectors", [{}, {"engine_1": "left", "engine_2": "right"}])
def test_errors_are_measured_where_the_fit_has_not_been_and_declared_as_the_worst_region_has_them(
    regions, effectors, monkeypatch
):
    """Of one envelope the worst is searched for; of regions random states count, of every age. The declared
    error is that of a fresh aircraft, whole travel, in the outermost box of any region."""
    asked, apart_from = [], []
    moves, about = Moves((0.2, 1.0), 0.1, 0.7), [f"region {k}" for k in range(regions)]
    plant = SimpleNamespace(aircraft=SimpleNamespace(effectors=effectors))

    def sample_all(plant, about, n, seed, properties, ages=EVERY_AGE, moves=None, errors=None):
        asked.append((about, n, seed, properties, ages, moves, errors and errors("these states")))
        return f"states {seed}"

    tables = np.abs(numbers(4 * regions, 3, 3, 2, seed=4))
    boxes = [{f"error_{axis}_rad_s2": of[i].tolist() for i, axis in enumerate("pqr")} for of in tables]

    def map_of(aircraft, sets, flown, n, of_moves):
        assert (aircraft, sets, flown, n, of_moves) == (
            "aircraft", ("first", "states 2"), "flown", regions, moves,
        )  # fmt: skip
        return {"boxes": boxes}, ("of the fit", "of the check", "of flights")

    monkeypatch.setattr(derivation, "sample_all", sample_all)
    monkeypatch.setattr(derivation, "map_of", map_of)
    monkeypatch.setattr(derivation, "errors_of", lambda aircraft, samples: (aircraft, samples))
    monkeypatch.setattr(derivation, "set_engines_apart", lambda *of: apart_from.append(of))
    monkeypatch.setattr(outline, "aircraft_of", lambda data, folder: "aircraft")
    data = {}
    found = derivation._check(data, plant, about, moves, Path(), "properties", ("first", "flown"))
    assert found == ("of the fit", "of the check")
    of_one = 8000, 2, "properties", AGES_OF_WORST, moves, ("aircraft", "these states")
    of_many = 18000, 2, "properties", EVERY_AGE, moves, None
    alike = 6000, 3, "properties", EVERY_AGE, replace(moves, apart=0.0), None
    assert asked == [(about, *(of_one if regions == 1 else of_many))] + [(about, *alike)] * bool(effectors)
    assert apart_from == [(boxes, plant.aircraft, "states 3")] * bool(effectors)
    largest = {axis: tables[-regions:, i, 0, -1].max() for i, axis in enumerate("pqr")}
    assert data == {"model_error_map": {"boxes": boxes}, "model_error_rad_s2": largest}


@pytest.mark.parametrize("regions", [1, 2])
@pytest.mark.parametrize("declared", [{}, {"mach": {"property": "of/mach"}}])
@pytest.mark.parametrize("thrust_term", [False, True])
@pytest.mark.parametrize("effectors", [{}, {"engine_1": "left"}])
def test_what_is_sampled_is_fitted_checked_and_given_its_thrust(
    regions, declared, thrust_term, effectors, monkeypatch
):
    """Signals of its own file are kept, else those of use are chosen among what JSBSim has, those of engines
    in any case. Terms of regions hold best near neutral. Thrust is measured unless a term has it."""
    told, asked = [], {}
    terms = {THRUST_TERM: "a term"} if thrust_term else {}
    aircraft = SimpleNamespace(effectors=effectors, terms=terms)
    plant = SimpleNamespace(aircraft=aircraft, has=lambda name: name != "lacks/it")
    about, moves = ["region"] * regions, Moves((0.3, 1.0))

    def keep(name, returns):
        def called(*of):
            asked[name] = of
            return returns

        return called

    class Forks:
        def __enter__(self):
            self.given = []
            return self

        def __exit__(self, *of):
            pass

        def give(self, what):
            self.given.append(what)

        def results(self):
            return [what() for what in self.given]

    monkeypatch.setattr(
        derivation, "SIGNAL_PROPERTIES", {"alpha_rate": "of/a", "lacking": "lacks/it", "thrust": "of/t"}
    )
    for name, returns in (
        ("fly_about_all", "flown"), ("sample_all", "first"), ("engine_signals", ["engines_n"]),
        ("signals_of_use", ["thrust", "alpha_rate"]), ("nearness", "weight"), ("_moments", "moments"),
        ("_check", ("fit", "check")), ("thrust_of", {"lag_s": 0.4}), ("Forks", Forks()),
    ):  # fmt: skip
        monkeypatch.setattr(derivation, name, keep(name, returns))
    monkeypatch.setattr(outline, "named_as", keep("named_as", "named moments"))
    monkeypatch.setattr(outline, "plant_of", lambda data, folder: ("plant of", folder))
    data = {"signals": dict(declared), "engine": {"start": "off"}}
    made = derivation._derived(data, plant, "trim", about, moves, Path("in"), told.append)
    assert made == ("fit", "check")
    known = {"mach": "of/mach"} if declared else {"alpha_rate": "of/a", "thrust": "of/t"}
    assert asked["fly_about_all"] == (plant, about, 3, known)
    assert asked["sample_all"] == (plant, about, 6000, 1, known, FRESH, moves)
    if declared:
        assert "signals_of_use" not in asked
        assert data["signals"] == declared
    else:
        wanted = ["engines_n", *(["thrust"] if effectors else [])]
        assert asked["engine_signals"] == ("first", "flown", aircraft)
        assert asked["signals_of_use"] == ("first", aircraft, 6, wanted)
        assert data["signals"] == {"thrust": {"property": "of/t"}, "alpha_rate": {"property": "of/a"}}
    weight = "weight" if regions > 1 else None
    assert asked.get("nearness") == (("first", 2, moves) if regions > 1 else None)
    assert asked["_moments"] == ("first", data, Path("in"), weight)
    assert asked["named_as"] == (aircraft, "moments")
    assert data["moments"] == "named moments"
    assert asked["_check"] == (data, plant, about, moves, Path("in"), known, ("first", "flown"))
    measured = {} if thrust_term else {"thrust": {"lag_s": 0.4}}
    assert data["engine"] == {"start": "off", **measured}
    assert asked.get("thrust_of") == (None if thrust_term else (("plant of", Path("in")), "trim"))
    assert told == ["sample", "fit", "check", *([] if thrust_term else ["engines"])]


ENGINES = {
    "engine_1": {"throttle": "left", "share": 0.4, "right_m": -1.7, "down_m": 0.3},
    "engine_2": {"throttle": "right", "share": 0.6, "right_m": 0.1, "down_m": 0.2},
}


def with_engines(monkeypatch, thrust, effectors):
    """(what is known of an aircraft with its engines as effectors, its data)."""
    monkeypatch.setattr(derivation, "thrust_of", lambda plant, trim: thrust)
    monkeypatch.setattr(derivation, "effectors_of", lambda plant, trim: effectors)
    monkeypatch.setattr(outline, "plant_of", lambda data, folder: ("plant of", dict(data), folder))
    data = {"engine": {"start": "steady"}}
    return derivation._with_engines(
        Source("mine", Path("mine.xml")), (data, "plant", "trim"), Path("in")
    ), data


def test_an_aircraft_with_its_engines_as_effectors_has_their_arms_their_thrust_and_their_failures(
    monkeypatch,
):
    thrust = {"force_n": [[0.0, 0.0], [0.0, 3.0]], "lag_s": 0.7}
    (of, plant, trim), data = with_engines(monkeypatch, thrust, ENGINES)
    assert of is data
    assert data == {
        "engine": {"start": "steady", "thrust": thrust},
        "effectors": ENGINES,
        "damage": {
            "engine_1-at-idle": {"property": "failures/engine-0-at-idle"},
            "engine_2-at-idle": {"property": "failures/engine-1-at-idle"},
        },
    }
    assert (plant, trim) == (("plant of", data, Path("in")), "trim")


@pytest.mark.parametrize(
    ("thrust", "right_m"),
    [({"force_n": [[0.0, 3.0]]}, 0.2), ({"force_n": [[0.0, 0.0], [0.0, 0.0]]}, 1.7), (None, 1.7)],
)
def test_engines_less_than_0_2_m_beside_the_middle_or_without_thrust_are_no_effectors(
    thrust, right_m, monkeypatch
):
    engines = {name: of | {"right_m": right_m} for name, of in ENGINES.items()}
    with pytest.raises(BadInput, match=r"^mine: its engines do not yaw it, allowed: engines beside one anot"):
        with_engines(monkeypatch, thrust, engines)


@pytest.mark.parametrize(
    ("altitude_m", "span_m", "ends"),
    [(4000.0, 20.0, [2600.0, 5500.0]), (1500.0, 20.0, [200.0, 3000.0]), (1500.0, 80.0, [260.0, 3000.0]),
     (120.0, 20.0, [200.0, 1620.0])],
)  # fmt: skip
def test_altitudes_are_1500_m_about_trim_above_the_ground(altitude_m, span_m, ends):
    """What is sampled goes 100 m on, but not below 100 m, nor below two spans."""
    trim = SimpleNamespace(altitude_m=altitude_m)
    assert derivation._altitudes_about(trim, span_m) == ends


def test_terms_of_several_regions_are_as_many_as_a_file_may_have_of_one_moment(monkeypatch):
    asked = []

    def fitted(samples, aircraft, most, weight):
        asked.append((most, weight))
        return "terms"

    monkeypatch.setattr(derivation, "fitted", fitted)
    monkeypatch.setattr(derivation, "design_record", lambda of: None)
    monkeypatch.setattr(outline, "aircraft_of", lambda data, folder: None)
    assert derivation._moments("samples", {"surfaces": {"aileron": {}}}, Path(), "weight") == "terms"
    assert asked == [(derivation.MAX_TERMS_OF_ONE, "weight")]


@pytest.mark.parametrize(
    ("gamma_rad", "n_engines", "seen", "retracted"),
    [(-0.02, 1, True, True), (-0.01, 2, True, True), (-0.0099, 1, True, False), (0.02, 1, True, False),
     (-0.02, 0, True, False), (-0.02, 1, False, False)],
)  # fmt: skip
@pytest.mark.parametrize("engines", [False, True])
def test_a_gear_that_its_power_does_not_carry_is_retracted_in_the_copy(
    gamma_rad, n_engines, seen, retracted, engines, monkeypatch, tmp_path
):
    """If it sinks, has engines, and its aerodynamics see a gear; the copy is then another one."""
    copies, tried = [], []
    folder = tmp_path / "new" / "mine"

    def instrument_model(model, into, travel, absent, gear_up=False, apart=False, views=None):
        assert not (into == folder and folder.exists())
        assert (views == "views") is (into == folder)
        into.mkdir(parents=True, exist_ok=True)
        copies.append((into, travel, absent, gear_up, apart))
        return into / "mine.xml"

    def level_flight(outlines, into, said):
        said.append(f"said at try {len(tried) + 1}")
        tried.append(into)
        return "data", SimpleNamespace(n_engines=n_engines), SimpleNamespace(gamma_rad=gamma_rad)

    names = {"gear/gear-pos-norm"} if seen else {"gear/other"}
    for name, instead in (
        ("find_surfaces", lambda source, own, named: Surfaces({}, {}, {"aileron": (-0.2, 0.3)}, "views")),
        ("instrument_model", instrument_model),
        ("_own", lambda source, into: (into / "x.xml", ("of/lacking",))),
        ("seen_by_aerodynamics", lambda model: frozenset(names)),
        ("_with_engines", lambda source, level, into: ("with engines", level, into)),
    ):  # fmt: skip
        monkeypatch.setattr(derivation, name, instead)
    monkeypatch.setattr(outline, "own_control", lambda *of: ([], ()))
    monkeypatch.setattr(outline, "outline", lambda *of: {})
    monkeypatch.setattr(outline, "level_flight", level_flight)
    notes, source = [], Source("mine", Path("mine.xml"))
    level, pair = derivation._prepared(source, folder, outline.EnvelopeFile(), notes, str, engines)
    travel, absent = {"aileron": (-0.2, 0.3)}, ("of/lacking",)
    copy = (folder, travel, absent, False, engines)
    up = tmp_path / "own" / "gear-up" / "mine"
    again = [(folder, travel, absent, True, engines), (up, {}, absent, True, False)] if retracted else []
    assert copies == [copy, *again]
    assert pair.own == (up / "mine.xml" if retracted else tmp_path / "own" / "x.xml")
    assert tried == [folder] * (1 + retracted)
    gear = ["its landing gear is retracted in the copy: with it, its power does not hold it level"]
    said = [*gear, "said at try 2"] if retracted else ["said at try 1"]
    assert notes == ["JSBSim alone gives it no of/lacking: 0 in the copy", *said]
    assert (level[0] == "with engines") is engines
    if engines:
        assert (level[1][0], level[2]) == ("data", folder)


def test_of_an_aircraft_with_a_file_engines_are_in_it_or_are_none(tmp_path):
    source = Source("mine", Path("mine.xml"), TRAINER)
    says = r"^mine: has a file, allowed: `effectors` in it, or a JSBSim model alone$"
    with pytest.raises(BadInput, match=says):
        derivation._prepared(source, tmp_path, outline.EnvelopeFile(), [], str, engines=True)


@pytest.mark.parametrize("wish", [{}, {"airspeed_mps": (42.0, 54.0), "alpha_deg": (-2.0, 9.0),
                                       "altitude_m": 810.0, "sideslip_deg": 5.0}])  # fmt: skip
def test_an_aircraft_with_a_file_keeps_all_of_it_but_its_moments_and_what_is_wished_for(wish, tmp_path):
    """It is trimmed where its flights start, or in the middle of the airspeeds that are wished for."""
    folder = tmp_path / "new"
    data, plant, point = outline.level_as_filed(TRAINER, folder, outline.EnvelopeFile(**wish))
    own = yaml.safe_load((TRAINER / "aircraft.yaml").read_text())
    assert (folder / "trainer.xml").read_text() == (TRAINER / "trainer.xml").read_text()
    assert plant.aircraft.folder == TRAINER
    assert "moments" not in data
    for section in ("name", "surfaces", "mass", "geometry", "trim"):
        kept = data[section]
        assert kept == own[section] or kept | own[section] == kept, section
    airspeed, alpha = ([42.0, 54.0], [-2.0, 9.0]) if wish else ([35.0, 65.0], [-4.0, 14.0])
    assert data["envelope"] == {"airspeed_mps": airspeed, "alpha_deg": alpha}
    start = (48.0, 810.0) if wish else (45.0, 1828.8)
    assert data["start"] == {"airspeed_mps": start[0], "altitude_m": start[1]}
    assert (point.airspeed_mps, point.altitude_m) == start
