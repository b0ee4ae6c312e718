"""Records of flights that are over become records of new ones, to the byte."""

import numpy as np

from beaver_ftc.loop import assembly

RECORD = np.dtype(
    [("few", "f8", (7,)), ("inside", [("kind", "i8"), ("line", "f8", (900,))]), ("rest", "u1", (3001,))],
    align=True,
)


def _record(rng):
    record = np.zeros(1, RECORD)
    record["few"], record["inside"]["kind"] = rng.normal(size=7), 3
    record["rest"][0, rng.integers(0, 3001, 5)] = 255
    return record


def _dirty():
    """Memory of a flight that is over, of whatever it has left."""
    old = assembly.taken((1,), RECORD)
    old.view(np.uint8)[:] = 77
    assembly.give_back(old)


def test_a_copy_is_its_record_to_the_byte_in_whatever_memory():
    rng = np.random.default_rng(1)
    for record in (_record(rng), _record(rng), np.zeros(1, RECORD), np.ones(1, RECORD)):
        kept = assembly.taken((1,), RECORD)
        kept[:] = record
        _dirty()
        copy = assembly.copied(kept)
        assert copy.tobytes() == kept.tobytes()
        copy["few"] = 5.0
        assert (kept["few"] == record["few"]).all()


def test_empty_memory_holds_nothing_of_the_flight_before():
    _dirty()
    assert assembly.taken_empty((1,), RECORD).tobytes() == bytes(RECORD.itemsize)
