"""Kernels of the statistics, given a whole diagnosis: each takes what it wants of that."""

from beaver_ftc.diagnosis.detection import parity


def views_of(record):
    """Those that there are."""
    return record["views"][: int(record["n_views"])]


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
        parts = (record[name] for name in ("noise", "block", "forces", "gust", "gust", "vaneless"))
        parity.project_innovation(views, int(tests["regress"]), *parts, innovation, y[2])
        parity.update_views(views, tests, record["tone_test_config"], y, fdi["config"]["dt"], frame, latched)

    @staticmethod
    def changes_view(fdi, view, s, column):
        return parity.changes_view(view, fdi["statistical"]["forces"], s, column)
