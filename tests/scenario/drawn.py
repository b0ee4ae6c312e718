"""Whole scenarios drawn from the schema (tools/drawn), for the properties that must hold for all of them."""

from itertools import islice

from tools.drawn.campaign import plain
from tools.drawn.compose import drawn_flights

from samples import samples

SCENARIOS = [plain(one.words) for one in islice(drawn_flights(7, ("beaver",)), samples(300))]
