"""What the diagnosis has found by a frame: alarm, names, types and estimates, read off the frame record."""

from collections.abc import Sequence
from itertools import compress
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.diagnosis import Verdict
from beaver_ftc.diagnosis.conclusion import NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.diagnosis.monitors.records import sensor_monitor_finding
from beaver_ftc.diagnosis.types.findings import NO_FINDINGS, estimate_fault_parameter, fault_finding_dict
from beaver_ftc.loop.frame import isolated_theta


def instant(seconds: float) -> float | None:
    """An instant, s; None for one that never came, which records have as -1."""
    return float(seconds) if seconds >= 0.0 else None


def _estimate(fdi: np.void, surface: int) -> float:
    """theta in [-1, 0] of the isolated loss. Only the statistical detector's needs compiled code, whose first
    call from Python takes a quarter of a second."""
    if fdi["statistical"]["test"]["enabled"]:
        return float(isolated_theta(fdi, surface))
    axis, estimator = int(fdi["layout"]["dominant_axis"][surface]), int(fdi["verdict"]["isolated_estimator"])
    return float(fdi["isolation"]["estimator"][estimator]["theta"][axis])


def _isolation(fdi: np.void, surfaces: Sequence[str]) -> dict[str, Any]:
    """isolated, isolation_type, candidates, estimate, isolation_time_s of a Landing.

    If losses of effectiveness are the only types, the candidates are the surfaces whose estimators are not
    excluded, and, while no surface is isolated, all surfaces that a damage may take: excluding the loss of a
    surface does not exclude its damage.
    """
    verdict, isolation = fdi["verdict"], fdi["isolation"]
    isolated = int(verdict["isolated_estimator"])
    if fdi["config"]["diagnoses_all_types"] or not verdict["detected"] or isolated == UNANTICIPATED:
        return fault_finding_dict(fdi, surfaces)
    estimators = isolation["estimator"][: int(isolation["config"]["n_estimators"])]
    left = [surfaces[s] for s in estimators["surface"][estimators["excluded"] == 0]]
    if isolated == NOT_ISOLATED:
        left += compress(surfaces, isolation["config"]["losable"])
        return {**NO_FINDINGS, "candidates": tuple(dict.fromkeys(left))}
    s = int(estimators["surface"][isolated])
    return {
        "isolated": surfaces[s],
        "isolation_type": "loss_of_effectiveness",
        "candidates": tuple(dict.fromkeys(left)),
        "estimate": _estimate(fdi, s),
        "isolation_time_s": float(verdict["isolated_at_s"]),
    }


def _alarm(fdi: np.void) -> dict[str, Any]:
    """detection_time_s and detection_axis of a Landing."""
    verdict = fdi["verdict"]
    return {
        "detection_time_s": instant(verdict["detected_at_s"]),
        "detection_axis": AXES[int(verdict["axis"])] if verdict["detected"] else None,
    }


def _findings(frame: np.void, surfaces: Sequence[str]) -> dict[str, Any]:
    """The findings on surfaces (`_alarm`, `_isolation`), on the sensors, or on both:

        sensor broken    alarm of surfaces    fault of surfaces    finding     `faults`
        no               -                    -                    surfaces    of surfaces
        yes              void                 -                    sensor      none
        yes              kept                 isolated             surfaces    of surfaces, sensor
        yes              kept                 open                 sensor      sensor, of surfaces

    The alarm of surfaces is kept if it came long before that of the sensors: the sensors were sound then.
    """
    fdi, monitor = frame["fdi"], frame["fdi"]["sensor_monitor"]
    broken = sensor_monitor_finding(monitor, float(frame["t"]))
    if broken is not None:
        broken["so_far"] = False if broken["isolated"] else None
        if not monitor["output"]["keeps_surface"]:
            return {"detection_axis": None, **broken}
    alarm, finding = _alarm(fdi), _isolation(fdi, surfaces)
    isolated = finding["isolated"]
    finding["so_far"] = None if isolated is None else isolated in surfaces
    if broken is None:
        return alarm | finding
    if isolated in surfaces:  # its estimate is of the last frame with a sound sensor
        finding["estimate_at_s"] = float(monitor["output"]["alarmed_at_s"]) - float(frame["dt"])
        if not fdi["config"]["diagnoses_all_types"]:
            finding["estimate"] = float(frame["assessment"]["effectiveness"][surfaces.index(isolated)]) - 1.0
    of_surfaces = finding.get("faults") or (finding,)
    faults = (*of_surfaces, broken) if isolated else (broken, *of_surfaces)
    return {**faults[0], **alarm, "faults": faults}


def found_so_far(frame: np.void, surfaces: Sequence[str], verdict: Verdict | None) -> dict[str, Any]:
    """Alarm and names as of the frame just flown; verdict: of a plug-in detector, the last one."""
    return _findings(frame, surfaces) if verdict is None else _of_verdict(frame["fdi"], verdict)


def verdict_of(frame: np.void, surfaces: Sequence[str]) -> Verdict:
    """What the built-in diagnosis makes of the flight so far, as a plug-in law is given it."""
    fdi = frame["fdi"]
    if not (fdi["verdict"]["detected"] or fdi["sensor_monitor"]["output"]["alarmed"]):
        return Verdict()
    finding = _findings(frame, surfaces)
    return Verdict(
        detected=True,
        axis=finding["detection_axis"],
        isolated=finding["isolated"],
        type=finding["isolation_type"],
        estimate=finding["estimate"],
        candidates=finding["candidates"],
    )


def words_follow_from(fdi: np.void) -> bytes:
    """The state on which every part of a verdict depends but its estimate: the same state, the same words.

    brief: whether a constant was seen for too short a time to exclude types that vary (types/findings.py).
    """
    types, surfaces = fdi["types"], fdi["types"]["surface"]
    evidence = surfaces["evidence"]
    brief = evidence["n_anomalous"] - evidence["n_rest"] < types["config"]["half_frames"]
    excluded = fdi["isolation"]["estimator"]["excluded"], surfaces["sets"]["excluded"]
    parts = fdi["verdict"], types["pair"]["group_alarm"], surfaces["status"], brief, *excluded
    return b"".join(part.tobytes() for part in parts)


def estimate_now(fdi: np.void, said: Verdict, surfaces: Sequence[str]) -> float | None:
    """The estimate at this frame of the fault that `said` names, by a diagnosis of every type."""
    s, types = surfaces.index(str(said.isolated)), fdi["types"]
    status = types["surface"][s]["status"] if types["pair"]["enabled"] else fdi["verdict"]
    return estimate_fault_parameter(fdi, s, int(status["fault_type"]))


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
