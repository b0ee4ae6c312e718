"""The table feature x aircraft of aircraft.md: what can be done with which aircraft, or why not.

features.yaml says how each feature is tried.
"""

import json
import re
import tempfile
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from beaver_ftc.documents.errors import BeaverFtcError
from beaver_ftc.scenario.schema import load
from beaver_ftc.studies.matrix.fault_matrix import FAULTS, FaultCase, airspeeds_of, fly_case
from beaver_ftc.studies.present.tables import markdown_table
from beaver_ftc_aircraft.derive.first_use import derive_if_needed
from beaver_ftc_live.page import messages
from beaver_ftc_live.page.session import Session
from tools.data import beside
from tools.docs.tables import beaver

PLANES = {
    "beaver": "built in",
    "beaver-split": "halves by side",
    "jsbsim:c172p": "propeller",
    "jsbsim:737": "jets",
    "jsbsim:SGS": "glider",
}
Document = dict[str, Any]
LONGEST_S = 900
LIVE = "`live`, changes in flight"
YES, NO = "✓", "✗"
STUDIES = ("sweep", "compare", "detectability")


RUN = "run S.yaml --no-report"
FEATURES = beside(__file__)


def features() -> str:
    """All that the documents speak of, on one aircraft of each kind."""
    return _table(PLANES)


def features_probe() -> str:
    """On the aircraft that is built in, without the studies of several flights."""
    quick = {name: of for name, of in FEATURES.items() if not of.get("line", RUN).startswith(STUDIES)}
    return _table(("beaver",), quick, {LIVE: _live})


def _table(
    planes: Iterable[str],
    features: Mapping[str, Document] = FEATURES,
    functions: Mapping[str, Callable[[str], str]] | None = None,
) -> str:
    """A row a feature and a function, a column a plane. functions: what is tried without a command, by name;
    each takes the plane and returns why it cannot be done, or nothing."""
    functions = functions or {
        "`matrix`": partial(_matrix, declared=False),
        "`matrix --declared`": partial(_matrix, declared=True),
        LIVE: _live,
    }
    reasons: list[str] = []
    rows = [[name] for name in (*features, *functions)]
    for plane in planes:
        if plane.startswith("jsbsim:"):
            derive_if_needed(plane)
        said = [_tried(of.get("line", RUN), of.get("keys", {}), plane) for of in features.values()]
        said += [tried(plane) for tried in functions.values()]
        for row, why in zip(rows, said, strict=True):
            if why and why not in reasons:
                reasons.append(why)
            row.append(f"{NO} {reasons.index(why) + 1}" if why else YES)
    head = [f"`{plane}`, {PLANES[plane]}" for plane in planes]
    notes = "\n".join(f"{i}. {why}" for i, why in enumerate(reasons, 1))
    return markdown_table(("", *head), rows) + (f"\n\n{notes}" if notes else "")


def _tried(line: str, keys: Document, plane: str) -> str:
    """Why it cannot be done; nothing if it can. line: the command; keys: of the scenario."""
    speed_mps = load({"name": "S", "aircraft": plane}).initial.airspeed_mps
    line = line.format(plane=plane, speed=speed_mps)
    fault = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.6, "at_s": 3}
    flight = {"name": "S", "aircraft": plane, "duration_s": 6, "faults": [fault]} | keys
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "S.yaml").write_text(json.dumps(flight))
        (Path(folder) / "W.yaml").write_text(json.dumps({"name": "W", "base": "S.yaml", "runs": 2}))
        run = beaver(*line.split(), cwd=Path(folder), longest_s=LONGEST_S)
    if run.returncode in (0, 1):
        return ""
    return re.sub(r"^S(\.yaml)?(:\d+)?: |`", "", run.stderr.strip().splitlines()[-1])


def _matrix(plane: str, declared: bool) -> str:
    """One fault of the table, of the elevator."""
    case = FaultCase(FAULTS[0][0], "elevator", airspeeds_of(plane)[1], declared, plane)
    try:
        row = fly_case(case)
    except BeaverFtcError as error:
        return str(error)
    return "the verdict is wrong" if row["verdict"] == "WRONG" else ""


def _live(plane: str) -> str:
    """A flight of the live page in which all changes: a fault, a gust, law and sensors, a repair."""
    asked = (
        {"do": "break", "fault": {"actuator": "elevator", "type": "stuck"}},
        {"do": "blow", "velocity_mps": [0.0, 3.0, -2.0]},
        {"do": "change", "law": "nominal", "scheme": "observer-constant", "sensors": "tactical-grade"},
        {"do": "repair"},
    )
    scenario = load({"name": "S", "aircraft": plane})
    with tempfile.TemporaryDirectory() as folder:
        session = Session(scenario, Path(folder))
        try:
            for request in asked:
                session.handle(messages.parse(json.dumps(request)))
                for _ in range(50):
                    session.step()
        except BeaverFtcError as error:
            return str(error)
        finally:
            session.sim.release()
    return ""
