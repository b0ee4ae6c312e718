"""How small a fault is certain to be found, and what it can be taken for, along a flight."""
