"""What the picture remembers from one step to the next: one immutable value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from gateway.align import Geoid
from gateway.associate import Association, Change
from gateway.estimators.deck import Deck
from gateway.frames import RunwayFrame
from gateway.fuse import Lanes
from gateway.fuse.consistency import Consistency
from gateway.predict import ArrivalFlow, FlowWays, Predicting, Probing
from gateway.reckon import Reckoners
from gateway.register import Registration, Remembered
from gateway.settings import Options, RadarSite, Site
from gateway.track import RadarTracks, Unnumbered


@dataclass(frozen=True, slots=True)
class State:
    """Everything the picture remembers: what each stage knows, the session's time, counters, and what was said."""

    site: Site
    options: Options
    frame: RunwayFrame
    radars: Mapping[int, RadarSite]  # from the site file, else from what a radar says of itself
    geoid: Geoid
    tracks: RadarTracks = RadarTracks()
    association: Association = Association()
    registration: Registration = Registration()
    lanes: Lanes = Lanes()
    now: int | None = None  # session time of the newest arrival or watermark
    instant: int = 0  # the next whole second
    serial: int = 0  # observations so far that a stage reads
    steps: int = 0
    counters: Mapping[str, int] = field(default_factory=dict)
    said: frozenset[str] = frozenset()  # what is said once
    reported: frozenset[Change] = frozenset()  # pairs made and lost, lately
    consistency: Consistency = Consistency()  # whether sources scatter as much as the settings say
    predicting: Predicting = Predicting()  # what aircraft say of their plans, and what is thought of each
    unnumbered: Unnumbered = Unnumbered()  # plots without a number, and what they are thought to be
    probing: Probing = Probing()  # which tracks are foretold to come near each other
    reckoners: Reckoners = Reckoners()  # of vehicles that tell how they move
    deck: Deck | None = None  # of a runway that follows a ship

    def to_remember(self, at: int) -> Remembered | None:
        """What is known of the radars' errors, for the next session of this site; None where nothing is."""
        runway = self.site.runway
        where = runway.latitude_rad, runway.longitude_rad, runway.landing_compass_rad
        return self.registration.to_remember(self.radars, at, where)


def initial(
    site: Site,
    options: Options = Options(),
    remembered: Remembered | None = None,
    began: int = 0,
    flows: Sequence[ArrivalFlow] = (),
) -> State:
    """The state before the first arrival. `remembered`: of the site's radars, older by now, `began`, ns since 1970 UTC.

    `flows`: ways that arrivals come.
    """
    radars = {radar.number: radar for radar in site.radars}
    age_s = 0.0 if remembered is None else remembered.age_s(began)
    registration = Registration(remembered=remembered, age_s=age_s)
    geoid = Geoid(site.runway.geoid_separation_m)
    frame = RunwayFrame(site.runway)
    predicting = Predicting(flows=FlowWays.of(flows, site, frame))
    deck = None if site.runway.follows is None else Deck(site.runway.follows)
    return State(site, options, frame, radars, geoid, registration=registration, predicting=predicting, deck=deck)
