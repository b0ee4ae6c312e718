"""Names in prose: those of the code, its files and commands pass; one letter more, and it is a line."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tools.docs import bare, names
from tools.docs.known import Code, known
from tools.docs.marks import parsed
from tools.docs.names import Names

from beaver_ftc.plugins import LAWS, registered

GOOD = (
    "fdi.bounds.sensors",
    "faults[].at_s",
    "q_threshold_rad_s",
    "alpha_measured_rad",
    "<surface>_effectiveness_estimate",
    "q_*",
    "fcs/elevator-pos-rad",
    "uncertainty/<term>-scale",
    "velocities/p-rad_sec",
    "flight.metrics",
    "detection.delay_s",
    "plant/adapter.py",
    "src/beaver_ftc/loop/frame.py",
    "test_docs_names.py",
    "scenarios/elevator-partial-loss.yaml",
    "log.parquet",
    "beaver-ftc run elevator-partial-loss --no-report",
    "beaver-ftc challenge new autumn",
    "sweep FILE --workers 2",
    "challenge grade FOLDER --workers 3",
    "--no-report",
    "--host ADDRESS",
    "python -m tools.docs --check",
    "make docs-check",
    "bf.fly(scenario, detector=MyCusum())",
    "beaver_ftc.design.context.Context",
    "fault_class: all",
    "fdi: {scheme: cusum}",
    "zhang2005",
    "NAME-search-delay",
    "runs/live-SCENARIO-DATE-TIME/",
    "Detector",
    "x_0 + 3 (y - 2)",
)
# A letter of each word of a name is doubled, but for those in brackets and what a reader fills in.
WRONG = {
    "fdi.bounds.sensorss": "fdi.bounds.sensorss",
    "fdi.rate_hz": "fdi.rate_hz",
    "q_thresholds_rad_s": "q_thresholds_rad_s",
    "allpha_measured_rad": "allpha_measured_rad",
    "<surface>_effectivenesss_estimate": "<surface>_effectivenesss_estimate",
    "fcs/elevator-position-rads": "fcs/elevator-position-rads",
    "flight.metricss": "flight.metricss",
    "plant/adapters.py": "plant/adapters.py",
    "src/beaver_ftc/loop/frames.py": "src/beaver_ftc/loop/frames.py",
    "logs.parquet": "logs.parquet",
    "beaver-ftc rum elevator-partial-loss": "rum",
    "beaver-ftc run elevator-partial-loss --no-reports": "--no-reports",
    "beaver-ftc challenge neww autumn": "challenge",
    "sweep FILE --workerss 2": "--workerss",
    "challenge grade FOLDER --workerss 3": "--workerss",
    "--no-reports": "--no-reports",
    "python -m tools.doc --check": "tools.doc",
    "make docs-checks": "docs-checks",
    "bf.flyy(scenario)": "bf.flyy",
    "beaver_ftc.design.context.Contexts": "beaver_ftc.design.context.Contexts",
    "fault_classs: all": "fault_classs",
    "sensors: ideall": "ideall",
    "the frame calls frame_stepp of it": "frame_stepp",
    "fault_tolerant_lawyer": "fault_tolerant_lawyer",
    'sim["velocities/p-rad_secs"]': "velocities/p-rad_secs",
}


@pytest.fixture(scope="module")
def checker():
    """Knows the project and nothing else; the page's blocks show MyCusum."""
    return Names(known(), frozenset({"SyncVectorEnv"}), frozenset({"MyCusum", "cusum"}))


@pytest.mark.parametrize("span", GOOD)
def test_a_name_of_the_project_passes(checker, span):
    assert checker.wrong(span) is None


@pytest.mark.parametrize("span", WRONG)
def test_a_name_that_is_none_is_found(checker, span):
    assert checker.wrong(span) == WRONG[span]


@given(st.text(st.sampled_from("ab_.<>*{}/:()[]\"' -=,0"), max_size=30))
def test_no_span_breaks_the_checker(span):
    if span.strip():
        assert Names(known(), frozenset()).wrong(span) is None or span


def test_every_column_property_key_law_and_command_is_known(checker):
    of = known()
    assert len(of.columns) > 80
    assert len(of.properties) > 300
    listed = (*of.columns, *of.commands, *registered(LAWS), *list(of.properties)[::20])
    assert [name for name in listed if name and checker.wrong(name)] == []


def test_names_of_others_pass_and_each_has_to_be_used(monkeypatch):
    monkeypatch.setattr(
        names, "foreign", lambda: {"SyncVectorEnv": "of Gymnasium", "never_said": "of nobody"}
    )
    text = "`SyncVectorEnv` is theirs,\n`AsyncVectorEnvs` is nobody's.\n"
    first, second = names.check([parsed(text, "docs/page.md")])
    assert str(first).startswith("docs/page.md:2: `AsyncVectorEnvs` is no name here")
    assert "never_said: no page has it" in second.words
    assert len(names.check([parsed(text, "docs/page.md")], every=False)) == 1


def test_only_prose_is_looked_at():
    text = "```python\nno_such(`gone_name`)\n```\n<!-- `gone_name` -->\n\n    run `gone_name`\n\n`yes`\n"
    assert list(names.spans(text)) == [(8, "yes")]
    assert {"no_such", "run"} <= names.shown(text)


STAGE = '''"""Says gone_function."""
LIMIT = 3


class Bank:
    """Says gone_key."""

    size: int = 1

    def step(self, delay_s):
        return record(alarm_s=delay_s), f"{delay_s}_residual", "a_key"
'''


def test_what_a_file_defines_is_known_and_what_it_describes_is_not(tmp_path):
    path = tmp_path / "stage.py"
    path.write_text(STAGE)
    code = Code()
    code.read(path)
    assert {"stage", "Bank", "step", "delay_s", "alarm_s", "a_key", "LIMIT"} <= code.words
    assert not {"gone_function", "gone_key"} & code.words
    assert code.members["Bank"] == {"size", "step"}
    assert [bool(re.fullmatch(pattern, "q_residual")) for pattern in code.patterns] == [True]


BARE = {
    "It takes 0.31 s.": True,
    "It finds 95 % of them.": True,
    "| a | 34 dB |": True,
    "It takes <!--=case detection.delay_s .2f-->0.31<!--/--> s.": False,
    "<!-- printed: fly -->\n| a | 34 dB |\n<!-- /printed -->": False,
    "In `duration_s: 0.31` it is.": False,
    "From $dt=0.01$ s on.": False,
    "```yaml\nduration_s: 0.31\n```": False,
    "It is 0.31 s [Zhang2005, sec. IV].": False,
    "Another cites [Zhang2005]. It takes 0.31 s.": True,
    "See section 4.2 and equations (14) and (15).": False,
    "On 2026-11-20 with JSBSim 1.3.3.": False,
    "One of 4 surfaces.": False,
    "## 2.5 A heading": False,
    "[a link](page.md#the-95-percent)": False,
}


@pytest.mark.parametrize("text", BARE)
def test_a_number_that_no_command_prints_is_counted(text):
    assert bool(list(bare.numbers(parsed(text, "docs/page.md")))) == BARE[text]
