"""A design model for any JSBSim aircraft: sampled, fitted, and the error that is left measured."""
