"""The isolability statement against flights: what it says would show shows, and what would not does not."""

import numpy as np

from beaver_ftc.flights.diagnose import diagnose
from beaver_ftc.flights.identification import identify
from beaver_ftc.flights.inputs import load_flights
from beaver_ftc.flights.isolability import statement
from beaver_ftc.flights.vehicle import load_vehicle
from flights import synthetic

SLAVED = synthetic.VEHICLE.replace("pitch_command: 0.5}, left", "pitch_command: 0.0}, left").replace(
    "pitch_command: -0.5", "pitch_command: 0.0"
)
FLIGHTS = 6


def sampled(wing, folder, name, **flown):
    return load_flights([synthetic.write_csv(folder / f"{name}.csv", synthetic.fly(**flown))], wing)[0]


def shares_found(wing, folder, model, loss):
    """Share of drawn flights in which a loss of the left elevon is found within 60 s of its begin."""
    found = []
    for seed in range(FLIGHTS):
        part = (100, 160, 1.0, 1.0 - loss)
        samples = sampled(wing, folder, "drawn", duration_s=160.0, parts=(part,), seed=50 + seed)
        rows = diagnose(samples, model)
        found.append(bool((rows.faulty[(rows.t_s > 102) & (rows.t_s < 160)]).mean() > 0.1))
    return np.mean(found)


def test_the_smallest_loss_is_where_flights_begin_to_show_it(wing, wing_folder, wing_model):
    healthy = sampled(wing, wing_folder, "said", duration_s=160.0, seed=49)
    said = {tuple(one["surfaces"]): one for one in statement(healthy, wing_model)["groups"]}
    smallest = said[("left",)]["smallest_loss"]["60"]
    assert 0.02 < smallest < 0.4
    assert shares_found(wing, wing_folder, wing_model, min(3.0 * smallest, 1.0)) > 0.8
    assert shares_found(wing, wing_folder, wing_model, smallest / 4.0) < 0.3


def test_surfaces_that_move_together_are_said_to_and_named_together(wing_folder):
    """Two surfaces on one command: a loss in either gives the same rates, so both are named."""
    (wing_folder / "slaved.yaml").write_text(SLAVED)
    slaved = load_vehicle(wing_folder / "slaved.yaml")
    healthy = synthetic.fly(300.0, seed=61)
    del healthy["right_effectiveness"], healthy["left_effectiveness"]
    model = identify(load_flights([synthetic.write_csv(wing_folder / "slaved.csv", healthy)], slaved), slaved)
    assert model.groups == [["right", "left"]]
    named = []
    for part in ((80, 160, 0.2, 1.0), (80, 160, 1.0, 0.2)):
        samples = sampled(slaved, wing_folder, "one", duration_s=160.0, parts=(part,), seed=62)
        assert statement(samples, model)["together"][0]["surfaces"] == ["right", "left"]
        rows = diagnose(samples, model)
        named.append(set(rows.named[rows.faulty == 1]) - {"unknown"})
        suspected = rows.faulty == 1
        assert (rows.low[suspected] == 0.0).mean() > 0.9
    assert named[0] == named[1] == {"right+left"}
