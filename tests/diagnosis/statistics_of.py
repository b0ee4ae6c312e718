"""Kernels of the statistics, given a whole diagnosis: each takes what it wants of that."""

import numpy as np

from beaver_ftc.diagnosis.detection import parity, statistical
from beaver_ftc.plant.instruments import MEASURED


def views_of(record):
    """Those that there are."""
    return record["views"][: int(record["n_views"])]


def _measured(x, y, attitude=(0.0, 0.0, 0.0)):
    measured = np.zeros(1, MEASURED)[0]
    measured["x"], measured["attitude"] = x, attitude
    measured["y"][: len(y)] = y
    return measured


class Statistical:
    """Of `statistical.py`; record: fdi["statistical"]."""

    @staticmethod
    def score(record, t, known=True):
        tests, blocks, views = record["test"], record["block"], views_of(record)
        statistical.update_alarm(
            record["alarm"], tests, blocks, views, record["forces"], record["gust"], t, known
        )

    @staticmethod
    def prepare(record, fdi, design, x, y, u):
        parts = (record[name] for name in ("test", "noise", "block", "gust"))
        statistical.prepare_tests(*parts, fdi["bound"], design, _measured(x, y), u, fdi["config"]["dt"])


class Across:
    """Calls the kernels of `parity.py`."""

    @staticmethod
    def part(fdi, view, innovation, i):
        parts = (fdi["statistical"][name] for name in ("forces", "gust", "vaneless"))
        return parity.view_innovation(view, *parts, innovation, i)

    @staticmethod
    def turn(fdi, view, G):
        record = fdi["statistical"]
        return parity.turn_view(view, record["forces"], record["gust"], fdi["bound"], G)

    @staticmethod
    def regress(fdi, view, innovation, share):
        view["leak"] = share
        along = sum(g * Across.part(fdi, view, innovation, i) for i, g in enumerate(view["col"]) if g)
        parity.fill_view_regressors(view, fdi["statistical"]["block"], fdi["statistical"]["forces"], along)

    @staticmethod
    def observe(fdi, innovation, G, Gu, y, frame, latched):
        record, bound = fdi["statistical"], fdi["bound"]
        views, tests = views_of(record), record["test"]
        parity.turn_views(views, record["forces"], record["gust"], bound, G, Gu)
        parts = (record[name] for name in ("noise", "block", "forces", "gust", "vaneless"))
        parity.project_innovation(views, int(tests["regress"]), *parts, innovation, y[2])
        parity.update_views(views, tests, record["tone_test_config"], y, fdi["config"]["dt"], frame, latched)

    @staticmethod
    def changes_view(fdi, view, s, column):
        return parity.changes_view(view, fdi["statistical"]["forces"], s, column)


def put(record, **fields):
    """Write loose numbers where they belong: tests, noise, alarm."""
    for name, value in fields.items():
        (part,) = [part for part in ("test", "noise", "alarm") if name in record[part].dtype.names]
        record[part][name] = value
