"""What the adaptive alpha-beta-gamma filter keeps of its tracks, what it assumes, and how sure it is between updates.

Arrays are (n, axes): n tracks, their axes. Source: 002-1, sections 1 and 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import source_error
from gateway.estimators.axis_covariance import Terms, carried, matrices

Floats = NDArray[np.float64]

WINDOW = 10  # residuals that p is the mean of


@dataclass(frozen=True, slots=True)
class Tuning:
    """What the filter assumes; the defaults serve drones and jets, since density and p follow the target."""

    q: float | None = None  # of a calm target, fixed, for equal intervals; None = from the table
    density: float = 0.1  # m2/s5 at the start: growth of the acceleration's variance a second
    learning: float = 0.02  # of the logarithm of the density, for each unit of surprise; 0 = never
    least_density: float = 1e-6  # m2/s5 that it can be taught
    least_p: float = 0.3  # without a floor a target without noise would freeze the filter
    greatest_p: float = 30.0
    follows_covariance: bool = True  # False: as printed, gains and covariance of the steady state throughout
    robust: float | None = None  # sigmas beyond which a residual pulls no more


@dataclass(frozen=True, slots=True)
class Estimate:
    """n tracks: position m, velocity m/s, acceleration m/s2 (n, axes) now; the rest as it was at each axis's last update.

    `terms` (6, n, axes): the covariance in the order ss, sv, sa, vv, va, aa.
    """

    position: Floats
    velocity: Floats
    acceleration: Floats
    terms: Floats
    since_s: Floats  # (n, axes) since the last update
    density: Floats  # (n, axes) m2/s5, of the calm target
    surprises: Floats  # (WINDOW, n, axes) squared residuals over what was expected, latest last
    p: Floats  # (n, axes) their mean within its bounds
    sped_s: Floats  # (n, axes) since a velocity was measured, inf = never
    error: Floats | None = None  # (5, n, axes) of the position source, as `source_error` keeps it; None = it has none


def covariance(state: Estimate) -> Floats:
    """The covariance now as matrices (n, axes, 3, 3) over position, velocity, acceleration of each axis."""
    terms = own_terms(state)
    return matrices(terms if state.error is None else source_error.spread(terms, state.error))


def own_terms(state: Estimate) -> Terms:
    """ss, sv, sa, vv, va, aa now, each (n, axes), without the source error's part."""
    return terms_now(state, state.density)


def terms_now(state: Estimate, density: Floats) -> Terms:
    """The filter's own terms now: those of the last update, over the interval since."""
    if not state.since_s.any():  # just after an update
        ss, sv, sa, vv, va, aa = state.terms
        return ss, sv, sa, vv, va, aa
    return carried(state.terms, state.since_s, shaken(state, density) * state.since_s)


def shaken(state: Estimate, density: Floats) -> Floats:
    """Growth of the acceleration's variance a second, (n, axes) m2/s5, in the manoeuvre that p shows."""
    # The step grows as p does where gamma is small. A p below 1, of ten residuals, is luck as often as not, and makes
    # nothing surer.
    return np.asarray(np.square(np.maximum(state.p, 1.0)) * density)
