"""The commands `live` and `challenge`."""
