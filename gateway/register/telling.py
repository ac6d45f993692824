"""What register tells at each step, as columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gateway.register.learning import Registration
from gateway.register.pairing import Gathered
from gateway.register.registered import EACH, Registered, Residuals
from gateway.register.verdicts import in_words
from gateway.settings import RadarSite

Floats = NDArray[np.float64]


def residuals(gathered: Gathered, registration: Registration, radars: Mapping[int, RadarSite]) -> Residuals:
    """How far pairs are apart, as measured and with what is taken off."""
    pairs = gathered.pairs
    off = np.array(
        [registration.of(radars[radar], at) for radar, at in zip(pairs.radar, gathered.at, strict=True)]
    ).reshape(-1, EACH)
    after = pairs.off - off[:, :3] + np.nan_to_num(pairs.rates) * off[:, 3:]
    times, numbers = np.array(gathered.at, np.int64), np.array(pairs.radar, np.int64)
    return Residuals(times, numbers, tuple(pairs.aircraft), pairs.off, after)


def table(
    registration: Registration, radars: Mapping[int, RadarSite], now: int, learnt: Sequence[Residuals]
) -> Registered:
    """What is known of each radar, and what is taken off at an instant."""
    some = tuple(radars[number] for number in sorted(radars))
    correction: Floats = np.array([registration.of(radar, now) for radar in some]).reshape(-1, EACH)
    return replace(_known(registration, some), correction=correction, residuals=Residuals.of(learnt))


@lru_cache(maxsize=1)  # it changes each second, and is told at each step
def _known(registration: Registration, radars: tuple[RadarSite, ...]) -> Registered:
    """What is known of some radars, without what is taken off."""
    told = Registered.untold([radar.number for radar in radars], np.zeros((len(radars), EACH)))
    solution = registration.solution
    if solution is None:
        return told
    words = list(told.verdict)
    for row, radar in enumerate(radars):
        verdicts, choice = registration.verdicts(radar), registration.choices.get(radar.number)
        if verdicts is None:
            continue
        told.error[row], told.sigma[row] = [one.value for one in verdicts], [one.sigma for one in verdicts]
        if choice is not None:
            told.applied[row] = choice.applied
            said = [in_words(one, is_on) for one, is_on in zip(verdicts, choice.applied, strict=True)]
            words[row] = said[0], said[1], said[2], said[3]
    east, north, up = solution.common_m.tolist()
    sigma_e, sigma_n, sigma_u = solution.common_sigma_m.tolist()
    return replace(
        told,
        verdict=tuple(words),
        told_at=registration.solved_at,
        source_m=(east, north, up),
        source_sigma_m=(sigma_e, sigma_n, sigma_u),
        own_sigma_m=solution.own_sigma_m,
        prior_wrong=registration.is_prior_wrong,
    )
