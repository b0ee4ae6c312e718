"""How small a fault is found, how surely and how soon: computed from the declared bounds, and by flights."""
