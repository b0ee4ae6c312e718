"""`beaver-ftc import gtm`: what it refuses, and the folder it writes."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.io import savemat

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.aircraft import UnknownAircraft
from beaver_ftc.documents.errors import BadInput
from beaver_ftc_aircraft.gtm import conversion
from beaver_ftc_aircraft.gtm.database import read
from beaver_ftc_aircraft.gtm.folder import regions
from beaver_ftc_aircraft.gtm.parameters import cases, parameters
from products.aircraft.gtm import made

FAILURES = (
    "effectiveness", "stuck", "stuck-at-UNIT", "hardover", "float", "bias-UNIT", "rate-scale",
    "oscillation-amplitude-UNIT", "oscillation-frequency-rad_sec",
)  # fmt: skip


def test_without_the_data_a_line_says_where_they_are(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(
        UnknownAircraft, match=r"^'gtm' is not imported yet.*import gtm.*github.com/nasa/GTM_DesignSim"
    ):
        load("gtm")


VERSION = "Polynominal Fit, with damage"
ALLOWED = "the data base of github.com/nasa/GTM_DesignSim, gtm_design/config/T2_polynomial_aerodatabase.mat"
CUT_OFF = b"MATLAB 5.0 MAT-file" + b" " * 97 + b"\0" * 8 + b"\0\1IM\x0f\0\0\0\xff\0\0\0xx"


def base(data, **axes):
    """A data base of one table."""
    return {"ver": VERSION, "C6_bas": {"data": data, **axes}}


WHOLE = np.zeros((32, 27, 6))
CONTENTS = [  # bytes, or what is in the file
    (b"", "is no whole MATLAB file"),
    (b"no such thing" * 100, "is no whole MATLAB file"),
    (CUT_OFF, "is no whole MATLAB file"),
    ({"x": 1}, "has the version ''"),
    ({"ver": "x" * 61}, f"has the version {'x' * 60!r}"),
    ({"ver": VERSION}, "has no C6_bas.data"),
    ({"ver": VERSION, "C6_bas": 3}, "has no C6_bas.data"),
    (base(np.zeros((3, 4))), "C6_bas.data is of (3, 4) values, not (32, 27, 6)"),
    (base("text"), "C6_bas.data is no table of numbers"),
    (base(np.nan * WHOLE), "C6_bas.data has values that are not finite"),
    (base(WHOLE, alpha=np.zeros(32)), "C6_bas.alpha does not rise"),
    (base(WHOLE, alpha=np.arange(27.0)), "C6_bas.alpha is of (27,) values, not (32,)"),
]


@pytest.mark.parametrize(("content", "says"), CONTENTS)
def test_other_contents_are_refused_in_a_line(tmp_path, content, says):
    path = tmp_path / "x.mat"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        savemat(path, content)
    with pytest.raises(BadInput) as wrong:
        read(path)
    (line,) = str(wrong.value).splitlines()
    assert line.startswith(f"{path}: {says}")
    assert line.endswith(f", allowed: {ALLOWED}")


def test_no_file_and_a_folder_are_refused(tmp_path):
    for path, says in (
        (tmp_path / "none.mat", "cannot be read (No such file"),
        (tmp_path, "is no file of th"),
    ):
        with pytest.raises(BadInput) as wrong:
            read(path)
        assert str(wrong.value).startswith(f"{path}: {says}")


def test_a_file_of_more_than_50_mb_is_not_read(tmp_path):
    """Of which nothing is on the disk."""
    for size, says in ((50_000_000, "is no whole MATLAB file"), (50_000_001, "is no file of this kind")):
        with (tmp_path / "x.mat").open("wb") as file:
            file.truncate(size)
        with pytest.raises(BadInput, match=says):
            read(tmp_path / "x.mat")


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


def test_every_surface_and_engine_has_all_failures(bench):
    effectors = [*parameters()["surfaces"], "left_engine", "right_engine"]
    assert len(effectors) == 19
    has = bench.fdm.get_property_manager().hasNode
    for name in effectors:
        unit = "norm" if "engine" in name else "rad"
        wanted = [f"failures/{name}/{failure.replace('UNIT', unit)}" for failure in FAILURES]
        wanted += [f"fcs/{name}-{end}-{unit}" for end in ("cmd", "pos", "effective")]
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


def test_parts_of_the_envelope_overlap_by_a_meter_per_second():
    speeds = [part.airspeed_mps for part in regions()]
    assert [after[0] - before[1] for before, after in pairwise(speeds)] == [-1.0] * 4
    assert (speeds[0][0], speeds[-1][1]) == (33.0, 60.0)
