"""What is known before the first byte arrives: the site (where runway and radars stand) and the options of a run.

A site file is TOML with the unit in every key's name; inside, everything is SI and radians.
"""

from gateway.settings.options import AssociationRule, EstimatorName, Mute, Options, Registering, Weighting
from gateway.settings.reading import SiteError, parse_site
from gateway.settings.safety import Separation, Stabilised
from gateway.settings.site import (
    DEMO_SITE,
    DeadReckoning,
    DecisionPoint,
    Estimation,
    PositionSource,
    RadarSite,
    Runway,
    Site,
    Units,
    Waypoint,
    Weather,
    encloses,
    with_radar,
)
from gateway.settings.writing import format_site

__all__ = [
    "DEMO_SITE",
    "AssociationRule",
    "DeadReckoning",
    "DecisionPoint",
    "Estimation",
    "EstimatorName",
    "Mute",
    "Options",
    "PositionSource",
    "RadarSite",
    "Registering",
    "Runway",
    "Separation",
    "Site",
    "SiteError",
    "Stabilised",
    "Units",
    "Waypoint",
    "Weather",
    "Weighting",
    "encloses",
    "format_site",
    "parse_site",
    "with_radar",
]
