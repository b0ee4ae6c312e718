"""The cost of a frame: the bare aircraft, the closed loop part by part, and other ways to write it."""
