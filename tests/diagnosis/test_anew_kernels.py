"""What a kernel fills it fills anew: whatever stood there before makes no difference."""

import numpy as np
import pytest
from kernels import fill, holder, new_fdi
from statistics_of import Statistical

from beaver_ftc.aircraft.schema import MAX_MONOMIALS
from beaver_ftc.design import model
from beaver_ftc.diagnosis import bounds, gusts
from beaver_ftc.diagnosis.gusts import GUST_RECORD

X, U = np.array([0.1, -0.05, 0.07]), np.array([0.1, -0.15, 0.05, 0.2])
Y = np.array([0.1, 0.03, 45.0, 1036.0, 0.3, 0.0, 0.0, 0.0])


def design():
    return model.design_record().view(np.recarray)[0]


FILL = {
    "free response": ((3,), lambda out: model.both_responses(design(), X, Y, out, np.full((3, 4), 9.0))),
    "control effectiveness": ((3, 4), lambda out: model.both_responses(design(), X, Y, np.full(3, 9.0), out)),
    "damping": ((3, 3), lambda out: model.rate_damping(design(), X, Y, U, np.full(MAX_MONOMIALS, 9.0), out)),
    "level axes": ((3, 3), lambda out: gusts.fill_rotation(0.3, 0.2, out)),
}


@pytest.mark.parametrize("name", FILL)
def test_arrays(name):
    shape, fill = FILL[name]
    clean, used = np.zeros(shape), np.full(shape, 9.0)
    fill(clean)
    fill(used)
    assert used.tolist() == clean.tolist()
    assert clean.any()


@pytest.mark.parametrize("moving", [0, 1])
def test_the_drift_of_the_detectors_blocks(moving):
    found = []
    for before in (0.0, 9.0):
        fdi = new_fdi()
        record = fdi["statistical"]
        record["gust"]["output"]["gusty"], record["noise"]["eta_u"] = (
            moving,
            0.01,
        )
        (
            record["gust"]["output"]["rate_damping"],
            record["gust"]["memory"]["Q"],
            record["gust"]["memory"]["share"],
        ) = np.eye(3), 1e-3, 0.5
        record["gust"]["output"]["C"] = np.arange(9.0).reshape(3, 3)
        for block, axes in zip(record["block"], ((1,), (0, 2)), strict=False):
            block["n"], block["axes"][: len(axes)], block["Q_scale"] = (
                len(axes),
                axes,
                1.0,
            )
        record["noise"]["eta"] = record["block"]["Q_d"] = record["block"]["Q_x"] = before
        fdi["bound"]["const"] = 0.02
        Statistical.drifts(record, fdi, design(), X, Y)
        found.append(
            [
                record["noise"]["eta"].tolist(),
                record["block"]["Q_d"][0, 0, 0].tolist(),
            ]
        )
        found[-1] += [
            record["block"]["Q_d"][1].tolist(),
            record["block"]["Q_x"][1].tolist(),
        ]
    assert found[0] == found[1]


def test_the_gusts_effect():
    found, filled = (
        [],
        (
            "f",
            "w_body",
            "acc",
            "acc_coarse",
            "rate_damping",
        ),
    )
    for before in (0.0, 9.0):
        record = np.zeros(1, GUST_RECORD).view(np.recarray)[0]
        fill(record, span=14.0, C=np.eye(3), w=(0.0, 0.02, -0.03))
        fill(record, **dict.fromkeys((*filled, "scratch"), before))
        gusts.fill_gust_effect(record, design(), X, Y, U)
        found.append([holder(record, name)[name].tolist() for name in filled])
    assert found[0] == found[1]


def test_the_published_bound_adds_to_what_is_there():
    once, more = np.zeros(3), np.full(3, 0.5)
    for out in (once, more):
        bounds.add_published_bound(X, design(), np.full(3, 0.1), np.full(3, 0.02), 7e-5, out)
    assert more - once == pytest.approx([0.5] * 3)
