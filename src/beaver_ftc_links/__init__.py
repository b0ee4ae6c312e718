"""Links to other programs: autopilots (`sitl`), Gymnasium (`gym`) and FlightGear (`flightgear`)."""
