"""Which YAML files pytest collects as what, without a pytest of their own."""

from types import SimpleNamespace

import pytest

from beaver_ftc import pytest_plugin as plugin
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.pytest_plugin import ExpectationItem, ExpectationMissed, Flown, ScenarioFile, SweepFile
from beaver_ftc.results.model import Expectation, Judged

TOLD = Expectation("pass_rate.at_least", True, "≥ 0.5", "1 of 2 flights")
VERDICT = Judged("many", True, (TOLD,))
SCENARIO, SWEEP = "name: one\nduration_s: 1\n", "name: many\nbase: fault-free\nruns: 3\n"


def file(folder, name, text):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


KINDS = {  # name, text: as it is found, named, found with --beaver, named with --beaver
    "marked": ("a.scenario.yaml", "", [ScenarioFile] * 4),
    "marked in short": ("a.scenario.yml", "", [ScenarioFile] * 4),
    "scenario": ("a.yaml", SCENARIO, [None, ScenarioFile, ScenarioFile, ScenarioFile]),
    "sweep": ("a.yaml", SWEEP, [None, SweepFile, None, SweepFile]),
    "sweep by what varies": ("a.yaml", "name: a\nvary: {}\n", [None, SweepFile, None, SweepFile]),
    "base alone": ("a.yaml", "name: a\nbase: fault-free\n", [None] * 4),
    "another tool's": ("a.yaml", "services: {}\n", [None] * 4),
    "name alone": ("a.yaml", "name: a\n", [None, ScenarioFile, ScenarioFile, ScenarioFile]),
    "name and no key of ours": ("a.yaml", "name: a\nzebra: 1\n", [None] * 4),
    "description alone": ("a.yaml", "description: a\n", [None] * 4),
    "nearly a key": ("a.yaml", "FAUTLS: []\n", [None, ScenarioFile, ScenarioFile, ScenarioFile]),
    "empty": ("a.yaml", "", [None] * 4),
    "a list": ("a.yaml", "- a\n", [None] * 4),
    "cannot be read": ("a.yaml", "name: [a\n", [None, None, ScenarioFile, ScenarioFile]),
}


@pytest.mark.parametrize("name", KINDS)
def test_what_a_file_is_collected_as(tmp_path, name):
    called, text, kinds = KINDS[name]
    path = file(tmp_path, called, text)
    ways = [(named, all_of_them) for all_of_them in (False, True) for named in (False, True)]
    assert [plugin._kind(path, *way) for way in ways] == kinds


@pytest.mark.parametrize(("beside", "result"), [
    (("scenario.yaml", "metrics.json"), True), (("scenario.yaml", "log.parquet"), True),
    (("sweep.json", "results.parquet"), True), (("scenario.yaml", "results.parquet"), False),
    (("metrics.json",), False), ((), False),
])  # fmt: skip
def test_what_a_run_has_written_is_collected_where_it_is_named(tmp_path, beside, result):
    for one in beside:
        file(tmp_path, one, "")
    path = file(tmp_path, "below/a.yaml", SCENARIO)
    assert plugin._is_a_result(tmp_path) is result
    assert plugin._kind(path, False, True) is (None if result else ScenarioFile)
    assert plugin._kind(path, True, True) is ScenarioFile


def test_only_yaml_is_looked_at(tmp_path):
    config = SimpleNamespace(getoption=lambda name: True)
    parent = SimpleNamespace(session=SimpleNamespace(isinitpath=lambda path: False), config=config)
    assert plugin.pytest_collect_file(file(tmp_path, "a.json", SCENARIO), parent) is None
    assert plugin.pytest_collect_file(file(tmp_path, "a.yaml", "- a\n"), parent) is None


def item(flown, name="isolated_as"):
    """An expectation of a file of which this came, as pytest would make it."""
    made = object.__new__(ExpectationItem)
    made.name, made.user_properties, made.path = name, [], "a.yaml"
    made.parent = SimpleNamespace(flown=lambda: flown, name_flown="one")
    return made


def expected(**passed):
    told = tuple(Expectation(name, ok, "rudder", "flap") for name, ok in passed.items())
    return Flown(told, "tmp/one")


def test_an_item_holds_its_own_expectation_alone():
    met = item(expected(isolated_as=True, other=False))
    assert met.runtest() is None
    assert met.user_properties == [("result", "tmp/one")]
    assert met.reportinfo() == ("a.yaml", 0, "one: isolated_as")
    missed = item(expected(other=True, isolated_as=False))
    says = r"isolated_as: expected rudder, actual flap\nkept: tmp/one \(see report.html\)"
    with pytest.raises(ExpectationMissed, match=says) as info:
        missed.runtest()
    assert missed.repr_failure(info) == str(info.value)


def test_a_file_is_flown_once_whatever_came_of_it(tmp_path):
    """What went wrong is said again to each of its items."""
    flights = []

    class Once(plugin.FlownFile):
        def _fly(self, out):
            flights.append(out)
            if self.name_flown == "bad":
                raise BadInput("no")
            return Flown((), str(out))

    for name in ("good", "bad"):
        made = object.__new__(Once)
        made.name_flown = name
        factory = SimpleNamespace(mktemp=lambda called: tmp_path / called)
        made.config = SimpleNamespace(_tmp_path_factory=factory)
        for _ in range(2):
            if name == "good":
                assert made.flown() == Flown((), str(tmp_path / "beaver-ftc"))
                continue
            with pytest.raises(BadInput, match="no"):
                made.flown()
    assert len(flights) == 2


@pytest.mark.parametrize("passed", [True, False])
def test_of_a_scenario_that_fails_the_figures_are_kept(monkeypatch, tmp_path, passed):
    saved = []

    def save(out, report):
        saved.append((out, report))
        return out / "one"

    flight = SimpleNamespace(passed=passed, expectations=(TOLD,), save=save)
    monkeypatch.setattr("beaver_ftc.results.flight.fly", lambda scenario: flight)
    made = object.__new__(ScenarioFile)
    made.scenario = None
    assert made._fly(tmp_path) == Flown((TOLD,), str(tmp_path / "one"))
    assert saved == [(tmp_path, not passed)]


@pytest.mark.parametrize("passed", [True, False])
def test_of_a_sweep_that_fails_a_page_is_made_and_nothing_flown_again(monkeypatch, tmp_path, passed):
    runs = []

    def run_sweep(sweep, options):
        runs.append((options.out, options.report, options.resume, options.source))
        return {"passed": passed}

    monkeypatch.setattr("beaver_ftc.studies.sweep.campaign.run_sweep", run_sweep)
    monkeypatch.setattr("beaver_ftc.studies.sweep.summary_page.verdict", lambda summary: VERDICT)
    made = object.__new__(SweepFile)
    made.sweep, made.path = SimpleNamespace(name="many"), "many.yaml"
    assert made._fly(tmp_path) == Flown((TOLD,), str(tmp_path / "many"))
    again = [] if passed else [(tmp_path, True, True, "many.yaml")]
    assert runs == [(tmp_path, False, False, "many.yaml"), *again]
