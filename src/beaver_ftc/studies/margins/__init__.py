"""Margins of the default law on the whole aircraft: what `beaver-ftc linearise` shows."""
