"""Aircraft of other people: models derived from JSBSim (`derive`), and imported data sets (`gtm`)."""
