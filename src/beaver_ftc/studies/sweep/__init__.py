"""Many flights: drawn, flown on all cores or a cluster, kept as they land, and what they show."""
