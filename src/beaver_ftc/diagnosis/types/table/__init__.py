"""The rows of the fault types: surfaces held in place, surfaces that follow their command wrongly."""
