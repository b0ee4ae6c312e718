"""Rival laws, each after its source, behind the contract of control/__init__.py."""
