"""Track: plots of one radar number become radar tracks, and a number that is used again becomes another."""

from typing import Any

from gateway.track import RadarTracks, name_of, table


def _fed(plots: list[Any]) -> tuple[RadarTracks, list[tuple[int, int, int]]]:
    tracks, keys = RadarTracks(), []
    for plot in plots:
        tracks, key = tracks.after(plot)
        keys.append(key)
    return tracks, keys


def test_plots_of_one_number_are_one_track_in_order_of_time(world: Any) -> None:
    """However they arrive, a track's plots stand in order of validity."""
    course = world.Course()
    plots = [world.plot(course, t, serial=i) for i, t in enumerate((1.0, 1.4, 0.6, 2.2, 1.8, 0.2))]
    tracks, keys = _fed(plots)
    assert set(keys) == {(1, 3, 0)}
    assert [plot.at for plot in tracks.plots[1, 3, 0]] == sorted(plot.at for plot in plots)


def test_plots_of_one_instant_stand_in_order_of_arrival(world: Any) -> None:
    """Two plots of one number and time keep the order in which they came."""
    course = world.Course()
    tracks, _ = _fed([world.plot(course, 1.0, serial=s) for s in (5, 6)] + [world.plot(course, 0.6, serial=7)])
    assert [plot.serial for plot in tracks.plots[1, 3, 0]] == [7, 5, 6]


def test_numbers_and_radars_do_not_mix(world: Any) -> None:
    """Each radar's each number is a track of its own."""
    there, course = world.two_radars, world.Course()
    plots = [there.plot(course, 1.0, radar=radar, number=number) for radar in (1, 2) for number in (3, 4)]
    tracks, _ = _fed(plots)
    assert sorted(tracks.plots) == [(1, 3, 0), (1, 4, 0), (2, 3, 0), (2, 4, 0)]
    assert table(tracks, 2).active == ("1/3", "1/4", "2/3", "2/4")
    assert table(tracks, 2).untracked == 2


def test_a_number_used_for_another_aircraft_begins_a_new_track(world: Any) -> None:
    """A plot where the aircraft cannot have flown to begins a new episode: in range, in azimuth, without range too."""
    course, away = world.Course(), world.Course(left_m=4000.0)
    first = [world.plot(course, 0.4 * k) for k in range(5)]
    for missing in ("", "e", "re"):
        tracks, keys = _fed([*first, world.plot(away, 2.4, missing=missing), world.plot(away, 2.8)])
        assert keys == [(1, 3, 0)] * 5 + [(1, 3, 1)] * 2
        assert name_of(keys[-1]) == "1/3"
        assert len(tracks.plots[1, 3, 0]) == 5


def test_an_aircraft_that_flies_on_keeps_its_track(world: Any) -> None:
    """Noise of several sigmas, missing components and a gap of 9 s do not split a track."""
    course = world.Course(speed_mps=250.0, swing_m=1500.0)
    times = [0.4 * k for k in range(20)] + [16.6, 17.0]
    plots = [
        world.plot(course, t, off=((-1) ** k * 60.0, 4e-3, -4e-3), missing="rae"[k % 3]) for k, t in enumerate(times)
    ]
    _, keys = _fed(plots)
    assert set(keys) == {(1, 3, 0)}


def test_a_long_silence_begins_a_new_track(world: Any) -> None:
    """After more than 10 s without plots the number is another track, even in the same place."""
    course = world.Course()
    _, keys = _fed([world.plot(course, t) for t in (0.0, 0.4, 10.3, 20.5, 20.9)])
    assert keys == [(1, 3, 0), (1, 3, 0), (1, 3, 0), (1, 3, 1), (1, 3, 1)]


def test_late_plots_go_to_the_target_that_they_are_of(world: Any) -> None:
    """After a number was used again, a late plot of the old target goes to the old track and of the new to the new."""
    course, away = world.Course(), world.Course(left_m=4000.0)
    old = [world.plot(course, 0.4 * k) for k in range(5)]
    new = [world.plot(away, 3.2 + 0.4 * k) for k in range(3)]
    tracks, keys = _fed([*old, *new, world.plot(course, 1.0), world.plot(course, 2.0), world.plot(away, 2.8)])
    assert keys[-3:] == [(1, 3, 0), (1, 3, 0), (1, 3, 1)]
    for plots in tracks.plots.values():
        assert [plot.at for plot in plots] == sorted(plot.at for plot in plots)


def test_after_a_silence_late_plots_go_to_the_new_track(world: Any) -> None:
    """A plot that comes late at the start of a new episode belongs to it, not to the track of long ago."""
    course = world.Course()
    _, keys = _fed([world.plot(course, t) for t in (0.0, 0.4, 13.0, 12.2, 0.8)])
    assert keys == [(1, 3, 0), (1, 3, 0), (1, 3, 1), (1, 3, 1), (1, 3, 0)]


def test_azimuth_that_passes_half_a_turn_is_no_jump(world: Any) -> None:
    """A target that crosses behind the radar stays one track."""
    behind = world.Course(along_m=3300.0, left_m=210.0, speed_mps=0.0, swing_m=0.0)
    past = world.Course(along_m=3300.0, left_m=90.0, speed_mps=0.0, swing_m=0.0)
    plots = [world.plot(behind, 0.0), world.plot(past, 0.4)]
    assert plots[0].polar[1] * plots[1].polar[1] < -9.0  # one near +pi, one near -pi
    _, keys = _fed(plots)
    assert keys == [(1, 3, 0)] * 2


def test_old_plots_are_forgotten_and_empty_tracks_too(world: Any) -> None:
    """Pruning keeps what is not older than the instant; the number's next plots are still told from the old ones."""
    course = world.Course()
    tracks, _ = _fed([world.plot(course, t) for t in (0.0, 0.4, 0.8)])
    assert [plot.at for plot in tracks.pruned(world.at(0.4)).plots[1, 3, 0]] == [world.at(0.4), world.at(0.8)]
    assert tracks.pruned(world.at(0.0)) is tracks
    assert tracks.pruned(world.at(5.0)).plots == {}
