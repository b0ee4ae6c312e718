"""What a session tells of a flight, held whole: events, states and frames of scripted flights."""

import json
import sys
from math import pi
from types import SimpleNamespace

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.aircraft import load
from beaver_ftc.diagnosis import Verdict
from beaver_ftc.documents.errors import BadInput
from beaver_ftc_live.commands import live as live_command
from beaver_ftc_live.page import messages, reports
from beaver_ftc_live.page import serve as serve_module
from beaver_ftc_live.page import session as session_module
from beaver_ftc_live.page.session import Session, as_live, changes_of, fault_types

LOSS = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.4}
ADDED = {"scenarios", "laws", "schemes", "description", "columns", "sensors"}  # what others may add to


def asked(session, **request):
    return session.handle(messages.parse(json.dumps(request)))


def seen(session):
    """The state, the frame in short, and what has happened since."""
    frame = session.frame()
    values = frame.pop("v")
    assert len(values) == len(session.columns)
    frame["t_s"], frame["hidden"] = values[0], sum(value is None for value in values)
    events = [list(event.values()) for event in session.take_events()]
    return json.loads(messages.encode({"state": session.state(), "frame": frame, "events": events}))


@pytest.fixture
def session(tmp_path):
    return Session(bf.load("fault-free"), tmp_path, seed=1)


def _flown(session, frames):
    for _ in range(frames):
        session.step()


def test_a_flight_in_which_much_is_asked(session, changed):
    told = [{key: value for key, value in session.hello().items() if key not in ADDED}, seen(session)]
    script = [
        (150, {"do": "break", "fault": LOSS}), (150, {"do": "stick", "rates_deg_s": [1.5, 0, -0.5]}),
        (5, {"do": "blow", "velocity_mps": [0, 3, -1.5]}), (1, {"do": "repair", "actuator": "elevator"}),
        (202, {"do": "change", "law": "adaptive", "scheme": "adaptive-estimators"}),
        (2, {"do": "break", "fault": {"type": "bias", "sensor": "q", "magnitude": 4}}),
        (60, {"do": "repair"}), (5, {"do": "stick", "rates_deg_s": [0, 0, 0]}), (2, None),
    ]  # fmt: skip
    for frames, request in script:
        _flown(session, frames)
        told += [seen(session), asked(session, **request) if request else ""]
    assert not changed(told)


def test_a_round_by_chance_to_its_end(session, changed):
    asked(session, do="stick", rates_deg_s=[0.5, 0, 0])
    told = [asked(session, do="game", move="random"), seen(session)]
    with pytest.raises(BadInput, match="answer: 'nose' is not known"):
        asked(session, do="game", move="answer", answer="nose")
    while session.game.phase == "waiting":
        session.step()
    told.append(seen(session))
    _flown(session, 150)
    asked(session, do="game", move="answer", answer=session.game.fault["actuator"])
    while session.game.hidden:
        session.step()
    told += [seen(session), asked(session, do="game", move="stop"), seen(session)]
    assert not changed(told)


def test_how_long_a_gust_is_shown(session):
    """Half a second up, one held, half a second down, and the frame it ends with."""
    asked(session, do="blow", velocity_mps=[0, 3, 0])
    frames = 0
    while session.state()["gust"]:
        session.step()
        frames += 1
    assert frames == 201


def test_the_rates_of_a_coordinated_turn_are_seen_to_every_tenth_frame(session):
    asked(session, do="stick", rates_deg_s=[8, 0, 0], coordinated=True)
    sticks = {}
    for _ in range(200):
        session.step()
        sticks.setdefault(session.frame()["stick"], session.sim.frames - 1)
    assert len(sticks) > 5
    assert {frames % 10 for frames in list(sticks.values())[1:]} == {0}
    steps = np.array([stick for stick in sticks if stick is not None])
    rest = (steps - np.radians([8, 0, 0])) / np.radians(0.1)
    assert rest == pytest.approx(np.round(rest), abs=1e-9)


def test_the_latest_400_events_are_kept(session):
    for i in range(401):
        session._tell("test", str(i))
    assert [session.events[0]["says"], session.events[-1]["says"], len(session.events)] == ["1", "400", 400]
    assert len(session.take_events()) == 402
    assert len(session.hello()["events"]) == 400
    assert session.take_events() == []


def test_what_there_is_to_break_and_how_it_is_said(changed):
    assert not changed(fault_types())


def test_a_live_flight_is_an_hour_and_expects_nothing():
    given = bf.load({"name": "n" * 64, "expect": {"no_departure": True}, "fdi": {"fault_class": "published"}})
    flown = as_live(given)
    name, date, time, milliseconds = flown.name.rsplit("-", 3)
    assert name == "live-" + "n" * 60
    assert (len(date), len(time), len(milliseconds)) == (8, 6, 3)
    assert flown.duration_s == 3600.0
    assert (flown.fdi.fault_class, flown.fdi.sensor_monitor) == ("published", "always")
    assert not flown.expect.model_dump(exclude_none=True)
    own = as_live(bf.load({"name": "x", "fdi": {"sensor_monitor": "auto"}}))
    assert (own.fdi.fault_class, own.fdi.sensor_monitor) == ("all", "auto")


@pytest.mark.parametrize(
    "request_",
    [
        {}, {"law": "lqr", "scheme": "none", "fault_class": "all", "sensors": "ideal"},
        {"turbulence": "none", "autopilot": False}, {"turbulence": "severe", "autopilot": True},
    ],
)  # fmt: skip
def test_what_a_new_flight_changes(request_, changed):
    assert not changed(changes_of(messages.parse(json.dumps({"do": "fresh", **request_})), load()))


def test_words_of_what_is_asked(session, tmp_path):
    asked(session, do="fresh", autopilot=True)
    assert asked(session, do="aim", altitude_m=1850.5, heading_deg=20) == "altitude_m 1850.5, heading_deg 20"
    assert asked(session, do="blow", velocity_mps=[1, 0, -2.5]) == "gust"
    assert asked(session, do="change", sensors="ideal") == "sensors ideal"
    assert asked(session, do="change", law="lqr", scheme="none") == "law lqr, scheme none"
    hello = session.hello()  # of whoever comes now
    assert (hello["law"], hello["scheme"]) == ("lqr", "none")
    assert asked(session, do="stick", rates_deg_s=[0, 0, 0]) == ""
    says = [(event["kind"], event["says"]) for event in session.events][1:]
    assert says == [
        ("autopilot", "altitude_m 1850.5, heading_deg 20"),
        ("gust", "1, 0, -2.5 m/s (north, east, down)"),
        ("changed", "sensors ideal"),
        ("changed", "law lqr, scheme none"),
    ]
    assert session.stick.rates_deg_s == (0, 0, 0)
    assert asked(session, do="fresh", scenario="fault-free") == "new flight"
    assert session.scenario.autopilot is None
    assert session._rates_rad_s() is None
    asked(session, do="stick", rates_deg_s=[0, 18, 0])
    assert session._rates_rad_s() == pytest.approx((0.0, pi / 10, 0.0))


def test_each_turn_of_a_verdict_is_told_once(session, monkeypatch):
    """Alarm, candidates, name, then another type of the same surface; taken back, alarmed anew, lost."""
    jam = {"detected": True, "axis": "q", "isolated": "elevator", "type": "stuck"}
    turns = [
        ({"detected": True, "axis": "q"}, ["residual of q beyond its threshold"]),
        ({"detected": True, "axis": "q", "candidates": ("elevator", "flap")}, ["elevator, flap"]),
        (jam, ["elevator, stuck"]), (jam, []), (jam | {"type": "rate_limit"}, ["elevator, rate limit"]),
        (jam | {"type": "rate_limit", "estimate": 0.1}, []),
        (jam | {"isolated": "unanticipated", "type": "unanticipated"}, ["unanticipated"]),
        ({"detected": True, "axis": "q", "candidates": ("flap",)}, ["flap"]),
        ({"detected": True, "axis": "q", "candidates": tuple("abcdefghijk")}, ["11 remain; excluded: flap"]),
        (
            {"detected": True, "axis": "q", "candidates": tuple("abcde")},
            ["5 remain; excluded: f, g, h, i and 2 more"],
        ),
        ({"detected": True, "axis": "q"}, ["none left"]),
        ({"detected": True}, ["instruments disagree beyond their bound"]),
        ({"mode": "adaptive", "detected": True}, ["nominal to adaptive"]), ({}, ["adaptive to nominal"]),
        ({"departed": True}, ["the aircraft is lost; start a new flight"]), ({"departed": True}, []),
    ]  # fmt: skip
    session.take_events()
    for keys, says in turns:
        of = {"mode": "nominal", "departed": False} | keys
        sim = SimpleNamespace(
            t_s=1.0, mode=of.pop("mode"), departed=of.pop("departed"), verdict=Verdict(**of)
        )
        monkeypatch.setattr(session, "sim", sim)
        session._notice()
        assert [event["says"] for event in session.take_events()] == says, keys


def test_what_a_page_waits_for_is_told_whatever_hides_the_rest(session, monkeypatch):
    """The diagnosis has 10 s once somebody has answered; a scenario's own faults come and go unseen."""
    asked(session, do="game", move="second")
    with pytest.raises(BadInput, match="a round is on, allowed: changes after it"):
        asked(session, do="change", law="lqr")
    asked(session, do="break", fault={"type": "bias", "actuator": "flap", "bias_deg": 0.001})
    asked(session, do="game", move="answer", answer="nothing")
    answered_s = session.sim.t_s
    while session.game.hidden:
        session.step()
    assert session.sim.t_s - answered_s == pytest.approx(10.0, abs=0.011)
    assert session.state()["game"]["winner"] is None
    assert asked(session, do="fresh", scenario="rudder-stuck") == "new flight"
    assert [fault.actuator for fault in session.scenario.faults] == ["rudder"]
    assert session.state()["game"]["phase"] == "idle"
    asked(session, do="game", move="second")
    assert session.scenario.faults == ()  # what is hidden is not what the scenario says
    asked(session, do="fresh")
    assert [fault.actuator for fault in session.scenario.faults] == ["rudder"]
    assert session.state()["game"]["phase"] == "over"


def test_faults_of_the_scenario_are_told_when_they_come_and_end(tmp_path):
    """Two at the same instant, one that ends, one there from the start."""
    jam = {"type": "stuck", "actuator": "rudder", "at_s": 0.1, "end_s": 0.2}
    faults = [{**LOSS, "at_s": 0.1}, jam, {"type": "float", "actuator": "flap", "at_s": 0.0, "end_s": 0.3}]
    session = Session(bf.load({"name": "x", "faults": faults}), tmp_path)
    _flown(session, 40)
    own = [list(event.values()) for event in session.events if event["kind"] in ("broken", "repaired")]
    assert own == [
        [0.02, "broken", "flap: float", True],
        [0.1, "broken", "elevator: loss of effectiveness (magnitude 0.4)", True],
        [0.1, "broken", "rudder: stuck", True],
        [0.2, "repaired", "rudder: stuck", True],
        [0.3, "repaired", "flap: float", True],
    ]


def test_what_the_session_was_given_can_be_flown_again_and_files_cannot(session):
    given = bf.load({"name": "mine", "seed": 77})
    own = Session(given, session._out)
    asked(own, do="fresh", scenario="fault-free")
    assert own.hello()["scenario"] == "fault-free"
    assert "mine" in own.hello()["scenarios"]
    asked(own, do="fresh", scenario="mine", law="lqr")
    assert (own.scenario.seed, own.scenario.control.law, own.hello()["law"]) == (77, "lqr", "lqr")
    with pytest.raises(BadInput, match="scenario: 'fault-fre' is not known, did you mean fault-free"):
        asked(own, do="fresh", scenario="fault-fre")


def test_a_saved_flight_is_said_and_its_report_is_to_be_drawn(session, tmp_path, monkeypatch):
    asked_for = []

    def save(_, out, report):
        asked_for.append((out, report))
        return out / "x"

    monkeypatch.setattr(bf.Flight, "save", save)
    says = asked(session, do="save")
    assert asked_for == [(tmp_path, False)]
    assert says == f"saved: {tmp_path / 'x'}; fly it again: beaver-ftc run {tmp_path / 'x' / 'scenario.yaml'}"
    asked(session, do="stick", rates_deg_s=[1, 0, 0])
    assert asked(session, do="save") == says
    assert len(asked_for) == 1  # of an instant once, though it is pressed again and again
    for changes in (session.step, lambda: asked(session, do="break", fault=LOSS)):
        changes()
        asked(session, do="save")
    assert len(asked_for) == 3
    assert session.unreported == [tmp_path / "x"] * 3
    assert session.events[-1]["says"] == "x"  # guests hear this: no folder of whoever flies


def test_a_saved_flight_says_of_each_fault_who_broke_it(tmp_path, monkeypatch):
    """Those of the scenario come before, between and after those of the guests, and not in their order."""
    own = [
        {"type": "float", "actuator": "flap", "at_s": at_s, "end_s": at_s + 0.02}
        for at_s in (0.06, 0.11, 0.01)
    ]
    session, saved = Session(bf.load({"name": "own", "faults": own}), tmp_path), []
    monkeypatch.setattr(bf.Flight, "save", lambda flight, out, report: saved.append(flight) or out / "x")
    for by, surface in (("Ada", "rudder"), ("", "aileron"), ("Bo", "elevator")):
        request = {"do": "break", "fault": LOSS | {"actuator": surface}}
        session.handle(messages.parse(json.dumps(request)), by)
        _flown(session, 3)
    asked(session, do="repair", actuator="rudder")
    _flown(session, 3)
    asked(session, do="save")
    found = [(fault["at_s"], fault["actuator"], fault.get("by")) for fault in saved[0].metrics["faults"]]
    assert found == [
        (0.01, "flap", None), (0.02, "rudder", "Ada"), (0.05, "aileron", None), (0.06, "flap", None),
        (0.08, "elevator", "Bo"), (0.11, "flap", None),
    ]  # fmt: skip


def test_reports_are_drawn_one_by_one_and_what_waits_at_the_end_all_the_same(tmp_path, monkeypatch):
    begun = []

    class Drawing:
        returncode = None

        def __init__(self, *folders):
            begun.append([folder.name for folder in folders])

        def poll(self):
            return self.returncode

        def communicate(self):
            return None, "Traceback\nno room\n" if self.returncode else ""

    monkeypatch.setattr(reports, "_begun", Drawing)
    drawn = reports.Reports()
    assert drawn.news() == []
    for name in "aabbcd":
        drawn.add(tmp_path / name)
    assert (begun, drawn.news()) == ([["a"]], [])
    for status, says in ((1, []), (0, ["a/report.html"]), (1, ["b: without a report: no room"])):
        drawn._drawing[1].returncode = status
        assert drawn.news() == says
    assert begun == [["a"], ["a"], ["b"], ["c"]]  # a was saved again while it was drawn
    drawn.leave()
    assert begun[4:] == [["d"]]


def test_a_report_that_cannot_be_drawn_leaves_the_folder_as_it_was(tmp_path, monkeypatch):
    (tmp_path / "metrics.json").write_text("{}")
    monkeypatch.setattr(sys, "argv", ["draw", str(tmp_path / "gone"), str(tmp_path)])
    monkeypatch.setattr(reports.os, "nice", lambda by: by, raising=False)
    with pytest.raises(SystemExit, match=r"report.html could not be written: .*log.parquet"):
        reports.draw()
    assert [path.name for path in tmp_path.iterdir()] == ["metrics.json"]


def test_another_aircraft_has_none_of_the_errors_that_the_scenario_gives_its_own():
    name = next(name for name in bf.scenarios() if bf.load(name).uncertainty.inertia_coupling.p)
    given = bf.load(name)
    for same in (None, str(given.aircraft)):
        assert live_command._with(same, name) == given
    healthy = next(name for name in bf.scenarios() if not bf.load(name).faults)
    other = live_command._with("beaver-split", healthy)
    assert (other.airframe.name, other.duration_s) == ("beaver-split", bf.load(healthy).duration_s)
    assert other.uncertainty == bf.load({"name": "x"}).uncertainty


def test_a_terminal_is_told_whose_link_is_whose(capsys):
    live_command._point_to("http://a", [], "")
    assert capsys.readouterr().out == "live: http://a\nOpen it in a browser; Ctrl-C ends the flight.\n"
    live_command._point_to("http://a", ["http://b", "http://c"], "anyone\n")
    assert capsys.readouterr().out.splitlines() == [
        "live: http://a", "guest 1: http://b", "guest 2: http://c", "anyone",
        "Open the first in a browser, give a guest one of the others; Ctrl-C ends the flight.",
    ]  # fmt: skip


def test_of_a_flight_that_is_over_all_may_be_asked_but_what_flies_on(session, monkeypatch):
    done = []
    for do in (*ASKS, "fresh", "save", "stick", "game"):
        monkeypatch.setattr(session, f"_{do}", lambda request: done.append(request.do) or "done")
    for over in (False, True):
        monkeypatch.setattr(Session, "over", over)
        done.clear()
        for do, more in ASKS.items():
            if over:
                with pytest.raises(BadInput, match=r"^the flight is over, allowed: a new flight$"):
                    asked(session, do=do, **more)
            else:
                assert asked(session, do=do, **more) == "done"
        for do, more in (("fresh", {}), ("save", {}), ("stick", {"rates_deg_s": [0, 0, 0]}),
                         ("game", {"move": "stop"})):  # fmt: skip
            assert asked(session, do=do, **more) == "done"
        assert done == [*(() if over else ASKS), "fresh", "save", "stick", "game"]


ASKS = {
    "break": {"fault": LOSS}, "repair": {}, "blow": {"velocity_mps": [0, 1, 0]}, "aim": {"altitude_m": 1},
    "change": {"law": "lqr"},
}  # fmt: skip


def test_sensors_that_are_exchanged_are_declared_as_well(session, monkeypatch):
    """Law and diagnosis are what is asked, and no more is said of the flight than that."""
    changed = []
    monkeypatch.setattr(session.sim, "change", changed.append)
    before = dict(session.flying)
    for request in ({"sensors": "consumer-grade", "law": "lqr"}, {"scheme": "none"}):
        asked(session, do="change", **request)
    grade = "consumer-grade"
    assert changed == [{"law": "lqr", "sensors": grade, "declared_sensors": grade}, {"scheme": "none"}]
    assert session.flying == before | {"law": "lqr", "sensors": grade, "scheme": "none"}


def test_an_autopilot_holds_what_the_aircraft_can_be_asked_for(monkeypatch):
    fresh = messages.parse(json.dumps({"do": "fresh", "autopilot": True}))
    monkeypatch.setattr(session_module, "channels_of", lambda of: ("bank_deg", "heading_deg", "altitude_m"))
    held = {"altitude_m": [{"hold": True}], "heading_deg": [{"hold": True}]}
    assert changes_of(fresh, load()) == {"autopilot": held}


@pytest.mark.parametrize(
    ("host", "guests", "found", "warned"),
    [
        ("127.0.0.1", None, 0, False), ("127.0.0.1", 3, 3, False), ("192.0.2.77", None, 10, True),
        ("192.0.2.77", 0, 0, True), ("192.0.2.77", 4, 4, True),
    ],
)  # fmt: skip
@pytest.mark.parametrize("opens", [False, True])
def test_the_command_listens_for_as_many_guests_as_are_asked_for(
    monkeypatch, capsys, tmp_path, host, guests, found, warned, opens
):
    """Ten on an address that others reach, none on the loopback; who reaches it is said."""
    served, opened = [], []
    monkeypatch.setattr(serve_module, "serve", lambda *of: served.extend(of))
    monkeypatch.setattr("webbrowser.open", opened.append)
    live_command.command("fault-free", "beaver-split", 8001, host, guests, tmp_path, opens)
    load_it, out, place, say = served
    assert (load_it().airframe.name, out) == ("beaver-split", tmp_path)
    assert place == serve_module.Place(8001, host, found)
    say("http://a", ["http://b"])
    printed = capsys.readouterr().out
    assert printed.startswith("live: http://a\nguest 1: http://b\n")
    assert (f"live: {host} is no loopback: anyone" in printed) == warned
    assert opened == (["http://a"] if opens else [])


@pytest.mark.parametrize("fails", [[False, True, False], [False, False, False], [True, False, False]])
def test_every_report_is_drawn_courteously_and_a_failure_is_the_end(tmp_path, monkeypatch, fails):
    """A folder that is gone is passed over."""
    folders, drawn, niced = [tmp_path / name for name in "abcd"], [], []
    for folder in (folders[0], *folders[2:]):
        folder.mkdir()
        (folder / "metrics.json").write_text(json.dumps({"name": folder.name}))

    def add_report(folder, document):
        drawn.append((folder, document["name"]))
        return f"no room for {folder.name}" if fails[len(drawn) - 1] else ""

    monkeypatch.setattr("beaver_ftc.results.add_report", add_report)
    monkeypatch.setattr(sys, "argv", ["draw", *map(str, folders)])
    monkeypatch.setattr(reports.os, "nice", niced.append, raising=False)
    with pytest.raises(SystemExit) as ended:
        reports.draw()
    assert drawn == [(folder, folder.name) for folder in (folders[0], *folders[2:])]
    assert niced == [10]
    names = [folder.name for (folder, _), failed in zip(drawn, fails, strict=True) if failed]
    assert ended.value.code == (f"no room for {names[0]}" if names else 0)
