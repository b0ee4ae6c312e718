"""Questions asked of many flights: one folder a study."""
