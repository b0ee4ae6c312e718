"""The control laws of ours, one a file; table.py lists them."""
