"""Truth against design: the errors of the design model, their size, and their cost for the diagnosis.

states     the log of a flight, and what it lacks, as arrays
actuators  positions that healthy actuators would have
sources    the part of each cause in truth less design, from differences of models
split      the sum of the causes, compared with the bound
bound      the bound that is recommended
linear     truth and design linearised about the trim
documents  the document of a split, rows and entries
study      flights and their files
over_envelope     the map over airspeed and altitude
variants   scenarios with wrong designs
tables, charts, linear_charts    the results for people
"""
