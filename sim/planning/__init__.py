"""Routes under threat (paper 002-3): from a case to a mission.

case, files, fixtures   what is planned: ends, threats, areas, on a plane about a place on the earth
triples, seed           the paper's method: annealed optima of triples, a corridor, fitted curves
grid, spline, modern    the modern planner: ways on a grid, each bent to its least price
field, areas, task      what both are priced and kept out by
flight, mission         a level, take-off, final; waypoints
drawing, picture        the same in the viewer
"""
