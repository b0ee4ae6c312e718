"""From a stranger's YAML text to checked data: bounded reading, lines kept, every mistake in words."""
