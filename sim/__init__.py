"""A world that speaks the real wires: aircraft as MAVLink, radars as landing-radar datagrams; studies."""
