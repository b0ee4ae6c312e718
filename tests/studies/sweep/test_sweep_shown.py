"""All that a sweep shows, of flights with every kind of key and end: summary, figures, page, worst."""

import shlex
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.scenario.sweeps import SweepExpect, load_sweep_text
from beaver_ftc.studies.sweep import outcomes, pictures
from beaver_ftc.studies.sweep.outcomes import rank, replay_command, worst_flights
from beaver_ftc.studies.sweep.pictures import FIGURES, magnitude_key, write_figures
from beaver_ftc.studies.sweep.summary import OUTCOMES, evaluate, summarise
from beaver_ftc.studies.sweep.summary_page import render, summary_text
from kept import page, picture

from .counted import ROWS, ROWS_OF_VARIOUS, SWEEP, VARIOUS, detected, flights_of, row

LEVELS = SWEEP.replace("uniform: [0.1, 1]", "linspace: [0.1, 1, 3]")
OF_LEVELS = [
    {**r, "faults[0].magnitude": (0.1, 0.55, 1.0)[i % 3]}
    for i, r in enumerate([*ROWS[:8], *(row(run) for run in range(8, 12))])
]
LATE = [*(detected(run, 0.1) for run in range(11)), detected(11, 2.1)]
SHOWN = {
    "various": (ROWS_OF_VARIOUS, VARIOUS),
    "levels": (OF_LEVELS, LEVELS),
    "late": (LATE, SWEEP),
}
SEARCH = {"objective": "delay", "run": 7, "score": 1.5, "history": [None, 1.0, 1.5, 1.5]}


@pytest.fixture(params=SHOWN)
def shown(request, tmp_path):
    rows, text = SHOWN[request.param]
    flights, sweep = flights_of(rows, tmp_path, text), load_sweep_text(text)
    return flights, summarise(flights, sweep), sweep


def test_the_summary(shown, changed):
    assert not changed(shown[1])


def test_every_figure(shown, changed):
    flights, summary, _ = shown
    summary = summary | {"search": SEARCH} if summary["sweep"] == "various" else summary
    drawn = {name: draw(flights, summary) for name, (_, draw) in FIGURES.items()}
    assert not changed({name: whole(figure) for name, figure in drawn.items() if figure is not None})


def whole(figure):
    """A picture, and the places that annotations are of."""
    places = [list(getattr(text, "xy", ())) for axes in figure.axes for text in axes.texts]
    return picture(figure) | {"places": places}


SMALL = ("initial.altitude_m", "initial.flap_deg", *(
    f"{of}.{axis}{what}" for axis in "pqr" for of, what in (
        ("uncertainty.sinusoid", ".amplitude_rad_s2"), ("uncertainty.inertia_coupling", ""),
        ("fdi.bounds.inertia_coupling", ""),
    )
))  # fmt: skip
MANY = "\n".join([
    f"{SWEEP}  sensors: {{choice: [ideal, tactical-grade, consumer-grade]}}",
    "  faults[0].at_s: {uniform: [3, 4]}", *(f"  {key}: {{uniform: [0.01, 0.02]}}" for key in SMALL),
])  # fmt: skip


def test_of_many_keys_those_that_explain_most_are_shown(tmp_path):
    sweep = load_sweep_text(MANY)
    keys = list(sweep.file.vary)
    sensors = ("ideal", "tactical-grade", "consumer-grade")
    rows = [
        row(
            run,
            **{key: float((run * (k + 3)) % 20) for k, key in enumerate(keys)}
            | {"sensors": sensors[run % 3]},
        )
        for run in range(20)
    ]
    flights = flights_of(rows, tmp_path, MANY)
    ranked = [{"key": key, "explained": 0.5} for key in keys]
    summary = {"sensitivity": dict.fromkeys(OUTCOMES, ranked)}
    bars, lines = pictures.sensitivity_bars(flights, summary), pictures.parallel_coordinates(flights, summary)
    assert [text.get_text() for text in bars.axes[0].get_yticklabels()] == [
        pictures.in_words(key) for key in keys[:12]
    ]
    assert len(lines.axes[0].get_xticks()) == 9
    assert lines.get_size_inches().tolist() == [pytest.approx(16.6), 5.0]
    names = {text.get_text(): text.xy for text in lines.axes[0].texts if text.get_text() in sensors}
    assert names == {"consumer-grade": (1, 0.0), "ideal": (1, 0.5), "tactical-grade": (1, 1.0)}
    few = summary | {"sensitivity": {"detection_delay": ranked[:2]}}
    assert pictures.parallel_coordinates(flights, few).get_size_inches()[0] == 7.0


def test_nothing_is_kept_of_what_no_flight_tells(tmp_path):
    healthy = {"fault.actuator": None, "fault.type": None, "fault.at_s": None}
    flights = flights_of([row(0, **healthy)], tmp_path)
    for bound in ({"at_most": 1.0, "confidence": 0.9}, {"at_least": 0.0, "confidence": 0.9}):
        (found,) = evaluate(SweepExpect(detection_rate=bound), flights)
        assert (found["passed"], found["of"]) == (False, 0)


def test_the_worst_flights_the_page_and_the_text(shown, changed, tmp_path):
    flights, summary, sweep = shown
    found = {
        "name": "detection_rate",
        "expected": {"at_least": 0.9},
        "actual": 0.8,
        "of": 50,
        "passed": False,
    }
    worst = worst_flights(flights, sweep, "beaver-ftc sweep a.yaml")
    summary |= {
        "worst": worst,
        "expectations": [found],
        "passed": False,
        "folder": "runs/a",
        "search": SEARCH,
    }
    assert not changed(worst, "worst")
    assert not changed(summary_text(summary).splitlines(), "text")
    (tmp_path / "flights" / worst[0]["name"]).mkdir(parents=True)
    (tmp_path / "flights" / worst[0]["name"] / "metrics.json").write_text("{}")
    (tmp_path / "figures").mkdir()
    for name in FIGURES if len(flights) > 12 else ("search", "sensitivity"):
        (tmp_path / "figures" / f"{name}.png").write_bytes(name.encode())
    assert not changed(page(render(summary | {"versions": {"jsbsim": "1"}}, tmp_path)), "page")


def test_what_was_drawn_before_goes(tmp_path):
    flights = flights_of([row(0)], tmp_path)
    (tmp_path / "figures").mkdir()
    for name in ("search", "mine"):
        (tmp_path / "figures" / f"{name}.png").write_text("old")
    drawn = write_figures(flights, summarise(flights, load_sweep_text(SWEEP)), tmp_path / "figures")
    assert {p.stem for p in (tmp_path / "figures").iterdir()} == {"mine", *(path.stem for path in drawn)}


@pytest.mark.parametrize(
    ("size", "expected"),
    [(1, [1]), (9, [9]), (19, [19]), (20, [10, 10]), (35, [12, 12, 11]), (176, [11] * 16)],
)
def test_bins_are_equally_full_and_not_too_small(size, expected):
    values = np.random.default_rng(1).permutation(size)
    bins = pictures._bins(values)
    assert [each.size for each in bins] == expected
    assert values[np.concatenate(bins)].tolist() == sorted(values)


def test_few_levels_are_shown_by_themselves_and_many_in_bins():
    few, many = np.tile(np.arange(32), 2)[::-1], np.tile(np.arange(33), 2)
    assert [few[each].tolist() for each in pictures._levels(few)] == [[i, i] for i in range(32)]
    assert [each.size for each in pictures._levels(many)] == [11] * 6


class _Many(dict):
    """So many flights, of which some are bad."""

    def __init__(self, count, bad):
        self.count, false = count, np.zeros(count, bool)
        missed, lost, alarmed = (false.copy() for _ in range(3))
        for place, position in enumerate(bad):
            (missed, lost, alarmed)[place % 3][position] = True
        super().__init__(false_alarm=alarmed)
        self.faulted, self.detected, self.departed = ~false, ~missed, lost

    def __len__(self):
        return self.count


@pytest.mark.parametrize(
    ("count", "bad", "expected"),
    [
        (400, [3], range(400)),
        (401, [3], {3, *range(0, 401, 2)}),
        (1200, [1, 2, 4], {1, 2, 4, *range(0, 1200, 3)}),
        (1200, range(1, 400, 2), {*range(1, 400, 2), *range(0, 1200, 3)}),
        (1200, range(1, 402, 2), {*range(1, 402, 4), *range(0, 1200, 3)}),
    ],
)
def test_of_many_flights_the_bad_ones_are_drawn_first(count, bad, expected):
    assert set(pictures._spread(_Many(count, bad)).tolist()) == set(expected)


@pytest.mark.parametrize(
    ("ranked", "vary", "expected"),
    [
        (["b", "faults[0].at_s", "faults[0].magnitude"], [], "faults[0].magnitude"),
        (["b", "faults[1].end_s", "a"], [], "b"),
        ([], ["text", "a", "faults[0].kappa_per_s"], "faults[0].kappa_per_s"),
        (["text"], ["a"], None),
        ([], [], None),
    ],
)
def test_how_large_a_fault_is(ranked, vary, expected):
    flights = SimpleNamespace(vary=vary, is_number=lambda key: key != "text")
    summary = {"sensitivity": {"detection_delay": [{"key": key} for key in ranked]}}
    assert magnitude_key(flights, summary) == expected


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("[]", "none"), ("tactical-grade", "tactical-grade"), ('{"a": "x_y", "b": 1, "c": "z"}', "x y z"),
        ("a" * 40, "a" * 28), ("rate_limit", "rate limit"),
    ],
)  # fmt: skip
def test_a_choice_in_few_words(name, said):
    assert pictures._short(name) == said


def test_of_many_flights_evenly_spaced_ones_are_ranked():
    rng = np.random.default_rng(3)
    x, y = rng.random(8001), rng.random(8001)
    assert rank({"x": x}, x + y) == rank({"x": x[::3]}, (x + y)[::3])
    assert rank({"x": x[:4000]}, y[:4000]) != rank({"x": x[:4000:2]}, y[:4000:2])


def test_as_many_flights_as_two_a_bin_are_enough_to_rank():
    x, share = (
        np.arange(16.0),
        1 - (4 / 8) / (340 / 15),
    )  # pairs: within them 8 x 0.5, in all 16 (256 - 1) / 12
    assert rank({"x": x[:15]}, x[:15]) == []
    found = rank({"x": x, "same": 0 * x, "x again": x}, x)
    assert [tuple(each.values()) for each in found] == [
        ("x", pytest.approx(share, abs=1e-6), 1.0, 0.005),
        ("x again", pytest.approx(share, abs=1e-6), 1.0, 0.005),
        ("same", 0.0, None, 1.0),
    ]


def test_up_to_eight_levels_are_groups_and_more_are_binned():
    eight, nine = np.repeat(np.arange(8.0), 3), np.repeat(np.arange(9.0), 3)
    assert outcomes._groups(eight).tolist() == np.repeat(np.arange(8), 3).tolist()
    expected = [int(rank * 8 // 27) for rank in np.repeat(np.arange(1.0, 27, 3), 3)]
    assert outcomes._groups(nine).tolist() == expected
    assert outcomes._groups(nine.astype(str).astype(object)).max() == 8


def test_the_share_explained_is_that_of_an_analysis_of_variance():
    from scipy.stats import f_oneway

    rng = np.random.default_rng(5)
    groups, ranks = rng.integers(0, 4, 50), rng.permutation(50).astype(float)
    f = f_oneway(*(ranks[groups == g] for g in range(4))).statistic
    n, k = 50, 4
    assert outcomes._explained(groups, ranks) == pytest.approx(1 - (n - 1) / (f * (k - 1) + n - k))
    assert outcomes._explained(np.array([0, 2, 2]), np.array([0.0, 1.0, 2.0])) == pytest.approx(0.5)
    assert outcomes._explained(np.array([0, 1, 2]), np.array([0.0, 1.0, 2.0])) == 0.0
    assert outcomes._explained(np.zeros(3, int), np.array([0.0, 1.0, 2.0])) == 0.0


def test_the_command_that_replays_a_flight():
    assert shlex.split(replay_command("a b.yaml", Path("o"), "delay")) == [
        "beaver-ftc", "sweep", "a b.yaml", "--search", "delay", "--out", "o"
    ]  # fmt: skip
    assert replay_command("a.yaml", Path("runs")) == "beaver-ftc sweep a.yaml"


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("faults[0].magnitude", "fault 1: magnitude"),
        ("faults[1].at_s", "fault 2: at (s)"),
        ("reference.q[0].amplitude_deg_s", "reference: q[0]: amplitude (deg/s)"),
        ("initial.airspeed_mps", "initial: airspeed (m/s)"),
    ],
)
def test_a_key_in_words(key, said):
    assert pictures.in_words(key) == said
