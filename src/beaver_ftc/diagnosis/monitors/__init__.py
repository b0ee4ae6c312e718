"""Monitors of what is not a control surface: sensors by their redundancy, engines by their symmetry."""
