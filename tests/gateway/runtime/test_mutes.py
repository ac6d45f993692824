"""What is muted is taken out, and nothing else."""

from gateway.observation import Attitude, GpsReport, Heard, Observation, RadarPlot
from gateway.runtime.mutes import Muting
from gateway.settings import Mute

ATTITUDE = Attitude("mavlink:1", 0, 0, 0.0, 0.0, 0.0)


def gps(aircraft: str) -> GpsReport:
    return GpsReport(aircraft, 0, 0, 0.0, 0.0)


def plot(radar: int) -> RadarPlot:
    return RadarPlot(radar, 1, 0, 0)


def left(mute: Mute, at: int, *observations: Observation, notes: tuple[tuple[str, str], ...] = ()) -> Heard | None:
    return Muting((mute,)).without_muted(Heard(at, observations, notes), at)


def test_a_mute_holds_from_its_beginning_up_to_before_its_end() -> None:
    mute = Mute("gps", None, 100, 200)
    whole = Heard(0, (gps("mavlink:1"),))
    muting = Muting((mute,))
    kept = [at for at in (99, 100, 199, 200) if muting.without_muted(whole, at) is not None]
    assert kept == [99, 200]
    assert muting.counters == {"GPS reports muted": 2}


def test_a_number_reaches_only_that_vehicle_whatever_it_is_called_on_a_second_link() -> None:
    names = ("mavlink:1", "mavlink:1@2", "mavlink:2", "icao:4840d6")
    heard = left(Mute("gps", 1, 0, 9), 5, *(gps(name) for name in names))
    assert heard is not None
    assert [one.aircraft for one in heard.observations if isinstance(one, GpsReport)] == ["mavlink:2", "icao:4840d6"]


def test_without_a_number_all_positions_are_muted_and_only_positions() -> None:
    heard = left(Mute("gps", None, 0, 9), 5, gps("mavlink:1"), ATTITUDE, gps("icao:4840d6"), plot(1))
    assert heard is not None
    assert heard.observations == (ATTITUDE, plot(1))


def test_a_radars_number_reaches_only_that_radar() -> None:
    heard = left(Mute("radar", 2, 0, 9), 5, plot(1), plot(2), gps("mavlink:2"))
    assert heard is not None
    assert heard.observations == (plot(1), gps("mavlink:2"))


def test_what_there_is_to_say_is_said_although_all_was_muted() -> None:
    note = ("warning", "something")
    assert left(Mute("radar", None, 0, 9), 5, plot(1)) is None
    heard = left(Mute("radar", None, 0, 9), 5, plot(1), notes=(note,))
    assert heard is not None
    assert heard.notes == (note,)
    assert not heard.observations
