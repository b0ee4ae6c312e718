"""The mismatch in words: each sentence and cell of a small document made by hand."""

import json

import pytest

from beaver_ftc.aircraft import AXES
from beaver_ftc.studies.mismatch import tables as module
from beaver_ftc.studies.mismatch.tables import comparison_text, findings, percent, tables


def of(largest, share, **more):
    return {"rms": largest / 2.0, "max": largest, "bound_share": share, **more}


def guarantee(alarm=False, delay_s=0.5, certain_s=0.75):
    case = {"false_alarm": alarm, "detection_delay_s": delay_s, "guaranteed_delay_s": certain_s}
    return {"declared": case, "recommended": {**case, "detection_delay_s": None, "guaranteed_delay_s": None}}


@pytest.fixture
def found():
    parts = {"parts": {"roll": of(0.002, 0.2), "none": of(0.0, 0.0)}}
    sources = {"wrong_inertia": of(0.0005, 0.5, **parts), "absent": of(0.0, 0.0)}
    bound = {
        "constant_rad_s2": 0.03, "smallest_constant_rad_s2": 0.0123, "worst_ratio": 0.5, "worst_at_s": 3.0,
        "exceeded_s": 0.25, "exceeded_times": 2,
        "exceedances": [
            {"source": "small_one", "peak_ratio": None},
            {"source": "large_one", "peak_ratio": 1.5},
        ],
    }  # fmt: skip
    mode = {
        "truth": {"frequency_rad_s": 2.5, "damping": 0.4}, "deviation": {"fdc": 0.01, "design": 0.2},
        "jsbsim_own_deviation": None,
    }  # fmt: skip
    return {
        "scenario": "case", "axes": dict.fromkeys(AXES, sources),
        "bound": {axis: bound if axis == "p" else {**bound, "exceedances": []} for axis in AXES},
        "linear": {"modes": {"short_period": mode}, "airspeed_mps": 45.0, "altitude_m": 300.0},
        "dominant": {"source": "wrong_inertia", "bound_share": 0.5, "axis": "p"}, "false_alarm": True,
        "detection": {"time_s": 4.0, "axis": "q"}, "guarantee": guarantee(),
        "recommended": {"constant_rad_s2": dict.fromkeys(AXES, 0.04), "runs": 3, "settled": False},
    }  # fmt: skip


def test_sources_without_any_effect_have_no_line(found):
    (_, head, rows), _, _ = tables(found)
    assert len(head) == 1 + 3 * len(AXES)
    assert [row[0] for row in rows] == ["wrong inertia", "  roll", "  none"]
    assert rows[0][1:4] == ["0.25", "0.5", "50 %"]
    assert rows[1][1:4] == ["1", "2", "20 %"]
    assert rows[2][1:] == ["-"] * 9


def test_a_source_of_one_axis_alone_has_a_line(found):
    found["axes"] = {axis: {"only": of(0.1 * (axis == "r"), 0.1)} for axis in AXES}
    (_, _, rows), _, _ = tables(found)
    assert rows == [["only", *["-"] * 6, "50", "100", "10 %"]]


def test_the_bound_names_the_source_of_its_largest_excess(found):
    _, (_, _, rows), (caption, _, modes) = tables(found)
    assert rows[0] == ["p", "0.03", "0.0123", "50 %", "3.00 s", "0.25 s", "2", "large one"]
    assert rows[1][-1] == "-"
    assert caption == "modes at trim, 45 m/s and 300 m"
    assert modes == [["short period", "2.5", "0.4", "1 %", "20 %", "no bound"]]


def test_every_finding_has_its_sentence(found):
    constant = f"constant bound {'  '.join(f'{axis} 0.04' for axis in AXES)} rad/s2"
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
             "guaranteed_delay_s": None}  # fmt: skip
    entry |= {f"{axis}_worst_ratio": 0.5 for axis in AXES}
    entry |= {f"{axis}_smallest_constant_rad_s2": 0.0123 for axis in AXES}
    other = {**entry, "scenario": "two", "dominant": None, "false_alarm": False, "guarantee_void": False}
    text = comparison_text([entry, {**other, "guaranteed_delay_s": 0.5}], found, "out")
    one, two = (line.split() for line in text.splitlines() if line.startswith(("one", "two")))
    assert one[1:] == ["50", "%", "/", "0.0123"] * 3 + ["wrong", "inertia", "yes", "void"]
    assert two[-4:] == ["-", "no", "0.50", "s"]
    assert "results      out" in text


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
