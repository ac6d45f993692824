"""Register: the systematic errors of radars, learnt from pairs while a session runs, which the next align takes off.

`pairing` holds reports beside what radars measured of the same aircraft; `learning` is the stage's state, and what happens each
second; `choosing` decides what is taken off and `corrections` steps towards it; `watching` notices a radar that was moved
or repaired; `verdicts` says it in words; `remembered` is what one session hands to the next; `telling` makes the result, and
`allowing` says how far off radars may still be.
Source: 004.
"""

from gateway.register.allowing import remaining
from gateway.register.learning import Registration
from gateway.register.pairing import WAIT_NS, Gathered, gathered
from gateway.register.registered import Registered, Residuals
from gateway.register.remembered import Remembered, RememberedRadar
from gateway.register.telling import residuals, table

__all__ = [
    "WAIT_NS",
    "Gathered",
    "Registered",
    "Registration",
    "Remembered",
    "RememberedRadar",
    "Residuals",
    "gathered",
    "remaining",
    "residuals",
    "table",
]
