import json
import re
import resource

import numpy as np
import pytest
from typer.testing import CliRunner

from beaver_ftc.cli.main import app
from beaver_ftc.results.style import LOOKS
from beaver_ftc.scenario.loader import load_scenario
from beaver_ftc.studies.reproduce import reproduction
from beaver_ftc.studies.reproduce.cases import BESIDE, PUBLISHED, VARIANTS, fly_case
from beaver_ftc.studies.reproduce.choices import CHOICES, GIVEN, scenario
from beaver_ftc.studies.reproduce.claims import CLAIMS
from beaver_ftc.studies.reproduce.published_figures import FIGURES, shares
from beaver_ftc.studies.reproduce.reproduction import fly_published

SHOWN = {"Fig. 2a", "Fig. 2b", "Fig. 3", "Fig. 4a", "Fig. 4b", "Fig. 4c", "Fig. 5", "Fig. 6", "Fig. 7"}


@pytest.fixture(scope="module")
def flights():
    return fly_published()


def _numbers(flights):
    return {claim.statement: claim.measure(flights) for claim in CLAIMS}


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.statement)
def test_published_statement_is_borne_out(claim, flights):
    assert claim.reading.holds(claim.measure(flights)), (claim.measure(flights), claim.remark(flights))


def _broken(claim, flights, **instead):
    return not claim.reading.holds(
        claim.measure(flights | {name: flights[other] for name, other in instead.items()})
    )


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.statement)
def test_every_statement_can_fail(claim, flights):
    """A flight with another fault, another law or without one in the place of the right one."""
    lost, named = "unanticipated-nominal", "elevator"
    swaps = [{case.name: other} for case in PUBLISHED for other in (lost, named, "fault-free-nominal")]
    wild = {case.name: _wild(flights[case.name]) for case in PUBLISHED}
    assert any(_broken(claim, flights, **swap) for swap in swaps) or not claim.reading.holds(
        claim.measure(flights | wild)
    )


def _wild(flown):
    """The flight with residuals a hundredfold and a flap that jumps from frame to frame."""
    log = dict(flown.log)
    log |= {name: 100 * values for name, values in log.items() if name.endswith("_residual_rad_s")}
    log["flap_cmd_rad"] = np.where(np.arange(len(log["t_s"])) % 2, 0.1, 0.0)
    return type(flown)(flown.metrics, log)


def test_numbers_agree_with_the_log_itself(flights):
    log = flights["elevator"].log
    over = [np.abs(log[f"{axis}_residual_rad_s"]) > log[f"{axis}_threshold_rad_s"] for axis in "pqr"]
    first_s = log["t_s"][1:][np.any(over, axis=0)[1:]][0]
    numbers = _numbers(flights)
    assert numbers["The elevator fault is detected within 0.5 s."] == pytest.approx(first_s - 12.0)
    error = np.rad2deg(log["q_model_rad_s"] - log["q_rad_s"])[1400:]
    tracked = numbers["With reallocation the pitch rate is tracked acceptably in spite of the fault."]
    assert tracked == pytest.approx(np.linalg.norm(error) / np.sqrt(error.size) / 3.0)


def test_published_setting_is_that_of_the_built_in_scenario():
    ours, shipped = scenario("x", {}), load_scenario("elevator-partial-loss")
    for part in ("initial", "uncertainty", "duration_s", "rate_hz", "actuators", "sensors"):
        assert getattr(ours, part) == getattr(shipped, part), part
    assert ours.fdi.bounds == shipped.fdi.bounds
    assert ours.fdi.thresholds == "published"
    assert not any(ours.fdi.sharpen.model_dump().values())


def test_every_choice_has_its_reason_and_none_is_given_by_the_paper():
    assert all(len(choice.reason) > 10 for choice in CHOICES)
    assert not {choice.key for choice in CHOICES} & set(GIVEN)


def test_every_published_figure_is_drawn_with_its_panels():
    titles = {view.title.split(":")[0]: view for view, _, _ in FIGURES}
    assert set(titles) >= SHOWN
    for figure in ("Fig. 2a", "Fig. 2b", "Fig. 5", "Fig. 6", "Fig. 7"):
        labels = [panel.label for panel in titles[figure].panels]
        assert labels[:2] == ["elevator deflection", "flap deflection"]
        assert labels[-1] == "pitch rate q"
    for figure in ("Fig. 3", "Fig. 4a", "Fig. 4b", "Fig. 4c"):
        assert len(titles[figure].panels) == 3
    cases = {case.name for case in (*PUBLISHED, *BESIDE)}
    assert {case for _, case, _ in FIGURES} <= cases


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.name)
def test_every_variant_changes_the_scenario(variant):
    assert scenario("x", variant.changes) != scenario("x", {})


def test_unanticipated_fault_is_never_named_under_the_interval_test():
    flown = fly_case(next(case for case in BESIDE if case.name == "unanticipated-interval"))
    assert [flown.named_s(name) for name in ("aileron", "elevator", "rudder")] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (0.0224, "of the amplitude", "2.2 % of the amplitude"),
        (317.2, "times", "317 times"),
        (0.01, "s", "0.01 s"),
        (None, "s", "never"),
    ],
)
def test_numbers_in_words(value, unit, said):
    assert reproduction.number(value, unit) == said


@pytest.mark.parametrize(
    ("lowest", "number", "highest", "at_least", "expected"),
    [
        (0.1, 0.2, 1.0, False, (0.2, 0.4, 2.0)),
        (1.0, 2.0, 5.0, True, (0.1, 0.25, 0.5)),
        (0.1, 0.2, None, False, (0.2, 0.4, np.inf)),
        (1.0, None, None, True, (0.0, 0.0, 0.5)),
        (0.0, 0.0, 5.0, True, (0.1, np.inf, np.inf)),
    ],
)
def test_margins_are_shares_of_what_is_allowed(lowest, number, highest, at_least, expected):
    claim = {"lowest": lowest, "number": number, "highest": highest, "limit": 0.5, "at_least": at_least}
    assert shares(claim) == pytest.approx(expected)


def test_command_writes_table_figures_and_page(tmp_path):
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = CliRunner().invoke(app, ["reproduce", "--out", str(tmp_path), "--format", "json"])
    assert done.exit_code == 0, done.output
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before < 100  # s of CPU: 60 s on 2 cores
    document = json.loads(done.stdout)
    assert document["passed"] is True
    folder = tmp_path / "reproduction"
    pictures = {view.name for view, _, _ in FIGURES} | {"sensitivity"}
    assert {path.stem for path in (folder / "figures").iterdir()} == pictures
    page = (folder / "reproduction.html").read_text()
    assert page.count("<img") == len(pictures)
    assert page.count("borne out</td>") == len(CLAIMS)
    assert not re.search(r"""(src|href)\s*=\s*["'](?!data:)""", page)
    assert len(page) < 5e6
    text = (folder / "reproduction.md").read_text()
    assert all(f"| {claim.statement} |" in text for claim in CLAIMS)
    assert all(f"figures/{view.name}.png" in text for view, _, _ in FIGURES)
    assert all(row["held_in"] > 0.8 * len(VARIANTS) for row in document["claims"])


def test_no_look_in_a_figures_legend_means_two_things():
    """Curves that look alike are called alike, and so share one entry of the legend."""
    for view, _, _ in FIGURES:
        said = {}
        for trace in (trace for panel in view.panels for trace in panel.traces if trace.label):
            look = LOOKS[trace.role]
            said.setdefault((look.colour, look.dash), set()).add(trace.label)
        assert all(len(labels) == 1 for labels in said.values()), (view.name, said)
