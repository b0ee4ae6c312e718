"""What the watch over the instruments has found, in words."""

from typing import Any

import numpy as np

from beaver_ftc.plant.instruments import SENSORS
from beaver_ftc.scenario.sensor_faults import sensor_words

WAIT_S = 1.0  # for the instrument to be told; then the fault is outside what can be named


def instrument_found(watch: np.void, t_s: float) -> dict[str, Any] | None:
    """The verdict's parts as of t_s, where an instrument is found broken; None where none is."""
    if not watch["alarmed"] or watch["beside"]:
        return None
    said: dict[str, Any] = {"isolated": None, "isolation_type": None, "estimate": None, "candidates": ()}
    said["detection_time_s"], said["isolation_time_s"] = float(watch["alarmed_at_s"]), None
    if watch["named"] >= 0:
        said["isolated"] = sensor_words(SENSORS[int(watch["named"])])
        said["isolation_time_s"] = float(watch["named_at_s"])
    elif t_s > said["detection_time_s"] + WAIT_S:
        said["isolated"] = said["isolation_type"] = "unanticipated"
        said["isolation_time_s"] = said["detection_time_s"] + WAIT_S
    else:
        left = zip(SENSORS, watch["suspect"], strict=True)
        said["candidates"] = tuple(sensor_words(name) for name, possible in left if possible)
    return said
