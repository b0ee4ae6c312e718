"""`beaver-ftc import gtm`: what it refuses, and the folder it writes."""

import re
import shutil
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from scipy.io import savemat
from tools.gtm.specification import DATABASE

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.aircraft import UnknownAircraft, imported_folder
from beaver_ftc.documents.errors import BadInput
from beaver_ftc_aircraft.gtm import aerodynamics, conversion, elements, folder, masses, systems
from beaver_ftc_aircraft.gtm.database import read
from beaver_ftc_aircraft.gtm.parameters import cases, parameters
from beaver_ftc_aircraft.gtm.steady import Condition, Steady
from products.aircraft.gtm import made
from telling import apart

FAILURES = (
    "effectiveness", "stuck", "stuck-at-rad", "hardover", "float", "bias-rad", "rate-scale",
    "oscillation-amplitude-rad", "oscillation-frequency-rad_sec",
)  # fmt: skip


def test_without_the_data_a_line_says_where_they_are(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(
        UnknownAircraft, match=r"^'gtm' is not imported yet.*import gtm.*github.com/nasa/GTM_DesignSim"
    ):
        load("gtm")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "is no whole MATLAB file"),
        (b"no such thing" * 100, "is no whole MATLAB file"),
        (b"MATLAB 5.0 MAT-file" + b" " * 97 + b"\0" * 8 + b"\0\1IM\x0f\0\0\0\xff\0\0\0xx", "is no whole"),
    ],
)  # fmt: skip
def test_other_bytes_are_refused_in_a_line(tmp_path, content, says):
    (tmp_path / "x.mat").write_bytes(content)
    with pytest.raises(BadInput) as wrong:
        read(tmp_path / "x.mat")
    assert says in str(wrong.value)
    assert "\n" not in str(wrong.value)
    assert "allowed: the data base of github.com/nasa" in str(wrong.value)


def test_no_file_and_a_folder_are_refused(tmp_path):
    for path, says in (
        (tmp_path / "none.mat", "cannot be read (No such file or directory)"),
        (tmp_path, "is no file of this kind"),
    ):
        with pytest.raises(BadInput) as wrong:
            read(path)
        assert str(wrong.value) == f"{path}: {says}, allowed: {ALLOWED}"


VERSION = "Polynominal Fit, with damage"
ALLOWED = "the data base of github.com/nasa/GTM_DesignSim, gtm_design/config/T2_polynomial_aerodatabase.mat"


def test_a_file_of_more_than_50_mb_is_not_read(tmp_path):
    """Of which nothing is on the disk."""
    for size, says in ((50_000_000, "is no whole MATLAB file"), (50_000_001, "is no file of this kind")):
        with (tmp_path / "x.mat").open("wb") as file:
            file.truncate(size)
        with pytest.raises(BadInput, match=says):
            read(tmp_path / "x.mat")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ({"x": 1}, "has the version ''"),
        ({"ver": "x" * 61}, f"has the version {'x' * 60!r}"),
        ({"ver": VERSION}, "has no C6_bas.data"),
        ({"ver": VERSION, "C6_bas": 3}, "has no C6_bas.data"),
        (
            {"ver": VERSION, "C6_bas": {"data": np.zeros((3, 4))}},
            "C6_bas.data is of (3, 4) values, not (32, 27, 6)",
        ),
        ({"ver": VERSION, "C6_bas": {"data": "text"}}, "C6_bas.data is no table of numbers"),
        (
            {"ver": VERSION, "C6_bas": {"data": np.full((32, 27, 6), np.nan)}},
            "C6_bas.data has values that are not finite",
        ),
        (
            {"ver": VERSION, "C6_bas": {"data": np.zeros((32, 27, 6)), "alpha": np.zeros(32)}},
            "C6_bas.alpha does not rise",
        ),
        (
            {"ver": VERSION, "C6_bas": {"data": np.zeros((32, 27, 6)), "alpha": np.arange(27.0)}},
            "C6_bas.alpha is of (27,) values, not (32,)",
        ),
    ],
)
def test_other_contents_are_refused_in_a_line(tmp_path, content, says):
    savemat(tmp_path / "x.mat", content)
    with pytest.raises(BadInput) as wrong:
        read(tmp_path / "x.mat")
    assert str(wrong.value) == f"{tmp_path / 'x.mat'}: {says}, allowed: {ALLOWED}"


@pytest.mark.parametrize(
    ("table", "of", "place", "value", "says"),
    [
        ("dC6_w", "data", (3, 4, 5, 2), np.nan, "dC6_w.data has values that are not finite"),
        ("C6_bas", "data", (31, 26, 5), -np.inf, "C6_bas.data has values that are not finite"),
        ("dC3_ele", "alpha", 31, -5.0, "dC3_ele.alpha does not rise"),
        ("dC6_rud", "rud", 1, -30.0, "dC6_rud.rud does not rise"),
        ("flaps", "flaprib", 3, np.nan, "flaprib has values that are not finite"),
    ],
)  # fmt: skip
def test_one_wrong_number_is_refused_by_the_name_of_its_table(tmp_path, table, of, place, value, says):
    tables = made.tables()
    tables[table][of] = np.array(tables[table][of])
    tables[table][of][place] = value
    savemat(tmp_path / "x.mat", tables)
    with pytest.raises(BadInput, match=f"x.mat: {says}, allowed"):
        read(tmp_path / "x.mat")


@pytest.mark.parametrize("share", [0.1, 0.5, 0.99])
def test_half_the_data_base_is_refused(data, tmp_path, share):
    whole = (data / DATABASE).read_bytes()
    (tmp_path / "half.mat").write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(BadInput, match=r"is no whole MATLAB file|has no"):
        read(tmp_path / "half.mat")


def test_another_folder_in_the_way_is_left_alone(tmp_path):
    (tmp_path / "gtm").mkdir()
    (tmp_path / "gtm" / "mine.txt").write_text("mine")
    with pytest.raises(BadInput, match="was not imported, allowed: another folder"):
        conversion.convert(tmp_path / "x.mat", tmp_path)
    assert (tmp_path / "gtm" / "mine.txt").read_text() == "mine"


def test_every_surface_and_engine_has_all_failures(bench):
    effectors = [*parameters()["surfaces"], "left_engine", "right_engine"]
    assert len(effectors) == 19
    has = bench.fdm.get_property_manager().hasNode
    for name in effectors:
        unit = "norm" if "engine" in name else "rad"
        wanted = [f"failures/{name}/{failure.replace('-rad', f'-{unit}', 1)}" for failure in FAILURES[:-1]]
        wanted += [
            f"failures/{name}/{FAILURES[-1]}",
            *(f"fcs/{name}-{end}-{unit}" for end in ("cmd", "pos", "effective")),
        ]
        assert [each for each in wanted if not has(each)] == []
    assert [case for case in cases() if not has(f"failures/damage/{case}")] == []


@pytest.mark.parametrize("number", range(1, 7))
def test_a_lost_surface_has_no_effect_and_a_case_takes_what_it_says(bench, number):
    name, of = [*cases().items()][number - 1]
    for surface in parameters()["surfaces"]:
        bench.fdm[f"fcs/{surface}-cmd-rad"] = 0.05
    bench.damage(number)
    bench.place(800.0, (160.0, 0.0, 8.0), (0.0, 0.05, 0.0))
    still = {surface: bench.fdm[f"fcs/{surface}-effective-rad"] for surface in parameters()["surfaces"]}
    stand = {surface: bench.fdm[f"fcs/{surface}-pos-rad"] for surface in parameters()["surfaces"]}
    bench.damage(0)
    for surface in parameters()["surfaces"]:
        bench.fdm[f"fcs/{surface}-cmd-rad"] = 0.0
    assert {surface for surface, rad in still.items() if rad == 0.0} == set(of["takes"]), name
    assert set(stand.values()) == {0.05}


def test_the_first_of_two_cases_is_in_force(bench):
    bench.damage(5)
    bench.fdm["failures/damage/fin-off"] = 1.0
    bench.place(800.0, (160.0, 0.0, 8.0), (0.0, 0.05, 0.0))
    number = bench.fdm["failures/damage-case"]
    bench.damage(0)
    assert number == 2


def test_where_it_is_kept_follows_the_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert imported_folder("gtm") == tmp_path / "beaver-ftc" / "imported" / "gtm"


def test_our_own_file_the_start_and_the_scripts_of_a_folder(tmp_path, changed):
    """Of a steady flight no two numbers of which are alike."""
    flown = Steady(165.0, 91.0, 3.0, 0.7, 1.3, 3.5, 2.4, -0.4, 0.25, 39.8, 1e-10)
    apart(steady=list(vars(flown).values()))
    folder.write_outline(tmp_path)
    folder.write_start(tmp_path, flown)
    folder.write_scripts(tmp_path, flown)
    written = {path.name: path for path in tmp_path.rglob("*.*")}
    assert not changed(yaml.safe_load(written.pop("aircraft.yaml").read_text()), "aircraft")
    kept = ("reset00.xml", "doublets.xml", "fin-off.xml")
    assert not changed({name: written[name].read_text().splitlines() for name in kept}, "xml")
    assert written.keys() == {*kept, *(f"{case}.xml" for case in cases())}


def test_an_operation_on_one_argument_is_that_argument_where_nothing_is_to_be_done():
    a, b = elements.value(2.0), elements.read("p")
    for operation in ("sum", "product"):
        assert elements.do(operation, a) == a
        assert elements.do(operation, a, b) == f"<{operation}>{a}{b}</{operation}>"
    assert elements.do("abs", b) == f"<abs>{b}</abs>"


def test_what_was_imported_before_is_replaced_and_nothing_else(tmp_path, monkeypatch):
    """Known by its notice; a folder of somebody's own is left alone before anything is read."""
    monkeypatch.setattr(conversion, "read", lambda database: (_ for _ in ()).throw(BadInput("it was read")))
    for notice, says in ((False, "is there already and was not imported"), (True, "it was read")):
        (tmp_path / "gtm").mkdir(exist_ok=True)
        (tmp_path / "gtm" / "mine.txt").write_text("mine")
        if notice:
            (tmp_path / "gtm" / "LICENSE.md").write_text("terms")
        with pytest.raises(BadInput, match=says):
            conversion.convert(tmp_path / "database", tmp_path)
        assert (tmp_path / "gtm" / "mine.txt").exists()


def test_a_line_of_samples_hands_each_on_before_it_takes_the_next():
    """The oldest is written first: else a command would run through the whole line at once."""
    text = '<channel name="x"><fcs name="fcs/flap-demand-rad"><property> fcs/flap-cmd-rad </property></fcs>'
    made = ElementTree.fromstring(f"<s>{systems._delayed(text, 'flap')}</channel></s>")
    names = [part.get("name") for part in made[0]]
    n = systems._SAMPLES
    assert names == [*(f"fcs/flap-cmd-{i}-ago-rad" for i in reversed(range(n))), "fcs/flap-cmd-late-rad"]
    read = [[each.text.strip() for each in part.iter("property")] for part in made[0]]
    for place, i in enumerate(reversed(range(n))):
        assert read[place][-1] == names[place]  # kept where no sample is due
        before = names[place + 1] if i else "fcs/flap-cmd-rad"
        assert before in read[place]


def test_a_fault_that_nobody_anticipates_adds_a_pitching_moment_on_alpha_cubed(monkeypatch):
    """Of data of nothing it is all that there is: a factor, and three angles of attack."""
    for part in ("flow", "static", "elevator", "ailerons", "rudder", "spoilers", "flaps", "rates"):
        monkeypatch.setattr(aerodynamics, f"_{part}", lambda *of: None)
    made = ElementTree.fromstring(aerodynamics.aerodynamics(defaultdict(lambda: None)))
    (product,) = (of for of in made.iter("product") if "Cm-alpha3" in ElementTree.tostring(of, "unicode"))
    factors = [of.text.strip() for of in product.iter("property")]
    assert factors == ["failures/unanticipated/Cm-alpha3", *["aero/alpha-rad"] * 3]
    assert [of.get("name") for of in made.iter("function")].count("aero/coefficient/Cm") == 1


@pytest.mark.parametrize("case", range(1, len(cases()) + 1))
@pytest.mark.parametrize("gear_down", [False, True])
def test_small_masses_make_of_the_whole_aircraft_what_a_case_leaves(case, gear_down):
    """Weights, places and inertia added up, all about the centre of gravity that the case has."""
    whole, wanted = masses.mass_of(), masses.mass_of(case, gear_down)
    small = masses.small_masses_lbf(case, gear_down)
    weights = np.array([whole.weight_lbf, *small])
    places = np.vstack([whole.cg_ft, whole.cg_ft + masses._PLACES])
    assert weights.sum() == pytest.approx(wanted.weight_lbf)
    assert weights @ places / weights.sum() == pytest.approx(wanted.cg_ft, abs=1e-9)
    off = places - wanted.cg_ft
    each = [w / 32.174049 * (r @ r * np.eye(3) - np.outer(r, r)) for w, r in zip(weights, off, strict=True)]
    assert whole.inertia + sum(each) == pytest.approx(wanted.inertia, abs=1e-9)


@pytest.mark.parametrize("surface", parameters()["surfaces"])
def test_an_actuator_has_its_servo_in_radians_unless_it_is_set_on_the_ground(surface):
    """Of the servo the source has a bandwidth, and a rate in degrees a second."""
    of, servo = parameters()["surfaces"][surface], parameters()["servo"]
    text = systems._surface(surface, of)
    numbers = {
        name: float(number)
        for number, name in re.findall(rf'<property value="(\S+?)"> (actuators/{surface}/\S+) ', text)
    }
    moves = of["kind"] != "stabiliser"
    rate = numbers[f"actuators/{surface}/rate-limit-rad_sec"]
    assert rate == pytest.approx(np.pi / 180 * servo["rate_limit_deg_s"] if moves else 0.0)
    assert numbers[f"actuators/{surface}/bandwidth-rad_sec"] == (servo["bandwidth_rad_s"] if moves else 0.0)
    assert (f"fcs/{surface}-cmd-late-rad" in text) == moves
    assert ("stabiliser-stands" in text) == (not moves)


FLOWN = Steady(165.0, 91.04, 3.0, 0.7, 1.3, 3.5, 2.4163, -0.4172, 0.25, 39.816, 1e-10)


@pytest.mark.parametrize("kept", [False, True])
@pytest.mark.parametrize("agreed", [False, True])
def test_what_is_imported_is_trimmed_at_3_deg_derived_by_regions_and_put_where_it_is_looked_for(
    kept, agreed, tmp_path, monkeypatch
):
    """With model, trim and derivation made up: what each gets, what is said of them, and the folder at the
    end. With the agreement if it is beside the data base; what was imported before is gone."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    out = None if kept else tmp_path / "out"
    target = (tmp_path / "cache" / "beaver-ftc" / "imported" if kept else out) / "gtm"
    target.mkdir(parents=True)
    (target / "LICENSE.md").write_text("of an import before")
    (target / "old.txt").write_text("of an import before")
    (tmp_path / "data").mkdir()
    if agreed:
        (tmp_path / "data" / "LicenseAgreement.pdf").write_bytes(b"terms")
    said, trimmed, derived = [], [], []

    class Bench:
        def __init__(self, model):
            trimmed.append(model.read_text())

        def steady(self, condition):
            trimmed.append(condition)
            return FLOWN

    def write_model(base, folder):
        (folder / "gtm.xml").write_text(f"model of {base}")
        return folder / "gtm.xml"

    def derive(reference, out, envelope=None, tell=print, regions=(), moves=None, engines=False):
        files = {path.name for path in Path(reference).iterdir()}
        derived.append((Path(reference).name, files, envelope, regions, moves, engines))
        tell("derive it")
        shutil.copytree(reference, out / "gtm")
        return SimpleNamespace(aircraft=SimpleNamespace(surfaces=("one", "other")))

    for name, instead in (("Bench", Bench), ("write_model", write_model), ("derive", derive)):
        monkeypatch.setattr(conversion, name, instead)
    monkeypatch.setattr(conversion, "read", lambda database: f"what {database.name} has")
    monkeypatch.setattr(conversion, "perf_counter", iter([7.25, 20.5]).__next__)
    found = conversion.convert(tmp_path / "data" / "x.mat", out, said.append)
    assert found == conversion.Imported(target, ("one", "other"), FLOWN, 13.25)
    assert said == ["read", "write the model", "trim", "derive it"]
    assert trimmed == ["model of what x.mat has", Condition(alpha_deg=3.0)]
    assert derived == [
        ("gtm", {"gtm.xml", "aircraft.yaml"}, None, folder.regions(), folder.MOVES, False),
    ]
    scripts = {"doublets.xml", *(f"{case}.xml" for case in cases())}
    files = {"gtm.xml", "aircraft.yaml", "LICENSE.md", "reset00.xml", "scripts"}
    assert {path.name for path in target.iterdir()} == files | ({"LicenseAgreement.pdf"} if agreed else set())
    assert {path.name for path in (target / "scripts").iterdir()} == scripts
    assert "T2_polynomial_aerodatabase.mat" in (target / "LICENSE.md").read_text()
    assert [path.name for path in target.parent.iterdir()] == ["gtm"]
    if agreed:
        assert (target / "LicenseAgreement.pdf").read_bytes() == b"terms"


def test_what_came_of_an_import_as_a_document_and_as_text():
    made = conversion.Imported(Path("there/gtm"), ("one", "other"), FLOWN, 13.256)
    apart(steady=[*vars(FLOWN).values()])
    document = conversion.document_of(made)
    assert document == {
        "aircraft": "gtm", "folder": "there/gtm", "surfaces": ["one", "other"],
        "damage": [
            "rudder-off", "fin-off", "left-outboard-flap-off", "left-wing-tip-off", "left-elevator-off",
            "left-stabiliser-off",
        ],
        "trim": {
            "airspeed_fps": 165.0, "eas_kt": 91.04, "alpha_deg": 3.0, "beta_deg": 0.7, "phi_deg": 1.3,
            "theta_deg": 3.5, "elevator_deg": 2.4163, "aileron_deg": -0.4172, "rudder_deg": 0.25,
            "throttle_percent": 39.816, "left": 1e-10,
        },
        "took_s": 13.26,
    }  # fmt: skip
    assert conversion.text_of(document).splitlines() == [
        "gtm: there/gtm, written in 13.3 s",
        " surfaces   one, other",
        " damage     rudder-off, fin-off, left-outboard-flap-off, left-wing-tip-off, left-elevator-off, "
        "left-stabiliser-off",
        " trim       3 deg, 91.0 kt: elevator 2.416 deg, aileron -0.417 deg, throttle 39.82 %",
        " the licence of NASA's data is in LICENSE.md of the folder",
    ]


def test_a_gear_that_is_down_shifts_the_centre_of_gravity_by_its_own_and_adds_its_inertia():
    """Beside what a case leaves, the tip of the left wing lost: 0.81 lbf less, the moment as before."""
    up, down = masses.mass_of(4), masses.mass_of(4, gear_down=True)
    assert (up.weight_lbf, down.weight_lbf) == pytest.approx((56.94, 56.94))
    left = 57.75 * np.array([-4.74747447, -0.0118, -0.9761]) / 56.94 + np.array([0.148, 0.628, 0.032]) / 12.0
    assert up.cg_ft == pytest.approx(left)
    assert down.cg_ft - up.cg_ft == pytest.approx([-0.0025, 0.0, 0.015])
    assert down.inertia - up.inertia == pytest.approx(np.diag([0.0441, 0.0, 0.006994]))
    assert np.diag(up.inertia) == pytest.approx(
        [1.221 + 0.001076938 - 0.25821, 4.655 + 0.002102173 - 0.01727, 5.587 + 0.001301532 - 0.274]
    )
    products = up.inertia[0, 1], up.inertia[0, 2], up.inertia[1, 2]
    assert products == pytest.approx((0.05998 - 0.006, 0.00295 - 0.274, 0.01346))


def test_a_scenarios_errors_of_mass_are_a_metre_from_the_centre_of_gravity_in_pairs():
    """In JSBSim's frame, inches aft, right and up, before the ten masses of damage."""
    made = ElementTree.fromstring(masses.mass_balance())
    (cg,) = made.findall("location")
    points = [point.find("location") for point in made.iter("pointmass")]
    off = [[float(of.findtext(axis)) - float(cg.findtext(axis)) for axis in "xyz"] for of in points]
    metre = 100.0 / 2.54 * np.eye(3)
    pairs = [way for axis in metre for way in (axis, -axis)]
    assert off[0] == [0.0, 0.0, 0.0]
    for k in (1, 3, 5):
        assert sorted(off[k : k + 2]) == pytest.approx(np.array(sorted(map(list, pairs[k - 1 : k + 1]))))
    assert len(off) == masses.FIRST + len(masses._PLACES) == 17
    assert [float(cg.findtext(axis)) for axis in "xyz"] == pytest.approx(
        [12 * 4.74747447, -12 * 0.0118, 12 * 0.9761]
    )
