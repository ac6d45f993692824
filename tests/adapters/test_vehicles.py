"""Who is who: one vehicle over several links, several vehicles of one number, and those who are no vehicles."""

import math
import struct
from dataclasses import dataclass, field

import pytest

from adapters import Arrival, Source
from adapters.decode import Decoder
from adapters.likeness import GLOBAL_POSITION_INT, Likeness, Trace
from adapters.mavlink_frames import FrameEncoder
from gateway.observation import Attitude, GpsReport, Heard, VehicleStatus

SECOND = 10**9
MS = 10**6
T0 = 1_790_000_000 * SECOND
RADIUS_M, TURN_RADPS = 300.0, 0.1  # 30 m/s
M_PER_DEG = 111_194.9
GCS, GIMBAL, COMPANION, NO_AUTOPILOT = 6, 26, 18, 8


@dataclass
class Airframe:
    """An aircraft that circles; parked until `takes_off_s` after boot."""

    booted_at: int = T0
    east_m: float = 0.0
    takes_off_s: float = 0.0
    utc_ahead_ns: int | None = 0  # of the truth; None: it has no UTC

    def frames(self, encoder: FrameEncoder, at: int, number: int) -> list[bytes]:
        """What it says on one of its ports at an instant: positions and attitudes, and each tenth time a SYSTEM_TIME."""
        boot_s = (at - self.booted_at) / SECOND
        boot_ms = (at - self.booted_at) // MS
        angle = max(boot_s - self.takes_off_s, 0.0) * TURN_RADPS
        north, east = RADIUS_M * (math.cos(angle) - 1.0), self.east_m + RADIUS_M * math.sin(angle)
        latitude = 31.0 + north / M_PER_DEG
        longitude = 104.0 + east / M_PER_DEG / math.cos(math.radians(31.0))
        moving = angle > 0.0
        roll = 0.3 * math.sin(boot_s) * moving
        frames = [
            encoder.encode("GLOBAL_POSITION_INT", time_boot_ms=boot_ms, lat=round(latitude * 1e7),
                           lon=round(longitude * 1e7), alt=500_000 + 1000 * moving, relative_alt=0, vx=0, vy=0, vz=0,
                           hdg=0),
            encoder.encode("ATTITUDE", time_boot_ms=boot_ms, roll=roll, pitch=0.01, yaw=math.remainder(angle, math.tau),
                           rollspeed=0.0, pitchspeed=0.0, yawspeed=0.0),
        ]  # fmt: skip
        if number % 10 == 0:
            usec = 0 if self.utc_ahead_ns is None else (self.booted_at + self.utc_ahead_ns) // 1000 + boot_ms * 1000
            frames.append(encoder.encode("SYSTEM_TIME", time_unix_usec=usec, time_boot_ms=boot_ms))
        return frames


@dataclass
class Link:
    """One port of an aircraft, heard over a link with its own delay. Says something every `period_ms`."""

    airframe: Airframe
    delay_ms: float = 5.0
    phase_ms: int = 0
    period_ms: int = 200
    system: int = 1
    until_s: float = math.inf
    encoder: FrameEncoder = field(init=False)

    def __post_init__(self) -> None:
        self.encoder = FrameEncoder(self.system)

    def arrivals(self, source: int, seconds: float) -> list[Arrival]:
        """All frames of the first seconds, sent from T0 + 100 s on."""
        sent = []
        for number in range(round(min(seconds, self.until_s) * 1000 / self.period_ms)):
            at = T0 + 100 * SECOND + (number * self.period_ms + self.phase_ms) * MS
            for place, frame in enumerate(self.airframe.frames(self.encoder, at, number)):
                stamp = (at + round(self.delay_ms * MS)) // 4000 * 4000 + 4000 * (8 * source + place)
                sent.append(Arrival(stamp, source, frame))
        return sent


def hear(links: list[Link], seconds: float) -> tuple[list[Heard], Decoder, list[str]]:
    decoder = Decoder([Source(number, "mavlink", f"link-{number}", f"udpin:{number}") for number in range(len(links))])
    arrivals = [one for number, link in enumerate(links) for one in link.arrivals(number, seconds)]
    heard = [decoder.feed(arrival) for arrival in sorted(arrivals)]
    return heard, decoder, [text for one in heard for _, text in one.notes]


def aircraft(heard: list[Heard], since_s: float = 0.0) -> set[str]:
    since = T0 + round((100 + since_s) * SECOND)
    return {
        one.aircraft
        for each in heard
        for one in each.observations
        if isinstance(one, GpsReport | Attitude) and one.received_at >= since
    }


def reports(heard: list[Heard]) -> list[GpsReport]:
    return [one for each in heard for one in each.observations if isinstance(one, GpsReport)]


def test_one_aircraft_that_sends_other_frames_on_each_of_two_radios_is_one() -> None:
    plane = Airframe()
    heard, decoder, notes = hear([Link(plane), Link(plane, delay_ms=40, phase_ms=73, period_ms=250)], 12)
    assert aircraft(heard) == {"mavlink:1"}
    assert not [note for note in notes if "wo vehicles" in note]
    assert decoder.counters()["link-1 frames"] > 80
    (health,) = decoder.health(T0 + 112 * SECOND).vehicles
    assert dict(health.words)["heard over"] == "link-0, link-1"


def test_both_links_of_one_aircraft_are_used_and_all_reports_are_of_their_own_time() -> None:
    """Between two reports of the one link lies one of the other; in order of time they follow the circle."""
    plane = Airframe()
    heard, _, _ = hear([Link(plane), Link(plane, delay_ms=700, phase_ms=100)], 30)
    late = [one for one in reports(heard) if one.received_at > T0 + 115 * SECOND]
    assert len({one.valid_at for one in late}) == len(late) > 140
    for one in late:
        angle = (one.valid_at - T0) / SECOND * TURN_RADPS
        east = (math.degrees(one.longitude_rad) - 104.0) * M_PER_DEG * math.cos(math.radians(31.0))
        assert east == pytest.approx(RADIUS_M * math.sin(angle), abs=0.2)


def test_a_link_that_is_seconds_late_is_told_to_be_the_same_aircraft_by_its_utc() -> None:
    plane = Airframe()
    heard, decoder, notes = hear([Link(plane), Link(plane, delay_ms=3000, phase_ms=31)], 25)
    assert aircraft(heard) == {"mavlink:1"}
    assert not [note for note in notes if "wo vehicles" in note or "rebooted" in note]
    assert decoder.counters().get("link-1 undecided", 0) < 10 * 15


def test_without_utc_too_a_link_that_is_seconds_late_is_the_same_aircraft_once_it_has_flown() -> None:
    plane = Airframe(utc_ahead_ns=None)
    heard, _, notes = hear([Link(plane), Link(plane, delay_ms=2500, phase_ms=31)], 25)
    assert aircraft(heard) == {"mavlink:1"}
    assert not [note for note in notes if "wo vehicles" in note]


def test_without_utc_the_better_links_clock_serves_both() -> None:
    """By the envelope alone a link that is 250 ms late would put its reports that much too late."""
    plane = Airframe(utc_ahead_ns=None)
    heard, _, _ = hear([Link(plane), Link(plane, delay_ms=250, phase_ms=100)], 20)
    for one in reports(heard)[-40:]:
        angle = (one.valid_at - T0) / SECOND * TURN_RADPS
        east = (math.degrees(one.longitude_rad) - 104.0) * M_PER_DEG * math.cos(math.radians(31.0))
        assert east == pytest.approx(RADIUS_M * math.sin(angle), abs=0.4)  # 5 ms of the faster link, at 30 m/s


def test_what_both_links_tell_of_one_time_is_heard_once() -> None:
    plane = Airframe()
    heard, decoder, _ = hear([Link(plane), Link(plane, delay_ms=20)], 12)
    times = [one.valid_at for one in reports(heard)]
    assert len(times) == len(set(times)) == 60
    assert decoder.counters()["link-1 heard twice"] > 80


def test_two_aircraft_of_one_number_that_fly_apart_are_two_and_said() -> None:
    heard, _, notes = hear([Link(Airframe()), Link(Airframe(east_m=100.0), phase_ms=73)], 6)
    assert aircraft(heard, 4.0) == {"mavlink:1", "mavlink:1@2"}
    assert len([note for note in notes if "Two vehicles say that they are system 1" in note]) == 1


def test_two_that_stand_at_one_place_but_booted_apart_are_two() -> None:
    first, second = Airframe(takes_off_s=1e6), Airframe(booted_at=T0 - 30 * SECOND, takes_off_s=1e6)
    heard, _, _ = hear([Link(first), Link(second, phase_ms=73)], 6)
    assert aircraft(heard, 4.0) == {"mavlink:1", "mavlink:1@2"}


def test_two_that_stand_at_one_place_and_booted_two_seconds_apart_are_two_by_their_utc() -> None:
    first = Airframe(takes_off_s=1e6)
    second = Airframe(booted_at=T0 - 2 * SECOND, takes_off_s=1e6)
    heard, _, _ = hear([Link(first), Link(second, phase_ms=73)], 8)
    assert aircraft(heard, 6.0) == {"mavlink:1", "mavlink:1@2"}


def test_two_that_booted_as_one_at_one_place_are_one_until_they_part_and_then_two_and_said() -> None:
    first, second = Airframe(takes_off_s=110.0), Airframe(takes_off_s=1e6)
    heard, _, notes = hear([Link(first), Link(second, phase_ms=73)], 25)
    assert aircraft([one for one in heard if one.now < T0 + 110 * SECOND]) == {"mavlink:1"}
    assert aircraft(heard, 20.0) == {"mavlink:1", "mavlink:1@2"}
    assert len([note for note in notes if "is elsewhere: that is another vehicle" in note]) == 1
    (earlier, later) = ([one for one in reports(heard)[-12:] if one.aircraft == name] for name in
                        ("mavlink:1", "mavlink:1@2"))  # fmt: skip
    assert {one.latitude_rad for one in later} == {math.radians(31.0)}
    assert math.radians(31.0) not in {one.latitude_rad for one in earlier}


def test_a_link_that_dies_leaves_the_aircraft_to_the_other_with_its_name() -> None:
    plane = Airframe()
    heard, _, notes = hear([Link(plane, until_s=6), Link(plane, delay_ms=300, phase_ms=73)], 20)
    assert aircraft(heard) == {"mavlink:1"}
    assert reports(heard)[-1].received_at > T0 + 119 * SECOND
    assert not [note for note in notes if "wo vehicles" in note]


def test_a_late_link_does_not_bring_back_a_fix_that_is_lost() -> None:
    """Both links tell each GPS_RAW_INT, one of them 1.5 s later: what is over is not told again."""
    plane, frames = Airframe(), []
    ports = [FrameEncoder(1), FrameEncoder(1)]
    for number in range(200):
        at = T0 + 100 * SECOND + number * SECOND // 10
        for source, delay in enumerate((5 * MS, 1505 * MS)):
            own = plane.frames(ports[source], at + 7 * MS * source, number)
            fix = ports[source].encode("GPS_RAW_INT", time_usec=(at - T0) // 1000, fix_type=3 if number < 150 else 1,
                                       lat=310_000_000, lon=1_040_000_000, alt=500_000, eph=1, epv=1, vel=0, cog=0,
                                       satellites_visible=9)  # fmt: skip
            for place, frame in enumerate([*own, fix]):
                frames.append(Arrival((at + delay) // 4000 * 4000 + 4000 * (8 * source + place), source, frame))
    decoder = Decoder([Source(0, "mavlink", "near", "a"), Source(1, "mavlink", "far", "b")])
    notes = [text for arrival in sorted(frames) for _, text in decoder.feed(arrival).notes]
    assert len([note for note in notes if "lost its GPS fix" in note]) == 1
    assert len([note for note in notes if "has a GPS fix" in note]) == 1


def _beat(decoder: Decoder, sender: tuple[int, int], kind: int, autopilot: int, stamp: int) -> Heard:
    frame = FrameEncoder(*sender).encode(
        "HEARTBEAT", type=kind, autopilot=autopilot, base_mode=0, custom_mode=0, system_status=4, mavlink_version=3
    )
    return decoder.feed(Arrival(stamp, 0, frame))


def test_who_rides_along_is_named_and_is_no_vehicle() -> None:
    decoder = Decoder([Source(0, "mavlink", "link-0", "udpin:0")])
    for number, (sender, kind, autopilot) in enumerate(
        [((1, 1), 1, 3), ((255, 190), GCS, NO_AUTOPILOT), ((1, 154), GIMBAL, NO_AUTOPILOT),
         ((1, 191), COMPANION, NO_AUTOPILOT)]
    ):  # fmt: skip
        _beat(decoder, sender, kind, autopilot, T0 + 4000 * number)
    (health,) = decoder.health(T0 + SECOND).vehicles
    assert health.aircraft == "mavlink:1"
    assert dict(health.words)["also on this link"] == ("gimbal 1/154, companion computer 1/191, ground station 255/190")


def test_a_component_that_says_it_is_a_ground_station_is_no_vehicle_any_more() -> None:
    decoder = Decoder([Source(0, "mavlink", "link-0", "udpin:0")])
    (status,) = _beat(decoder, (7, 1), 1, 3, T0).observations
    assert isinstance(status, VehicleStatus)
    assert _beat(decoder, (7, 1), GCS, NO_AUTOPILOT, T0 + 4000).observations == ()
    assert decoder.health(T0 + SECOND).vehicles == ()


def test_component_1_is_a_vehicle_before_its_first_heartbeat_and_others_are_not() -> None:
    decoder = Decoder([Source(0, "mavlink", "link-0", "udpin:0")])
    plane = Airframe()
    found = [decoder.feed(Arrival(T0 + 100 * SECOND + 4000 * number, 0, frame)).observations
             for number, frame in enumerate(plane.frames(FrameEncoder(3), T0 + 100 * SECOND, 1)
                                            + plane.frames(FrameEncoder(3, 191), T0 + 100 * SECOND, 1))]  # fmt: skip
    assert [len(one) for one in found] == [1, 1, 0, 0]


def test_health_tells_each_vehicles_clock_delays_and_rates() -> None:
    _, decoder, _ = hear([Link(Airframe(), delay_ms=5), Link(Airframe(), system=2, period_ms=100)], 30)
    first, second = decoder.health(T0 + 130 * SECOND).vehicles
    assert (first.aircraft, first.clock, second.aircraft) == ("mavlink:1", "UTC", "mavlink:2")
    assert 0.001 <= first.clock_sigma_s < 0.002
    assert first.delay_s <= first.delay_99_s < 0.003
    assert dict(first.readings)["ATTITUDE, 1/s"] == pytest.approx(5.0, abs=0.6)
    assert dict(second.readings)["ATTITUDE, 1/s"] == pytest.approx(10.0, abs=1.2)
    assert not [name for name, _ in decoder.health(T0 + 200 * SECOND).vehicles[0].readings if name.endswith(", 1/s")]


def test_asking_for_health_changes_nothing_that_is_heard() -> None:
    links = [Link(Airframe()), Link(Airframe(), delay_ms=40, phase_ms=73)]
    arrivals = sorted(one for number, link in enumerate(links) for one in link.arrivals(number, 8))
    sources = [Source(number, "mavlink", f"link-{number}", "") for number in range(2)]
    quiet, asked = Decoder(sources), Decoder(sources)
    for arrival in arrivals:
        one = asked.feed(arrival)
        asked.health(arrival.received_at + 7 * SECOND)
        assert quiet.feed(arrival) == one


def _beats(source: int, seconds: float) -> list[Arrival]:
    """What a link brings of a vehicle that says only that it is there, 0.3 s behind the others."""
    encoder, since = FrameEncoder(1), T0 + 100 * SECOND + 300 * MS
    return [
        Arrival(
            since + number * 500 * MS,
            source,
            encoder.encode(
                "HEARTBEAT", type=1, autopilot=3, base_mode=0, custom_mode=0, system_status=4, mavlink_version=3
            ),
        )
        for number in range(round(seconds * 2))
    ]


def _hear_all(arrivals: list[Arrival], sources: int) -> tuple[list[Heard], list[str]]:
    decoder = Decoder([Source(number, "mavlink", f"link-{number}", f"udpin:{number}") for number in range(sources)])
    heard = [decoder.feed(arrival) for arrival in sorted(arrivals)]
    return heard, [text for one in heard for _, text in one.notes]


def test_two_that_part_while_it_is_open_who_a_third_is_part_once() -> None:
    """Found by fuzzing: with each further frame they parted again, and made one more vehicle of the same number."""
    links = [Link(Airframe(takes_off_s=102.0)), Link(Airframe(takes_off_s=1e6), phase_ms=73)]
    arrivals = [one for number, link in enumerate(links) for one in link.arrivals(number, 20)]
    heard, notes = _hear_all(arrivals + _beats(2, 20), 3)
    assert aircraft(heard, 15.0) == {"mavlink:1", "mavlink:1@2"}
    assert sum("is elsewhere" in note for note in notes) == 1


def test_a_link_that_brings_only_heartbeats_keeps_no_other_from_being_used() -> None:
    """Nothing that it says could tell whether they are one; after 10 s they are."""
    beats = [one._replace(received_at=one.received_at - 400 * MS) for one in _beats(0, 20)]
    heard, notes = _hear_all(beats + Link(Airframe()).arrivals(1, 20), 2)
    assert aircraft(heard, 11.0) == {"mavlink:1"}
    assert len([one for one in reports(heard) if one.received_at > T0 + 111 * SECOND]) > 40
    assert not [note for note in notes if "wo vehicles" in note]


def test_of_three_links_each_pair_is_compared_in_full() -> None:
    """What one link says of its motion counts in the comparison with every other link."""
    traces = [Trace(0) for _ in range(3)]
    likenesses = [Likeness(traces[0], other) for other in traces[1:]]
    for second in range(10):
        for place, trace in enumerate(traces):
            at_ms, north = second * 1000 + place * 100, 310_000_000 + 100 * (second * 1000 + place * 100)
            payload = struct.pack("<Iiii", at_ms, north, 1_040_000_000, 500_000)
            trace.hear(GLOBAL_POSITION_INT, payload, at_ms * 10**6)
        for likeness in likenesses:
            likeness.compare()
    compared = [list(likeness.apart_m) for likeness in likenesses]
    assert [len(one) for one in compared] == [9, 9]
    assert max(max(one) for one in compared) < 0.5
