"""The commands `check`, `separate` and `evidence`."""
