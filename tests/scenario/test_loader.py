"""What a user sees of a mistake: FILE:LINE: key.path: what is wrong, what is allowed."""

import os
import pickle
import re
import time
from pathlib import Path

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import data_root
from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.scenario.builtin import resolve
from beaver_ftc.scenario.schema import load_scenario, load_text

LINE = re.compile(r"^[^:\n]+(:\d+: \S[^:\n]*)?: [^\n]+allowed: [^\n]+$")


def mistakes(text: str, **options) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        load_text(text, source="s.yaml", **options)
    lines = str(caught.value).split("\n")
    assert all(LINE.match(line) for line in lines), lines
    return lines


def mistake(text: str, **options) -> str:
    lines = mistakes("name: x\n" + text, **options)
    assert len(lines) == 1, lines
    return lines[0]


ONE_MISTAKE = {
    "descripton: y": "s.yaml:2: descripton: unknown key, did you mean description?",
    "initial: {airspeed_kts: 80}": "s.yaml:2: initial.airspeed_kts: unknown key, did you mean airspeed_mps?",
    "initial:\n  airspeed_mps: 45 m/s": (
        "s.yaml:3: initial.airspeed_mps: '45 m/s' is text, allowed: a number from 20 to 70 "
    ),
    "initial: {airspeed_mps: 12:30}": "s.yaml:2: initial.airspeed_mps: '12:30' is text,",
    "initial: {airspeed_mps: '45'}": "s.yaml:2: initial.airspeed_mps: '45' is text,",
    "initial: {airspeed_mps: yes}": "s.yaml:2: initial.airspeed_mps: true is a truth value,",
    "initial: {airspeed_mps: .nan}": "s.yaml:2: initial.airspeed_mps: nan is not finite,",
    "initial: {airspeed_mps: -.inf}": "s.yaml:2: initial.airspeed_mps: -inf is not finite,",
    "initial: {airspeed_mps: 1e400}": "s.yaml:2: initial.airspeed_mps: inf is not finite,",
    f"initial: {{airspeed_mps: {'9' * 350}}}": "s.yaml:2: initial.airspeed_mps: a whole number this large is",
    f"seed: {'9' * 350}": "s.yaml:2: seed: a whole number this large is out of range,",
    "initial:\n  airspeed_mps:": "s.yaml:3: initial.airspeed_mps: has no value, allowed: a number from 20",
    "initial: {airspeed_mps: [45]}": "s.yaml:2: initial.airspeed_mps: this is a list,",
    "initial: 45": "s.yaml:2: initial: 45 is a number, allowed: a mapping of airspeed_mps, altitude_m,",
    "initial: {altitude_m: 6001}": "allowed: a number from -300 to 6000 (altitude above sea level, m)",
    "duration_s: -1": "s.yaml:2: duration_s: -1 is out of range, allowed: a number over 0 up to 360000 (",
    "duration_s: 0.001": "s.yaml:2: duration_s: 0.001 is less than one frame, allowed: at least 0.01 s",
    "rate_hz: 1001": "s.yaml:2: rate_hz: 1001 is out of range, allowed: a number from 20 to 1000 (",
    "substeps: 2.5": "s.yaml:2: substeps: 2.5 is a number, allowed: a whole number from 1 to 50",
    "substeps: true": "s.yaml:2: substeps: true is a truth value, allowed: a whole number from 1 to 50",
    "aircraft: beever": "s.yaml:2: aircraft: 'beever' is not known, did you mean beaver?",
    "faults: [{actuator: elevator, type: stuk, at_s: 1}]": (
        "s.yaml:2: faults[0].type: 'stuk' is not known, did you mean stuck?"
    ),
    "faults: [{actuator: elevator, at_s: 1}]": "s.yaml:2: faults[0].type: required key is missing,",
    "faults: [3]": "s.yaml:2: faults[0]: 3 is a number, allowed: a mapping of type bias,",
    "faults:\n  - {type: float, actuator: flaps, at_s: 1}": (
        "s.yaml:3: faults[0].actuator: 'flaps' is not known, did you mean flap?"
    ),
    "faults:\n  - type: float\n    actuator: flap\n    at_s: 30": (
        "s.yaml:5: faults[0].at_s: 30 is after the end, allowed: earlier than duration_s, 30 s"
    ),
    "faults: [{type: float, actuator: flap, at_s: -1}]": "faults[0].at_s: -1 is out of range,",
    "faults: [{type: float, actuator: flap, at_s: 2, end_s: 2}]": "faults[0].end_s: 2 is not after at_s,",
    "faults: [{type: float, actuator: flap}]": "s.yaml:2: faults[0].at_s: required key is missing,",
    "faults: [{type: stuck, actuator: flap, at_s: 1, profile: incipient}]": (
        "faults[0].profile: 'incipient' is not known, allowed: abrupt"
    ),
    "faults: [{type: bias, bias_deg: 1, actuator: flap, at_s: 1, profile: incipient}]": (
        "faults[0].kappa_per_s: required key is missing,"
    ),
    "faults: [{type: bias, bias_deg: 1, actuator: flap, at_s: 1, kappa_per_s: 1}]": (
        "faults[0].kappa_per_s: has no meaning here, allowed: only with profile: incipient"
    ),
    "faults: [{type: unanticipated, actuator: flap, at_s: 1}]": "faults[0].actuator: unknown key",
    "reference: {q: {sine: {amplitude_deg_s: 1, frequency_hz: 1}}}": "reference.q: this is a mapping,",
    "reference: {q: [{sin: {amplitude_deg_s: 1, frequency_hz: 1}}]}": "q[0].sin: unknown key, did you mean",
    "reference: {q: [{}]}": "reference.q[0]: 0 kinds in one list item, allowed: exactly one of sine,",
    "reference: {q: [{step: {amplitude_deg_s: 1, start_s: 5, end_s: 4}}]}": (
        "reference.q[0].step.end_s: 4 is not after start_s, allowed: later than 5 s"
    ),
    "reference: {q: [{step: {amplitude_rad_s: 1, amplitude_deg_s: 1}}]}": (
        "reference.q[0].step.amplitude_rad_s: unknown key, did you mean amplitude_deg_s?"
    ),
    "uncertainty: {coefficients: {Cm_alfa: 1.05}}": (
        "uncertainty.coefficients.Cm_alfa: unknown aerodynamic term, did you mean Cm_alpha?"
    ),
    "actuators: servos": "s.yaml:2: actuators: 'servos' is not known, did you mean servo? allowed: ideal,",
    "actuators: {bandwidth_rad_s: -1}": "s.yaml:2: actuators.bandwidth_rad_s: -1 is out of range,",
    "actuators: {bandwidth: 1}": "s.yaml:2: actuators.bandwidth: unknown key, did you mean bandwidth_rad_s?",
    "actuators: {flap: {travel_deg: [5, 1]}}": "actuators.flap.travel_deg: stops out of order or range,",
    "sensors: {q: {noise_std: 1}}": "sensors.q.noise_std: unknown key, did you mean noise_std_deg_s?",
    "environment: {turbulence: dryden}": "environment.severity: required key is missing, allowed: light,",
    "environment: {severity: light}": "environment.severity: has no meaning here,",
    "environment: {wind_mps: [1, 2]}": "environment.wind_mps: too few items, allowed: a list of 3 items",
    "environment: {turbulence: off}": "environment.turbulence: false is not known, allowed: none, dryden",
    "expect: {isolated_as: elevater}": "expect.isolated_as: 'elevater' is not known, did you mean elevator?",
    "expect: {detected_within_s: 1}": "expect.detected_within_s: there is no fault to expect it of,",
    "fdi: {thresholds: foo}": "fdi.thresholds: 'foo' is not known,",
    "fdi: {detection_pole_per_s: '3'}": "fdi.detection_pole_per_s: '3' is text, allowed: a number",
    "control: {hand_over_s: true}": "control.hand_over_s: true is a truth value, allowed: a number",
    "control: {law: nominl}": "control.law: unknown law 'nominl', did you mean nominal?",
    "name: y": "s.yaml:2: name: duplicate key, first on line 1, allowed: each key once",
    "description: 3": "description: 3 is a number, allowed: text of at most 2000 characters",
    '"a\\nb": 1': "s.yaml:2: a\\nb: unknown key,",
    '"": 1': "s.yaml:2: (empty): unknown key,",
}


@pytest.mark.parametrize("text", ONE_MISTAKE)
def test_one_mistake_is_one_line(text):
    assert ONE_MISTAKE[text] in mistake(text)


def test_the_name_is_required():
    assert mistakes("seed: 1") == [
        "s.yaml:1: name: required key is missing, "
        "allowed: text of letters, digits, - and _ of at most 100 characters"
    ]


def test_all_mistakes_at_once_in_the_order_of_the_file():
    lines = mistakes(
        "name: a b\n"
        "duration_s: 20\n"
        "initial: {airspeed_mps: 5,\n altitude_ft: 3}\n"
        "faults:\n"
        "  - {type: bias, actuator: elevator, at_s: 25, end_s: 3}\n"
        "seed: 1\n"
        "seed: 2\n"
        "expect: {isolated_as: tail}\n"
    )
    assert [line.split(": ")[:2] for line in lines] == [
        ["s.yaml:1", "name"],
        ["s.yaml:3", "initial.airspeed_mps"],
        ["s.yaml:4", "initial.altitude_ft"],
        ["s.yaml:6", "faults[0].bias_deg"],
        ["s.yaml:6", "faults[0].at_s"],
        ["s.yaml:8", "seed"],
        ["s.yaml:9", "expect.isolated_as"],
    ]


@pytest.mark.parametrize("text", ["", "\n# only a comment\n", "---\n", "3", "[]", "just words", "null"])
def test_a_file_without_a_mapping(text):
    assert "allowed: a mapping" in mistakes(text)[0]


HUGE = {
    "items": "name: x\nfaults:\n" + "- 1\n" * 150_000,
    "duplicate keys": "name: x\n" * 150_000,
    "unknown keys": "name: x\n" + "".join(f"durations{i}_s: 1\n" for i in range(100_000)),
    "late faults": "name: x\nfaults:\n" + "- {type: float, actuator: flap, at_s: 40}\n" * 20_000,
    "terms": "name: x\nuncertainty:\n  coefficients:\n" + "".join(f"    Cm_{i}: 1\n" for i in range(100_000)),
    "digits": "name: x\nseed: " + "1" * 1_000_000 + "." + "e" * 1_000_000,
    "anchors": "name: x\n" + "".join(f"a{i}: &a{i} 1\n" for i in range(100_000)),
}


@pytest.mark.parametrize("case", HUGE)
def test_a_hostile_file_costs_seconds_and_a_hundred_lines_at_most(case):
    began = time.process_time()
    lines = mistakes(HUGE[case])
    assert len(lines) <= 101
    assert time.process_time() - began < 10  # a quadratic step would take minutes


# Files


def refused(path: Path | str) -> str:
    with pytest.raises(BadInput) as caught:
        load_scenario(path)
    line = str(caught.value)
    assert LINE.match(line), line
    return line


def test_a_pipe_is_refused_without_waiting_for_a_writer(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    assert "is a pipe or a device" in refused(tmp_path / "pipe.yaml")


def test_a_file_of_100_mb_is_refused_unread(tmp_path):
    path = tmp_path / "large.yaml"
    with path.open("wb") as file:
        file.truncate(100_000_000)
    assert "is too large (100 MB), allowed: at most 4 MB" in refused(path)


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads everything")
def test_an_unreadable_file(tmp_path):
    path = tmp_path / "locked.yaml"
    path.write_text("name: x")
    path.chmod(0)
    assert "permission denied" in refused(path)


def test_odd_file_names_stay_on_one_line(tmp_path):
    path = tmp_path / "a\nb.yaml"
    path.write_text("name: a b")
    assert "a\\nb.yaml:1: name:" in refused(path)


def test_the_error_survives_a_process_boundary():
    with pytest.raises(ScenarioError) as caught:
        load_text("name: a b")
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value)
    assert again.problems == caught.value.problems


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        (
            "faults: [{actuator: elevatr, typ: stuck, at_s: -1}]",
            ["faults[0].typ", "faults[0].actuator", "faults[0].at_s"],
        ),
        (
            "faults: [{actuator: elevatr, type: stuk, at_s: -1, bogus: 2}]",
            ["faults[0].type", "faults[0].actuator", "faults[0].at_s", "faults[0].bogus"],
        ),
        (
            "reference: {q: [{sin: {amplitude_deg_s: 3000, frequency_hz: -1}}]}",
            [
                "reference.q[0].sin",
                "reference.q[0].sine.amplitude_deg_s", "reference.q[0].sine.frequency_hz"
            ],
        ),
        (
            "actuators: {bandwith_rad_s: 20, rate_limit_deg_s: -6}",
            ["actuators.bandwith_rad_s", "actuators.rate_limit_deg_s"],
        ),
        ("initial: {bogus: 1, altitude_m: 99999}", ["initial.bogus", "initial.altitude_m"]),
    ],
)  # fmt: skip
def test_one_wrong_key_hides_no_other_mistake_on_its_line(text, keys):
    with pytest.raises(ScenarioError) as refused:
        load_text(f"name: x\n{text}\n")
    found = [line.split(": ")[1] for line in refused.value.lines if line.startswith("<text>:2: ")]
    assert sorted(found) == sorted(keys)


@pytest.mark.parametrize(("name", "kind", "file"), [
    ("elevator-partial-loss", "scenario", "scenarios/elevator-partial-loss.yaml"),
    ("elevator-effectiveness", "sweep", "scenarios/sweeps/elevator-effectiveness.yaml"),
    ("flight-controls", "plan", "evidence/flight-controls.yaml"),
    ("elevator-partial-loss", "sweep", None), ("elevator-effectiveness", "scenario", None),
    ("a.yaml", "plan", None),
])  # fmt: skip
def test_a_name_stands_for_a_file_of_its_kind_and_for_itself_otherwise(name, kind, file):
    assert resolve(name, kind) == (Path(name) if file is None else data_root() / file)
