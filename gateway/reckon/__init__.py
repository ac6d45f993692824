"""Dead reckoning live: what vehicles tell of their own motion carries them on while their positions are away, or are denied.

`told` holds what was told in columns, `cells` cuts it into tenths of a second, `running` runs the filters of many vehicles
side by side, `judging` says which positions are to be believed, `reckoners` is all of that as one immutable value. Source: 002-4.
"""

from gateway.reckon.reckoners import Easing, Reckoned, Reckoner, Reckoners
from gateway.reckon.tip import JUMPED, NOTHING, WALKED_OFF
from gateway.reckon.told import reads

__all__ = ["JUMPED", "NOTHING", "WALKED_OFF", "Easing", "Reckoned", "Reckoner", "Reckoners", "reads"]
