"""Silence for filters of position, velocity and acceleration, axis by axis: the acceleration dies away.

Nobody turns for ever: held over half a minute, an acceleration leads far off. Here it fades with a time constant, shaken
by white noise of the same density that the filter has learnt (Singer's model), so that for times well below the time
constant this is the filter's own prediction, and far beyond it the target goes straight on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.axis_covariance import Terms, Three

Floats = NDArray[np.float64]

SHORT = 0.05  # of the time constant: below it the noise is that of an acceleration which does not fade, to 4 %


def moved(mean: Three, t: Floats, time_constant_s: float) -> Three:
    """Position, velocity and acceleration (n, axes) times t (n, 1) later."""
    by_place, by_speed, kept = _shares(t, time_constant_s)
    place, speed, acceleration = mean
    return place + t * speed + by_place * acceleration, speed + by_speed * acceleration, kept * acceleration


def spread(terms: Terms, t: Floats, density: Floats, time_constant_s: float) -> Three:
    """Variance of position, covariance with the velocity, and its variance (n, axes) a time later; density in m2/s5."""
    ss, sv, sa, vv, va, aa = terms
    by_place, by_speed, _ = _shares(t, time_constant_s)
    with_speed = sv + t * vv + by_place * va
    with_acceleration = sa + t * va + by_place * aa
    noise = _noise(t, time_constant_s)
    return (
        ss + t * sv + by_place * sa + t * with_speed + by_place * with_acceleration + density * noise[0],
        with_speed + by_speed * with_acceleration + density * noise[1],
        vv + by_speed * (2.0 * va + by_speed * aa) + density * noise[2],
    )


def _shares(t: Floats, time_constant_s: float) -> Three:
    """What one unit of acceleration adds to position and velocity, and what is left of it."""
    kept = np.exp(t / -time_constant_s)
    by_speed = time_constant_s * (1.0 - kept)
    return time_constant_s * (t - by_speed), by_speed, kept


def _noise(t: Floats, time_constant_s: float) -> Three:
    """Variances that noise of unit density adds to position, both, and velocity. Source: R. Singer (1970), eq 8."""
    x = t / time_constant_s
    once, twice = np.exp(-x), np.exp(-2.0 * x)
    place = 0.5 * (1.0 - twice + 2.0 * x - 4.0 * x * once) + x * x * (x / 3.0 - 1.0)
    both = 0.5 * (1.0 + twice + x * x) - once + x * once - x
    speed = 2.0 * once - 1.5 - 0.5 * twice + x
    short = x < SHORT  # the sums above lose all digits there
    return (
        np.where(short, t**5 / 20.0, time_constant_s**5 * place),
        np.where(short, t**4 / 8.0, time_constant_s**4 * both),
        np.where(short, t**3 / 3.0, time_constant_s**3 * speed),
    )
