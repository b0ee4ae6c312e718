"""Which mechanism of adaptive diagnosis and accommodation improves a verdict or a flight."""
