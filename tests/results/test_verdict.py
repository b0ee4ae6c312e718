"""The words of the verdict: each kind of value that an expectation can hold, as a reader sees it."""

import pytest

from beaver_ftc.results import verdict
from beaver_ftc.results.model import CertificateCounts, ChangeInFlight, DeclaredFault, Metrics
from beaver_ftc.results.verdict import expectations_in_words
from beaver_ftc.scenario.schema import Expect

# Each key of `expect:` with what the metrics say of it, whether it passes, and the sentence
# that a reader is shown.
SAID = [
    ("detected_within_s", 0.5, 0.01, True, "detection delay ≤ 0.5 s, got 0.01 s (2 % of the limit)"),
    ("detected_within_s", 0.5, None, False, "detection delay ≤ 0.5 s, got none"),
    ("detected_within_s", 1.0, 15.96, False, "detection delay ≤ 1 s, got 16 s (1600 % of the limit)"),
    ("altitude_within_m", 2000, 1234.5, True,
     "altitude deviation ≤ 2000 m, got 1230 m (61.7 % of the limit)"),
    ("isolated_within_s", 1.0, 0.256, True, "isolation delay ≤ 1 s, got 0.256 s (25.6 % of the limit)"),
    ("isolated_as", "elevator", "rudder", False, "isolated fault elevator, got rudder"),
    ("isolated_as", "elevator", None, False, "isolated fault elevator, got none"),
    ("isolated_as", "elevator", "elevator", True, "isolated fault elevator"),
    ("isolated_type", "stuck", "float", False, "fault type stuck, got float"),
    ("candidate_type", "bias", ["stuck", "bias"], True, "possible fault types include bias, got stuck, bias"),
    ("candidate_type", "bias", [], False, "possible fault types include bias, got none"),
    ("no_false_alarm", True, False, False, "no false alarm, got a false alarm"),
    ("no_false_alarm", True, True, True, "no false alarm"),
    ("no_departure", False, True, False, "a departure, got no departure"),
    ("pre_fault_rms_deg_s.p", 0.5, 0.2, True,
     "roll rate RMS before the fault ≤ 0.5 deg/s, got 0.2 deg/s (40 % of the limit)"),
    ("post_fault_rms_deg_s.q", 1.0, 0.11249, True,
     "pitch rate RMS after the fault ≤ 1 deg/s, got 0.112 deg/s (11.2 % of the limit)"),
    ("altitude_within_m", 15, 3.4567, True, "altitude deviation ≤ 15 m, got 3.46 m (23 % of the limit)"),
    ("airspeed_within_limits_mps", 5, 1.25, True,
     "deviation from the limited airspeed (10 s mean) ≤ 5 m/s, got 1.25 m/s (25 % of the limit)"),
    ("airspeed_within_mps", 3, None, False, "airspeed deviation (10 s mean) ≤ 3 m/s, got none"),
    ("heading_within_deg", 5, 7.0, False, "heading deviation ≤ 5 deg, got 7 deg (140 % of the limit)"),
    ("stays_in_envelope", True, False, False, "stays in the envelope, got leaves the envelope"),
    ("arrives.altitude_m", 20.0, -31.2, False,
     "altitude deviation at the end ≤ 20 m, got -31.2 m (156 % of the limit)"),
    ("arrives.in_envelope", True, False, False,
     "inside the envelope at the end, got outside the envelope at the end"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "expected", "actual", "passed", "said"), SAID)
def test_an_expectation_in_words(name, expected, actual, passed, said):
    found = {"name": name, "expected": expected, "actual": actual, "passed": passed}
    (held,) = expectations_in_words(Metrics.of({"expectations": [found]}))
    assert (held.name, held.sentence, held.passed) == (name, said, passed)


def test_every_key_of_expect_is_said_in_words_here():
    assert {name.partition(".")[0] for name, *_ in SAID} == set(Expect.model_fields)


DETECTION = {"detected": True, "time_s": 12.5, "delay_s": 0.5, "guaranteed_delay_s": None, "axis": "q"}


@pytest.mark.parametrize(
    ("changes", "false_alarm", "said"),
    [
        ({"detected": False}, False, "no alarm"),
        ({"delay_s": None}, True, "FALSE ALARM at 12.50 s on q"),
        ({}, True, "after 0.50 s on q"),  # the false one was of a diagnosis that a change has ended
        ({}, False, "after 0.50 s on q"),
        ({"guaranteed_delay_s": 0.75}, False, "after 0.50 s on q (certain within 0.75 s)"),
        ({"axis": None}, False, "after 0.50 s by the sensor monitor"),
    ],
)
def test_the_alarm_in_words(changes, false_alarm, said):
    assert (
        verdict._detection_text(Metrics.of({"detection": DETECTION | changes, "false_alarm": false_alarm}))
        == said
    )


@pytest.mark.parametrize(
    ("time_s", "said"),
    [
        (None, "no alarm; threshold 6.50 σ, peak in healthy flight 0.81 of it"),
        (3.0, "alarm at 3.00 s; threshold 6.50 σ, peak in healthy flight 0.81 of it"),
    ],
)
def test_the_statistical_detector_in_words(time_s, said):
    found = {"time_s": time_s, "alarm_level": 6.5, "closest_approach": 0.81}
    assert verdict._statistical_text(Metrics.of({"detection": {"statistical": found}})) == said
    assert verdict._statistical_text(Metrics.of({"detection": {}})) == ""


NAMED = {
    "isolated": True, "fault": "elevator", "delay_s": 0.25, "correct": True, "type_correct": None,
    "type": "stuck", "candidates": ["stuck"], "estimate": None, "estimate_deg": None,
}  # fmt: skip
FAULTS = [
    {"actuator": "rudder", "type": "stuck", "at_s": 4.0, "profile": "abrupt", "size": {"position_deg": 9.0}},
    {
        "actuator": "elevator",
        "type": "stuck",
        "at_s": 4.0,
        "profile": "abrupt",
        "size": {"position_deg": 3.0},
    },
    {
        "actuator": "elevator",
        "type": "loss_of_effectiveness",
        "at_s": 4.0,
        "profile": "abrupt",
        "size": {"magnitude": 0.4},
    },
]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, "elevator after 0.25 s; correct, stuck"),
        ({"delay_s": None, "correct": False}, "elevator; WRONG, stuck"),
        ({"type_correct": False}, "elevator after 0.25 s; WRONG, stuck"),
        ({"so_far": False}, "elevator after 0.25 s; correct, stuck"),
        ({"so_far": True}, "elevator (only remaining candidate) after 0.25 s; correct, stuck"),
        (
            {"so_far": True, "delay_s": None, "correct": False},
            "elevator (only remaining candidate); WRONG, stuck",
        ),
        (
            {"type": None, "candidates": ["stuck", "rate_limit"]},
            "elevator after 0.25 s; correct, type not determined (2 remain: stuck, rate limit)",
        ),
        (
            {"type": None, "candidates": ["stuck", "rate_limit", "bias"]},
            "elevator after 0.25 s; correct, type not determined (3 remain: stuck, rate limit, bias)",
        ),
        (
            {"type": None, "candidates": ["stuck", "rate_limit", "bias", "float"]},
            "elevator after 0.25 s; correct, type not determined (4 remain: stuck, rate limit, bias, float)",
        ),
        ({"type": None, "candidates": []}, "elevator after 0.25 s; correct, of no known type"),
        ({"fault": "sensor q", "type": None}, "sensor q after 0.25 s; correct"),
        ({"type": "unanticipated"}, "elevator after 0.25 s; correct"),
        (
            {"estimate": 0.05, "estimate_deg": 2.9},
            "elevator after 0.25 s; correct, stuck, estimated 2.9 deg (true 3 deg)",
        ),
        (
            {"type": "loss_of_effectiveness", "estimate": -0.39},
            "elevator after 0.25 s; correct, loss of effectiveness, estimated loss 39 % (true 40 %)",
        ),
    ],
)
def test_a_named_fault_in_words(changes, said):
    named = NAMED | changes
    faults = [FAULTS[0], *(fault for fault in FAULTS[1:] if fault["type"] == named["type"])]
    found = {"isolation": named, "faults": faults, "flight": {"flown_s": 30.0, "rate_hz": 100.0}}
    assert verdict._isolation_text(Metrics.of(found)) == said


@pytest.mark.parametrize(
    ("candidates", "said"),
    [
        (["rudder"], "still possible: rudder"),
        (["aileron", "unanticipated"], "still possible: aileron or a fault outside the class"),
        (
            ["left_flap:stuck", "left_flap:float"],
            "still possible: left flap; type not determined (2 remain: stuck, float)",
        ),
        (
            [f"{side}_{name}:{kind}" for side in ("left", "right") for name in ("aileron", "flap", "elevator")
             for kind in ("bias", "stuck", "rate_limit")] + ["damage"],
            "still possible: one of 6 surfaces (4 on the wing, 2 on the tail) or damage; "
            "type not determined (3 remain: bias, stuck, rate limit)",
        ),
        (
            ["aileron", "elevator", "rudder", "flap"],
            "still possible: aileron or elevator or rudder or flap",
        ),
        (
            ["aileron", "elevator", "rudder", "flap", "slat"],
            "still possible: one of 5 surfaces (3 on the wing, 2 on the tail)",
        ),
        (["sensor p", "sensor phi"], "still possible: sensor p or sensor phi"),
    ],
)  # fmt: skip
def test_what_is_still_possible_is_grouped_and_counted(candidates, said):
    assert verdict.candidates_in_words(candidates) == said


FIRST, AGAIN, OTHER = (
    {"fault": name, "from_s": from_s, "to_s": to_s}
    for name, from_s, to_s in (("elevator", 12.0, 12.25), ("elevator", 14.0, 15.0), ("flap", 13.0, 13.5))
)


@pytest.mark.parametrize(
    ("gone", "said"),
    [
        ([], ""),
        ([FIRST], "; named before: elevator from 12.00 s to 12.25 s"),
        (
            [OTHER | {"type": "rate_limit", "because": "a sensor is broken"}],
            "; named before: flap (rate limit) from 13.00 s to 13.50 s, withdrawn because a sensor is broken",
        ),
        (
            [FIRST, OTHER, AGAIN],
            "; named before: elevator 2 times, for 1.25 s in all, from 12.00 s to 15.00 s; "
            "flap from 13.00 s to 13.50 s",
        ),
    ],
)
def test_what_was_named_before_in_words(gone, said):
    document = {"isolation": NAMED | {"withdrawn": gone}, "faults": FAULTS}
    assert verdict._isolation_text(Metrics.of(document)) == f"elevator after 0.25 s; correct, stuck{said}"
    nothing = {"isolated": False, "candidates": [], "withdrawn": gone}
    assert (
        verdict._isolation_text(Metrics.of({"isolation": nothing, "detection": {"detected": True}}))
        == f"none{said}"
    )


def test_modes_left_out_are_counted_before_the_last():
    modes = [{"mode": "nominal", "time_s": 0.0}, {"mode": "adaptive", "time_s": 2.0}]
    assert verdict._supervisor_text(Metrics.of({"supervisor": modes})) == "nominal 0.00 s → adaptive 2.00 s"
    said = verdict._supervisor_text(Metrics.of({"supervisor": modes, "mode_changes_left_out": 7}))
    assert said == "nominal 0.00 s → (7 more) → adaptive 2.00 s"


def test_engine_and_authority_in_words():
    power = {"from_s": 13.2, "in_charge_s": 0.9, "lowest_inhg": 20.04, "highest_inhg": 22.26}
    assert verdict._engine_power_text(Metrics.of({"engine_power": power})) == (
        "took over pitch at 13.20 s, for 0.90 s in all, 20.0 to 22.3 inHg"
    )
    assert verdict._engine_power_text(Metrics.of({"engine_power": None})) == ""
    least = verdict.MIN_SHOWN_BEYOND_S
    axes = {"p": {"beyond_s": 0.5 * least}, "q": {"beyond_s": 1.89}, "r": {"beyond_s": least}}
    assert verdict._insufficient_authority_text(Metrics.of({"authority": axes})) == (
        f"no deflection could hold the rate: q for 1.89 s, r for {least:.2f} s"
    )
    assert verdict._insufficient_authority_text(Metrics.of({"authority": None})) == ""


def test_a_probing_in_words():
    said = "flap and elevator moved from 14.00 s to 18.50 s"
    assert verdict._probing_text(Metrics.of({"isolation": {"probing_s": [14.0, 18.5]}})) == said
    assert verdict._probing_text(Metrics.of({"isolation": {"probing_s": None}})) == ""


def test_a_change_in_flight_is_said_with_what_the_diagnosis_before_it_found():
    change = {"law": "adaptive", "scheme": None, "sensors": {}, "time_s": 6.0}
    assert verdict._change_text(ChangeInFlight.of(change)) == "law adaptive at 6.00 s"
    assert verdict._change_text(ChangeInFlight.of({**change, "law": None})) == "declared sensors at 6.00 s"
    found = {"sensors": {"p": 1}, "detection_time_s": 2.5, "isolated": None, "false_alarm": False}
    said = verdict._change_text(ChangeInFlight.of({**change, **found}))
    assert said == "law adaptive, sensors at 6.00 s; the diagnosis before: alarm at 2.50 s, not isolated"
    said = verdict._change_text(
        ChangeInFlight.of({**change, **found, "isolated": "rudder", "false_alarm": True})
    )
    assert said.endswith("the diagnosis before: FALSE ALARM at 2.50 s, rudder")


def test_stays_outside_the_envelope_are_counted_from_the_first():
    exits = [{"start_s": 3.0, "end_s": 4.5}, {"start_s": 8.0, "end_s": 9.0}]
    metrics = {"envelope_exits": exits, "envelope": {"exits": 2, "outside_s": 2.5}}
    assert verdict._envelope_text(Metrics.of(metrics)) == "left 2 times, 2.50 s in all, first at 3.00 s"
    assert verdict._envelope_text(Metrics.of({**metrics, "envelope_exits": []})) == ""


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ({"sensor": "q", "type": "bias", "size": {"magnitude": 3.0}}, ["+3 deg/s"]),
        ({"sensor": "altitude", "type": "noise", "size": {"magnitude": 12.0}}, ["12 m"]),
        ({"sensor": "V", "type": "scale", "size": {"magnitude": -0.25}}, ["-25%"]),
        ({"sensor": "V", "type": "lost", "size": {}}, []),
    ],
)
def test_the_size_of_an_instruments_fault_is_in_the_instruments_unit(fault, said):
    declared = DeclaredFault.of(fault | {"at_s": 2.0, "end_s": 5.0})
    assert verdict._fault_size_texts(declared) == said
    size = f" ({said[0]})" if said else ""
    expected = f"sensor {fault['sensor']} {fault['type']}{size} at 2.00 s to 5.00 s"
    assert verdict._fault_text(declared) == expected


@pytest.mark.parametrize(
    ("seconds", "said"),
    [(0.125, "0.12 s"), (999.994, "999.99 s"), (1000.0, "1000.0 s"), (1000.5, "1000.5 s")],
)
def test_long_times_are_told_to_a_tenth(seconds, said):
    assert verdict._seconds_text(seconds) == said


def flown(**changes):
    """The metrics of a flight of which little is to be said."""
    nothing = {
        "detection": DETECTION | {"detected": False}, "isolation": {"isolated": False, "candidates": []},
        "fault": None, "false_alarm": False, "supervisor": [], "authority": None, "engine_power": None,
        "envelope_exits": [], "departure": None, "saturation_s": {}, "changes": [], "profile": None,
    }  # fmt: skip
    rms = {"p": 0.1, "q": 0.25, "r": 1.0}
    tracking = {"pre_fault_rms_deg_s": None, "post_fault_rms_deg_s": rms}
    expected = {"name": "no_false_alarm", "expected": True, "actual": True, "passed": True}
    missed = {"name": "detected_within_s", "expected": 0.5, "actual": None, "passed": False}
    return {
        "scenario": "a-flight", "expectations": [expected, missed], "passed": False, "tracking": tracking,
        **nothing, **changes,
    }  # fmt: skip


def test_the_verdict_is_a_line_for_each_thing_worth_knowing():
    both = {"pre_fault_rms_deg_s": {"p": 0.5, "q": 0.6, "r": 0.7}, "post_fault_rms_deg_s": None}
    text = verdict.verdict_text(Metrics.of(flown(tracking=flown()["tracking"] | both)), "runs/a-flight")
    assert text.splitlines()[0] == "a-flight: FAILED"
    assert "tracking RMS  p 0.5  q 0.6  r 0.7 deg/s before the fault" in text
    assert "expected      met    no false alarm" in text
    assert "expected      MISSED detection delay ≤ 0.5 s, got none" in text
    assert text.splitlines()[-1] == " results       runs/a-flight"
    assert "\x1b" not in text
    for what, how in verdict.verdict_lines(Metrics.of(flown())):
        assert f" {what:13} {how}" in text
    after = verdict.verdict_text(Metrics.of(flown()), "runs/a-flight")
    assert "tracking RMS  p 0.1  q 0.25  r 1 deg/s after the fault" in after
    assert "certificate" not in after
    certified = Metrics.of(flown(certificate={"statements": 1, "without": 0}))
    row = " certificate   1 statement; check: beaver-ftc check runs/x"
    assert row in verdict.verdict_text(certified, "runs/x").splitlines()


def test_in_colour_what_is_missed_is_red_and_names_stand_out():
    lines = verdict.verdict_text(Metrics.of(flown()), "runs/a-flight", colour=True).splitlines()
    assert "\x1b[1;31m" in lines[0]
    assert any("\x1b[1;31mMISSED" in line for line in lines)
    assert any("\x1b[32mmet" in line for line in lines)
    assert "\x1b[1m" in lines[-1]
    assert "\x1b[1;36m" not in "".join(lines), "numbers are not coloured as numbers"
    long = flown(scenario="a" * 200, passed=True)
    assert "\x1b[1;32m" in verdict.verdict_text(Metrics.of(long), "x", colour=True)


def test_markup_in_a_name_is_no_markup():
    text = verdict.verdict_text(Metrics.of(flown(scenario="[red]x[/red] :smile:")), "runs/[bold]x")
    assert "[red]x[/red] :smile:" in text
    assert "runs/[bold]x" in text


@pytest.mark.parametrize(
    ("limit", "said"),
    [
        (("airspeed_mps", "at least", 38.04, True), "airspeed to at least 38.0 m/s from 20.00 s: trim"),
        (
            ("bank_deg", "at most", 30.0, False),
            "bank to at most 30 deg from 20.00 s, no longer at the end: trim",
        ),
    ],
)
def test_a_limit_that_was_lifted_is_said_to_be_gone(limit, said):
    """Only of a limit that is not in force when the flight ends is it said that it is gone."""
    keys = ("limits", "side", "value", "in_force")
    entry = {"time_s": 20.0, "because": "trim", **dict(zip(keys, limit, strict=True))}
    assert ("limited", said) in list(verdict.verdict_lines(Metrics.of(flown(limits=[entry]))))


LINK = {
    "protocol": "sitl", "frames": 1200, "packets_hz": 400.0, "latency_ms": {"median": 0.25, "p99": 1.5},
    "interval_ms": {"mean": 2.5, "jitter_rms": 0.125}, "repeated": 3, "late": 0, "missed": 4, "malformed": 0,
    "strangers": 5, "off_rate": 0, "resets": 6,
}  # fmt: skip
AXIS = {
    "beyond_s": 0.0, "least_rad_s2": -2.0, "greatest_rad_s2": 1.0, "healthy_least_rad_s2": -3.0,
    "healthy_greatest_rad_s2": 2.0,
}  # fmt: skip
WHOLE = AXIS | {"least_rad_s2": -3.0, "greatest_rad_s2": 2.0}
ENGINES = {"engines_least_rad_s2": -0.25, "engines_greatest_rad_s2": 0.5}
NEARLY = {
    "least_rad_s2": 0.0, "greatest_rad_s2": 995.0, "healthy_least_rad_s2": 0.0,
    "healthy_greatest_rad_s2": 1000.0,
}  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "what", "said"),
    [
        (
            {"link": LINK},
            "link",
            "sitl, 1200 frames at 400 Hz, 3 repeated, 4 missing, 5 from other senders, 6 restarts; "
            "latency 0.25 ms (99th percentile 1.50), interval 2.50 ms, jitter 0.12 ms RMS",
        ),
        (
            {"authority": {"p": AXIS, "q": WHOLE, "r": WHOLE | ENGINES}},
            "remaining",
            "roll authority 60 % (-2 to 1 rad/s2); "
            "yaw authority 100 % (-3 to 2 rad/s2, engines -0.25 to 0.5)",
        ),
        ({"authority": {"p": WHOLE, "q": AXIS | NEARLY, "r": {"beyond_s": 0.0}}}, "remaining", None),
        ({"departure": {"time_s": 7.5, "signal": "beta_rad"}}, "departure", "LOST at 7.50 s: beta_rad"),
        (
            {"saturation_s": {"aileron": 1.25, "flap": 0.0, "rudder": 2.5}},
            "saturation",
            "aileron 1.25 s, rudder 2.50 s",
        ),
    ],
)
def test_the_rest_of_a_flight_in_words(changes, what, said):
    assert dict(verdict.verdict_lines(Metrics.of(flown(**changes)))).get(what) == said


@pytest.mark.parametrize(
    ("statements", "without", "said"),
    [
        (0, 0, "nothing to certify: no alarm"),
        (0, 2, "0 statements, 2 not certified; check: beaver-ftc check runs/x"),
        (1, 0, "1 statement; check: beaver-ftc check runs/x"),
        (3, 1, "3 statements, 1 not certified; check: beaver-ftc check runs/x"),
    ],
)
def test_a_certificate_is_counted_with_the_command_that_checks_it(statements, without, said):
    assert verdict._certificate_text(CertificateCounts(statements, without), "runs/x") == said


@pytest.mark.parametrize(
    ("changes", "title", "outcome_class"),
    [
        ({"passed": True}, "PASSED", "good"),
        ({"passed": True, "departure": None}, "PASSED", "good"),
        ({"passed": True, "departure": {"time_s": 1.0}}, "PASSED, the aircraft was LOST", "lost"),
        ({"departure": {"time_s": 1.0}}, "FAILED, the aircraft was LOST", "bad"),
        ({"interrupted_s": 2.5}, "INTERRUPTED at 2.50 s, not passed", "bad"),
        ({"expectations": [], "passed": True}, "flown, nothing was expected", "good"),
    ],
)
def test_the_title_and_the_mood(changes, title, outcome_class):
    document = flown(**changes)
    assert (verdict.title(Metrics.of(document)), verdict.outcome_class(Metrics.of(document))) == (
        f"a-flight: {title}",
        outcome_class,
    )


def test_an_alarm_does_not_hide_where_nothing_could_be_concluded():
    reason = {"quantity": "altitude_m", "flown": None, "share": 0.25, "says": "too high"}
    blind = {"share": 0.25, "from_s": 3.5, "reasons": [reason]}
    found = {"detected": True, "delay_s": 0.75, "time_s": 2.75, "axis": "r", "guaranteed_delay_s": None}
    said = dict(verdict.verdict_lines(Metrics.of(flown(detection=found | {"inconclusive": blind}))))
    assert said["detection"] == "after 0.75 s on r"
    assert said["inconclusive"] == "nothing can be concluded in 25 % of the frames from 3.50 s on: too high"
