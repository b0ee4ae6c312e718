"""Which evidence is looked for of each event, in which frames, and what is said where there is none."""

from math import inf
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from beaver_ftc.diagnosis import LOSS, scheme_number
from beaver_ftc_assurance.certificates import blocks, certificate, chance, inequality, kinds
from beaver_ftc_assurance.certificates import tape as tape_module
from beaver_ftc_assurance.certificates.blocks import by_blocks, in_blocks, log_rows_of
from beaver_ftc_assurance.certificates.certificate import statements
from beaver_ftc_assurance.certificates.inequality import DeclaredErrors, History, Hypothesis, Term
from telling import numbers

POLES = [0.7, 3.0]


def note(asked: list[Any], what: Any, answer: Any = None) -> Any:
    """Keep what was asked, and answer."""
    asked.append(what)
    return answer


def plain(terms):
    """Direction, pole, first and last frame of each of a candidate's terms, and the fault's effect before."""
    return [(one.direction.tolist(), one.pole_per_s, one.filter_start, one.last_frame, one.effect_before)
            for one in terms]  # fmt: skip


def along(axes):
    return [[sign * (i == axis) for i in range(3)] for axis in axes for sign in (1.0, -1.0)]


@pytest.fixture
def tried(monkeypatch):
    """Every inequality that is tried, and the hypothesis it is to exclude; none is found."""
    found: list[tuple[list[Any], Hypothesis]] = []
    monkeypatch.setattr(
        certificate,
        "_first_violated",
        lambda candidates, of, history, tape: found.append(([*candidates], of)),
    )
    monkeypatch.setattr(certificate, "_detection_poles", lambda scenario: POLES)
    return found


def test_an_alarm_is_looked_for_in_its_frame_and_in_each_filter_since_the_diagnosis_began(tried):
    flown = SimpleNamespace(first=5, end=20, since=7)
    assert certificate._alarm_inequality(None, flown, None, 7) is None
    assert tried == []
    certificate._alarm_inequality(None, flown, None, 9)
    ((candidates, health),) = tried
    expected = [(d, inf, 8, 9, 0.0) for d in along(range(3))]
    expected += [(d, pole, 7, 9, 0.0) for pole in POLES for d in along(range(3))]
    assert [plain(one) for one in candidates] == [[one] for one in expected]
    assert (health.first_frame, health.offset.shape, health.theta_low, health.theta_high) == (
        5,
        (15, 3),
        0,
        0,
    )
    assert not health.offset.any()


@pytest.mark.parametrize("axes", [(0, 2), (0, 1, 2)])
@pytest.mark.parametrize("k", [9, 12])
@pytest.mark.parametrize(("kind", "profile", "thresholds", "last"), [
    (LOSS, "abrupt", "published", "constant"), (LOSS, "incipient", "published", "filter"),
    (LOSS + 1, "abrupt", "published", "filter"), (LOSS, "incipient", "adaptive", ""),
    (LOSS + 1, "abrupt", "adaptive", ""),
])  # fmt: skip
def test_an_exclusion_is_looked_for_in_frames_then_filters_then_with_a_constant_parameter(
    tried, monkeypatch, axes, k, kind, profile, thresholds, last
):
    """Of the second estimator, after an alarm in frame 9; a parity direction only of three axes."""
    offset, slope, spread = (numbers(9, 3, 3, seed=seed) for seed in range(3))
    low, high = numbers(3, 2, 4, seed=3), numbers(3, 2, 4, seed=4)
    across = np.array([0.2, -0.3, 0.4])
    estimators = [None, SimpleNamespace(active_axes=axes, theta_min=-0.4, theta_max=0.9, hypothesis_kind=kind,
                                        parity_direction=across)]  # fmt: skip
    flown = SimpleNamespace(
        first=5, since=7, offset=offset, slope=slope, spread=spread, reach_low=low, reach_high=high,
        alarm=SimpleNamespace(diagnosis=SimpleNamespace(estimators=estimators)),
    )  # fmt: skip
    fdi = SimpleNamespace(isolation_pole_per_s=2.5, fault_profile=profile, thresholds=thresholds)
    asked: list[Any] = []
    monkeypatch.setattr(
        certificate,
        "constant_theta_tests",
        lambda of, history, frames: note(asked, (of, history, frames.tolist()), []),
    )
    assert certificate._exclusion_inequality(SimpleNamespace(fdi=fdi), flown, "log", 1, 9, k) is None
    (candidates, of), (again, lasting) = tried
    for given, expected in ((of.offset, offset), (of.slope, slope), (of.spread, spread)):
        np.testing.assert_array_equal(given, expected[:, 1])
    assert (of.first_frame, of.theta_low, of.theta_high, of.axes) == (5, -0.4, 0.9, axes)
    assert (of.theta_is_constant, lasting.theta_is_constant, lasting.theta_low) == (False, True, -0.4)
    pairs = len(axes) * (len(axes) - 1)  # of two axes, both ways
    one_by_one = [plain(one)[0] for one in candidates]
    single, rest = one_by_one[: 2 * len(axes) + pairs], one_by_one[2 * len(axes) + pairs :]
    assert {one[1:] for one in single} == {(inf, k - 1, k, 0.0)}
    expected_rest: list[tuple[list[float], float, int, int, float]] = []
    for m, pole in enumerate(POLES):
        for i in axes:
            ends = zip(along((i,)), (high[1, m, i], -low[1, m, i]), strict=True)
            expected_rest += [(d, pole, 7, k, reach) for d, reach in ends]
        if len(axes) == 3:
            expected_rest += [(across.tolist(), pole, 7, k, high[1, m, 3]),
                              ((-across).tolist(), pole, 7, k, -low[1, m, 3])]  # fmt: skip
    since_alarm = [(d, 2.5, 9, k, 0.0) for d in along(axes)] if k > 9 else []
    assert rest == expected_rest + since_alarm
    assert asked == ([(lasting, "log", [*range(9, k + 1)])] if last == "constant" else [])
    filters = [plain(one)[0] for one in again if one]
    assert filters == (since_alarm if last == "filter" else [])


def test_the_first_inequality_that_the_data_violate_is_taken_with_what_the_tape_has(monkeypatch):
    terms = [Term(np.eye(3)[i], 1.0, 2, 9) for i in range(3)]
    judged = []

    def violated(known, of, history):
        judged.append((known[0].first_kept_frame, of, history))
        return not known[0].direction[0]

    monkeypatch.setattr(certificate, "is_violated", violated)
    flown = SimpleNamespace(first=6)
    candidates = [[], [terms[0]], [terms[1], terms[0]], [terms[2]]]
    found, of = certificate._first_violated(candidates, "fault", "log", flown)
    assert [(one.direction.tolist(), one.first_kept_frame) for one in found] == [
        ([0, 1, 0], 6),
        ([1, 0, 0], 6),
    ]
    assert (of, judged) == ("fault", [(6, "fault", "log")] * 2)
    assert certificate._first_violated(candidates[:2], "fault", "log", flown) is None


OURS = scheme_number("adaptive-estimators")
SEEN = {"test": "V", "sides": [2.0, 1.0]}
WEIGHED = {"likelihood": "flap_likelihood_share", "sides": [[2.0], [1.0]]}


def said_of(
    monkeypatch, found=("alarm", "flap"), fdi=(), watch=None, diagnosis=(), weighed=None, excludes=()
):
    """Statements of an alarm in row 4 and exclusions of a flap in row 12, of a rudder in row 30, the first
    after the tape, and of an elevator in the log's first row. found: what an inequality is found of."""
    names = ("flap", "rudder", "elevator", "aileron")

    def inequality(of):
        return (of, "fault") if of in found else None

    asked: list[Any] = []
    monkeypatch.setattr(
        certificate, "_alarm_inequality", lambda *of: note(asked, of[1:], inequality("alarm"))
    )
    monkeypatch.setattr(
        certificate, "_exclusion_inequality", lambda *of: note(asked, of[1:], inequality(names[of[3]]))
    )
    monkeypatch.setattr(certificate, "inequality_fields", lambda terms, of, history: {"terms": terms})
    monkeypatch.setattr(certificate.instruments_say, "instrument_alarm_statement", lambda monitor: watch)
    monkeypatch.setattr(chance, "alarm_statement", lambda *of: note(asked, of, weighed))
    monkeypatch.setattr(
        chance, "alarm_excludes", lambda flown, e, alarm: (names[e], alarm["frame"]) in excludes
    )
    monkeypatch.setattr(certificate, "_type_statements", lambda *of: [of])
    raised = SimpleNamespace(has_raised_alarm=watch is not None)
    its = {"estimators": [1], "enabled": True, "scheme_number": OURS, "sensor_monitor": raised}
    its |= dict(diagnosis)
    flown = SimpleNamespace(names=names, end=30, alarm=SimpleNamespace(diagnosis=SimpleNamespace(**its)))
    scenario = SimpleNamespace(
        fdi=SimpleNamespace(**{"statistical": None, "fault_class": "published"} | dict(fdi)),
        airframe=SimpleNamespace(surfaces="surfaces"),
    )
    history = SimpleNamespace(statement_fields={"block": [1]})
    events = {"fie_rudder_excluded": 30, "fie_flap_excluded": 12, "fie_elevator_excluded": 0, "detected": 4}
    return [*statements(scenario, flown, history, events)], asked, flown, history


ALARM = {"what": None, "column": "detected", "frame": 4}
FLAP = {"what": "flap", "column": "fie_flap_excluded", "frame": 12}
RUDDER = {"what": "rudder", "column": "fie_rudder_excluded", "frame": 30, "because": certificate.TOO_LATE}
ELEVATOR = {"what": "elevator", "column": "fie_elevator_excluded", "frame": 0}
UNKNOWN = {"because": chance.EXCLUSION_NOT_STATED}


def test_an_event_has_its_inequality_or_why_there_is_none(monkeypatch):
    """In the log's first row there is no innovation, and after the tape nothing is known."""
    found, asked, flown, history = said_of(monkeypatch)
    assert found == [
        ALARM | {"block": [1], "terms": "alarm"}, FLAP | {"block": [1], "terms": "flap"}, RUDDER,
        ELEVATOR | UNKNOWN,
    ]  # fmt: skip
    assert asked == [(flown, history, 4), (flown, history, 0, 4, 12)]
    found, _, _, _ = said_of(monkeypatch, found=())
    assert found == [ALARM | {"because": chance.ALARM_NOT_STATED}, FLAP | UNKNOWN, RUDDER, ELEVATOR | UNKNOWN]


def test_an_alarm_without_an_inequality_is_that_of_instruments_or_of_chance(monkeypatch):
    statistical = {"statistical": "declared"}
    for given, said in (
        ({"watch": SEEN}, ALARM | SEEN),
        ({"watch": SEEN, "fdi": statistical, "weighed": WEIGHED}, ALARM | SEEN),
        ({"fdi": statistical, "weighed": WEIGHED}, ALARM | WEIGHED), ({"weighed": WEIGHED}, None),
        ({"fdi": statistical}, None),
        ({"found": ("alarm",), "watch": SEEN, "fdi": statistical, "weighed": WEIGHED},
         ALARM | {"block": [1], "terms": "alarm"}),
    ):  # fmt: skip
        found, asked, flown, history = said_of(monkeypatch, **{"found": (), **given})
        assert found[0] == (said or ALARM | {"because": chance.ALARM_NOT_STATED})
        weighed = [(flown, history, "surfaces", 4)] if "watch" not in given and "fdi" in given else []
        assert [one for one in asked if "surfaces" in one] == weighed


def test_where_the_alarm_excludes_that_is_the_evidence_if_there_is_no_other(monkeypatch):
    """Of a row that the tape has: also of the log's first."""
    excludes = [(name, 4) for name in ("flap", "rudder", "elevator")]
    found, _, _, _ = said_of(monkeypatch, excludes=excludes)
    assert found[1:] == [FLAP | {"block": [1], "terms": "flap"}, RUDDER, ELEVATOR | {"as": "alarm"}]
    found, _, _, _ = said_of(monkeypatch, found=("alarm",), excludes=excludes)
    assert found[1] == FLAP | {"as": "alarm"}


@pytest.mark.parametrize("other", [{"estimators": []}, {"enabled": False}, {"scheme_number": OURS + 1}])
def test_of_another_scheme_only_instruments_say_something(monkeypatch, other):
    found, _, _, _ = said_of(monkeypatch, diagnosis=other)
    assert found == [ALARM | {"because": "another scheme was in charge"}]
    assert said_of(monkeypatch, diagnosis=other, watch=SEEN)[0] == [ALARM | SEEN]


def test_types_come_last_where_all_of_them_are_diagnosed(monkeypatch):
    found, _, flown, history = said_of(monkeypatch, fdi={"fault_class": "all"})
    assert len(found) == 5
    assert found[-1][1:] == (flown, history, 4)


ROWS = {  # what is followed over many frames, what a frame says, and what no rule knows
    0: SimpleNamespace(frames_test="swing", deflection_relation=None),
    1: SimpleNamespace(frames_test="", deflection_relation="relation"),
    2: SimpleNamespace(frames_test="", deflection_relation=None),
}
BY_MANY = {"because": kinds.EXCLUDED_BY_MANY_FRAMES}


def of_types(monkeypatch, excluded, frames_per_block=1, n_types=3, constant=True, reason=None, found=True):
    """Statements of excluded (surface, type, frame); in blocks frames, tape and alarm are other ones."""

    def tape(name, first, length):
        return SimpleNamespace(
            name=name, first=first, types=np.zeros((length, 2, 3)),
            alarm=SimpleNamespace(diagnosis=SimpleNamespace(
                types_config=SimpleNamespace(frames_per_block=frames_per_block))),
        )  # fmt: skip

    rows, whole = tape("rows", 10, 5), tape("blocks", 2, n_types)
    zeros = np.zeros((40, 3))
    log = History(0.02, 1.0, zeros, zeros, zeros, None)
    asked: list[Any] = []
    in_whole = by_blocks(log, 4, 3)
    monkeypatch.setattr(
        certificate, "in_blocks", lambda t, h, a: note(asked, (t.name, a), (whole, in_whole, 5))
    )
    monkeypatch.setattr(kinds, "excluded_types", lambda t: note(asked, t.name, iter(excluded)))
    monkeypatch.setattr(kinds, "reason_not_certified", lambda t, kind: reason)
    monkeypatch.setattr(kinds, "exclusion_row", lambda t, s, kind: (t.name, s, kind))
    monkeypatch.setattr(kinds, "exclusion_name", lambda surface, kind: f"{surface} {kind}")
    monkeypatch.setattr(kinds, "exclusion_column", lambda surface, kind: f"{surface}_{kind}")
    monkeypatch.setattr(certificate, "TYPES", ROWS)
    held = SimpleNamespace(theta_is_constant=constant, axes=(1,))
    monkeypatch.setattr(kinds, "hypothesis_held_anywhere", lambda t, s: ("held", t.name, s))
    monkeypatch.setattr(
        kinds, "hypothesis_of_type", lambda t, s, kind: note(asked, ("of", t.name, s, kind), held)
    )
    monkeypatch.setattr(
        certificate.courses,
        "statement_by_course",
        lambda *of: note(
            asked, ("course", of[1].name, of[2] is log, *of[3:]), {"theta": "course"} if found else None
        ),
    )
    monkeypatch.setattr(
        kinds, "candidate_inequalities", lambda of, history, alarm, k: (history is log, alarm, k)
    )
    monkeypatch.setattr(
        blocks.Blocks, "summed_frame_tests", lambda self, k, axes, first: ("sums", k, axes, first)
    )

    def first(candidates, of, history, tape):
        asked.append((candidates, history is log, tape.name))
        return ("terms", of) if found else None

    monkeypatch.setattr(certificate, "_first_violated", first)
    monkeypatch.setattr(certificate, "inequality_fields", lambda terms, of, history: {"terms": terms})
    scenario = SimpleNamespace(airframe=SimpleNamespace(surfaces=("flap", "rudder")))
    return [*certificate._type_statements(scenario, rows, log, 12)], asked


def test_a_type_is_excluded_by_its_course_or_by_its_frames(monkeypatch):
    def about(s, kind):
        surface = ("flap", "rudder")[s]
        return {"what": f"{surface} {kind}", "column": f"{surface}_{kind}", "frame": ("rows", s, kind)}

    excluded = [(1, 0, 14), (0, 1, 13), (0, 2, 12)]
    found, asked = of_types(monkeypatch, excluded)
    assert found == [about(1, 0) | {"theta": "course"}, about(0, 1) | {"terms": "terms"},
                     about(0, 2) | {"because": kinds.UNKNOWN_TYPE}]  # fmt: skip
    assert asked == ["rows", ("course", "rows", True, ("held", "rows", 1), 1, 0, 12), ("of", "rows", 0, 1),
                     ((True, 12, 13), True, "rows")]  # fmt: skip
    found, _ = of_types(monkeypatch, excluded, found=False)
    assert found == [about(1, 0) | BY_MANY, about(0, 1) | BY_MANY,
                     about(0, 2) | {"because": kinds.UNKNOWN_TYPE}]  # fmt: skip
    found, _ = of_types(monkeypatch, excluded, reason="another reason")
    assert found == [about(s, kind) | {"because": "another reason"} for s, kind, _ in excluded]
    of_block = {"block": [4, 3, 39]}
    found, asked = of_types(monkeypatch, excluded, frames_per_block=4)
    assert found[:2] == [
        about(1, 0) | of_block | {"theta": "course"},
        about(0, 1) | of_block | {"terms": "terms"},
    ]
    assert asked == [
        ("rows", 12), "blocks", ("course", "blocks", False, ("held", "blocks", 1), 1, 0, 5),
        ("of", "blocks", 0, 1), ((False, 5, 13), False, "blocks"),
    ]  # fmt: skip
    found, asked = of_types(monkeypatch, excluded[1:2], frames_per_block=4, constant=False)
    assert found == [about(0, 1) | {"terms": "terms"}]
    of_rows = (("sums", 13, (1,), 10), True, "rows")  # the tape whose frames these are, and its first one
    assert asked[2:] == [("of", "blocks", 0, 1), ("of", "rows", 0, 1), of_rows]
    found, asked = of_types(monkeypatch, excluded, frames_per_block=4, n_types=0)  # no block is whole
    assert found == [about(s, kind) | BY_MANY for s, kind, _ in excluded]
    assert asked == [("rows", 12), "rows"]


def test_a_type_is_excluded_from_the_frame_on_in_which_it_was_first_and_for_good():
    """Two surfaces, the second of which cannot be at fault; of three types on the first one is left, one is
    excluded from frame 12 on, and one was before, and taken back."""
    types = np.zeros((6, 2, 3))
    types[2:, 0, 1] = types[4:, 0, 2] = types[0, 0, 2] = 1.0
    types[:, 1] = 1.0
    layout = SimpleNamespace(position_estimator_index_by_surface=(3, 1))
    excluded = np.zeros((6, 4))
    excluded[:, 1] = excluded[:5, 3] = 1.0
    flown = SimpleNamespace(
        first=10, types=types, excluded=excluded,
        alarm=SimpleNamespace(diagnosis=SimpleNamespace(layout=layout)),
    )  # fmt: skip
    assert [*kinds.excluded_types(flown)] == [(0, 1, 12), (0, 2, 10)]
    assert [kinds.exclusion_row(flown, 0, kind) for kind in (1, 2)] == [12, 14]
    assert kinds.exclusion_row(flown, 1, 0) == 10


@pytest.mark.parametrize(("single", "returns", "has_shown", "released", "because"), [
    (True, True, "f", None, None), (False, True, "f", None, kinds.OSCILLATION_AT_STOP),
    (False, True, None, None, None), (True, True, None, "f", kinds.RETURNING_SURFACE),
    (True, False, None, "f", None), (False, True, "f", "f", kinds.OSCILLATION_AT_STOP),
])  # fmt: skip
def test_of_what_may_come_back_or_stay_at_a_stop_nothing_is_certified(
    monkeypatch, single, returns, has_shown, released, because
):
    row = SimpleNamespace(has_shown=has_shown, on_possible_release=released)
    monkeypatch.setattr(kinds, "TYPES", ("another", row))
    config = SimpleNamespace(single_instant=single, returns_lagged=returns)
    diagnosis = SimpleNamespace(types_config=config)
    flown = SimpleNamespace(alarm=SimpleNamespace(diagnosis=diagnosis))
    assert kinds.reason_not_certified(flown, 1) == because


@pytest.mark.parametrize("moves", [True, False])
def test_a_type_of_one_number_is_looked_for_in_frames_since_the_alarm_that_health_does_not_explain(
    monkeypatch, moves
):
    """Two frames that no number explains, and then each of the last three; of a number that may vary the
    frame of the exclusion and the one before."""
    monkeypatch.setattr(kinds, "constant_theta_tests", lambda of, history, frames: ["two", *frames])
    monkeypatch.setattr(kinds, "single_frame_tests", lambda frame, of: [("one", frame)])
    monkeypatch.setattr(kinds, "is_unexplained_by_health", lambda history, frames: frames % 5 != 0)
    of = SimpleNamespace(theta_is_constant=True, slope=np.array([0.0, 0.3 * moves]), first_frame=11)
    found = [*kinds.candidate_inequalities(of, None, 14, 21)]
    assert found[: int(moves)] == [["two", 14, 16, 17, 18, 19, 21]] * moves
    frames = [plain(one)[0] for one in found[int(moves) :]]
    assert frames == [(d, inf, k - 1, k, 0.0) for k in (18, 19, 21) for d in along(range(3))]
    varies = SimpleNamespace(theta_is_constant=False, first_frame=11)
    assert [*kinds.candidate_inequalities(varies, None, 14, 21)] == [("one", 20), ("one", 21)]
    of.first_frame = varies.first_frame = 21
    found = [*kinds.candidate_inequalities(of, None, 14, 21)]
    assert found[: int(moves)] == [["two", 21]] * moves
    assert {plain(one)[0][3] for one in found[int(moves) :]} == {21}
    assert [*kinds.candidate_inequalities(varies, None, 14, 21)] == [("one", 21)]
    assert [*kinds.candidate_inequalities(of, None, 22, 21)] == []  # the alarm came after this frame


def test_blocks_are_those_that_types_were_tested_with():
    """Of four rows, the first of which begins with row 3: the alarm, in row 21, came with three of one."""
    x, model, eta_bar = (numbers(41, 3, seed=seed) for seed in range(3))
    declared = DeclaredErrors(*(np.full(3, 0.01 * (i + 1)) for i in range(2)), 0.3, np.full(3, 1.2),
                              *(np.full(3, 0.01 * (i + 5)) for i in range(3)))  # fmt: skip
    log = History(0.02, 1.0, x, model, np.abs(eta_bar), declared)
    kept = {
        name: numbers(23, 2, seed=seed) for seed, name in enumerate(("offset", "slope", "spread", "types"))
    }
    diagnosis = SimpleNamespace(types_config=SimpleNamespace(frames_per_block=4), n_frames_in_block_so_far=3)
    flown = tape_module.Tape(
        17, 23, 2, SimpleNamespace(diagnosis=diagnosis), "last", ("flap",), np.zeros(1), np.ones(1),
        kept, {},
    )  # fmt: skip
    seen, whole, alarm = in_blocks(flown, log, 21)
    assert (alarm, seen.first, seen.frames, seen.end) == (5, 4, 5, 9)
    for n in range(5):  # the first begins with row 19, the third of the tape
        rows = range(2 + 4 * n, 6 + 4 * n)
        for name in ("offset", "slope", "spread"):
            assert seen.kept[name][n] == pytest.approx(kept[name][rows].mean(axis=0))
        assert seen.types[n].tolist() == kept["types"][rows[-1]].tolist()
    assert {len(values) for values in seen.kept.values()} == {5}
    assert (whole.dt, whole.instant_share < 1.0, whole.begin, whole.length) == (0.08, True, 3, 4)
    assert whole.statement_fields == {"block": [4, 3, 39]}
    assert whole.rates_rad_s.shape == (9, 3)
    for n in range(9):
        rows = range(3 + 4 * n, 7 + 4 * n)
        assert whole.rates_rad_s[n].tolist() == x[rows[-1]].tolist()
        assert whole.model_rad_s2[n] == pytest.approx(model[rows].mean(axis=0))
        assert whole.eta_bar_rad_s2[n] == pytest.approx(abs(eta_bar[rows]).mean(axis=0))
        unstated = whole.unstated_bound(slice(n, n + 1))[0]
        assert unstated == pytest.approx(log.unstated_bound(slice(rows[0], rows[-1] + 1)).mean(axis=0))
    pole = blocks.ADDING_POLE_PER_S
    for first, ends in ((17, (22, 26)), (18, (22, 26)), (19, (26,)), (22, (26,)), (23, ())):
        tests = [plain(one)[0] for one in whole.summed_frame_tests(5, (0, 2), first)]
        assert tests == [(d, pole, end - 4, end, 0.0) for end in ends for d in along((0, 2))]
    span = {"first": 4, "frame": 5}
    assert log_rows_of({"block": [4, 3, 39]}, span).tolist() == [*range(19, 27)]
    assert log_rows_of({}, span).tolist() == [4, 5]
    for so_far, first in ((0, 2), (1, 1), (3, 3)):
        diagnosis.n_frames_in_block_so_far = so_far
        assert in_blocks(flown, log, 21)[1].begin == first
    diagnosis.n_frames_in_block_so_far = 2
    assert in_blocks(flown, log, 0)[2] == 1  # block 0 has no rates from before it


@pytest.mark.parametrize(("block", "expected"), [(0, []), (1, [8]), (3, [12, 16])])
def test_a_block_of_which_the_tape_has_no_frames_proves_nothing(block, expected):
    """Blocks of four rows from row 1 on, and a tape from row 4 on: a block counts if it begins after row 4.
    The rates grow by the same amount in each row, and neither model nor fault explains it."""
    rates = np.cumsum(np.full((21, 3), (0.011, 0.013, 0.017)), axis=0)
    zeros, nothing = np.zeros((21, 3)), np.zeros(3)
    declared = DeclaredErrors(nothing, nothing, 0.0, np.ones(3), nothing, nothing, nothing)
    log = History(0.02, 1.0, rates, zeros, zeros, declared)
    effect = np.zeros((17, 3))
    of = Hypothesis(4, effect, effect, effect, -1.0, 1.0, axes=(1,))
    whole = by_blocks(log, 4, 1)
    tape = SimpleNamespace(first=4)
    ends = []
    for terms in whole.summed_frame_tests(block, of.axes, tape.first):
        found = certificate._first_violated([terms], of, log, tape)
        if found is not None:
            ((term,), _) = found
            assert (term.first_kept_frame, term.direction.tolist()) == (4, [0.0, 1.0, 0.0])
            value, _ = inequality.sides([term], of, log)
            decay = np.exp(-term.pole_per_s * 0.02)
            assert value == pytest.approx(0.013 * (1 + decay + decay**2 + decay**3))  # of four rows
            ends.append(term.last_frame)
    assert ends == expected


@pytest.mark.parametrize(("seen", "events", "changes", "expected"), [
    ({"alarm": 50}, [50, 53], {}, (43, 54)),  # a ring of eight to the alarm, one after the last event
    ({"alarm": 50}, [50, 53], {"fault_class": "all"}, (43, 73)),  # and two seconds, where types are excluded
    ({"alarm": 50}, [50, 90], {"fault_class": "all"}, (43, 77)),  # no more than is kept
    ({"alarm": 50}, [50, 53], {"fault_class": "all", "rows": 60}, (43, 60)),
    ({"alarm": 50}, [50, 52], {"fault_class": "all", "restarted": 55}, (43, 55)),
    ({"alarm": 50}, [50, 53], {"restarted": 50}, (43, 54)),
    ({"alarm": 50, "since": 47}, [50, 53], {}, (47, 54)),
    ({"alarm": 50, "clear": 46}, [50, 53], {}, (46, 54)),
    ({"alarm": 50}, [48, 50], {}, (43, 51)),
    ({"alarm": 3, "since": 0}, [3, 4], {}, (0, 5)),
    ({"alarm": -1, "frames": 60, "since": 20}, [59], {}, (52, 60)),  # no alarm: up to the flight's end
])  # fmt: skip
def test_a_tape_is_of_the_frames_around_its_events(monkeypatch, seen, events, changes, expected):
    """Of a ring of eight frames, and of twenty-six after the alarm."""
    its = {"alarm": 50, "frames": 100, "clear": 0, "since": 1} | seen
    monkeypatch.setattr(tape_module, "FrameReadout", lambda record: record)
    monkeypatch.setattr(tape_module, "KEPT_AFTER_EVENT_S", 2.0)
    monkeypatch.setattr(tape_module, "estimator_names", lambda fault_class, aircraft: (fault_class, aircraft))
    recorder = object.__new__(tape_module.Recorder)
    fault_class = changes.get("fault_class", "published")
    scenario = SimpleNamespace(fdi=SimpleNamespace(fault_class=fault_class), rate_hz=10.0, airframe="beaver")
    at_alarm = SimpleNamespace(since=its["since"])
    last = SimpleNamespace(since=changes.get("restarted", its["since"]))
    read = SimpleNamespace(
        read=lambda rows: {"reach_low": rows[:, 0], "reach_high": -rows[:, 0], "words": rows}
    )
    kept = np.arange(34.0)[:, None]
    vars(recorder).update(
        _scenario=scenario, _last=[last], _alarm=[at_alarm], _kept=kept,
        _ring=100.0 + np.arange(8.0)[:, None],
        _state=np.array([its["frames"], its["alarm"], its["clear"], 0, 0]), _early=read, _always=read,
    )  # fmt: skip
    found = recorder.tape(events, changes.get("rows", 100))
    first, end = expected
    assert (found.first, found.end) == expected
    raised = its["alarm"] >= 0
    assert (found.alarm, found.last, found.since) == (at_alarm if raised else last, last, its["since"])
    assert found.names == (fault_class, "beaver")
    alarm = its["alarm"] if raised else its["frames"] - 1
    before = [k % 8 for k in range(first, min(alarm + 1, end))]
    after = [8 + k - alarm - 1 for k in range(alarm + 1, end)]
    assert found.kept["words"][:, 0].tolist() == before + after
    assert found.filters["words"][:, 0].tolist() == [100 + k for k in before]
    assert (found.reach_low, found.reach_high) == (100 + before[0], -100 - before[0])
