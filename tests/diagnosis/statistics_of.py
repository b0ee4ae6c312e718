"""Kernels of the statistics, given a whole diagnosis: each takes what it wants of that."""

import numpy as np

from beaver_ftc.diagnosis.detection import parity, statistical
from beaver_ftc.diagnosis.detection.parity import fill_block_signatures, fill_view_signatures
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
    def signatures(record, Gu, cubic):
        fill_block_signatures(record["block"], Gu, cubic)

    @staticmethod
    def score(record, t, known=True):
        tests, blocks, views = record["test"], record["block"], views_of(record)
        statistical.update_alarm(
            record["alarm"], tests, blocks, views, record["forces"], record["gust"], t, known
        )

    @staticmethod
    def record(record, row):
        tests, blocks, views = record["test"], record["block"], views_of(record)
        statistical.write_scores(tests, blocks, views, record["forces"], record["gust"], row)

    @staticmethod
    def filter_known(record, surprise, dt):
        statistical.filter_known(record["block"], record["gust"], surprise, dt)

    @staticmethod
    def unknown_acceleration(record, out):
        statistical.fill_unmodelled(record["block"], record["gust"], out)

    @staticmethod
    def drifts(record, fdi, design, x, y):
        noise, blocks, air = record["noise"], record["block"], record["gust"]
        statistical.fill_noise(noise, blocks, air, fdi["bound"], design, _measured(x, y), fdi["config"]["dt"])

    @staticmethod
    def prepare(record, fdi, design, x, y, u):
        parts = (record[name] for name in ("test", "noise", "block", "gust"))
        statistical.prepare_tests(*parts, fdi["bound"], design, _measured(x, y), u, fdi["config"]["dt"])

    @staticmethod
    def look(record, fdi, design, x, y, u, attitude, dt):
        parts = (record[name] for name in ("test", "noise", "block", "gust"))
        statistical.add_test_instant(*parts, fdi["bound"], design, _measured(x, y, attitude), u, dt)

    @staticmethod
    def shows(fdi, surface):
        tests, blocks = fdi["statistical"]["test"], fdi["statistical"]["block"]
        return statistical.confirms_loss(
            tests, blocks, fdi["isolation"]["estimator"], fdi["layout"]["loss"], surface
        )

    @staticmethod
    def excludes(fdi, surface, ends):
        tests, blocks, loss_estimator = (
            fdi["statistical"]["test"],
            fdi["statistical"]["block"],
            fdi["layout"]["loss"],
        )
        return statistical.excludes_loss(
            tests,
            blocks,
            fdi["isolation"]["estimator"],
            loss_estimator,
            surface,
            ends,
            fdi["config"]["abrupt"],
        )


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
    def subtracts_gust(record, view):
        return parity.subtracts_gust(view, record["gust"])

    @staticmethod
    def blur(view, record, V):
        parts = (record[name] for name in ("noise", "block", "forces", "gust", "vaneless"))
        parity.fill_view_noise(view, *parts, V)

    @staticmethod
    def regress(fdi, view, innovation, share):
        view["leak"] = share
        along = sum(g * Across.part(fdi, view, innovation, i) for i, g in enumerate(view["col"]) if g)
        parity.fill_view_regressors(view, fdi["statistical"]["block"], fdi["statistical"]["forces"], along)

    @staticmethod
    def sign(fdi, view, Gu):
        fill_view_signatures(view, fdi["statistical"]["forces"], Gu)

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

    @staticmethod
    def shown(record, view):
        return parity.confirmed_score(
            view, views_of(record), record["test"], record["forces"], record["gust"]
        )

    @staticmethod
    def alarm(record, view):
        return parity.view_alarm_score(
            view, views_of(record), record["test"], record["forces"], record["gust"]
        )

    @staticmethod
    def excludes(fdi, s):
        record, column = (
            fdi["statistical"],
            fdi["isolation"]["estimator"]["effect"]["regressor"][fdi["layout"]["position"][s]],
        )
        views = views_of(record)
        return parity.views_exclude(views, record["test"], record["forces"], record["gust"], s, column)


def put(record, **fields):
    """Write loose numbers where they belong: tests, noise, alarm."""
    for name, value in fields.items():
        (part,) = [part for part in ("test", "noise", "alarm") if name in record[part].dtype.names]
        record[part][name] = value
