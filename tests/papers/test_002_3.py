"""Paper 002-3: routes under radar threat."""

import math

import numpy as np
import pytest

from sim.planning import modern
from sim.planning import seed as paper
from sim.planning.fixtures import SCENES, fixture
from sim.planning.scenes import APART_M, GOAL_M, START_M, draw_threats
from sim.planning.seed import CORRIDOR
from sim.planning.triples import OBJECTIVES, exact
from sim.studies.routes import errors_m, run, task_of


def test_the_shipped_scenes_are_what_their_seeds_draw_and_threats_are_apart_from_each_other_and_the_ends() -> None:
    for number in SCENES:
        case = fixture(number)
        np.testing.assert_allclose(case.threat_m, draw_threats(number), atol=1e-6)
        places = np.concatenate([case.threat_m, START_M[None], GOAL_M[None]])
        apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
        assert (apart[np.triu_indices(10, 1)] >= APART_M).all()


def test_the_corridor_is_the_printed_one_about_the_straight_way() -> None:
    """|y - 0.942 x - 1.059| <= 5 km; the print rounds its slope and intercept to three digits: 0.1 % of the width."""
    straight = GOAL_M - START_M
    upright_km = CORRIDOR * (straight @ straight) / straight[0] / 1e3
    assert upright_km == pytest.approx(5.0, rel=1e-3)
    assert straight[1] / straight[0] == pytest.approx(0.942, abs=1e-3)


def test_annealing_comes_within_20_m_of_the_exact_optimum_of_all_56_triples() -> None:
    """20 m is the page's; the last steps are 0.2 % of a side, some 20 m, and the best of the last hundreds is kept."""
    found = errors_m(fixture(2), "threat", seed=1)
    assert len(found) == 56
    assert found.max() <= 20.0


def test_the_exact_optima_are_those_of_geometry() -> None:
    """Of an equilateral triangle all three are its centre; with an angle above 120 degrees the least sum of distances is in
    that corner, on the radar, and the clearest point is on the longest side."""
    height = math.sqrt(3.0) / 2.0
    even = np.array([[[0.0, 0.0], [6e3, 0.0], [3e3, 6e3 * height]]])
    flat = np.array([[[0.0, 0.0], [10e3, 0.0], [5e3, 1e3]]])
    for objective in OBJECTIVES:
        np.testing.assert_allclose(exact(even, objective), [[3e3, 2e3 * height]], atol=0.1)
    np.testing.assert_allclose(exact(flat, "literal"), [[5e3, 1e3]], atol=0.1)
    found = exact(flat, "clearance")[0]
    assert found[1] == pytest.approx(0.0, abs=1e-6)
    assert min(np.hypot(*(flat[0] - found).T)) == pytest.approx(
        2600.0, abs=1e-3
    )  # as far from a corner as from the top


def test_routes_start_and_end_exactly_at_the_ends_and_the_paper_s_is_near_the_modern_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """To the bit; 1.15 is the page's, of the best known, which the modern route is within 0.1 % of (the study says). Optima are
    exact here, not annealed: the same within 20 m, and sooner."""
    monkeypatch.setattr(paper, "anneal", lambda found, objective, chance: exact(found, objective))
    task = task_of(fixture(2))
    ours, theirs = modern.plan(task), paper.plan(task, 1)
    for route in (ours, theirs):
        assert np.array_equal(route.curve_m[0], START_M)
        assert np.array_equal(route.curve_m[-1], GOAL_M)
    assert ours.measures.cost_m < theirs.measures.cost_m <= 1.15 * ours.measures.cost_m
    assert ours.measures.clearance_m >= theirs.measures.clearance_m


@pytest.mark.study
def test_over_ten_scenes_the_figures_are_the_pages() -> None:
    """40 % of the literal optima lie on a radar, says the page: the share of triangles with an angle above 120 degrees, drawn
    anew here, so a tenth to either side."""
    figures = run(len(SCENES), 1).figures
    assert figures["fine grid, least"] >= 0.999  # nobody beats the bound by more than the grid's rounding
    assert figures["fine grid, most"] <= 1.014  # and no way past other sides was missed
    assert figures["modern, J most"] <= 1.01
    assert figures["threat, J most"] <= 1.15
    assert figures["modern, as clear as threat"] >= 9
    for objective in OBJECTIVES:
        assert figures[f"{objective}, annealing most"] <= 20.0
    assert figures["literal, J most"] > 5.0  # it draws near to radars
    assert figures["literal, on a radar"] == pytest.approx(40.0, abs=10.0)
