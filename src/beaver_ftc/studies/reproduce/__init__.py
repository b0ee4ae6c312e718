"""The published study flown again: cases, figures, and each statement held against our numbers."""
