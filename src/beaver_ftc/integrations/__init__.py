"""Other people's frames around ours: pytest, Gymnasium."""
