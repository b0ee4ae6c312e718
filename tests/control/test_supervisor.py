"""Every law in every situation: the whole table, written out."""

import itertools

import numpy as np
import pytest

from beaver_ftc.control.accommodation import MODES, SUPERVISOR, mode_from, supervise
from beaver_ftc.diagnosis.conclusion import NOT_ISOLATED, UNANTICIPATED
from law_records import new_control

NAMES = "detected isolated_estimator target accommodation_mode diagnoses_all_types isolated_surface"
SAID = np.dtype([(name, int) for name in NAMES.split()])  # of verdict and assessment

SITUATIONS = {  # detected, isolated
    "healthy": (0, NOT_ISOLATED), "detected": (1, NOT_ISOLATED), "elevator": (1, 1),
    "unanticipated": (1, UNANTICIPATED),
}  # fmt: skip
TOLERANT = {
    "healthy": "nominal", "detected": "adaptive", "elevator": "reallocated",
    "unanticipated": "unanticipated",
}  # fmt: skip
EXPECTED = {
    "nominal": dict.fromkeys(SITUATIONS, "nominal"), "adaptive": TOLERANT | {"elevator": "adaptive"},
    "fault-tolerant": TOLERANT,
}  # fmt: skip


@pytest.mark.parametrize(("law", "situation"), list(itertools.product(EXPECTED, SITUATIONS)))
def test_mode(law, situation):
    control, said = new_control(law=law, main=(0, 1, 2), stand_in=3), np.zeros(1, SAID).view(np.recarray)[0]
    said["detected"], said["isolated_estimator"] = SITUATIONS[situation]
    said["isolated_surface"] = max(said["isolated_estimator"], -1)
    assert MODES[mode_from(control["config"], control["layout"], said, said)] == EXPECTED[law][situation]


@pytest.mark.parametrize(("told", "now", "wanted"), list(itertools.product((0, 1), MODES, MODES)))
def test_the_way_out_of_nominal_leads_through_adaptive(told, now, wanted):
    """As does that of a law which takes over from one that was told."""
    supervisor = np.zeros(1, SUPERVISOR).view(np.recarray)[0]
    supervisor.mode, supervisor.informed = MODES.index(now), told
    supervise(supervisor, MODES.index(wanted), 0, 1.0)
    leaves_nominal = (told or now == "nominal") and wanted != "nominal"
    assert MODES[supervisor.mode] == ("adaptive" if leaves_nominal else wanted)


def test_the_last_place_of_a_full_record_has_the_last_change():
    supervisor = np.zeros(1, SUPERVISOR).view(np.recarray)[0]
    supervisor.mode, n = 2, supervisor.mode_at_s.size
    for t in range(n + 3):
        supervise(supervisor, 2 + t % 2, 0, float(t))
    assert supervisor.mode_at_s.tolist() == [*range(n - 1), n + 2]
