"""The former place of the pytest plug-in."""
