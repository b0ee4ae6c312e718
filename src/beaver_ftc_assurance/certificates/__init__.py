"""Evidence for third parties: each alarm and exclusion as the inequality that the data violated."""
