"""The picture as entities of the Rerun viewer, one file a part of it; `gateway.sinks.rerun` sends what is made here.

3D positions are metres in the runway frame: x along the landing direction, y left, z up.
"""
