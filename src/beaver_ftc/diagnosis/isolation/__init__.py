"""Which fault of the class is it? One estimator a hypothesis, and the sets of parameters that fit it."""
