"""Table, heat map and document of the fault matrix, of rows made by hand; short rows."""

import pytest

from beaver_ftc.studies.matrix import fault_matrix
from beaver_ftc.studies.matrix.fault_matrix import (
    FAULTS,
    FILES,
    FaultCase,
    as_text,
    document_of,
    fly_case,
    heat_map_of,
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
