"""Table, heat map and document of the fault matrix, of rows made by hand; its scenarios; one short row."""

from math import radians
from pathlib import Path
from types import SimpleNamespace

import pytest

from beaver_ftc.results.model import Metrics
from beaver_ftc.studies.matrix import fault_matrix
from beaver_ftc.studies.matrix.fault_matrix import (
    FAULTS,
    FILES,
    FaultCase,
    airspeeds_of,
    as_text,
    cases,
    document_of,
    fly_case,
    heat_map_of,
    name_of,
    run_matrix,
    scenario_of,
    verdict,
)
from beaver_ftc.studies.present.page import contents
from kept import picture

LOST = {"departure_s": 20.0, "departure_signal": "alpha_rad"}
BOTH = {**LOST, "oracle_departure_s": 22.0}
MADE = [  # of the faults in turn, at two airspeeds
    ({}, {"delay_s": 0.5, "ratio": 1.9}),
    ({"verdict": "unseen", "delay_s": None, "detected": False, "ratio": 1.0}, {"ratio": 0.5}),
    ({"verdict": "surface", "candidates": ["stuck", "float"], "ratio": 4.0}, {"candidates": ["bias"]}),
    ({"verdict": "open", "candidates": ["flap:stuck"], "ratio": 4.3}, {"ratio": None}),
    ({**LOST, "ratio": 40.0}, {**BOTH, "oracle_beyond_s": 1.25}),
    ({**BOTH, "oracle_left_envelope_s": 15.0}, {**BOTH, "oracle_left_envelope_s": 14.0}),
    (LOST, {"verdict": "WRONG", "false_alarm": True, "delay_s": -1.0}),
    ({"ratio": None}, {"ratio": None}),
    *[({"verdict": "unseen", "delay_s": None, "detected": False, "ratio": 1.0},) * 2] * 2,
]


def rows_of(surfaces, **more):
    plain = {
        "aircraft": "beaver", "verdict": "named", "delay_s": 0.1, "false_alarm": False, "candidates": [],
        "ratio": 1.25, "departure_s": None, "oracle_departure_s": None, "departure_signal": None,
        "oracle_beyond_s": 0.0, "oracle_left_envelope_s": None, "axis": "q", "detected": True,
    }  # fmt: skip
    rows = []
    for i, (fault, _) in enumerate(FAULTS):
        for j, surface in enumerate(surfaces):
            two = MADE[(i + 3 * j) % len(MADE)]
            rows += [
                {"fault": fault, "surface": surface, "airspeed_mps": V, **plain, **found, **more}
                for V, found in zip((38.0, 45.0), two, strict=True)
            ]
    return rows


def told(rows):
    chances = [0.9 if row["detected"] else 0.2 for row in rows]
    return [
        row | {"told_chance": chance, "told_deflection": 1.0}
        for row, chance in zip(rows, chances, strict=True)
    ]


@pytest.mark.parametrize("made", ["plain", "told"])
def test_the_matrix_as_it_is_shown(made, changed):
    rows = (
        rows_of(("aileron", "elevator")) if made == "plain" else told(rows_of(("elevator", "rudder", "flap")))
    )
    document = document_of(rows)
    assert not changed(
        {
            key: value
            for key, value in document.items()
            if key not in ("flights", "lost_though_the_oracle_was_not")
        }
    )
    assert document["flights"] == rows
    lost = [row for row in rows if row["departure_s"] and not row["oracle_departure_s"]]
    assert document["lost_though_the_oracle_was_not"] == lost != []
    assert not changed(as_text(document).splitlines(), "text")
    figure = heat_map_of(document)
    assert not changed(picture(figure), "figure")
    files = contents(FILES, document)
    assert list(files) == ["fault-matrix.json", "fault-matrix.txt", "fault-matrix.png"]
    assert files["fault-matrix.txt"] == as_text(document) + "\n"
    assert '"wrong"' in files["fault-matrix.json"]


def test_the_flights_of_the_cases(changed):
    flown = {fault: scenario_of(FaultCase(fault, "elevator", 45.0), "nominal", -1.5) for fault, _ in FAULTS}
    assert not changed({fault: found.model_dump(mode="json")["faults"] for fault, found in flown.items()})
    assert not changed(flown["float"].model_dump(mode="json", exclude_defaults=True), "whole")


def test_the_flight_with_all_that_is_declared(changed):
    calm, rough = (
        scenario_of(FaultCase("total loss", "rudder", 38.0, True, turbulence=air), "oracle", 0.0)
        for air in ("none", "light")
    )
    assert not changed(rough.model_dump(mode="json", exclude_defaults=True))
    assert (calm.environment.turbulence, calm.fdi.bounds.turbulence) == ("none", "none")


def test_of_a_truth_whose_coefficients_cannot_be_wrong_all_else_is_declared(monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[2] / "data" / "aircraft")
    adjustable = fault_matrix.adjustable_terms.__wrapped__
    assert "Cl_aileron" in adjustable(TRAINER)
    assert "Cl_constant" not in adjustable(TRAINER)  # it has none

    class Fixed(fault_matrix.Plant):
        def has(self, name):
            return not name.startswith("uncertainty/") and super().has(name)

    monkeypatch.setattr(fault_matrix, "Plant", Fixed)
    monkeypatch.setattr(fault_matrix, "adjustable_terms", adjustable)
    flown = fault_matrix.declared("light", TRAINER)
    assert flown["uncertainty"] == {}
    assert flown["fdi"]["bounds"] == {
        "coefficients": 0.0, "sensors": "tactical-grade", "turbulence": "light"
    }  # fmt: skip


TRAINER = "./trainer"


def test_what_is_flown_of_which_aircraft(monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[2] / "data" / "aircraft")
    assert airspeeds_of("beaver") == (38.0, 45.0, 52.0)
    usual = fault_matrix.aircraft_of(TRAINER).usual_airspeed_mps
    assert airspeeds_of(TRAINER) == tuple(round(share * usual, 1) for share in (0.9, 1.0, 1.1))
    with monkeypatch.context() as at:
        made = SimpleNamespace(usual_airspeed_mps=33.37)
        at.setattr(fault_matrix, "aircraft_of", lambda reference: made)
        assert airspeeds_of(TRAINER) == (30.0, 33.4, 36.7)
    every = cases((40.0, 50.0), aircraft=TRAINER)
    assert every[:3] == [
        FaultCase(FAULTS[0][0], "aileron", 40.0, False, TRAINER, "none"),
        FaultCase(FAULTS[0][0], "aileron", 50.0, False, TRAINER, "none"),
        FaultCase(FAULTS[0][0], "elevator", 40.0, False, TRAINER, "none"),
    ]
    assert len(every) == 6 * len(FAULTS)
    assert scenario_of(every[0], "nominal", 0.0).uncertainty.sinusoid.p.amplitude_rad_s2 == 0.0
    assert [name_of(*which) for which in ((False, "none"), (True, "none"), (True, "light"))] == [
        "fault-matrix", "fault-matrix-declared", "fault-matrix-declared-light"
    ]  # fmt: skip


@pytest.fixture
def short(monkeypatch):
    """Flights of three seconds, the fault after one."""
    monkeypatch.setattr(fault_matrix, "DURATION_S", 3.0)
    monkeypatch.setattr(fault_matrix, "AT_S", 1.0)


@pytest.mark.parametrize(
    "case",
    [
        FaultCase("total loss", "elevator", 45.0),
        FaultCase("oscillation 0.5 deg, 10 rad/s", "aileron", 45.0, declared=True),
    ],
    ids=["elevator", "aileron"],
)
def test_a_row(case, short, changed):
    assert not changed(fly_case(case))


def landed(rms_deg_s, **found):
    """A flight of the trainer, whose surfaces stand in the order aileron, elevator, rudder."""
    airframe = SimpleNamespace(surfaces=("rudder", "aileron", "elevator"), dominant_axis=(2, 0, 1))
    rms = None if rms_deg_s is None else tuple(radians(of) for of in rms_deg_s)
    nothing = {"departure": None, "authority": {}, "envelope_exits": ()}
    scenario = SimpleNamespace(airframe=airframe)
    return SimpleNamespace(scenario=scenario, post_fault_rms_rad_s=rms, **nothing | found)


def test_tracking_is_of_the_surfaces_own_axis_beside_the_oracles():
    """What became of either flight, each by its own keys."""
    case = FaultCase("total loss", "rudder", 45.0)
    authority = {axis: {"beyond_s": of} for axis, of in (("p", 1.0), ("q", 2.0), ("r", 3.5))}
    ours = landed((0.1, 0.2, 0.6), departure=(21.5, "beta_rad"), envelope_exits=((19.0, 1.0),))
    oracle = landed(
        (0.7, 0.9, 0.4), departure=(25.0, "alpha_rad"), authority=authority,
        envelope_exits=((17.5, 2.0), (23.0, 4.0)),
    )  # fmt: skip
    found = fault_matrix._tracking(ours, oracle, case)
    numbers = [found.pop(key) for key in ("rms_deg_s", "oracle_rms_deg_s", "ratio")]
    assert numbers == pytest.approx([0.6, 0.4, 1.5])
    assert found == {
        "axis": "r", "departure_s": 21.5, "oracle_departure_s": 25.0, "departure_signal": "beta_rad",
        "oracle_beyond_s": 3.5, "oracle_left_envelope_s": 17.5,
    }  # fmt: skip
    kept = fault_matrix._tracking(landed((0.1, 0.2, 0.6)), landed(None), case._replace(surface="elevator"))
    assert (kept["axis"], kept["rms_deg_s"], kept["oracle_rms_deg_s"], kept["ratio"]) == (
        "q", pytest.approx(0.2), 0.0, None
    )  # fmt: skip
    assert [kept[key] for key in ("departure_s", "oracle_departure_s", "departure_signal")] == [None] * 3
    assert (kept["oracle_beyond_s"], kept["oracle_left_envelope_s"]) == (0.0, None)


def test_a_row_is_of_both_laws_and_of_the_informed_test_where_errors_are_declared(monkeypatch):
    """Each law flies the surface from its deflection in trim; the diagnosis is that of the first."""
    flown, asked = [], []
    monkeypatch.setattr(fault_matrix, "trimmed_deg", lambda *of: asked.append(of) or 1.25)
    monkeypatch.setattr(fault_matrix, "scenario_of", lambda case, law, deg: SimpleNamespace(
        law=law, deg=deg, airframe="airframe"))  # fmt: skip
    monkeypatch.setattr(fault_matrix, "columns_of", lambda airframe: [airframe])
    monkeypatch.setattr(
        fault_matrix, "fly", lambda one, log=None: flown.append((one.law, one.deg, log)) or one
    )
    monkeypatch.setattr(fault_matrix, "_diagnosis", lambda flight, case: {"seen by": flight.law})
    monkeypatch.setattr(
        fault_matrix, "_tracking", lambda flight, oracle, case: {"beside": (flight.law, oracle.law)}
    )
    monkeypatch.setattr(
        fault_matrix, "seen_when_told", lambda one, kept, surface: {"told": (one.law, kept, surface)}
    )
    ours, oracle = "fault-tolerant-published", "oracle-published"
    case = FaultCase("float", "rudder", 41.0, False, "beaver-split", "light")
    row = {"seen by": ours, "beside": (ours, oracle)}
    assert fly_case(case) == case._asdict() | row
    assert fly_case(case._replace(declared=True)) == case._asdict() | row | {
        "declared": True, "told": (ours, ["airframe"], "rudder")
    }  # fmt: skip
    assert asked == [(41.0, "rudder", "beaver-split")] * 2
    assert flown == [(law, 1.25, log) for kept in (None, ["airframe"]) for law, log in (
        (ours, kept), (oracle, None))]  # fmt: skip


def test_a_jam_is_off_the_trimmed_deflection():
    (name,) = [name for name, fault in FAULTS if fault.get("off_deg")][:1]
    off_deg = dict(FAULTS)[name]["off_deg"]
    (fault,) = scenario_of(FaultCase(name, "elevator", 45.0), "nominal", -1.5).faults
    assert fault.position_deg == -1.5 + off_deg
    assert (
        -5.0 < fault_matrix.trimmed_deg(52.0, "elevator") - fault_matrix.trimmed_deg(38.0, "elevator") != 0.0
    )


def test_the_shortest_time_beyond_all_deflections_is_a_reason():
    lost = {"axis": "p", "oracle_left_envelope_s": 3.0, "departure_signal": "beta_rad"}
    said = fault_matrix._reason([lost | {"oracle_beyond_s": 0.0}, lost | {"oracle_beyond_s": 0.1}])
    assert said == "for 0.1 s no deflection could hold the p rate"
    assert fault_matrix._reason([lost | {"oracle_beyond_s": 0.0}]).startswith(
        "the validated envelope was left at 3.0"
    )


def test_a_run_of_the_whole_matrix(monkeypatch, tmp_path):
    seen = []

    def made(case):
        seen.append(case)
        return rows_of(("aileron",))[0] | {"fault": case.fault, "surface": case.surface}

    monkeypatch.setattr(fault_matrix, "fly_case", made)
    monkeypatch.setattr(fault_matrix, "heat_map_of", lambda document: None)
    monkeypatch.setattr(fault_matrix, "FAULTS", FAULTS[:3])
    document = run_matrix(tmp_path, (40.0,), declared=True, turbulence="light")
    assert seen == cases((40.0,), True, "beaver", "light")
    assert (tmp_path / "fault-matrix-declared-light" / "fault-matrix.txt").read_text() == as_text(
        document
    ) + "\n"
    run_matrix(tmp_path)
    assert [case.airspeed_mps for case in seen[-3:]] == [38.0, 45.0, 52.0]


@pytest.mark.parametrize(
    ("isolation", "said"),
    [
        ({"fault": "elevator", "correct": True, "type": None, "candidates": []}, "surface"),
        ({"fault": "elevator", "correct": True, "type": "stuck", "type_correct": None}, "named"),
        ({"candidates": ["elevator"]}, "open"),
        ({"candidates": ["elevator:bias"]}, "WRONG"),
        ({"fault": "flap", "correct": False, "candidates": ["stuck"]}, "WRONG"),
    ],
)
def test_a_verdict(isolation, said):
    nothing = {"fault": None, "type": None, "candidates": [], "type_correct": None}
    document = {"detection": {"detected": True}, "false_alarm": False, "isolation": nothing | isolation}
    assert verdict(Metrics.of(document), "elevator", "stuck") == said
