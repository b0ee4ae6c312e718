"""Whole scenarios drawn from the schema, and every promise that a flight of one must keep.

    schema.json_schema() -> factors.py -> array.py -> compose.py -> fly -> promises.py -> shrink.py

What a scenario may say is read from its JSON schema: a new key is a new factor by itself. `ranges.py` has
what the schema does not say: ranges in which a flight means something. `declare.py` makes `fdi.bounds` cover
what was drawn of the truth. `python -m tools.drawn --help` says how to fly them.
"""
