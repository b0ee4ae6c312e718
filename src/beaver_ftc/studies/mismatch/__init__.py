"""Truth against design: where the design model is wrong, by how much, and what that costs the diagnosis.

`models` reads the log, `sources` takes the causes from differences of models, `split` holds their sum against
the bound, `bound` recommends one, `linear` is about the trim. `study` flies, wrong designs too; `tables` and
`charts` show what was found.
"""
