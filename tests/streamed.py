"""What a flight shows the diagnosis, for tests that diagnose it again without the flight."""

import numpy as np

import beaver_ftc as bf
from flying import scenario


class Flown:
    """What a flight shows the diagnosis, sample by sample, and what the loop makes of it."""

    def __init__(self, **keys):
        self.scenario = scenario(duration_s=6.0, **keys)
        sim = bf.Simulation(self.scenario)
        commands = [sim.columns.index(name) for name in sim.columns if name.endswith("_cmd_rad")]
        attitude = [sim.columns.index(f"{name}_rad") for name in ("phi", "theta", "psi")]
        self.samples, self.verdicts = [], []
        self.start = (start_rates(sim), start_signals(sim), sim.trim_rad)
        while not sim.done:
            measured, row = sim.measured, sim.values
            self.samples.append((measured.x, measured.y, row[commands], row[attitude]))
            self.verdicts.append(sim.verdict)
            sim.step()

    def diagnosis(self, aircraft=None, start=None, larger=()):
        """What diagnoses the samples again. larger: bounds of the diagnosis, beside those of the scenario."""
        keys = self.scenario.with_(dict(larger)).model_dump(mode="json", exclude_unset=True)
        others = {key: keys[key] for key in ("actuators", "design_model") if key in keys}
        return bf.Diagnosis(
            aircraft or bf.aircraft("beaver"), 100, keys.get("fdi"), start=start or self.start, **others
        )


def start_rates(sim):
    return [sim[f"velocities/{axis}-rad_sec"] for axis in "pqr"]


def start_signals(sim):
    psf, ft = 47.88025898033584, 0.3048
    names = ("aero/alpha-rad", "aero/beta-rad", "velocities/vt-fps", "aero/qbar-psf", "aero/dpt")
    return np.array([sim[name] for name in names]) * [1.0, 1.0, ft, psf, 1.0]
