"""Train the network on the flights of a sweep, and find its alarm level on healthy flights of another.

python -m learned_detector.train TRAINING.yaml HEALTHY.yaml --out learned.npz
"""

import argparse
from math import ceil

import numpy as np

from beaver_ftc.diagnosis import Verdict
from beaver_ftc.loop.loop import fly
from beaver_ftc.studies.compare import of_sweep
from learned_detector import CLASSES, Features, Network

ALPHA = 0.1  # false alarms per flight, at most
EVERY = 5  # frames: neighbours look alike


class Recorder:
    """A detector that keeps the features of every frame and raises no alarm."""

    def reset(self, context):
        self.features, self.rows = Features(context), []

    def step(self, measured, command):
        self.rows.append(self.features.step(measured))
        return Verdict()


def recorded(scenario):
    """The features of a flight under the nominal law, (frames, features), and the class of each frame."""
    recorder = Recorder()
    fly(scenario.with_({"control.law": "nominal"}), detector=recorder)
    rows = np.array(recorder.rows)
    labels = np.zeros(len(rows), dtype=int)
    for fault in scenario.faults:
        labels[round(fault.at_s * scenario.rate_hz) :] = CLASSES.index(fault.actuator)
    return rows, labels


def fit(scenarios, seed=0, hidden=16):
    """A network trained on all frames of these flights; its level is still 1."""
    from sklearn.neural_network import MLPClassifier

    flights = [recorded(scenario) for scenario in scenarios]
    rows = np.concatenate([rows[::EVERY] for rows, _ in flights])
    labels = np.concatenate([labels[::EVERY] for _, labels in flights])
    if set(labels) != set(range(len(CLASSES))):
        raise ValueError(f"the training flights lack a class, needed: {', '.join(CLASSES)}")
    mean, scale = rows.mean(axis=0), rows.std(axis=0) + 1e-6
    network = MLPClassifier((hidden,), alpha=1e-3, max_iter=300, early_stopping=True, random_state=seed)
    network.fit((rows - mean) / scale, labels)
    (W1, W2), (b1, b2) = network.coefs_, network.intercepts_
    return Network(mean, scale, W1, b1, W2, b2)


def conformal_level(largest, alpha=ALPHA):
    """The level that a new healthy flight exceeds with probability at most alpha [Vovk2005].

    largest (n,): the largest statistic of each healthy flight, none of which the network was trained on. The
    level is the ceil((n + 1)(1 - alpha))-th smallest; too few flights give none.
    """
    rank = ceil((len(largest) + 1) * (1.0 - alpha) - 1e-9)
    if rank > len(largest):
        raise ValueError(f"{len(largest)} healthy flights for {alpha:g}, needed: {ceil(1 / alpha) - 1}")
    return float(np.sort(largest)[rank - 1])


def calibrated(network, healthy, alpha=ALPHA):
    """The network with its level from healthy flights."""
    scores = [network.scores(recorded(scenario)[0]).max() for scenario in healthy]
    network.level = conformal_level(np.logaddexp(0.0, scores), alpha)
    return network


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("training")
    parser.add_argument("healthy")
    parser.add_argument("--out", default="learned.npz")
    asked = parser.parse_args()
    network = fit([case.scenario for case in of_sweep(asked.training)])
    calibrated(network, [case.scenario for case in of_sweep(asked.healthy)])
    np.savez(asked.out, **vars(network))
    print(f"{asked.out}: alarm level {network.level:.3f}")


if __name__ == "__main__":
    main()
