"""Whole scenarios drawn from the schema (tools/drawn), for the properties that must hold for all of them."""

from functools import cache
from itertools import islice
from typing import Any

from tools.drawn.campaign import plain
from tools.drawn.compose import drawn_flights

from samples import samples

COUNT = samples(300)


@cache
def scenarios() -> list[dict[str, Any]]:
    """Drawn where they are first wanted: every worker of the suite imports this."""
    return [plain(one.words) for one in islice(drawn_flights(7, ("beaver",)), COUNT)]
