"""The same flights for every scheme and law: who raises false alarms, who sees the fault, how soon, at what
cost."""
