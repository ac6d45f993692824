"""A world that speaks the real wires: aircraft as MAVLink, a radar as landing-radar datagrams, the papers' experiments."""
