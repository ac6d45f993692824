"""A source's constant error beside a filter of single axes that knows nothing of it, with whatever gains that filter has.

The filter goes on as if there were no error; what it makes of one is followed instead. The state is x + V e, x being the
filter's own error and V (position, velocity, acceleration) what one metre of the source's error e has done to it. A residual
then holds h e with h = V_s + 1 for that source, h = V_s for others, which tells e; and the covariance is the filter's own
plus V var(e) V'. Source: B. Friedland's separate estimation of a bias (1969), for gains that need not be the best.

Arrays are (5, n, axes): V, the error's estimate m, its variance m2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.axis_covariance import Terms, Three

Floats = NDArray[np.float64]


def begun(by_source: Floats, allowed_m: float) -> Floats:
    """At the start: `by_source` (n, axes) is 1 where the position is the source's own word, 0 where it is another's."""
    zero = np.zeros_like(by_source)
    return np.stack([-by_source, zero, zero, zero, np.full_like(zero, allowed_m**2)])


def carried(error: Floats, t: Floats) -> Floats:
    """A time (n, 1) later: what the error did to the velocity goes on into the position."""
    place, speed, acceleration, value, variance = error
    faster = speed + t * acceleration
    return np.stack([place + (0.5 * t) * (speed + faster), faster, acceleration, value, variance])


def loosened(error: Floats, elapsed_s: Floats, allowed_m: float, time_constant_s: float) -> Floats:
    """A time (n,) later: the error wanders within what is allowed, and is known less well."""
    keep = np.exp(elapsed_s / (-0.5 * time_constant_s))[:, None]
    return np.concatenate([error[:4], (allowed_m**2 - keep * (allowed_m**2 - error[4]))[None]])


@dataclass(frozen=True, slots=True)
class Share:
    """What residuals (n, axes) hold of the error: h, 0 where nothing was measured; and the variance that makes, m2."""

    h: Floats
    variance: Floats

    @classmethod
    def of(cls, error: Floats, component: int, by_source: Floats | float, seen: Floats) -> Share:
        """Of a residual in position (component 0) or velocity (1), of which a share `seen` was measured."""
        h = seen * (error[component] + by_source)
        return cls(h, h * h * error[4])

    def told(self, error: Floats, y: Floats, s: Floats, gain: Three) -> tuple[Floats, Three]:
        """The error after residuals with whole variances s that moved the filter by its gains; and the whole gains."""
        _, _, _, value, variance = error
        own = variance * self.h / s
        place, speed, acceleration = (done - each * self.h for done, each in zip(error[:3], gain, strict=True))
        whole = gain[0] + place * own, gain[1] + speed * own, gain[2] + acceleration * own
        return np.stack([place, speed, acceleration, value + own * y, variance - own * self.h * variance]), whole


def spread(terms: Terms, error: Floats) -> Terms:
    """The whole covariance's six terms: the filter's own, and those of what the error is not known by."""
    ss, sv, sa, vv, va, aa = terms
    place, speed, acceleration, _, variance = error
    by_place, by_speed, by_acceleration = place * variance, speed * variance, acceleration * variance
    return (
        ss + place * by_place,
        sv + speed * by_place,
        sa + acceleration * by_place,
        vv + speed * by_speed,
        va + acceleration * by_speed,
        aa + acceleration * by_acceleration,
    )
