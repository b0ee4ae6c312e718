"""Truth against design: where the design model is wrong, by how much, and what that costs the diagnosis.

`states` reads the log, `believed` and `moments` work the models out, `sources` names the causes, `split`
adds them up frame by frame, `tally` keeps the figures, `bound` holds them against eta_bar, `linear` and
`envelope` look around.
"""
