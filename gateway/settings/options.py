"""What may be chosen for a run: methods, models, and how long things last."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Weighting = Literal["bias", "covariance", "innovation", "literal"]
EstimatorName = Literal["kalman", "imm", "rmimm", "alpha-beta-gamma"]
AssociationRule = Literal["default", "literal"]
Registering = Literal["apply", "watch", "off"]
Reckoning = Literal["on", "off"]
MutedSource = Literal["gps", "radar"]


@dataclass(frozen=True, slots=True)
class Mute:
    """A source that is not listened to for a while, to see what would be without it: from `since` up to `until`.

    What: "gps" (all positions that aircraft report) or "radar"; `number` is the radar's or vehicle's, None for all.
    Times are receiver's stamps, ns since 1970 UTC.
    """

    what: MutedSource
    number: int | None
    since: int
    until: int


@dataclass(frozen=True, slots=True)
class Options:
    """What may be chosen for a run; everything in here changes numbers, so all of it is archived."""

    estimator: EstimatorName = (
        "kalman"  # constant velocity, straight and turns as interacting modes, or the light filter
    )
    weighting: Weighting = "bias"
    association: AssociationRule = "default"
    registration: Registering = "apply"  # what radars measure too much: learnt and taken off, only told, or neither
    dead_reckoning: Reckoning = "on"  # by what vehicles tell of their own motion, where their positions fail
    acceleration_sigma_mps2: float = 2.0  # of the constant-velocity model, east and north
    vertical_acceleration_sigma_mps2: float = 1.0  # aircraft change their climb less than their course
    acceleration_time_s: float = 0.4  # white over this time: sigma^2 x time is the density, whatever the step
    associate_at: int = 3  # hits in a row before a radar track and an aircraft are one
    association_wait_s: float = 1.0  # how long after a GPS report's validity plots may still bracket it
    history_s: float = 10.0  # later than this is too late
    confirm_odds: float = 1e4  # a track is confirmed when its measurements are so much likelier of one thing
    coast_after_s: float = 2.0  # without an update for this long a track is coasting
    end_after_s: float = 30.0  # and for this long it ends
    tentative_end_after_s: float = 15.0  # or for this long, if never confirmed: three of the slowest usual reports
    returns_within_s: float = 300.0  # an aircraft silent no longer than this comes back as its old track
    prediction_period_s: float = 1.0
    horizons_s: tuple[float, ...] = (10.0, 30.0, 60.0, 120.0)
    begins_at: int | None = None  # stamp; what came before is heard for its clocks, plans and places, and not fused
    mutes: tuple[Mute, ...] = ()
