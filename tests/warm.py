"""Compiles what most flights use, unless that has been done for the package's sources as they are.

`python tests/warm.py`, from the checkout's root; conftest.py does it, or waits for it, before the first test.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from filelock import FileLock

from beaver_ftc.compiled import cache_folder
from beaver_ftc.documents.files import PACKAGE, digest_of_files


def main():
    folder = cache_folder()
    if folder is None:
        return
    done = folder / f"warm-{digest_of_files(Path(__file__), *sorted(PACKAGE.rglob('*.py')))}"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    with FileLock(done.with_suffix(".lock")):
        if not done.exists():
            _warm()
            done.touch()


def _warm():
    import beaver_ftc as bf
    from beaver_ftc.control.rivals.indi import IncrementalInversion
    from beaver_ftc.diagnosis.rivals.rls import RlsMonitor
    from beaver_ftc.loop.loop import fly
    from beaver_ftc.scenario.schema import load_scenario
    from flying import loss, scenario

    for plugged in ({}, {"detector": RlsMonitor()}, {"law": IncrementalInversion()}):
        fly(scenario(duration_s=0.2, substeps=2, fdi={"statistical": {}}), **plugged)
    published = load_scenario("elevator-partial-loss")  # after an alarm other kernels are used
    for changed in ({}, {"fdi.fault_class": "all"}, {"control.law": "fault-tolerant"}):
        fly(published.with_(changed))
    every, real = {"fault_class": "all", "statistical": {}}, "tactical-grade"
    lost, zhang = [loss(at_s=0.3, magnitude=0.9)], "zhang2005"
    for keys in (
        {"fdi": every, "faults": lost},
        {"fdi": every | {"bounds": {"sensors": real}}, "sensors": real},
        {"fdi": {"statistical": {}, "authority": "either"}, "faults": lost},
        {"fdi": {"scheme": zhang}, "control": {"law": zhang}, "faults": lost},
        {"autopilot": {"altitude_m": [{"hold": True}]}},
    ):
        fly(scenario(duration_s=1.0, **keys))
    diagnosis = bf.Diagnosis(bf.aircraft("beaver"))
    diagnosis.step(rates_rad_s=[0.0] * 3, signals=[0.1, 0.0, 45.0, 1000.0, 1.0], command_rad=[0.0] * 4)
    sim = bf.Simulation(scenario(duration_s=1.0))
    sim.step(frames=2)
    sim.inject({"sensor": "q", "type": "bias", "magnitude": 3})
    sim.step(frames=2)


if __name__ == "__main__":
    main()
