"""Talkdown's picture of an approach: what was observed becomes aligned, tracked, associated, registered, fused, predicted.

Conventions, stated once:

Units    SI and radians inside. Degrees, degE7, millimetres, cm/s and feet exist only in adapters, settings and outputs.
         A unit suffix ends every name of a quantity at a boundary: `latitude_deg`, `range_m`, `azimuth_rad`.
Time     An int of nanoseconds since 1970 UTC. `valid_at`: when it was so, by the source's clock. `received_at`: when we
         heard, by the receiver's clock. `now`: the session's time, an argument everywhere; nothing below runtime reads a clock.
Missing  Not measured is None in an object, NaN in an array; never 0.
Frames   geodetic  WGS-84 latitude, longitude (rad), height above the ellipsoid (m)
         ecef      earth-centred, earth-fixed (m)
         enu       east, north, up at the runway centre (m)
         runway    x along the main landing direction, y left, z up, origin at the runway centre (m)
         radar     x along the boresight, y left, z up, origin at the antenna, axes parallel to the runway's horizontal (m)
         A matrix is named `radar_from_ecef`, so that inner names meet in a product.
Angles   `compass_azimuth` is clockwise from true north; `azimuth` alone is the radar's, counter-clockwise from its boresight.
Heights  `height_m` is above the ellipsoid; `altitude_msl_m` above mean sea level; height = altitude + geoid separation.
Shapes   Leading axes are batch axes; the same function serves one track and a thousand.
Names    Aircraft are strings ("mavlink:1"); radar tracks are pairs of ints written "1/3"; system tracks are ints from 1.
"""

__version__ = "0.1.0"
