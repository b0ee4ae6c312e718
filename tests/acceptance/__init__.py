"""The package as a stranger meets it: its wheel, its command line and its files, and nothing else."""
