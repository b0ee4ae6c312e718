"""The scheme's promises, put to the test on the JSBSim truth over many random flights."""
