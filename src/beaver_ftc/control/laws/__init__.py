"""Inner laws, one file each: what makes surfaces of a demanded body rate."""
