"""No claim is measured on the flights that a constant was chosen on."""

from importlib import import_module

from tools.docs.tables.recorded_flights import OWN_SEEDS

from beaver_ftc_logs.chosen import CHOSEN


def test_seeds_of_choice_and_of_claim_are_disjoint():
    chosen = {seed for one in CHOSEN for seed in one.seeds}
    assert not chosen & set(OWN_SEEDS)


def test_each_constant_is_there_and_names_its_flights():
    for one in CHOSEN:
        assert hasattr(import_module(f"beaver_ftc_logs.{one.module}"), one.constant)
        assert one.seeds or one.flights
    assert len({(one.module, one.constant) for one in CHOSEN}) == len(CHOSEN)
