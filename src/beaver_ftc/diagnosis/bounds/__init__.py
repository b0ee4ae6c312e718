"""What a scenario declares in `fdi.bounds`, read once: as a worst case, as variances, as a test's limit."""
