"""What MAVLink messages mean, and which of them mean nothing."""

import math
from typing import Any

import pytest

from adapters import Arrival, Source
from adapters.decode import Decoder
from adapters.mavlink_frames import FrameEncoder
from gateway.observation import Attitude, FlightPlan, GpsReport, Heard, Observation, Timing, Truth, VehicleStatus

SECOND = 10**9
T0 = 1_790_000_000 * SECOND
BOOT_S = 100
PLANE, ARDUPILOT, GCS, NO_AUTOPILOT = 1, 3, 6, 8


class Talker:
    """A vehicle that says what it is told to, at its own time since boot, on one source of a decoder."""

    def __init__(self, decoder: Decoder, source: int = 0, system: int = 1, component: int = 1) -> None:
        self.decoder, self.source = decoder, source
        self.encoder = FrameEncoder(system, component)
        self.second = 0.0
        self.notes: list[str] = []
        if source not in decoder._listened:
            decoder.add(Source(source, "mavlink", f"mavlink-{source + 1}", f"udpin:{source}"))

    @property
    def boot_ms(self) -> int:
        return round((BOOT_S + self.second) * 1000)

    def say(self, name: str, **values: Any) -> tuple[Observation, ...]:
        return self.send(self.encoder.encode(name, **values)).observations

    def send(self, frame: bytes) -> Heard:
        stamp = (T0 + round(self.second * SECOND)) // 4000 * 4000
        heard = self.decoder.feed(Arrival(stamp, self.source, frame))
        self.notes += [text for _, text in heard.notes]
        return heard

    def heartbeat(self, kind: int = PLANE, autopilot: int = ARDUPILOT) -> tuple[Observation, ...]:
        values = {"base_mode": 128, "custom_mode": 10, "system_status": 4, "mavlink_version": 3}
        return self.say("HEARTBEAT", type=kind, autopilot=autopilot, **values)

    def fix(self, fix_type: int = 3, **values: Any) -> tuple[Observation, ...]:
        place = {"lat": 310_000_000, "lon": 1_040_000_000, "alt": 500_000, "alt_ellipsoid": 500_000}
        rest = {
            "eph": 65535,
            "epv": 65535,
            "vel": 0,
            "cog": 0,
            "satellites_visible": 9,
            "time_usec": self.boot_ms * 1000,
        }
        return self.say("GPS_RAW_INT", fix_type=fix_type, **(place | rest | values))

    def position(self, **values: Any) -> tuple[Observation, ...]:
        place = {"lat": 310_000_000, "lon": 1_040_000_000, "alt": 500_000, "relative_alt": 0, "hdg": 9000}
        return self.say(
            "GLOBAL_POSITION_INT", **({"time_boot_ms": self.boot_ms, "vx": 0, "vy": 0, "vz": 0} | place | values)
        )

    def attitude(self, **values: Any) -> tuple[Observation, ...]:
        angles = dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), self.second / 9)
        return self.say("ATTITUDE", **({"time_boot_ms": self.boot_ms} | angles | values))

    def system_time(self, offset_ns: int = 0) -> None:
        self.say(
            "SYSTEM_TIME", time_unix_usec=(T0 + offset_ns) // 1000 + round(self.second * 1e6), time_boot_ms=self.boot_ms
        )

    def counter(self, reason: str) -> int:
        return self.decoder.counters().get(f"mavlink-{self.source + 1} {reason}", 0)


@pytest.fixture
def plane() -> Talker:
    """A plane with a heartbeat and a fix, not yet a clock."""
    talker = Talker(Decoder())
    talker.heartbeat()
    talker.fix()
    talker.second += 0.1
    return talker


def _report(found: tuple[Observation, ...]) -> GpsReport:
    (report,) = found
    assert isinstance(report, GpsReport)
    return report


def test_a_position_becomes_si_and_radians_with_up_positive(plane: Talker) -> None:
    plane.fix(h_acc=2500, v_acc=4000, vel_acc=300)
    report = _report(
        plane.position(lat=-353_632_610, lon=1_491_652_299, alt=584_090, vx=100, vy=-250, vz=75, hdg=35_300)
    )
    assert report.aircraft == "mavlink:1"
    assert math.degrees(report.latitude_rad) == pytest.approx(-35.363261, abs=1e-12)
    assert math.degrees(report.longitude_rad) == pytest.approx(149.1652299, abs=1e-12)
    assert report.altitude_msl_m == 584.09
    assert (report.velocity_north_mps, report.velocity_east_mps, report.velocity_up_mps) == (1.0, -2.5, -0.75)
    assert (report.horizontal_sigma_m, report.vertical_sigma_m, report.velocity_sigma_mps) == (2.5, 4.0, 0.3)
    assert report.compass_heading_rad == pytest.approx(math.radians(353.0))


def test_what_the_stream_does_not_give_is_none_and_not_zero(plane: Talker) -> None:
    report = _report(plane.position(hdg=65535))
    assert report.compass_heading_rad is None
    assert report.horizontal_sigma_m is None
    assert report.height_m is None


def test_a_repeated_altitude_gives_no_height_and_a_separate_one_does(plane: Talker) -> None:
    """SITL's alt_ellipsoid repeats alt: that is "not given", not a geoid separation of 0."""
    plane.fix(alt=500_000, alt_ellipsoid=500_000)
    assert _report(plane.position()).height_m is None
    plane.second += 1
    plane.fix(alt=500_000, alt_ellipsoid=465_000)
    assert _report(plane.position(alt=510_000)).height_m == 475.0
    plane.second += 1
    plane.fix(alt=500_000, alt_ellipsoid=500_000)  # equal once, but not throughout
    assert _report(plane.position(alt=510_000)).height_m == 510.0


@pytest.mark.parametrize(
    ("latitude", "longitude"), [(0, 0), (990, -343), (9_999_999, -9_999_999)], ids=["zero", "near zero", "1 degree"]
)
def test_no_report_comes_from_near_zero_zero_before_the_estimator_has_an_origin(
    plane: Talker, latitude: int, longitude: int
) -> None:
    assert plane.position(lat=latitude, lon=longitude) == ()
    assert plane.counter("no position yet") == 1


def test_who_flies_near_zero_zero_with_a_fix_there_is_heard(plane: Talker) -> None:
    plane.fix(lat=5_000_000, lon=-4_000_000)
    assert _report(plane.position(lat=5_000_100, lon=-4_000_100))


def test_no_report_comes_with_the_altitude_of_a_home_that_is_not_set(plane: Talker) -> None:
    """The altitude above home equals the altitude, and both are near 0, until home is set."""
    assert plane.position(alt=20, relative_alt=20) == ()
    assert plane.counter("no altitude yet") == 1
    plane.second += 1
    assert _report(plane.position(alt=499_000, relative_alt=20))
    plane.second += 1
    assert _report(plane.position(alt=350_000))  # once it agreed, a drift is the estimator's affair


def test_without_a_fix_the_estimators_dead_reckoning_is_no_report(plane: Talker) -> None:
    plane.fix(fix_type=1, lat=310_000_500)
    assert plane.position() == ()
    assert plane.counter("no fix") == 1
    plane.second += 1
    plane.fix(fix_type=3)
    assert _report(plane.position())


def test_a_fix_whose_time_stands_still_is_none(plane: Talker) -> None:
    for _ in range(30):
        plane.second += 0.1
        plane.attitude()
        plane.fix(time_usec=5_000_000)
    assert plane.position() == ()
    assert plane.counter("no fix") == 1


def test_a_position_that_repeats_its_time_is_dropped(plane: Talker) -> None:
    assert _report(plane.position())
    plane.second += 0.1
    assert plane.position(time_boot_ms=plane.boot_ms - 100) == ()
    assert plane.counter("repeated") == 1


def test_a_velocity_at_the_end_of_its_range_is_none_and_counted(plane: Talker) -> None:
    report = _report(plane.position(vx=32767))
    assert report.velocity_east_mps is report.velocity_north_mps is report.velocity_up_mps is None
    assert plane.counter("velocity out of range") == 1


def test_a_position_that_is_on_no_globe_is_refused(plane: Talker) -> None:
    assert plane.position(lat=900_000_001) == ()
    assert plane.counter("position out of range") == 1


def test_an_attitude_that_is_no_number_is_refused(plane: Talker) -> None:
    assert plane.attitude(roll=math.nan) == ()
    (attitude,) = plane.attitude(roll=0.25, pitch=-0.5, yaw=1.0)
    assert isinstance(attitude, Attitude)
    assert (attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad) == (0.25, -0.5, 1.0)


def test_a_heartbeat_tells_kind_mode_and_whether_it_is_armed() -> None:
    (status,) = Talker(Decoder()).heartbeat()
    assert isinstance(status, VehicleStatus)
    assert (status.vehicle_type, status.autopilot, status.armed, status.custom_mode) == (PLANE, ARDUPILOT, True, 10)


@pytest.mark.parametrize(
    ("kind", "autopilot"), [(GCS, ARDUPILOT), (26, ARDUPILOT), (27, ARDUPILOT), (18, ARDUPILOT), (PLANE, NO_AUTOPILOT)]
)
def test_who_is_no_vehicle_makes_no_reports(kind: int, autopilot: int) -> None:
    talker = Talker(Decoder())
    assert talker.heartbeat(kind, autopilot) == ()
    assert talker.position() == ()


def test_before_its_first_heartbeat_component_one_is_a_vehicle_and_others_are_not() -> None:
    decoder = Decoder()
    assert Talker(decoder, system=1, component=1).position()
    assert Talker(decoder, system=2, component=191).position() == ()


def test_system_zero_is_nobody() -> None:
    talker = Talker(Decoder(), system=0)
    assert talker.position() == ()
    assert talker.counter("system 0") == 1


def test_the_simulators_truth_comes_from_sim_state_rather_than_simstate(plane: Talker) -> None:
    zeros = dict.fromkeys(("xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro", "roll", "pitch", "yaw"), 0.0)
    (first,) = plane.say("SIMSTATE", lat=310_000_000, lng=1_040_000_000, **zeros)
    assert isinstance(first, Truth)
    quaternion = dict.fromkeys(("q1", "q2", "q3", "q4", "std_dev_horz", "std_dev_vert"), 0.0)
    place = {"lat": 31.0, "lon": 104.0, "alt": 550.0, "vn": 1.0, "ve": 2.0, "vd": 3.0}
    (truth,) = plane.say("SIM_STATE", **zeros, **quaternion, **place, lat_int=310_000_001, lon_int=1_040_000_002)
    assert isinstance(truth, Truth)
    assert math.degrees(truth.latitude_rad) == pytest.approx(31.0000001, abs=1e-12)
    assert (truth.altitude_msl_m, truth.velocity_north_mps, truth.velocity_up_mps) == (550.0, 1.0, -3.0)
    assert plane.say("SIMSTATE", lat=310_000_000, lng=1_040_000_000, **zeros) == ()


def test_without_utc_a_report_is_provisional_and_after_fifteen_seconds_on_the_envelope(plane: Talker) -> None:
    assert _report(plane.position()).timing is Timing.PROVISIONAL
    plane.second = 16.0
    report = _report(plane.position())
    assert report.timing is Timing.ENVELOPE
    assert report.valid_at == report.received_at


def test_with_utc_a_report_holds_when_the_vehicle_says_and_not_when_it_was_heard(plane: Talker) -> None:
    for _ in range(3):
        plane.second += 1.0
        plane.system_time()
    boot_ms = plane.boot_ms
    plane.second += 1.7  # held back by the radio
    report = _report(plane.position(time_boot_ms=boot_ms))
    assert report.timing is Timing.UTC
    assert abs(report.valid_at - (T0 + round((boot_ms / 1000 - BOOT_S) * SECOND))) < 2 * 10**6
    assert report.received_at - report.valid_at > 16 * SECOND // 10


def test_a_recording_from_last_year_takes_the_session_to_last_year_and_says_so_once(plane: Talker) -> None:
    for _ in range(8):
        plane.second += 1.0
        plane.system_time(-365 * 86_400 * SECOND)
    assert plane.decoder.epoch_offset_s == -365 * 86_400
    heard = plane.send(plane.encoder.encode("SYSTEM_TIME", time_unix_usec=0, time_boot_ms=plane.boot_ms))
    assert abs(heard.now - (T0 - 365 * 86_400 * SECOND + 81 * SECOND // 10)) < SECOND
    report = _report(plane.position())
    assert report.timing is Timing.UTC
    assert abs(report.valid_at - heard.now) < SECOND
    assert len([note for note in plane.notes if "clock of mavlink:1" in note]) == 1


def test_a_second_source_of_another_time_is_foreign_and_named_once(plane: Talker) -> None:
    other = Talker(plane.decoder, source=1, system=2)
    other.heartbeat()
    other.fix()
    for _ in range(8):
        plane.second += 1.0
        other.second = plane.second
        plane.system_time()
        other.system_time(-1000 * SECOND)
    assert plane.decoder.epoch_offset_s == 0
    assert _report(other.position()).timing is Timing.FOREIGN
    assert _report(plane.position()).timing is Timing.UTC
    assert [note for note in other.notes if "1000 s behind" in note] == [
        "The clock of mavlink:2 is 1000 s behind the session's: it is shown, not fused; "
        "set that clock, or begin a new session."
    ]


def _both_say(one: Talker, other: Talker, seconds: float, *, alike: bool) -> list[Observation]:
    """Both talk for a while; what came of the other."""
    found: list[Observation] = []
    for _ in range(round(seconds * 20)):
        one.second += 0.05
        other.second = one.second
        frame = one.encoder.encode("ATTITUDE", **_angles(one.boot_ms, 0.5))
        one.send(frame)
        if alike:
            found += other.send(frame).observations
        else:
            found += other.say("ATTITUDE", **_angles(one.boot_ms, -0.5))
    return found


def _angles(boot_ms: int, sign: float) -> dict[str, Any]:
    return {"time_boot_ms": boot_ms} | dict.fromkeys(
        ("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), sign * boot_ms / 1e6
    )


def test_the_same_vehicle_over_two_links_is_one_and_nothing_is_heard_twice(plane: Talker) -> None:
    other = Talker(plane.decoder, source=1)
    assert _both_say(plane, other, 3.0, alike=True) == []
    assert other.counter("heard twice") > 50
    frame = plane.encoder.encode("GLOBAL_POSITION_INT", time_boot_ms=plane.boot_ms, lat=310_000_000, lon=1_040_000_000,
                                 alt=500_000, relative_alt=0, vx=0, vy=0, vz=0, hdg=0)  # fmt: skip
    assert _report(other.send(frame).observations).aircraft == "mavlink:1"
    assert plane.send(frame).observations == ()


def test_two_vehicles_of_one_number_on_two_links_are_kept_apart_and_said(plane: Talker) -> None:
    other = Talker(plane.decoder, source=1)
    found = _both_say(plane, other, 3.0, alike=False)
    assert {one.aircraft for one in found if isinstance(one, Attitude)} == {"mavlink:1@2"}
    (note,) = [note for note in other.notes if "Two vehicles" in note]
    assert "mavlink:1 on udpin:0" in note
    assert "mavlink:1@2 on udpin:1" in note


def test_a_vehicle_that_comes_back_on_another_link_keeps_its_name(plane: Talker) -> None:
    other = Talker(plane.decoder, source=1)
    other.second = plane.second + 6.0
    (attitude,) = other.attitude()
    assert isinstance(attitude, Attitude)
    assert attitude.aircraft == "mavlink:1"


def test_heartbeats_without_a_position_are_said_with_what_to_do_about_it() -> None:
    talker = Talker(Decoder())
    for second in range(13):
        talker.second = float(second)
        talker.heartbeat()
    (note,) = [note for note in talker.notes if "no position" in note]
    assert "GLOBAL_POSITION_INT" in note


def test_a_vehicle_with_only_gps_raw_int_is_still_heard() -> None:
    talker = Talker(Decoder())
    found: list[Observation] = []
    for number in range(100):
        talker.second = number / 10
        talker.attitude()
        found += talker.fix(vel=2000, cog=9000)
    report = found[-1]
    assert isinstance(report, GpsReport)
    assert report.velocity_east_mps == pytest.approx(20.0)
    assert report.altitude_msl_m == 500.0


def test_a_position_of_gps_raw_int_is_of_the_time_of_its_fix_not_of_its_arrival() -> None:
    """The receiver tells when the fix was taken, 1.5 s before the message is heard: the report is of that time."""
    talker = Talker(Decoder())
    found: list[Observation] = []
    for number in range(100):
        talker.second = number / 10
        talker.attitude()
        found += talker.fix(time_usec=(talker.boot_ms - 1500) * 1000)
    report = found[-1]
    assert isinstance(report, GpsReport)
    assert report.received_at - report.valid_at == pytest.approx(1.5 * SECOND, abs=0.01 * SECOND)


def test_a_lost_fix_is_said_and_a_reboot_is_said(plane: Talker) -> None:
    plane.position()
    plane.fix(fix_type=0)
    assert any("lost its GPS fix" in note for note in plane.notes)
    plane.second += 60
    plane.attitude()
    for number in range(4):
        plane.second += 1
        plane.attitude(time_boot_ms=5000 + 1000 * number)
    assert any("has rebooted" in note for note in plane.notes)
    assert plane.counter("reboots") == 1


def _item(sequence: int, command: int, latitude: float, target: int = 255, **values: Any) -> dict[str, Any]:
    rest = dict.fromkeys(("param1", "param2", "param3", "param4"), 0.0)
    return {
        "target_system": target, "target_component": 0, "seq": sequence, "frame": 3, "command": command, "current": 0,
        "autocontinue": 1, "x": round(latitude * 1e7), "y": 1_040_000_000, "z": 50.0, **rest, **values,
    }  # fmt: skip


def test_a_mission_overheard_becomes_a_flight_plan_when_it_is_whole(plane: Talker) -> None:
    plane.say("HOME_POSITION", latitude=310_000_000, longitude=1_040_000_000, altitude=500_000,
              **dict.fromkeys(("x", "y", "z", "approach_x", "approach_y", "approach_z"), 0.0), q=[1.0, 0, 0, 0])  # fmt: skip
    plane.say("MISSION_COUNT", target_system=255, target_component=0, count=4)
    assert plane.say("MISSION_ITEM_INT", **_item(0, 16, 0.0)) == ()
    assert plane.say("MISSION_ITEM_INT", **_item(1, 22, 31.0)) == ()
    assert plane.say("MISSION_ITEM_INT", **_item(2, 16, 31.1)) == ()
    (plan,) = plane.say("MISSION_ITEM_INT", **_item(3, 21, 31.0, z=0.0))
    assert isinstance(plan, FlightPlan)
    assert [(point.sequence, point.kind) for point in plan.points] == [
        (0, "home"), (1, "take-off"), (2, "waypoint"), (3, "landing"),
    ]  # fmt: skip
    assert plan.points[0].altitude_msl_m == 500.0
    assert plan.points[2].altitude_above_home_m == 50.0
    assert plan.points[2].altitude_msl_m is None


def test_a_mission_that_a_station_sends_is_the_plan_of_the_vehicle_it_is_sent_to(plane: Talker) -> None:
    station = Talker(plane.decoder, source=0, system=255, component=190)
    station.heartbeat(GCS, NO_AUTOPILOT)
    station.say("MISSION_COUNT", target_system=1, target_component=1, count=2)
    station.say("MISSION_ITEM_INT", **_item(0, 16, 31.0, target=1))
    (plan,) = station.say("MISSION_ITEM_INT", **_item(1, 21, 31.0, target=1))
    assert isinstance(plan, FlightPlan)
    assert plan.aircraft == "mavlink:1"
