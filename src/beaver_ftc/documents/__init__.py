"""Files and their mistakes: from a stranger's YAML text to checked data, where files lie, errors in words."""
