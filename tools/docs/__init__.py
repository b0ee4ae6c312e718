"""Documentation made from what it documents: `python -m tools.docs` writes it again."""
