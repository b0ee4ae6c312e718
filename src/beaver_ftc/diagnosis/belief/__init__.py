"""The designer's expectation of a frame: f + G u, the effect of a gust, and the bound on their errors."""
