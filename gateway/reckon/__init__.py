"""Dead reckoning live: what vehicles tell of their own motion carries them on while their positions are away, or are denied.

`told` holds what was told in columns, `kinds` what vehicles are and are carried on by, `flying` what a unit would have told of
those that have none, `cells` cuts it into tenths of a second, `running` runs the filters of many vehicles side by side, `ties`
what these are tied to, `standing` whether they stand, `judging` says which positions are to be believed, `walking` whether they
leave their velocity, `proving` whose filters have shown that they may deny walks, `freezing` whether a place only stays the
same, `vehicle` remembers one vehicle, `reckoned` is where it is, `reckoners` is all of that as one immutable value.
Source: 002-4.
"""

from gateway.reckon.freezing import LastPlace
from gateway.reckon.reckoned import Reckoned
from gateway.reckon.reckoners import Easing, Reckoners
from gateway.reckon.tip import DISAGREES, JUMPED, NOTHING, USED, VELOCITY_JUMPED, VELOCITY_ONLY, WALKED_OFF
from gateway.reckon.told import reads
from gateway.reckon.vehicle import Reckoner

__all__ = [
    "DISAGREES",
    "JUMPED",
    "NOTHING",
    "USED",
    "VELOCITY_JUMPED",
    "VELOCITY_ONLY",
    "WALKED_OFF",
    "Easing",
    "LastPlace",
    "Reckoned",
    "Reckoner",
    "Reckoners",
    "reads",
]
