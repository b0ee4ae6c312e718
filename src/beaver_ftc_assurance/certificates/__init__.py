"""Evidence that a stranger can check: each alarm and exclusion as the inequality that the data violated."""
