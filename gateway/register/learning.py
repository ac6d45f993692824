"""What is known of the radars' errors, how it grows with each second's pairs, and what is made of it.

Each second the pairs that leave the history are learnt; every few seconds the equations are solved, and of each error it is
decided whether to take it off. Source: 004. Deviation: running, with fading; own errors of aircraft; lateness.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Correction
from gateway.estimators.registration_evidence import (
    AIRCRAFT_AT_MOST,
    RADARS_AT_MOST,
    Evidence,
    faded,
    learnt,
    remembering,
    without,
    without_past,
)
from gateway.estimators.registration_solution import Solution, against_past, folded, solved
from gateway.register.choosing import LEAST_PAIRS, Choice, chosen
from gateway.register.corrections import Steps, largest_step, stated
from gateway.register.pairing import Gathered
from gateway.register.remembered import Remembered, RememberedRadar, in_words
from gateway.register.verdicts import FEW, NAMES, PRIOR_CHI_SQUARE, SIGNIFICANT, SIGNIFICANT_OF_FEW, Verdict
from gateway.register.watching import Watch
from gateway.settings import PositionSource, RadarSite, Registering

Floats = NDArray[np.float64]

PAST_CHI_SQUARE = 30.0  # four; it is looked at every few seconds, and has to be so twice
FADES_S = 1200.0  # time constant, over seconds in which something was learnt
SOLVED_EACH_NS = 5 * SECOND
FOLDED_AFTER_NS = 300 * SECOND  # an aircraft without pairs for so long has left
COMMON_SHARE = 0.5  # of what is allowed as a constant error: the prior of the one that all aircraft share, an axis


@dataclass(frozen=True, slots=True)
class Said:
    """Something that a person should read."""

    level: str
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """What is known of the radars' errors; what the next align takes off."""

    evidence: Evidence = field(default_factory=Evidence)
    solution: Solution | None = None
    solved_at: int | None = None
    steps: Mapping[int, Steps] = field(default_factory=dict)  # of radars from which something was learnt
    choices: Mapping[int, Choice] = field(default_factory=dict)
    watches: Mapping[int, Watch] = field(default_factory=dict)
    is_prior_wrong: bool = False
    doubted: frozenset[int] = frozenset()  # radars that present aircraft tell otherwise than those before
    is_new: bool = False  # whether there is evidence that the solution does not know
    learnt_until: int = 0  # reports before this are in
    remembered: Remembered | None = None  # from an earlier session, of radars that are not met yet too
    age_s: float = 0.0  # of that, when this session began
    met: frozenset[int] = frozenset()

    def of(self, radar: RadarSite, at: int) -> Correction:
        """What is taken off this radar's measurements that are valid at an instant."""
        steps = self.steps.get(radar.number)
        return stated(radar) if steps is None else steps.of(at)

    def verdicts(self, radar: RadarSite) -> tuple[Verdict, ...] | None:
        """What is known of each error of a radar; None before anything is."""
        if self.solution is None or radar.number not in self.solution.radars:
            return None
        return _verdicts(self.solution, radar, self.evidence)

    # what happens each second --------------------------------------------------------------------------------------

    def second(
        self,
        pairs: Gathered | None,
        radars: Mapping[int, RadarSite],
        position: PositionSource,
        use: Registering,
        at: int,
        ahead: int,
    ) -> tuple[Registration, list[Said]]:
        """The same after a second, and what is to be said. Corrections change for what is valid `ahead` (ns) from now on."""
        after, said = self, list[Said]()
        if pairs is not None:
            after, said = after._learning(pairs, radars, at)
        if at // SECOND * SECOND % SOLVED_EACH_NS == 0 and after.is_new:
            after, more = after._solving(radars, position, use, at)
            said += more
        if after.choices:
            after = after._stepping(radars, at, ahead)
        return after, said

    def _learning(
        self, gathered: Gathered, radars: Mapping[int, RadarSite], at: int
    ) -> tuple[Registration, list[Said]]:
        """The pairs of a second: watched, and learnt where they are no reason to doubt the radar."""
        after, said = self._watching(gathered, radars)
        known = set(after.evidence.links)
        room = AIRCRAFT_AT_MOST - len(known)
        numbers = sorted({*after.evidence.radars, *gathered.pairs.radar})[:RADARS_AT_MOST]
        wanted = []
        for place, (radar, aircraft) in enumerate(zip(gathered.pairs.radar, gathered.pairs.aircraft, strict=True)):
            watch = after.watches.get(radar)
            if not gathered.held[place] or radar not in numbers or (watch is not None and watch.is_doubtful):
                continue
            if (aircraft, radar) not in known:
                if room <= 0:
                    continue
                room -= 1
                known.add((aircraft, radar))
            wanted.append(place)
        if not wanted:
            return after, said
        evidence = faded(after.evidence, math.exp(-1.0 / FADES_S))
        evidence = learnt(evidence, gathered.pairs.chosen(wanted), at, after.solution)
        return replace(after, evidence=evidence, is_new=True), said

    def _watching(self, gathered: Gathered, radars: Mapping[int, RadarSite]) -> tuple[Registration, list[Said]]:
        """Whether radars still measure as was learnt; what was learnt of one that does not is given up."""
        if self.solution is None:
            return self, []
        said, pairs = list[Said](), gathered.pairs
        left, variance = self.solution.left(pairs)
        numbers, watches = np.array(pairs.radar), dict(self.watches)
        for number in dict.fromkeys(pairs.radar):
            if number not in self.solution.radars or number not in radars:
                continue
            mine, radar = numbers == number, radars[number]
            usual = np.array([radar.range_sigma_m, radar.azimuth_sigma_rad, radar.elevation_sigma_rad])
            whose = {pairs.aircraft[place] for place in np.flatnonzero(mine).tolist()}
            watch = watches.get(number, Watch())
            watches[number] = watch.seeing(left[mine], variance[mine], pairs.sigma[mine], usual, len(whose))
        sure = [number for number, watch in watches.items() if watch.is_sure]
        after = replace(self, watches=watches)
        for number in sure:
            after, told = after._given_up(radars[number])
            said.append(told)
        return after, said

    def _given_up(self, radar: RadarSite) -> tuple[Registration, Said]:
        """A radar that was moved or repaired while aircraft were watched: all that was learnt of it is forgotten."""
        after, said = self._unlearnt(radar)
        return replace(after, evidence=without(after.evidence, radar.number)), said

    def _unlearnt(self, radar: RadarSite) -> tuple[Registration, Said]:
        """A radar is learnt anew, and until then what the site file says is taken off."""
        number = radar.number
        was = self.choices.get(number)
        more = ", no longer taken off," if was is not None and any(was.applied) else ""
        text = f"radar {number} suddenly measures otherwise: what was learnt of its errors is given up{more} and learnt anew"
        choices = {**self.choices, number: Choice.nothing(stated(radar))}
        watches = {one: watch for one, watch in self.watches.items() if one != number}
        return replace(self, solution=None, choices=choices, watches=watches), Said("warning", text)

    def _solving(
        self, radars: Mapping[int, RadarSite], position: PositionSource, use: Registering, at: int
    ) -> tuple[Registration, list[Said]]:
        """The errors that the evidence tells by now, and what is taken off of them from now on."""
        usual_m = max(position.systematic_m, 1.0) / math.sqrt(3.0)
        common_m = max(position.systematic_m, 1.0) * COMMON_SHARE
        own_m = usual_m if self.solution is None else self.solution.own_sigma_m
        evidence = folded(self.evidence, at - FOLDED_AFTER_NS, own_m)
        past = against_past(evidence, own_m, common_m) if evidence.links else {}
        doubted = frozenset(number for number, chi_square in past.items() if chi_square > PAST_CHI_SQUARE)
        given_up, said = self, list[Said]()
        for number in sorted(doubted & self.doubted & radars.keys()):
            evidence = without_past(evidence, number)
            given_up, warning = given_up._unlearnt(radars[number])
            said.append(warning)
        solution = solved(evidence, usual_m, common_m, given_up.solution)
        if solution is None:
            return replace(given_up, evidence=evidence, solution=None, is_new=False), said
        wrong = solution.prior_chi_square > PRIOR_CHI_SQUARE
        choices = dict(given_up.choices)
        # of so few aircraft nobody can tell what they have in common from what is each one's own: not trusted, not said
        is_told = wrong and max(evidence.seen, default=0) > FEW
        if is_told and not self.is_prior_wrong:
            said.append(Said("warning", _prior_in_words(solution)))
        pairs = dict(zip(evidence.radars, evidence.pairs, strict=True))
        for number in solution.radars:
            if number not in radars or pairs[number] < LEAST_PAIRS:
                continue
            radar = radars[number]
            before = choices.get(number, Choice.nothing(stated(radar)))
            choices[number], told = chosen(
                before, _verdicts(solution, radar, evidence), radar, use, at, trusted=not wrong
            )
            said += [Said("info", text) for text in told]
        known = replace(given_up, evidence=evidence, solution=solution, solved_at=at, is_new=False)
        return replace(known, choices=choices, is_prior_wrong=is_told, doubted=doubted), said

    def _stepping(self, radars: Mapping[int, RadarSite], at: int, ahead: int) -> Registration:
        """A step further towards what is to be taken off; what held before anything that can still come is forgotten."""
        steps = dict(self.steps)
        for number, choice in self.choices.items():
            if number in radars:
                now = steps.get(number) or Steps.always(stated(radars[number]))
                after = now.towards(choice.target, largest_step(radars[number]), at + ahead).pruned(at - 2 * ahead)
                if after is not now or number in steps:
                    steps[number] = after
        return replace(self, steps=steps)

    def again(self, at: int) -> Registration:
        """The same after the session's time was set back: what is taken off now has always been."""
        own_m = 1.0 if self.solution is None else self.solution.own_sigma_m
        return replace(
            self,
            evidence=folded(self.evidence, 1 << 62, own_m),
            steps={number: Steps.always(steps.of(at)) for number, steps in self.steps.items()},
            watches={},
            learnt_until=0,
        )

    # from one session to the next ----------------------------------------------------------------------------------

    def meeting(self, radars: Mapping[int, RadarSite], use: Registering) -> tuple[Registration, list[Said]]:
        """The same with what is remembered of radars that were not known until now, where they stand as they did."""
        new = [radars[number] for number in sorted(radars) if number not in self.met]
        after, said, remembered = replace(self, met=frozenset(radars)), list[Said](), self.remembered
        if remembered is None or use == "off":
            return after, said
        for radar in new:
            known = remembered.of(radar, self.age_s)
            if known is None:
                if remembered.knows(radar.number):
                    text = f"radar {radar.number} stands elsewhere than when it was registered: that is not used"
                    said.append(Said("info", text))
                continue
            error, sigma = known
            evidence = remembering(after.evidence, radar.number, error, sigma)
            verdicts = tuple(
                Verdict(name, value, spread, not math.isnan(value), there)
                for name, value, spread, there in zip(NAMES, error.tolist(), sigma.tolist(), stated(radar), strict=True)
            )
            choice = Choice.remembered(verdicts, radar, use)
            after = replace(
                after,
                evidence=evidence,
                is_new=True,
                choices={**after.choices, radar.number: choice},
                steps={**after.steps, radar.number: Steps.always(choice.target)},
            )
            taken = [one.sentence("applied") for one, is_on in zip(verdicts, choice.applied, strict=True) if is_on]
            what = "; ".join(taken) or "nothing of it is significant"
            said.append(Said("info", f"radar {radar.number}, as registered {in_words(self.age_s)} ago: {what}"))
        return after, said

    def to_remember(
        self, radars: Mapping[int, RadarSite], at: int, runway: tuple[float, float, float]
    ) -> Remembered | None:
        """What is known now, to be kept; None before anything is. `runway`: latitude, longitude, landing direction, rad."""
        rows = []
        for number in sorted(radars):
            radar = radars[number]
            verdicts = self.verdicts(radar)
            if verdicts is None:
                continue
            told = [one.is_told for one in verdicts]
            error = tuple(one.value if is_told else None for one, is_told in zip(verdicts, told, strict=True))
            sigma = tuple(one.sigma if is_told else None for one, is_told in zip(verdicts, told, strict=True))
            place = radar.along_m, radar.left_m, radar.antenna_height_m, radar.compass_boresight_rad
            rows.append(RememberedRadar(number, *place, error, sigma))
        return Remembered(at, *runway, tuple(rows)) if rows else None


def _verdicts(solution: Solution, radar: RadarSite, evidence: Evidence) -> tuple[Verdict, ...]:
    row = solution.radars.index(radar.number)
    seen = dict(zip(evidence.radars, evidence.seen, strict=True)).get(radar.number, 0)
    enough = SIGNIFICANT if seen > FEW else SIGNIFICANT_OF_FEW
    found, sigma = solution.error[row].tolist(), solution.sigma[row].tolist()
    parts = zip(NAMES, found, sigma, solution.observable[row].tolist(), stated(radar), strict=True)
    return tuple(Verdict(*part, enough) for part in parts)


def _prior_in_words(solution: Solution) -> str:
    east, north, up = solution.common_m.tolist()
    return (
        f"the position sources together are further off than [position] systematic_m allows (about {east:+.0f} m east, "
        f"{north:+.0f} m north, {up:+.0f} m up; chi-square {solution.prior_chi_square:.0f}): what radars measure too much "
        "can not be told from that, and nothing more is taken off"
    )
