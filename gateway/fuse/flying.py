"""How aircraft fly: the set of modes that a site's settings make."""

from __future__ import annotations

from dataclasses import replace

from gateway.estimators.holding import Held
from gateway.estimators.kalman import Motion
from gateway.estimators.modes import Mode, Modes
from gateway.settings import Estimation, Options

ACCELERATES_S = 1.0  # accelerations of modes are white over a second
FADE = 0.85  # of the residuals' mean, over a second: turns are found sooner than by the set's own, at some cost in RMSE


def modes_of(options: Options, motion: Motion, fly: Estimation) -> Modes | None:
    """The set of modes that the options ask for, as the site has them, or None for the one of `motion`.

    Straight flight comes in three: calm, in which noise is taken off best; with an acceleration that lasts, as aircraft brake
    and swing onto a course; and with changes of speed, climb or course that are sudden and no full turn.
    """
    if options.estimator == "kalman" or options.estimator == "alpha-beta-gamma":
        return None

    def moving(level_mps2: float, upright_mps2: float) -> Motion:
        level, upright = level_mps2**2 * ACCELERATES_S, upright_mps2**2 * ACCELERATES_S
        return replace(motion, acceleration_density=(level, level, upright))

    calm, across = fly.calm_acceleration_mps2, fly.calm_across_acceleration_mps2
    turning = moving(fly.turn_acceleration_mps2, fly.turn_acceleration_mps2)
    ways = (
        Mode(0.0, moving(across, calm), fly.calm_share, along=calm / across),
        Mode(0.0, moving(calm, calm), fly.lasting_share, holds=True),
        Mode(
            0.0,
            moving(fly.manoeuvre_acceleration_mps2, fly.manoeuvre_vertical_acceleration_mps2),
            fly.manoeuvre_share,
        ),
        Mode(1.0, turning, 0.5 * fly.turn_share),
        Mode(-1.0, turning, 0.5 * fly.turn_share),
    )
    held = Held(
        fly.lasting_across_acceleration_mps2,
        fly.lasting_acceleration_mps2,
        fly.lasting_for_s,
        fly.lasting_drag_mps2,
    )
    return Modes(ways, options.estimator, fly.mode_lasts_s, fly.turn_rate_rps, fly.bank_rad, FADE, held)
