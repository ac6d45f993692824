"""Paper 004: the figures of its case, with the study's own code, at fewer runs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gateway.estimators.registration import Method, Pairs, register
from gateway.estimators.registration_frames import SYSTEMS, per_metre
from gateway.geodesy import (
    ECCENTRICITY_2,
    FLATTENING,
    SECOND_ECCENTRICITY_2,
    SEMI_MAJOR_M,
    SEMI_MINOR_M,
    geodetic_to_ecef,
)
from sim.studies import Study
from sim.studies.registration import ALONE, RADAR_ERROR, SMALL_ERROR_M, SOURCE_ERROR, around, run, straight


@pytest.fixture(scope="module")
def study() -> Study:
    return run(runs=150, seed=11)


def test_the_tracks_before_registration_are_as_far_off_as_the_page_has_them() -> None:
    source_m, radar_m = straight(10).remaining_m(None)
    assert float(source_m) == pytest.approx(840.0, abs=1.0)
    assert float(radar_m) == pytest.approx(1047.0, abs=1.0)


def test_as_printed_one_round_leaves_metres_in_ecef_and_hundreds_in_the_other_systems(study: Study) -> None:
    assert max(study.figures["printed ecef source"], study.figures["printed ecef radar"]) <= 12.0
    for system in ("geodetic", "polar"):
        assert study.figures[f"printed {system} radar"] > 500.0


@pytest.mark.parametrize("system", SYSTEMS)
def test_weighted_each_system_converges_in_three_rounds(study: Study, system: str) -> None:
    left = [study.figures[f"whitened {system} {rounds}"] for rounds in (1, 2, 3)]
    assert left[0] <= (12.0 if system == "ecef" else 25.0)
    assert left[1] <= 0.02
    assert left[2] <= 1e-6


@pytest.mark.parametrize("count", [10, 100])
def test_with_noise_no_estimate_is_far_from_the_cramer_rao_bound_in_any_system(study: Study, count: int) -> None:
    printed = {10: (18.0, 0.35, 0.64, 13.4, 13.8, 28.5), 100: (5.8, 0.113, 0.213, 4.1, 4.3, 9.2)}[count]
    names = ("range m", "azimuth mrad", "elevation mrad", "east m", "north m", "height m")
    bound = [study.figures[f"{count} bound {name}"] for name in names]
    assert bound == pytest.approx(printed, rel=0.01)
    for name in names:
        found = [study.figures[f"{count} {system} {name}"] for system in SYSTEMS]
        assert max(found) <= 1.02 * min(found)
        assert max(found) <= 1.15 * study.figures[f"{count} bound {name}"]


def test_a_flight_abeam_tells_everything_and_radial_or_circling_ones_are_flagged(study: Study) -> None:
    assert study.figures["abeam condition"] < 10.0
    assert study.figures["abeam hidden"] == 0
    for name in ("radial", "circle"):
        assert study.figures[f"{name} condition"] > 80.0
        assert study.figures[f"{name} hidden"] >= 2
    assert study.figures["radial source with prior"] <= 26.0
    assert study.figures["radial radar with prior"] <= 36.0


def test_the_chi_square_of_the_prior_is_quiet_where_it_is_right_and_fires_where_the_source_is_637_m_off() -> None:
    case = straight(10)
    right = register(case.measured(100, 3, SMALL_ERROR_M * per_metre(case.geodetic)), Method(robust=False))
    wrong = register(case.measured(100, 3, np.array([1e-4, 0.0, 0.0])), Method(robust=False))
    limit = 16.3  # chi-square of 3 degrees, 99.9 %
    assert (right.prior_chi_square < limit).mean() >= 0.98
    assert (wrong.prior_chi_square > limit).all()
    assert math.hypot(*SOURCE_ERROR[:2] * 6.37e6) > 637.0


def test_wrong_pairs_pull_little() -> None:
    """One pair in ten is of another aircraft, 3 km away."""
    case = straight(100)
    pairs = case.measured(50, 5)
    geodetic = pairs.geodetic.copy()
    geodetic[:, ::10, 0] += 3000.0 * per_metre(case.geodetic)[0]
    mixed = Pairs(pairs.radars, pairs.which, pairs.polar, pairs.polar_sigma, geodetic, pairs.source_sigma_m)
    plain, robust = register(mixed, ALONE), register(mixed, Method(prior_sigma_m=None))
    east_m = [(found.source[:, 0] - SOURCE_ERROR[0]) / per_metre(case.geodetic)[0] for found in (plain, robust)]
    assert abs(east_m[0].mean()) > 200.0
    assert abs(east_m[1].mean()) < 30.0
    assert robust.weight[:, ::10].max() < 0.2
    assert np.median(np.delete(robust.weight, np.s_[::10], axis=1)) == 1.0


def test_a_radars_time_offset_is_found_beside_its_errors_where_flights_cross() -> None:
    """Of flights in one direction, a time offset and an error of the source along them are the same thing."""
    parts = []
    for name, sign in (("abeam", 1.0), ("abeam", -1.0), ("circle", 1.0)):
        case = around(name)
        pairs = case.measured(0, 0, SMALL_ERROR_M * per_metre(case.geodetic))
        place = geodetic_to_ecef(case.geodetic[:, 1], case.geodetic[:, 0], case.geodetic[:, 2])
        turned = np.gradient(np.unwrap(case.polar, axis=0, period=2.0 * math.pi), axis=0)
        turned[:, [0, 2]] = np.gradient(case.polar[:, [0, 2]], axis=0)
        # a point each ten seconds, there or back; the radar's clock is behind by 50 ms: what it says of t was so at t + 0.05
        parts.append((pairs, 0.1 * sign * np.gradient(place, axis=0), pairs.polar + 0.05 * 0.1 * sign * turned))
    first = parts[0][0]
    one_way = Pairs(
        first.radars, first.which, parts[0][2], first.polar_sigma, first.geodetic, first.source_sigma_m, parts[0][1]
    )
    all_ways = Pairs(
        first.radars,
        np.concatenate([pairs.which for pairs, _, _ in parts]),
        np.concatenate([polar for _, _, polar in parts]),
        np.concatenate([pairs.polar_sigma for pairs, _, _ in parts]),
        np.concatenate([pairs.geodetic for pairs, _, _ in parts]),
        np.concatenate([pairs.source_sigma_m for pairs, _, _ in parts]),
        np.concatenate([velocity for _, velocity, _ in parts]),
    )
    method = Method(prior_sigma_m=None, with_time=True, robust=False, rounds=4)
    found = register(all_ways, method)
    assert float(found.time_s[0]) == pytest.approx(0.05, abs=0.002)
    assert found.observable.all()
    assert not register(one_way, method).observable.all()
    assert np.isnan(register(first, ALONE).time_s).all()


def test_two_radars_each_have_their_own_errors() -> None:
    one, other = straight(40), around("abeam", 60)
    first, second = one.measured(0, 0), other.measured(0, 0, SOURCE_ERROR, -RADAR_ERROR)
    both = Pairs(
        np.concatenate([first.radars, second.radars]),
        np.concatenate([first.which, second.which + 1]),
        np.concatenate([first.polar, second.polar]),
        np.concatenate([first.polar_sigma, second.polar_sigma]),
        np.concatenate([first.geodetic, second.geodetic]),
        np.concatenate([first.source_sigma_m, second.source_sigma_m]),
    )
    found = register(both, Method(prior_sigma_m=None, robust=False, rounds=4))
    assert found.radar[0] == pytest.approx(RADAR_ERROR, rel=1e-6)
    assert found.radar[1] == pytest.approx(-RADAR_ERROR, rel=1e-6)
    assert found.source == pytest.approx(SOURCE_ERROR, rel=1e-6)


def test_what_cannot_be_registered_is_said() -> None:
    pairs = straight(10).measured(0, 0)
    with pytest.raises(ValueError, match="two pairs"):
        register(
            Pairs(
                *(
                    getattr(pairs, name)[:1]
                    for name in ("radars", "which", "polar", "polar_sigma", "geodetic", "source_sigma_m")
                )
            )
        )
    with pytest.raises(ValueError, match="velocities"):
        register(pairs, Method(with_time=True))


def test_equation_8_as_printed_is_off_and_is_a_misprint() -> None:
    """Its latitude lacks the second eccentricity: 6e-6 rad, and 59 m of height, for ever."""
    latitude, height = math.radians(33.2), 10_000.0
    x, y, z = geodetic_to_ecef(latitude, 1.7, height).tolist()
    from_axis = math.hypot(x, y)
    reduced = math.atan(z * SEMI_MAJOR_M / (SEMI_MINOR_M * from_axis))

    def of(numerator_2: float) -> tuple[float, float]:
        top = z + SEMI_MINOR_M * numerator_2 * math.sin(reduced) ** 3
        found = math.atan(top / (from_axis - SEMI_MAJOR_M * ECCENTRICITY_2 * math.cos(reduced) ** 3))
        normal = SEMI_MAJOR_M / math.sqrt(1.0 - ECCENTRICITY_2 * math.sin(found) ** 2)
        return found, z / math.sin(found) - normal * (1.0 - ECCENTRICITY_2)

    assert math.isclose(ECCENTRICITY_2, FLATTENING * (2.0 - FLATTENING))
    printed, repaired = of(ECCENTRICITY_2), of(SECOND_ECCENTRICITY_2)
    assert abs(repaired[0] - latitude) < 1e-9
    assert abs(repaired[1] - height) < 1e-2
    assert 3e-6 < abs(printed[0] - latitude) < 1e-5
    assert 30.0 < abs(printed[1] - height) < 90.0


def test_equation_12_as_printed_is_off_and_is_a_misprint() -> None:
    """Its elevation adds the squared range and takes a square root: not even an angle; repaired, it is one of a round Earth."""
    case = straight(10)
    earth_m, at_m, high_m = 6_371_000.0, 50.0, 10_000.0
    distance, elevation = case.polar[0, 0], case.polar[0, 2]
    heights = high_m**2 - at_m**2 + 2.0 * earth_m * (high_m - at_m)
    printed = (heights + distance**2) / math.sqrt(2.0 * distance * (earth_m + at_m))
    repaired = (heights - distance**2) / (2.0 * distance * (earth_m + at_m))
    assert printed > 1.0
    assert math.asin(repaired) == pytest.approx(elevation, abs=2e-3)
