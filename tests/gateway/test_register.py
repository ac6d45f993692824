"""Register while a session runs: what is learnt, said, taken off step by step, given up again, and handed on."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.estimators.registration_evidence import Pairs
from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz, polar_jacobian
from gateway.register import Gathered, Registration, Remembered, residuals, table
from gateway.register.corrections import largest_step
from gateway.settings import DEMO_SITE, PositionSource, RadarSite

Floats = NDArray[np.float64]

FRAME = RunwayFrame(DEMO_SITE.runway)
RADAR = DEMO_SITE.radars[0]
OTHER = RadarSite(2, -400.0, -200.0, 5.0, math.radians(265.0))
ERROR = np.array([150.0, math.radians(0.5), math.radians(0.2), 0.05])
NOTHING = np.zeros(4)
SPREAD = np.array([15.0, 1e-3, 1e-3])
CLOSE = np.array([10.0, math.radians(0.02), math.radians(0.02), 0.02])
AHEAD = 10 * SECOND
RUNWAY = DEMO_SITE.runway.latitude_rad, DEMO_SITE.runway.longitude_rad, DEMO_SITE.runway.landing_compass_rad


@dataclass
class Sky:
    """Aircraft in turns about the runway, each position source with an error of its own, and radars that measure wrong."""

    seed: int = 1
    count: int = 10
    own_m: float = 10.0
    common_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    errors: Callable[[int, float], Floats] = lambda radar, time_s: ERROR
    radars: tuple[RadarSite, ...] = (RADAR,)
    straight_in: bool = False
    state: Registration = field(default_factory=Registration)
    said: list[tuple[float, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.chance = np.random.default_rng(self.seed)
        self.middle = np.c_[
            self.chance.uniform(-30e3, 30e3, (self.count, 2)), self.chance.uniform(500.0, 4000.0, self.count)
        ]
        self.phase = self.chance.uniform(0.0, 2.0 * math.pi, self.count)
        self.off = self.chance.standard_normal((self.count, 3)) * self.own_m + np.array(self.common_m)
        self.known = {radar.number: radar for radar in self.radars}
        self.state, said = self.state.meeting(self.known, "apply")
        self.said += [(0.0, one.text) for one in said]

    def place(self, time_s: float) -> tuple[Floats, Floats]:
        """Where aircraft are, ENU m, and how fast they go there."""
        if self.straight_in:
            along = np.array([-48e3 + 80.0 * time_s, 100.0, 2400.0 - 4.0 * time_s])
            return along[None], np.array([[80.0, 0.0, -4.0]])
        turned, rate = self.phase + 0.01 * time_s, 0.01
        circle = np.c_[np.cos(turned), np.sin(turned), np.zeros(self.count)] * 9000.0
        speed = np.c_[-np.sin(turned), np.cos(turned), np.zeros(self.count)] * 9000.0 * rate
        return self.middle + circle, speed

    def pairs(self, time_s: float) -> Gathered:
        """A second's pairs of all radars."""
        true, speed = self.place(time_s)
        told = true + self.off[: len(true)] + self.chance.standard_normal(true.shape) * 8.0
        parts, names, numbers = [], [], []
        for radar in self.radars:
            frame, error = RadarFrame.of(radar, FRAME), self.errors(radar.number, time_s)
            by_enu = polar_jacobian(frame.from_enu(told)) @ frame.radar_from_enu
            rates = (by_enu @ speed[..., None])[..., 0]
            noise = self.chance.standard_normal(true.shape) * SPREAD / math.sqrt(2.5)
            seen = polar_from_xyz(frame.from_enu(true)) + noise + error[:3] - rates * error[3]
            off = seen - polar_from_xyz(frame.from_enu(told))
            off[:, 1] = np.remainder(off[:, 1] + math.pi, 2.0 * math.pi) - math.pi
            sigma = np.sqrt(SPREAD**2 / 2.5 + ((by_enu * 15.0) ** 2).sum(axis=-1))
            parts.append((off, sigma, by_enu, rates))
            names += [f"mavlink:{number}" for number in range(len(true))]
            numbers += [radar.number] * len(true)
        columns = [np.concatenate(some) for some in zip(*parts, strict=True)]
        at = [round(time_s * SECOND)] * len(names)
        return Gathered(at, Pairs(names, numbers, *columns), np.ones(len(names), np.bool_))

    def watch(
        self,
        since_s: int,
        until_s: int,
        change: Callable[[Gathered], Gathered] = lambda pairs: pairs,
        position: PositionSource = PositionSource(),
    ) -> None:
        """Some seconds of it."""
        for second in range(since_s, until_s):
            pairs = change(self.pairs(float(second)))
            self.state, said = self.state.second(pairs, self.known, position, "apply", second * SECOND, AHEAD)
            self.said += [(float(second), one.text) for one in said]

    def off_by(self, radar: int = 1) -> Floats:
        """What is found less the truth, (4,)."""
        assert self.state.solution is not None
        return self.state.solution.error[self.state.solution.radars.index(radar)] - self.errors(radar, 1e9)

    def taken_off(self, at_s: float, radar: int = 1) -> Floats:
        """What is taken off what is valid at a second."""
        return np.array(self.state.of(self.known[radar], round(at_s * SECOND)))

    def heard(self, words: str) -> list[float]:
        """When something with these words was said."""
        return [at for at, text in self.said if words in text]


@pytest.mark.parametrize(("own_m", "common_m"), [(10.0, (0.0, 0.0, 0.0)), (0.0, (35.0, -30.0, 20.0))])
def test_in_five_minutes_of_ten_aircraft_a_radar_is_found_and_taken_off(
    own_m: float, common_m: tuple[float, float, float]
) -> None:
    sky = Sky(own_m=own_m, common_m=common_m)
    sky.watch(0, 300)
    assert (np.abs(sky.off_by()) < CLOSE).all()
    assert (np.abs(sky.taken_off(330.0) - ERROR)[:3] < CLOSE[:3]).all()
    for words in ("range: measures", "degrees to the left", "degrees too high"):
        assert len([text for _, text in sky.said if words in text and text.endswith("applied")]) == 1


def test_own_errors_of_sixty_metres_are_claimed_no_better_than_they_allow() -> None:
    off = []
    for seed in range(4):
        sky = Sky(seed=seed, own_m=60.0)
        sky.watch(0, 120)
        assert sky.state.solution is not None
        off.append(sky.off_by() / sky.state.solution.sigma[0])
    assert np.sqrt((np.array(off) ** 2).mean()) < 1.6


def test_a_correction_is_approached_in_small_steps_that_hold_only_for_what_is_valid_later() -> None:
    sky = Sky()
    most = np.array(largest_step(RADAR))
    sky.watch(0, 60)
    for second in range(60, 200):
        before = [sky.taken_off(second + ahead) for ahead in range(-10, 10)]
        sky.watch(second, second + 1)
        assert np.array_equal(before, [sky.taken_off(second + ahead) for ahead in range(-10, 10)])
        step = np.abs(sky.taken_off(second + 10.0) - sky.taken_off(second + 9.0))
        assert (step <= most * (1.0 + 1e-9)).all()
    assert sky.taken_off(200.0)[0] > 100.0


def test_what_the_site_file_says_is_not_taken_off_twice() -> None:
    stated = replace(RADAR, range_error_m=150.0, azimuth_error_rad=ERROR[1], elevation_error_rad=ERROR[2])
    sky = Sky(radars=(stated,))
    sky.watch(0, 300)
    assert (np.abs(sky.taken_off(310.0) - ERROR)[:3] < CLOSE[:3]).all()
    assert sky.heard("range: nothing significant beyond what the site file says")
    assert not sky.heard("range: measures")


def test_a_radar_that_is_repaired_is_noticed_given_up_and_learnt_anew() -> None:
    sky = Sky(errors=lambda radar, time_s: ERROR if time_s < 200.0 else NOTHING)
    sky.watch(0, 215)
    (noticed,) = sky.heard("suddenly measures otherwise")
    assert 200.0 < noticed < 215.0
    assert sky.taken_off(noticed + 9.0)[0] > 130.0
    sky.watch(215, 300)
    assert np.abs(sky.taken_off(305.0)[0]) < 10.0
    assert (np.abs(sky.off_by())[:3] < CLOSE[:3]).all()


def test_an_aircraft_that_is_paired_wrongly_is_no_reason_to_doubt_the_radar() -> None:
    def wrong(pairs: Gathered) -> Gathered:
        """The first aircraft's radar track is another one's, which flies 170 m beside it."""
        off = pairs.pairs.off.copy()
        off[0] += pairs.pairs.by_enu[0] @ [100.0, -120.0, 70.0]
        return replace(pairs, pairs=replace(pairs.pairs, off=off))

    sky = Sky()
    sky.watch(0, 100)
    sky.watch(100, 200, change=wrong)
    assert not sky.heard("suddenly")
    assert (np.abs(sky.off_by())[:3] < 1.5 * CLOSE[:3]).all()


def test_lost_pairs_are_watched_and_not_learnt() -> None:
    sky, lost = Sky(), Sky(errors=lambda radar, time_s: NOTHING)
    sky.watch(0, 100)
    lost.state = sky.state
    known = sky.state.evidence
    lost.watch(100, 104, change=lambda pairs: replace(pairs, held=np.zeros(len(pairs.held), np.bool_)))
    assert lost.state.evidence.pairs == known.pairs
    assert lost.state.watches[1].is_doubtful


def test_each_radar_has_errors_of_its_own() -> None:
    sky = Sky(radars=(RADAR, OTHER), errors=lambda radar, time_s: ERROR if radar == 1 else -ERROR)
    sky.watch(0, 200)
    assert (np.abs(sky.off_by(1))[:3] < CLOSE[:3]).all()
    assert (np.abs(sky.off_by(2))[:3] < CLOSE[:3]).all()
    assert sky.taken_off(205.0, radar=2)[0] < -100.0


def test_a_straight_in_approach_says_what_it_does_not_tell_and_takes_nothing_off() -> None:
    sky = Sky(count=1, own_m=35.0, straight_in=True, errors=lambda radar, time_s: NOTHING)
    sky.watch(0, 400)
    assert sky.heard("range: not observable from this geometry")
    assert sky.heard("time: not observable from this geometry")
    assert not sky.state.choices[1].applied[0]
    assert not sky.state.choices[1].applied[3]


def test_of_three_aircraft_an_error_has_to_be_plainer_than_of_many() -> None:
    for count, enough in ((3, 4.5), (10, 3.0)):
        sky = Sky(count=count)
        sky.watch(0, 20)
        verdicts = sky.state.verdicts(RADAR)
        assert verdicts is not None
        told = replace(verdicts[0], value=4.0, sigma=1.0, observable=True)
        assert told.is_found == (enough < 4.0)
        assert not replace(told, value=2.9).is_found
        assert replace(told, value=4.6).is_found


def test_position_sources_that_are_all_off_beyond_what_is_allowed_are_said_and_nothing_is_taken_off() -> None:
    sky = Sky(common_m=(150.0, -120.0, 100.0))
    sky.watch(0, 100)
    assert sky.heard("the position sources together are further off")
    assert sky.state.is_prior_wrong
    assert np.array_equal(sky.taken_off(200.0), NOTHING)


def test_of_one_aircraft_that_is_off_nothing_is_said_of_all_position_sources() -> None:
    sky = Sky(count=1, common_m=(600.0, -500.0, 300.0))
    sky.watch(0, 100)
    assert not sky.heard("the position sources together")
    assert not sky.state.is_prior_wrong
    assert np.array_equal(sky.taken_off(200.0), NOTHING)


def test_what_is_told_is_what_is_known() -> None:
    sky = Sky()
    sky.watch(0, 150)
    last = sky.pairs(150.0)
    told = table(sky.state, sky.known, 150 * SECOND, [residuals(last, sky.state, sky.known)])
    assert told.radars == (1,)
    assert told.correction[0] == pytest.approx(sky.taken_off(150.0))
    assert told.applied[0, :3].all()
    assert told.verdict[0][0].startswith("range: measures 1")
    assert told.own_sigma_m < 25.0
    assert np.abs(told.residuals.before[:, 0]).mean() > 3.0 * np.abs(told.residuals.after[:, 0]).mean()
    nothing = table(Registration(), sky.known, 0, [])
    assert np.isnan(nothing.error).all()
    assert nothing.verdict == (("", "", "", ""),)


def remembered(sky: Sky, at_s: float = 0.0) -> Remembered:
    """What a session hands to the next."""
    found = sky.state.to_remember(sky.known, round(at_s * SECOND), RUNWAY)
    assert found is not None
    return found


def test_what_was_learnt_is_taken_off_from_the_first_plot_of_the_next_session_on() -> None:
    sky = Sky()
    sky.watch(0, 250)
    again = Sky(seed=2, state=Registration(remembered=remembered(sky), age_s=3.0 * 3600.0))
    assert (np.abs(again.taken_off(-1e6) - ERROR)[:3] < CLOSE[:3]).all()
    assert again.heard("radar 1, as registered 3 hours ago: range: measures 1")
    again.watch(0, 60)
    assert not again.heard("suddenly")
    assert (np.abs(again.off_by())[:3] < CLOSE[:3]).all()


def test_what_is_older_is_trusted_less_and_what_stands_elsewhere_not_at_all() -> None:
    sky = Sky()
    sky.watch(0, 250)
    known = remembered(sky)
    new, old = (known.of(RADAR, age_s) for age_s in (0.0, 100.0 * 86_400.0))
    assert new is not None
    assert old is not None
    assert np.array_equal(new[0], old[0], equal_nan=True)
    assert (old[1][:3] > 3.0 * new[1][:3]).all()
    moved = Sky(radars=(replace(RADAR, along_m=RADAR.along_m + 40.0),), state=Registration(remembered=known))
    assert moved.heard("radar 1 stands elsewhere than when it was registered: that is not used")
    assert np.array_equal(moved.taken_off(0.0), NOTHING)


def test_a_radar_that_was_repaired_between_two_sessions_is_noticed() -> None:
    sky = Sky()
    sky.watch(0, 250)
    state = Registration(remembered=remembered(sky), age_s=3600.0)
    again = Sky(seed=2, errors=lambda radar, time_s: NOTHING, state=state)
    again.watch(0, 120)
    assert again.heard("suddenly measures otherwise")
    assert np.abs(again.taken_off(150.0)[0]) < 15.0


def test_when_time_is_set_back_what_is_taken_off_stays() -> None:
    sky = Sky()
    sky.watch(0, 150)
    now = sky.taken_off(150.0)
    sky.state = sky.state.again(150 * SECOND)
    assert np.array_equal(sky.taken_off(-500.0), now)
    assert sky.state.evidence.links == ()
