"""Compiles what most flights use and derives what several tests fly, unless that has been done for the
package's sources as they are.

`python tests/warm.py`, from the checkout's root; conftest.py does it before the first test that flies.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from beaver_ftc.compiled import cache_folder
from beaver_ftc.documents.files import PACKAGE, digest_of_files

DERIVED = "jsbsim:c172p"


def main():
    folder = cache_folder()
    if folder is None:
        return
    done = folder / f"warm-{digest_of_files(*sorted(PACKAGE.rglob('*.py')))}"
    if done.exists():
        return
    from beaver_ftc import extensions
    from beaver_ftc.control.rivals.indi import IncrementalInversion
    from beaver_ftc.diagnosis.rivals.rls import RlsMonitor
    from beaver_ftc.loop.loop import fly
    from beaver_ftc.scenario.schema import load_scenario
    from flying import loss, scenario

    derive = extensions.offered("derive")
    if derive:
        derive(DERIVED)
    for plugged in ({}, {"detector": RlsMonitor()}, {"law": IncrementalInversion()}):
        fly(scenario(duration_s=0.2, substeps=2, fdi={"statistical": {}}), **plugged)
    published = load_scenario("elevator-partial-loss")  # after an alarm other kernels are used
    for changed in ({}, {"fdi.fault_class": "all"}, {"control.law": "fault-tolerant"}):
        fly(published.with_(changed))
    every, real = {"fault_class": "all", "statistical": {}}, "tactical-grade"
    for keys in (
        {"fdi": every, "faults": [loss(at_s=0.3, magnitude=0.9)]},
        {"fdi": every | {"bounds": {"sensors": real}}, "sensors": real},
        {"autopilot": {"altitude_m": [{"hold": True}]}},
    ):
        fly(scenario(duration_s=1.0, **keys))
    done.touch()


if __name__ == "__main__":
    main()
