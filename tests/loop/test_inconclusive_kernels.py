"""The count of frames in which nothing can be concluded, on plain records."""

import numpy as np

from beaver_ftc.diagnosis.bounds import N_MAP_COORDINATES
from beaver_ftc.diagnosis.schemes import fdi_dtype
from beaver_ftc.loop.frame import INCONCLUSIVE, note_inconclusive

DENSITY = 6


def diagnosis(enabled=1, outside=1, time_s=5.0, n_boxes=2, **place):
    fdi = np.zeros(1, fdi_dtype(4)).view(np.recarray)[0]
    fdi["config"]["enabled"], error_map = enabled, fdi["bound"]["error_map"]
    error_map["n_boxes"], error_map["outside"], error_map["time_s"] = n_boxes, outside, time_s
    error_map["n_rows"], error_map["until_s"][0] = 1, 60.0
    error_map["lo"][0], error_map["hi"][0] = -1.0, 1.0
    error_map["lo"][1], error_map["hi"][1] = -2.0, 3.0
    error_map["lo"][:2, DENSITY], error_map["hi"][:2, DENSITY] = (0.9, 1.0), (1.05, 1.2)
    error_map["coordinates"][:], error_map["coordinates"][DENSITY] = 0.5, 1.1
    for name, value in place.items():
        error_map["coordinates"][int(name[1:])] = value
    return fdi


def noted(*frames):
    counted = np.zeros(1, INCONCLUSIVE).view(np.recarray)[0]
    for k, fdi in enumerate(frames):
        note_inconclusive(counted, fdi, 0.5 * k)
    return counted


def test_each_reason_is_counted():
    counted = noted(
        diagnosis(outside=0),
        diagnosis(i6=0.8, i3=-2.5), diagnosis(i6=0.7), diagnosis(i6=1.25),  # alpha once, density three times
        diagnosis(time_s=61.0, i6=0.6),  # what else is beyond does not count then
        diagnosis(enabled=0, outside=0),
        diagnosis(),  # inside the range of each quantity
        diagnosis(n_boxes=0),  # an aircraft without a map
    )  # fmt: skip
    assert (counted.watched, counted.frames, counted.from_s) == (8, 6, 0.5)
    assert (counted.late, counted.undiagnosed, counted.between) == (1, 1, 1)
    beyond = np.zeros(N_MAP_COORDINATES)
    beyond[3], beyond[DENSITY] = 1, 3
    assert counted.beyond.tolist() == beyond.tolist()
    assert (counted.least[DENSITY], counted.greatest[DENSITY]) == (0.7, 1.25)
    assert (counted.least[3], counted.greatest[3]) == (-2.5, -2.5)
