"""Detection probability against magnitude, excitation and air, of every scheme, at equal false-alarm rate."""
