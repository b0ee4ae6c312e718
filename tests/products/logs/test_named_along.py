"""A name stands only where what is left unexplained lies along what the named surface turns."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc_logs.diagnose import _withdraw_contradicted, diagnose
from products.logs import synthetic

BIAS, FROM_S = 0.4, 60.0


@pytest.fixture(scope="module")
def biased(sampled):
    """A flight whose left elevon is off by a share of its travel: the linear wing's answer to that, added."""
    columns = synthetic.fly(120.0, seed=31)
    more, names = np.zeros((len(columns["t_s"]), 3)), ["p_rad_s", "q_rad_s", "r_rad_s"]
    offset = np.where(columns["t_s"] >= FROM_S, BIAS, 0.0)
    for k in range(3, len(more)):
        more[k] = more[k - 1] @ synthetic.PAST + offset[k - 3 : k] @ synthetic.LEFT[::-1]
    columns |= {name: columns[name] + of for name, of in zip(names, more.T, strict=True)}
    return sampled(columns=columns)


def named(biased, wing_model, name):
    rows = diagnose(biased, wing_model)
    given = replace(rows, isolated_surfaces=np.full(len(rows.t_s), name, dtype=object))
    return _withdraw_contradicted(biased, wing_model, given, 12.0)


def test_the_other_surface_is_taken_back_and_its_bounds_with_it(biased, wing_model):
    found = named(biased, wing_model, "right")
    late = found.t_s > FROM_S + 1.0
    assert (found.isolated_surfaces[late] == "unknown").mean() > 0.99
    assert (found.effectiveness_low[late & (found.isolated_surfaces == "unknown")] == 0.0).all()
    assert (found.isolated_surfaces[found.t_s < FROM_S] == "right").mean() > 0.95


def test_the_surface_at_fault_keeps_its_name(biased, wing_model):
    assert (named(biased, wing_model, "left").isolated_surfaces == "left").all()
    assert (named(biased, wing_model, "right+left").isolated_surfaces == "right+left").mean() < 1.0
