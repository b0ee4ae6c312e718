"""Documentation made from what it documents: `python -m beaver_ftc.docs` writes it anew."""
