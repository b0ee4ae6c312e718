"""The truth: the Beaver in JSBSim. The only package that imports jsbsim."""
