"""Every fault type on every surface: what the diagnosis makes of it, and what the flight costs."""
