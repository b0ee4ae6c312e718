"""How far a command has come, and what becomes of what goes wrong: line by line."""

import sys

import pytest

from beaver_ftc import cli
from beaver_ftc.cli import sweep
from beaver_ftc.documents.errors import BadInput


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
