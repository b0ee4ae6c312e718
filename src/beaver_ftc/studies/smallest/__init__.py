"""How small a loss of one surface is found in time: certain, and in 90 % of flights."""
