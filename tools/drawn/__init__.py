"""Whole scenarios drawn from the schema, and the promises that a flight of each must keep.

    schema.json_schema() -> factors.py -> array.py -> compose.py -> fly -> promises.py -> shrink.py

The JSON schema says which scenarios exist, so a new key is a new factor. `ranges.py` has the ranges in which
a flight means something, which the schema does not have. `declare.py` makes `fdi.bounds` contain the drawn
truth. `python -m tools.drawn --help` explains how to fly the scenarios.
"""
