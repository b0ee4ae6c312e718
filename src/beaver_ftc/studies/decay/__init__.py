"""How alarms, names and tracking change as the truth leaves what a scenario declares."""
