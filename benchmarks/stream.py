"""A call of `bf.Diagnosis` beside a frame of JSBSim alone, in one run.

    python benchmarks/stream.py [--rounds N]

Prints microseconds of processor time, least of the rounds, and the ratio, for the published class, for faults
of every type and with the statistical detector.
"""

import argparse
import time

import beaver_ftc as bf

SECONDS, RATE_HZ = 6.0, 100
CASES = {
    "published class": {},
    "faults of every type": {"fault_class": "all"},
    "statistical detector": {"statistical": {}, "bounds": {"sensors": "tactical-grade"}},
}


def samples_of(fdi: dict) -> list[tuple]:
    """What a healthy flight shows the diagnosis, sample by sample."""
    document = {"name": "stream", "duration_s": SECONDS, "rate_hz": RATE_HZ, "fdi": fdi}
    sim = bf.Simulation(bf.Scenario.model_validate(document))
    commands = [sim.columns.index(name) for name in sim.columns if name.endswith("_cmd_rad")]
    samples = []
    while not sim.done:
        samples.append((sim.measured.x, sim.measured.y, sim.values[commands]))
        sim.step()
    return samples


def call_us(fdi: dict, samples: list[tuple], rounds: int) -> float:
    """Processor time of a call, us."""
    diagnosis, spent = bf.Diagnosis(bf.aircraft("beaver"), RATE_HZ, fdi), []
    for _ in range(rounds):
        diagnosis.reset()
        diagnosis.step(*samples[0])
        began = time.process_time()
        for sample in samples[1:]:
            diagnosis.step(*sample)
        spent.append(1e6 * (time.process_time() - began) / (len(samples) - 1))
    return min(spent)


def jsbsim_us(rounds: int) -> float:
    """Processor time of a frame of JSBSim alone, the Beaver in trim, us."""
    sim, frames = bf.Simulation(bf.load("elevator-partial-loss")), int(SECONDS * RATE_HZ)
    spent = []
    for _ in range(rounds):
        began = time.process_time()
        for _ in range(frames):
            sim._loop.plant.fdm.run()
        spent.append(1e6 * (time.process_time() - began) / frames)
    return min(spent)


def main() -> None:
    """Print a line a case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    plain = jsbsim_us(rounds)
    print(f"a frame of JSBSim alone: {plain:.1f} us")
    for name, fdi in CASES.items():
        us = call_us(fdi, samples_of(fdi), rounds)
        print(f"{name}: {us:.1f} us a call, {us / plain:.1f} frames")


if __name__ == "__main__":
    main()
