"""Truth against design: where the design model is wrong, by how much, and what that costs the diagnosis.

`models` reads the log and works truth and design out, `sources` names the causes, `split` adds them
up frame by frame and keeps the figures, `bound` holds them against eta_bar, `linear` is about the trim.
`study` flies, wrong designs too; `tables` and `charts` show what was found.
"""
