"""Vehicles that fly a mission in closed loop and speak MAVLink as real ones do.

`motion` says what a vehicle is to everybody else; `speaker` lets vehicles talk on a link.
"""
