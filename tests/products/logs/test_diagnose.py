"""Diagnosis of flights whose faults are known; causal, calibrated, honest about what is together."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.diagnose import LogRows, diagnose
from beaver_ftc_logs.findings import verdict_document
from beaver_ftc_logs.samples import load_flights_for_fit
from beaver_ftc_logs.scoring import score_against_labels, score_diagnosis
from products.logs import synthetic

PARTS = ((60, 120, 1.0, 0.5), (160, 220, 0.4, 1.0))


@pytest.fixture(scope="module")
def flown(wing, wing_folder):
    columns = synthetic.fly(280.0, parts=PARTS, seed=11, trim=(0.12, -0.22), gain=0.95)
    return load_flights_for_fit([synthetic.write_csv(wing_folder / "flown.csv", columns)], wing)[0]


@pytest.fixture(scope="module")
def rows(flown, wing_model):
    return diagnose(flown, wing_model)


def test_faults_are_named_and_measured(flown, rows):
    for begin, end, surface, level in ((65, 120, 1, 0.5), (165, 220, 0, 0.4)):
        within = (rows.t_s > begin) & (rows.t_s < end)
        assert np.median(rows.effectiveness[within, surface]) == pytest.approx(level, abs=0.101)
        assert np.mean(rows.isolated_surfaces[within] == ("right", "left")[surface]) > 0.9
    before = rows.t_s < 60
    assert rows.faulty[before].mean() < 0.02


def test_labels_are_not_read(flown, rows, wing_model):
    from dataclasses import replace

    blind = diagnose(replace(flown, labels=np.full_like(flown.labels, np.nan)), wing_model)
    assert np.array_equal(blind.effectiveness, rows.effectiveness)


@pytest.mark.parametrize("cut", [400, 650, 1500])
def test_cutting_the_flight_short_changes_no_earlier_row(wing, wing_folder, wing_model, rows, cut):
    columns = synthetic.fly(280.0, parts=PARTS, seed=11, trim=(0.12, -0.22), gain=0.95)
    path = synthetic.write_csv(wing_folder / f"cut-{cut}.csv", columns, slice(0, cut))
    short = diagnose(load_flights_for_fit([path], wing)[0], wing_model)
    for field in (
        "t_s",
        "faulty",
        "isolated_surfaces",
        "effectiveness",
        "effectiveness_low",
        "effectiveness_high",
        "fault_probability",
    ):
        assert np.array_equal(getattr(short, field), getattr(rows, field)[:cut]), field


def test_bounds_are_in_order_and_hold_the_estimate(rows):
    assert (rows.effectiveness_low >= 0).all()
    assert (rows.effectiveness_high <= 1).all()
    assert (rows.effectiveness_low <= rows.effectiveness).all()
    assert (rows.effectiveness <= rows.effectiveness_high).all()


def test_score_of_a_perfect_diagnosis(flown, rows):
    faulty = (flown.labels < 1).any(axis=1).astype(int)
    perfect = replace(
        rows,
        effectiveness=flown.labels,
        effectiveness_low=flown.labels,
        effectiveness_high=flown.labels,
        faulty=faulty,
    )
    found = score_against_labels(perfect, flown.labels)
    assert [found[key] for key in ("classes", "healthy_or_faulty", "side", "held_by_bounds")] == [1.0] * 4
    assert found["mean_error"] == 0.0
    assert (
        score_against_labels(replace(perfect, effectiveness=np.ones_like(flown.labels)), flown.labels)[
            "classes"
        ]
        < 0.7
    )


def test_a_score_by_one_label_on_the_stamps_of_a_faster_log(flown, rows):
    """Two stamps a sample, and a surface without a label: the figures of the other one."""
    labels = flown.labels.copy()
    labels[:, 0] = np.nan
    twice = {name: np.repeat(getattr(rows, name), 2, axis=0) for name in rows.__dataclass_fields__}
    twice["t_s"] = twice["t_s"] + np.tile([0.0, 0.4 * flown.dt_s], len(rows.t_s))
    found = score_diagnosis(replace(flown, labels=labels), LogRows(**twice), [["right"], ["left"]])
    left = {
        name: getattr(rows, name)[:, 1:]
        for name in ("effectiveness", "effectiveness_low", "effectiveness_high")
    }
    wanted = score_against_labels(replace(rows, **left), flown.labels[:, 1:])
    assert found.pop("rows") == 2 * wanted.pop("rows")
    assert found.pop("settings") == wanted.pop("settings")
    assert found == {key: pytest.approx(value) for key, value in wanted.items()}


def test_another_rate_is_refused(wing, wing_folder, wing_model):
    columns = {name: values[::2] for name, values in synthetic.fly(60.0).items()}
    path = synthetic.write_csv(wing_folder / "slow.csv", columns)
    with pytest.raises(BadInput, match=r"has samples at 5 Hz, allowed: within 25% of the 10 Hz"):
        diagnose(load_flights_for_fit([path], wing)[0], wing_model)


def test_a_verdict_says_what_a_still_flight_cannot_show(wing, wing_folder, wing_model, rows, flown):
    still = synthetic.fly(60.0, trim=(0.0, 0.0))
    still["roll_command"][:] = 0.0
    still["pitch_command"][:] = 0.0
    samples = load_flights_for_fit([synthetic.write_csv(wing_folder / "still.csv", still)], wing)[0]
    said = verdict_document(samples, wing_model, diagnose(samples, wing_model))["isolability"]["groups"]
    lively = verdict_document(flown, wing_model, rows)["isolability"]["groups"]
    for one, other in zip(said, lively, strict=True):
        assert one["smallest_loss"]["5"] is None
        assert 0.0 < other["smallest_loss"]["60"] < other["smallest_loss"]["5"]


def test_events_are_as_few_as_the_faults(rows, wing):
    from beaver_ftc_logs.findings import events_to_show, fault_events

    events = events_to_show(fault_events(rows, list(wing.surfaces)))
    named = [event["named"] for event in events if event["to_s"] - event["from_s"] > 20]
    assert named == ["left", "right"]
    assert len(events) <= 5
    for event, begins in zip([e for e in events if e["to_s"] - e["from_s"] > 20], (60, 160), strict=True):
        assert begins <= event["from_s"] < begins + 5
