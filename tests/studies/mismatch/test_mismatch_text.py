"""The mismatch in words: each sentence and cell of a small document made by hand."""

import json

import pytest

from beaver_ftc.aircraft import AXES
from beaver_ftc.studies.mismatch import tables as module
from beaver_ftc.studies.mismatch.tables import comparison_text, findings, percent, tables


def of(rms, largest, share, **more):
    return {"rms": rms, "max": largest, "bound_share": share, **more}


def guarantee(alarm=False, delay_s=0.5, certain_s=0.75):
    case = {"false_alarm": alarm, "detection_delay_s": delay_s, "guaranteed_delay_s": certain_s}
    return {"declared": case, "recommended": {**case, "detection_delay_s": None, "guaranteed_delay_s": None}}


NOTHING = of(0.0, 0.0, 0.0)
OF_AXIS = {  # a source, and the part of it that is there
    "p": (of(0.00021, 0.0005, 0.5), of(0.0011, 0.0023, 0.2)),
    "q": (of(0.00031, 0.0013, 0.31), of(0.0017, 0.0047, 0.0042)),
    "r": (of(0.00041, 0.0029, None), of(0.0019, 0.0061, 1.5)),
}
STAYS = {
    "p": [{"source": "small_one", "peak_ratio": None}, {"source": "large_one", "peak_ratio": 1.5}],
    "q": [],
    "r": [{"source": "the_first", "peak_ratio": 3.5}, {"source": "the_last", "peak_ratio": 2.5}],
}
BOUND = {
    "p": (0.03, 0.0123, 0.5, 3.0, 0.25, 2), "q": (0.05, 0.0271, 1.2, 7.0, 0.0, 0),
    "r": (0.07, 0.0, None, None, 1.5, 4),
}  # fmt: skip
OF_BOUND = (
    "constant_rad_s2", "smallest_constant_rad_s2", "worst_ratio", "worst_at_s",
    "exceeded_s", "exceeded_times",
)  # fmt: skip


def mode(frequency, damping, fdc, design, own):
    truth = {"frequency_rad_s": frequency, "damping": damping}
    return {"truth": truth, "deviation": {"fdc": fdc, "design": design}, "jsbsim_own_deviation": own}


@pytest.fixture
def found():
    """No two axes, modes or columns have a number in common."""
    sources = {
        axis: {"wrong_inertia": whole | {"parts": {"roll": part, "none": NOTHING}}, "absent": NOTHING}
        for axis, (whole, part) in OF_AXIS.items()
    }
    bound = {
        axis: dict(zip(OF_BOUND, values, strict=True)) | {"exceedances": STAYS[axis]}
        for axis, values in BOUND.items()
    }
    modes = {"short_period": mode(2.5, 0.4, 0.01, 0.2, None), "roll": mode(4.56, 1.0, 0.03, 0.11, 0.0007)}
    constant = {"p": 0.04, "q": 0.06, "r": 0.08}
    return {
        "scenario": "case", "axes": sources, "bound": bound,
        "linear": {"modes": modes, "airspeed_mps": 45.0, "altitude_m": 300.0},
        "dominant": {"source": "wrong_inertia", "bound_share": 0.5, "axis": "p"}, "false_alarm": True,
        "detection": {"time_s": 4.0, "axis": "q"}, "guarantee": guarantee(),
        "recommended": {"constant_rad_s2": constant, "runs": 3, "settled": False},
    }  # fmt: skip


def test_each_source_of_each_axis_has_its_own_numbers(found):
    """A source without any effect has no line."""
    (caption, head, rows), _, _ = tables(found)
    assert caption == "case: truth less design (1e-3 rad/s2; share of the bound)"
    assert head == ["source", *(f"{axis} {what}" for axis in "pqr" for what in ("rms", "max", "bound"))]
    assert rows == [
        ["wrong inertia", "0.21", "0.5", "50 %", "0.31", "1.3", "31 %", "0.41", "2.9", "no bound"],
        ["  roll", "1.1", "2.3", "20 %", "1.7", "4.7", "0.42 %", "1.9", "6.1", "150 %"],
        ["  none", *["-"] * 9],
    ]


def test_a_source_of_one_axis_alone_has_a_line(found):
    found["axes"] = {axis: {"only": of(0.05, 0.1 * (axis == "r"), 0.1)} for axis in AXES}
    (_, _, rows), _, _ = tables(found)
    assert rows == [["only", *["-"] * 6, "50", "100", "10 %"]]


def test_the_bound_names_the_source_of_its_largest_excess(found):
    _, (bounds, head, rows), (caption, columns, modes) = tables(found)
    assert bounds == "the bound, without the fault (constants in rad/s2)"
    assert head == ["axis", "constant", "smallest", "worst", "at", "exceeded", "times", "because of"]
    assert rows == [
        ["p", "0.03", "0.0123", "50 %", "3.00 s", "0.25 s", "2", "large one"],
        ["q", "0.05", "0.0271", "120 %", "7.00 s", "0.00 s", "0", "-"],
        ["r", "0.07", "0", "no bound", "never", "1.50 s", "4", "the first"],
    ]
    assert caption == "modes at trim, 45 m/s and 300 m"
    assert columns == ["mode", "truth rad/s", "damping", "FDC off by", "design off by", "JSBSim's own off by"]
    assert modes == [
        ["short period", "2.5", "0.4", "1 %", "20 %", "no bound"],
        ["roll", "4.56", "1", "3 %", "11 %", "0.07 %"],
    ]


def test_every_finding_has_its_sentence(found):
    constant = "constant bound p 0.04  q 0.06  r 0.08 rad/s2"
    assert findings(found) == [
        "dominant     wrong inertia: 50 % of the bound on p",
        "FALSE ALARM  at 4.00 s on q",
        f"recommended  {constant}, from 3 run(s), still exceeded when flown",
        "published elevator case with the declared bound: detected after 0.50 s, certain within 0.75 s",
        "published elevator case with the recommended bound: not detected, never certain",
    ]
    for delays, says in (
        ({"delay_s": None}, "not detected, certain within 0.75 s"),
        ({"certain_s": None}, "detected after 0.50 s, never certain"),
    ):
        assert findings(found | {"guarantee": guarantee(**delays)})[3].endswith(f"bound: {says}")
    found |= {"dominant": None, "false_alarm": False, "guarantee": guarantee(alarm=True)}
    found["recommended"]["settled"] = True
    said = findings(found)
    assert said[0] == "dominant     nothing: truth and design agree"
    assert said[1].endswith("from 3 run(s)")
    assert "FALSE ALARM before the fault" in said[2]


def test_runs_stand_side_by_side(found):
    entry = {"scenario": "one", "dominant": "wrong_inertia", "false_alarm": True, "guarantee_void": True,
             "guaranteed_delay_s": 0.25}  # fmt: skip
    for axis, values in BOUND.items():
        entry |= {f"{axis}_{name}": value for name, value in zip(OF_BOUND, values, strict=True)}
    other = {**entry, "scenario": "two", "dominant": None, "false_alarm": False, "guarantee_void": False}
    caption, head, rows = module._comparison([entry, other])
    assert caption == "worst share of the bound / smallest constant bound in rad/s2"
    assert head == ["run", "p", "q", "r", "dominant", "false alarm", "certain within"]
    needed = ["50 % / 0.0123", "120 % / 0.0271", "no bound / 0"]
    assert rows == [
        ["one", *needed, "wrong inertia", "yes", "void"], ["two", *needed, "-", "no", "0.25 s"],
    ]  # fmt: skip
    text = comparison_text([entry, other], found, "out").splitlines()
    assert text[0] == caption
    assert text[-1] == "results      out"
    assert text[-4:-1] == findings(found)[2:]


@pytest.mark.parametrize(
    ("share", "said"),
    [(None, "no bound"), (0.0, "0 %"), (1e-6, "<0.001 %"), (1e-5, "0.001 %"), (0.0994, "9.9 %"),
     (0.0995, "10 %"), (1.5, "150 %")],
)  # fmt: skip
def test_a_share_has_two_digits_or_whole_per_cents(share, said):
    assert percent(share) == said


def test_the_section_of_a_report_has_words_tables_and_pictures_in_this_order(found, tmp_path, monkeypatch):
    """A picture that is not there is left out; whatever a picture says is text."""
    monkeypatch.setattr(module, "PICTURES", {"one": '<a> "q" & more', "none": "not drawn"})
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "one.png").write_bytes(b"a picture")
    (tmp_path / "mismatch.json").write_text(json.dumps(found))
    section = module.mismatch_section(tmp_path)
    says = "&lt;a&gt; &quot;q&quot; &amp; more"
    assert f'alt="{says}" src="data:image/png;base64,YSBwaWN0dXJl"' in section
    assert f"<figcaption>{says}</figcaption>" in section
    assert "not drawn" not in section
    places = [section.index(part) for part in ("dominant", "<table", "modes at trim", "<figure")]
    assert places == sorted(places)
