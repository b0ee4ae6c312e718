"""The benchmark on recorded flights: each diagnosed with a model that has not seen it, rivals beside ours."""
