"""The studies: each name leads to a module that runs, and what is drawn can be opened."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from sim.studies import STUDIES, prediction, prediction_honesty
from sim.studies import alpha_beta_gamma_peers as peers
from sim.studies import alpha_beta_gamma_tables as tables
from sim.studies.alpha_beta_gamma import run


@pytest.mark.parametrize("name", STUDIES)
def test_each_name_is_a_module_with_a_run(name: str) -> None:
    """`talkdown study NAME` finds the module of every name that it offers."""
    assert callable(importlib.import_module(f"sim.studies.{name.replace('-', '_')}").run)


def test_the_alpha_beta_gamma_study_fills_its_tables_and_draws(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A small run gives every table rows as wide as its headings, the figures by name, and a recording."""
    monkeypatch.setattr(peers, "TRACKS", (2,))
    monkeypatch.setattr(peers, "ROUNDS", 1)
    monkeypatch.setattr(tables, "TURNS", tables.TURNS[1:2])
    told: list[float] = []
    found = run(2, 1, rrd=tmp_path / "figures.rrd", progress=lambda _, share: told.append(share))
    assert len(found.tables) == 5
    for table in found.tables:
        assert table.rows
        assert {len(row) for row in table.rows} == {len(table.columns)}
    assert found.figures["manoeuvre q 0.001 adaptive"] < found.figures["manoeuvre q 0.001 fixed"]
    assert told == sorted(told)
    assert (tmp_path / "figures.rrd").read_bytes()[:4] == b"RRF2"


def test_the_prediction_study_fills_its_tables_and_draws(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two runs give every table rows as wide as its headings, literal and default among them, and a recording."""
    monkeypatch.setattr(prediction_honesty, "SECONDS", 240)
    found = prediction.run(2, 1, rrd=tmp_path / "figures.rrd")
    assert len(found.tables) == 6
    for table in found.tables:
        assert table.rows
        assert {len(row) for row in table.rows} == {len(table.columns)}
    assert {row[0] for row in found.tables[0].rows} == {"literal", "default"}
    assert (tmp_path / "figures.rrd").read_bytes()[:4] == b"RRF2"
