"""How far a command has come, and what becomes of what goes wrong: line by line."""

import io
import sys
from collections import Counter

import pytest

from beaver_ftc import cli
from beaver_ftc.cli import sweep
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
