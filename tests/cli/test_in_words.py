"""How far a command has come, and what becomes of what goes wrong: line by line."""

import io
import json
import re
import sys
from collections import Counter
from pathlib import Path

import pytest

import needs
from beaver_ftc import cli
from beaver_ftc.cli import Format, mismatch, run, sweep
from beaver_ftc.documents.errors import BadInput, BeaverFtcError, SimulationFailed


class Terminal(io.StringIO):
    def __init__(self, is_one):
        super().__init__()
        self.isatty = lambda: is_one


@pytest.fixture
def clock(monkeypatch):
    """The time, to be set."""
    now = {"s": 100.0}
    monkeypatch.setattr(cli.time, "monotonic", lambda: now["s"])
    return now


def counts(done, **more):
    return Counter({"done": done, "total": 1000, **more})


@pytest.mark.parametrize(
    ("terminal", "step_s", "shown"),
    [
        (False, 15.0, "one: 20 of 1000 flights, 0.67/s, 25 min left\n"
         "one: 40 of 1000 flights, 0.67/s, 24 min left\n"),
        (True, 0.1, "\rone: 20 of 1000 flights, 100/s, 10 s left\rone: 40 of 1000 flights, 100/s, 10 s left\r"
         + " " * 41 + "\r"),
    ],
)  # fmt: skip
def test_a_line_of_a_sweep_now_and_then(monkeypatch, clock, terminal, step_s, shown):
    monkeypatch.setattr(sys, "stderr", Terminal(terminal))
    with cli.live_progress("one") as show:
        for i in range(5):
            show(counts(10 * i))
            clock["s"] += 1.0001 * step_s
    assert sys.stderr.getvalue() == shown


@pytest.mark.parametrize(
    ("of", "passed_s", "line"),
    [
        (counts(5), 10.0, "one: 5 of 1000 flights, 0/s"),
        (counts(25), 0.0, "one: 25 of 1000 flights, 20000000000/s, 0 s left"),
        (counts(25, faulted=8, detected=2), 10.0, "one: 25 of 1000 flights, 2/s, 8 min left, detected 25.0%"),
        (counts(25, failed=3), 200.0, "one: 25 of 1000 flights, 0.1/s, 2 h 42 min left, 3 not flown"),
        (counts(1000, faulted=8), 10.0, "one: 1000 of 1000 flights, 100/s, 0 s left, detected 0.0%"),
    ],
)  # fmt: skip
def test_a_line_of_a_sweep(monkeypatch, clock, of, passed_s, line):
    monkeypatch.setattr(sys, "stderr", Terminal(False))
    shown = cli._Progress("one", False)
    shown(counts(5))
    assert shown.line(of, 100.0 + passed_s) == line


@pytest.mark.parametrize(
    ("seconds", "span"),
    [
        (0.4, "0 s"),
        (99.4, "99 s"),
        (100, "2 min"),
        (5940, "99 min"),
        (6000, "1 h 40 min"),
        (7260, "2 h 01 min"),
    ],
)
def test_spans_of_time(seconds, span):
    assert cli._span(seconds) == span


def test_a_log_has_a_line_of_a_study_now_and_then_and_none_of_a_short_one(clock, monkeypatch):
    monkeypatch.setattr(sys, "stderr", log := Terminal(False))
    with cli.progress_bar("x") as show:
        for flown in range(101):  # one a second
            clock["s"] = 100.0 + flown
            show(flown / 100)
            if flown == 5:
                assert log.getvalue() == ""
    first, second, *others = log.getvalue().splitlines()
    assert first == "x: 6%"
    assert second == "x: 36%, 64 s left"
    assert len(others) == 2


def test_a_bar_shows_once_it_is_waited_for(monkeypatch, clock):
    bars = []
    monkeypatch.setattr(cli, "_bar", lambda label, stack: bars.append(label) or bars.append)
    monkeypatch.setattr(sys, "stderr", Terminal(True))
    with cli.progress_bar("x") as show:
        for after_s, done in ((1.0, 0.1), (1.01, 0.2), (1.02, 0.3)):
            clock["s"] = 100.0 + after_s
            show(done)
    assert bars == ["x", 0.2, 0.3]


@pytest.mark.parametrize(
    ("error", "says", "status"),
    [
        (BadInput("a\nb"), "a\nb", 2),
        (SimulationFailed("c"), "c", 3),
        (BeaverFtcError("d"), "d", 3),
        (MemoryError("so  much\n"), "there is not enough memory for this: so much", 3),
        (MemoryError(), "there is not enough memory for this", 3),
        (KeyError("k"), "unexpected KeyError: 'k' (BEAVER_FTC_DEBUG=1 shows where)", 3),
    ],
)
def test_an_error_is_a_line_and_a_status(monkeypatch, capsys, error, says, status):
    monkeypatch.setenv("BEAVER_FTC_DEBUG", "")
    failure = cli.failure_of(error)
    assert (failure is error) == isinstance(error, BeaverFtcError)
    assert failure.__cause__ is (None if failure is error else error)
    assert cli.report(failure) == status
    assert capsys.readouterr() == ("", f"{says}\n")
    monkeypatch.setenv("BEAVER_FTC_DEBUG", "1")
    assert cli.report(failure) == status
    assert type(error).__name__ in capsys.readouterr().err


@pytest.mark.parametrize(("asked", "given", "is_said"), [
    (Format.json, False, True), (Format.json, True, False), (Format.text, False, False),
])  # fmt: skip
def test_who_asked_for_a_document_gets_one(capsys, asked, given, is_said):
    assert cli._remember(asked) is asked
    if given:
        cli.emit_json({"a": 1})
        capsys.readouterr()
    assert cli.report_last(BadInput("a\nb")) == 2
    shown = capsys.readouterr()
    assert shown.err == "a\nb\n"
    assert shown.out == ('{\n  "errors": [\n    "a",\n    "b"\n  ]\n}\n' if is_said else "")
    cli._remember(Format.text)


def test_what_is_emitted_ends_its_line_once(capsys):
    for text in ("a", "b\n"):
        cli.emit(text)
    cli.answer(Format.text, {"c": 1}, lambda: "d")
    cli.answer(Format.json, {"c": 1}, lambda: "d")
    assert capsys.readouterr().out == 'a\nb\nd\n{\n  "c": 1\n}\n'


@pytest.mark.parametrize(("error", "refused"), [(BrokenPipeError(), False), (OSError(28, "No space"), True)])
def test_a_reader_that_went_away_and_a_full_disk(monkeypatch, error, refused):
    def write(_):
        raise error

    discarded = []
    monkeypatch.setattr(cli, "_discard_stdout", lambda: discarded.append(1))
    monkeypatch.setattr(
        sys, "stdout", type("Out", (), {"write": staticmethod(write), "flush": lambda _: None})()
    )
    if refused:
        with pytest.raises(SimulationFailed, match=r"^cannot write standard output: No space$"):
            cli.emit("a")
    else:
        cli.emit("a")
    assert discarded == [1]


@pytest.mark.parametrize(("text", "names"), [("a, b,,c ", ["a", "b", "c"]), ("", []), (" , ", [])])
def test_names_with_commas(text, names):
    assert cli.listed(text) == names


def test_scenarios_are_told_all_their_mistakes_at_once(tmp_path):
    for name, text in (("a", "name: x"), ("b", "name: x"), ("c", "name: c\nrate_hz: 1"),
                       ("d", "name: d\n\ninitial: {airspeed_mps: 22, altitude_m: 6000}")):  # fmt: skip
        (tmp_path / f"{name}.yaml").write_text(text)
    files = [str(tmp_path / f"{name}.yaml") for name in "abcd"]
    with pytest.raises(BadInput) as caught:
        cli.load_all(files)
    lines = [line.removeprefix(f"{tmp_path}/")[:44] for line in str(caught.value).splitlines()]
    assert lines == [
        "c.yaml:2: rate_hz: 1 is out of range, allowe", "d.yaml:3: initial: no steady straight flight",
        "two scenarios are named x: one result would ",
    ]  # fmt: skip
    assert [scenario.name for scenario in cli.load_all([files[0], "fault-free"])] == ["x", "fault-free"]


@needs.service("flightgear")
@pytest.mark.parametrize(("given", "port"), [
    ("localhost:1", 1), ("localhost:65535", 65535), ("::1:0", None), ("localhost:65536", None),
    ("x:-1", None), (":80", None), ("localhost", None), ("localhost:8 0", None), ("localhost:0", None),
    ("localhost:x", None),
])  # fmt: skip
def test_where_a_flightgear_is(given, port):
    if port is None:
        says = f"--flightgear: {given!r} is no address, allowed: HOST:PORT with a port of 1 to 65535"
        with pytest.raises(BadInput, match=f"^{re.escape(says)}$"):
            run._shown(given)
    else:
        assert run._shown(given).keywords == {"host": "localhost", "port": port}
    assert run._shown(None) is None


def test_runs_end_with_the_worst_status_and_a_document_of_all(monkeypatch, capsys):
    ended = {"good": {"passed": True}, "bad": {"passed": False}, "lost": SimulationFailed("gone")}

    def one(scenario, options, prepare, drawn):
        if isinstance(ended[scenario.name], Exception):
            raise ended[scenario.name]
        return {"scenario": scenario.name, "folder": "f", **ended[scenario.name]}

    written = []
    monkeypatch.setattr(run, "_run_one", one)
    monkeypatch.setattr(
        run,
        "write_junit",
        lambda judged, path: written.append([(each.name, each.error, each.took_s > 0) for each in judged]),
    )
    for names, status in ((("good",), 0), (("good", "bad"), 1), (("lost", "bad"), 3), (("lost",), 3)):
        scenarios = [type("S", (), {"name": name})() for name in names]
        assert run._run_all(scenarios, run.Options(scenarios=[], format=Format.json), ((), ())) == status
        shown = capsys.readouterr()
        document = json.loads(shown.out)
        assert document["passed"] is (status == 0)
        assert [each.get("error") for each in document["runs"]] == [
            "gone" if name == "lost" else None for name in names
        ]
        assert ("scenario" in document) == (len(names) == 1)
        assert shown.err == ("gone\n" if "lost" in names else "")
        assert written[-1] == [(name, "gone" if name == "lost" else None, True) for name in names]


@pytest.mark.parametrize(
    ("flights", "kept"),
    [("none", ("none", set())), ("worst", ("worst", set())), ("3, 17", ("selected", {3, 17})), ("3,x", None)],
)
def test_flights_to_keep(flights, kept):
    if kept is None:
        with pytest.raises(
            BadInput, match=r"--keep-logs: '3,x' is not known, allowed: none, .*, or indices like 3,17"
        ):
            sweep._keep(flights)
    else:
        keep = sweep._keep(flights)
        assert (keep.policy, set(keep.runs)) == kept


def test_a_sweep_is_asked_to_stop_once_and_stopped_twice(capsys):
    import signal

    from beaver_ftc.studies.sweep.campaign import SweepStopped

    before = signal.getsignal(signal.SIGTERM)

    def stopped_twice():
        with sweep._stoppable() as stopped:
            assert not stopped()
            signal.raise_signal(signal.SIGTERM)
            assert stopped()
            assert capsys.readouterr().err.startswith("\nstopping: flights in the air have a second to land")
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(SweepStopped, match="stopped; what had landed is kept"):
        stopped_twice()
    if hasattr(signal, "setitimer"):
        assert signal.setitimer(signal.ITIMER_REAL, 0.0) == (0.0, 0.0)  # nothing goes off later
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.skipif(sys.platform == "win32", reason="there a second Ctrl-C ends it")
def test_flights_that_do_not_land_are_not_waited_for(monkeypatch):
    import signal
    import time

    from beaver_ftc.studies.sweep.campaign import SweepStopped

    monkeypatch.setattr(sweep, "LANDS_S", 0.01)

    def stopped_once():
        with sweep._stoppable():
            signal.raise_signal(signal.SIGINT)
            time.sleep(60.0)  # nothing lands

    with pytest.raises(SweepStopped, match="go on with --resume"):
        stopped_once()
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGALRM) is signal.SIG_DFL


def test_what_is_asked_of_a_sweep():
    arguments = sweep.Arguments("f.yaml", Path("o"), 3, sweep.Backend.ray, "auto", True, "all",
                                search=sweep.Objective.delay, no_report=True)  # fmt: skip
    asked = sweep._options(arguments)
    assert (asked.out, asked.workers, asked.backend, asked.address, asked.resume) == (
        Path("o"),
        3,
        "ray",
        "auto",
        True,
    )
    assert (asked.keep.policy, asked.report, asked.search, asked.source) == ("all", False, "delay", "f.yaml")
    usual = sweep._options(sweep.Arguments("f.yaml"))
    assert (usual.backend, usual.report, usual.search, usual.resume) == ("local", True, None, False)


def test_formats_of_figures_are_each_kept_once_and_without_spaces():
    assert run._formats("pdf, svg ,pdf") == ("pdf", "svg")
    with pytest.raises(BadInput, match=r"^--figures: 'gif' is no format, allowed: "):
        run._formats("svg,gif")


@pytest.mark.parametrize("terminal", [True, False])
def test_a_line_of_a_study_replaces_the_one_before_on_a_terminal_and_is_shown_nowhere_else(
    monkeypatch, terminal
):
    monkeypatch.setattr(sys, "stderr", Terminal(terminal))
    with cli.told() as tell:
        tell("one of two")
        tell("two")
        shown = sys.stderr.getvalue()
    assert shown == ("\r\033[Kone of two\r\033[Ktwo" if terminal else "")
    assert sys.stderr.getvalue() == shown + ("\r\033[K" if terminal else "")


class Warned:
    """A scenario of which there is something to say before it flies."""

    name = "mine"

    def warnings(self):
        return iter(("this", "that"))


WARNED = "mine: warning: this\nmine: warning: that\n"


@pytest.mark.parametrize("certified", [False, True])
def test_a_flight_is_flown_and_written_as_it_was_asked_for(monkeypatch, capsys, tmp_path, certified):
    given = []

    def write(scenario, out, with_report, progress, *others):
        given.append((scenario.name, out, with_report, *others))
        (out / scenario.name).mkdir()
        text = {"statements": [1, 2, 3], "without": ["a"], "flight": "x"}
        (out / scenario.name / "certificate.json").write_text(json.dumps(text))
        return {"passed": True}

    monkeypatch.setattr("beaver_ftc.results.writer.run", write)
    options = run.Options(
        ["mine"], tmp_path, no_report=certified, csv=True, acmi=certified, certificate=certified,
        recording=run.Recording.ulog if certified else None,
    )  # fmt: skip
    found = run._run_one(Warned(), options, "connect", ("painters", ("pdf", "svg")))
    assert capsys.readouterr() == ("", WARNED)
    exports, recording = (["csv", "acmi"], "ulog") if certified else (["csv"], None)
    wanted = ("mine", tmp_path, not certified, exports, "connect", recording, certified)
    assert given == [(*wanted, "painters", ("pdf", "svg"))]
    counted = {"certificate": {"statements": 3, "without": 1}} if certified else {}
    assert found == {"passed": True, "folder": str(tmp_path / "mine")} | counted


def test_what_is_said_of_a_scenario_is_said_before_its_errors_are_split(monkeypatch, capsys, tmp_path):
    given, said = [], []
    study = "beaver_ftc.studies.mismatch"
    monkeypatch.setattr(
        f"{study}.study.run_mismatch", lambda *of: given.append(of[:-1]) or ({"m": 1}, "tally")
    )
    monkeypatch.setattr(f"{study}.tables.mismatch_text", lambda *of: ("text", *of))
    scenario = Warned()
    found = mismatch._split(scenario, tmp_path, False, said.append)
    assert found == ({"m": 1, "folder": str(tmp_path / "mine")}, "tally")
    assert given == [(scenario, tmp_path, False)]
    assert said == [("text", {"m": 1}, str(tmp_path / "mine"), sys.stdout.isatty())]
    assert capsys.readouterr().err == WARNED
