"""Ships that keep their track: hull, sea, four generations of autopilot, track control, and both over MAVLink (paper 002-5)."""
