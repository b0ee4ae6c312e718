"""What a frame costs: the bare aircraft, the closed loop part by part, and other ways to write it."""
