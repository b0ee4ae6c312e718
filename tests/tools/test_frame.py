"""The list of what runs in a frame: in the order in which a value comes about."""

import subprocess
import sys

ORDER = (
    "frame.sense", "model_prediction.evaluate_design", "bounds.add_published_bound  -> fdi.bound.eta_now",
    "filters.update_bank", "frame.command", "allocation.allocate", "model_prediction.move_surfaces",
)  # fmt: skip


def test_calls_stand_in_their_order_with_what_each_wrote():
    of_it = [sys.executable, "-m", "tools.frame", "elevator-partial-loss", "--at", "0.02"]
    printed = subprocess.run(of_it, capture_output=True, text=True, check=True).stdout
    places = [printed.index(kernel) for kernel in ORDER]
    assert places == sorted(places)
    assert "fdi.bound.eta_now" not in printed.replace(ORDER[2], "")
