"""What the diagnosis has found by a frame: alarm, names, types and estimates, read off the frame record."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.diagnosis import Verdict
from beaver_ftc.diagnosis.monitors.records import sensor_monitor_finding
from beaver_ftc.diagnosis.state import NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.diagnosis.types.findings import estimate_fault_parameter, fault_finding_dict
from beaver_ftc.loop.frame import isolated_theta


def instant(seconds: float) -> float | None:
    """An instant, s; None for one that never came, which records have as -1."""
    return float(seconds) if seconds >= 0.0 else None


def _estimate(fdi: np.void, surface: int) -> float:
    """theta of the isolated loss. Compiled code is asked only where it must be: the first call from Python
    takes a quarter of a second."""
    if fdi["statistical"]["test"]["enabled"]:
        return float(isolated_theta(fdi, surface))
    axis, estimator = int(fdi["layout"]["dominant_axis"][surface]), int(fdi["verdict"]["isolated_estimator"])
    return float(fdi["isolation"]["estimator"][estimator]["theta"][axis])


def _isolation(fdi: np.void, surfaces: Sequence[str]) -> dict[str, Any]:
    """isolated, isolation_type, candidates, estimate, isolation_time_s of a Landing."""
    if fdi["config"]["diagnoses_all_types"]:
        return fault_finding_dict(fdi, surfaces)
    isolated = int(fdi["verdict"]["isolated_estimator"])
    said: dict[str, Any] = {"isolated": None, "isolation_type": None, "estimate": None, "candidates": ()}
    said["isolation_time_s"] = None
    if not fdi["verdict"]["detected"]:
        return said
    if isolated == UNANTICIPATED:
        said |= {"isolated": "unanticipated", "isolation_type": "unanticipated"}
    else:
        estimators = fdi["isolation"]["estimator"][: int(fdi["isolation"]["config"]["n_estimators"])]
        left = [surfaces[int(fie["surface"])] for fie in estimators if not fie["excluded"]]
        if isolated == NOT_ISOLATED:  # a loss that is excluded is no damage excluded
            left += [
                s for s, taken in zip(surfaces, fdi["isolation"]["config"]["losable"], strict=True) if taken
            ]
        said["candidates"] = tuple(dict.fromkeys(left))
    if isolated >= 0:
        surface = int(fdi["isolation"]["estimator"][isolated]["surface"])
        said |= {"isolated": surfaces[surface], "isolation_type": "loss_of_effectiveness"}
        said["estimate"] = _estimate(fdi, surface)
    if isolated != NOT_ISOLATED:
        said["isolation_time_s"] = float(fdi["verdict"]["isolated_at_s"])
    return said


def _alarm(fdi: np.void) -> dict[str, Any]:
    """detection_time_s and detection_axis of a Landing."""
    verdict = fdi["verdict"]
    return {
        "detection_time_s": instant(verdict["detected_at_s"]),
        "detection_axis": AXES[int(verdict["axis"])] if verdict["detected"] else None,
    }


def _findings(frame: np.void, surfaces: Sequence[str]) -> dict[str, Any]:
    """What `_alarm` and `_isolation` have, of surfaces, of an instrument, or of both."""
    fdi, monitor = frame["fdi"], frame["fdi"]["sensor_monitor"]["output"]
    broken = sensor_monitor_finding(fdi["sensor_monitor"], float(frame["t"]))
    if broken is not None:
        broken["so_far"] = False if broken["isolated"] else None
        if not monitor["keeps_surface"]:
            return {"detection_axis": None, **broken}
    alarm, said = _alarm(fdi), _isolation(fdi, surfaces)
    said["so_far"] = None if said["isolated"] is None else said["isolated"] in surfaces
    if broken is None:
        return alarm | said
    if said["isolated"] in surfaces:  # its estimate is of the last frame with a sound sensor
        said["estimate_at_s"] = float(monitor["alarmed_at_s"]) - float(frame["dt"])
        if not fdi["config"]["diagnoses_all_types"]:
            effectiveness = frame["assessment"]["effectiveness"][surfaces.index(said["isolated"])]
            said["estimate"] = float(effectiveness) - 1.0
    found = said.get("faults") or (said,)
    parts = (*found, broken) if said["isolated"] else (broken, *found)
    return {**parts[0], **alarm, "faults": parts}


def found_so_far(frame: np.void, surfaces: Sequence[str], verdict: Verdict | None) -> dict[str, Any]:
    """Alarm and names as of the frame just flown; verdict: of a plug-in detector, the last one."""
    return _findings(frame, surfaces) if verdict is None else _of_verdict(frame["fdi"], verdict)


def verdict_of(frame: np.void, surfaces: Sequence[str]) -> Verdict:
    """What the built-in diagnosis makes of the flight so far, as a plug-in law is given it."""
    fdi = frame["fdi"]
    if not (fdi["verdict"]["detected"] or fdi["sensor_monitor"]["output"]["alarmed"]):
        return Verdict()
    said = _findings(frame, surfaces)
    return Verdict(
        detected=True,
        axis=said["detection_axis"],
        isolated=said["isolated"],
        type=said["isolation_type"],
        estimate=said["estimate"],
        candidates=said["candidates"],
    )


def words_follow_from(fdi: np.void) -> bytes:
    """What a verdict of the built-in diagnosis follows from, but for its estimate: others, if it changes."""
    types, surfaces = fdi["types"], fdi["types"]["surface"]
    evidence = surfaces["evidence"]
    brief = evidence["n_anomalous"] - evidence["n_rest"] < types["config"]["half_frames"]
    excluded = fdi["isolation"]["estimator"]["excluded"], surfaces["sets"]["excluded"]
    parts = fdi["verdict"], types["pair"]["group_alarm"], surfaces["status"], brief, *excluded
    return b"".join(part.tobytes() for part in parts)


def estimate_now(fdi: np.void, said: Verdict, surfaces: Sequence[str]) -> float | None:
    """The estimate of a verdict that otherwise still stands, of a diagnosis for every type."""
    surface, types = surfaces.index(str(said.isolated)), fdi["types"]
    pairs = types["pair"]["enabled"]
    status = types["surface"][surface]["status"] if pairs else fdi["verdict"]
    return estimate_fault_parameter(fdi, surface, int(status["fault_type"]))


def _of_verdict(fdi: np.void, verdict: Verdict) -> dict[str, Any]:
    """The same of a Landing, from a plug-in's verdict."""
    said = verdict if fdi["verdict"]["detected"] else Verdict()
    return _alarm(fdi) | {
        "isolated": said.isolated,
        "isolation_type": said.type if said.isolated else None,
        "candidates": tuple(said.candidates),
        "estimate": said.estimate if said.isolated else None,
        "isolation_time_s": float(fdi["verdict"]["isolated_at_s"]) if said.isolated else None,
    }
