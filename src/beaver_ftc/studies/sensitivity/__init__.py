"""How verdicts and flights change with larger errors, and without parts of the diagnosis and the law."""
