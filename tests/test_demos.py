"""The demos run, under mpirun too, and give the numbers that they state."""

import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import COMM

DEMOS = Path(__file__).parent.parent / "demos"


@pytest.fixture(autouse=True)
def demos_on_the_path(monkeypatch):
    monkeypatch.setattr(sys, "path", [str(DEMOS), *sys.path])


def test_eccentric_cantilever(tmp_path_all, capsys):
    import eccentric_cantilever

    path, error = eccentric_cantilever.main(tmp_path_all, load_factors=(0.5, 0.9, 1.1))
    assert error < 1e-6 and path.stable.all()
    printed = capsys.readouterr().out
    if COMM.rank == 0:
        assert "2.200615" in printed and "beyond its pole" in printed
        assert all(
            (tmp_path_all / f).stat().st_size > 5000
            for f in ("cantilever.xdmf", "cantilever.h5", "figure.png", "rod.png")
        )
    else:
        assert printed == ""
    COMM.barrier()


@pytest.mark.slow
@pytest.mark.serial
def test_motion_quick(capsys):
    """All seven motions."""
    import motion

    for check, off in motion.main(out=None, quick=True):
        assert off <= check.allowed, check
    printed = capsys.readouterr().out
    assert all(demo.__name__ in printed for demo in motion.DEMOS) and len(motion.DEMOS) == 7


def test_motion(tmp_path_all, capsys):
    """The shortest motion, with its picture, on any number of processes."""
    import motion

    ((check, off),) = motion.main(["released_column"], tmp_path_all, quick=True)
    assert off <= check.allowed, check
    printed = capsys.readouterr().out
    if COMM.rank == 0:
        assert "released_column" in printed
        assert (tmp_path_all / "released_column.png").stat().st_size > 50_000
    else:
        assert printed == ""
    COMM.barrier()


@pytest.mark.serial
def test_overhead_quick(tmp_path):
    """The bare loop and `solve` give the same digits; times are not tested."""
    import overhead

    _, _, difference = overhead.main(runs=1, out=tmp_path)
    assert np.max(difference) < 1e-10


@pytest.mark.slow
@pytest.mark.serial
def test_accuracy_quick(tmp_path):
    import accuracy

    text = accuracy.main(quick=True, out=tmp_path)
    assert "| mixed | P3 | 4.9e-07" in text and "EA = GA = infinity" in text and "eta = 0 to 9" in text


@pytest.mark.serial
def test_rungs_quick(tmp_path):
    """All models valid for a scene give the same tip; cheaper ones have fewer unknowns."""
    import rungs

    scenes = [(rungs.eccentric_cantilever, ((3, 4), None)), (rungs.lee_frame, ((4, 8),)), (rungs.spring, ((4, 24),))]
    for (name, _), rows in rungs.main(runs=1, out=tmp_path, scenes=scenes).items():
        sizes = [row[1] for row in rows]
        assert rows[-1][0] == "spatial" and sizes == sorted(set(sizes)), name
        assert all(error < 2e-6 for _, _, _, _, error, _ in rows), rows


@pytest.mark.slow
@pytest.mark.serial
def test_choice_quick(tmp_path):
    """The automatic choice and the choice by hand are as accurate as requested."""
    import choice

    found = choice.main(runs=1, out=tmp_path, scenes=choice.SCENES[:1], counts=(2, 4, 8))
    (rows, ratio) = found["eccentric_cantilever"]
    (_, model, *_, error, estimate), (_, by_hand, *_, picked, _) = rows
    assert (
        model == "determinate" and by_hand in ("determinate", "planar") and ratio > 0
    )  # the measured time decides which one by hand
    assert error <= estimate <= 1e-6 and picked <= 1e-6


@pytest.mark.slow
@pytest.mark.serial
def test_scaling_quick(tmp_path):
    """The numbers of unknowns; times are not tested."""
    import scaling

    rows = scaling.main(sizes=(4, 16, 64), out=tmp_path)
    assert rows[:, 0].tolist() == [112, 448, 1792] and (rows[:, 1:] > 0).all()


@pytest.mark.slow
@pytest.mark.serial
def test_steps_quick(tmp_path):
    """Models and schemes give the same motion; most steps reuse a tangent. Times are not tested."""
    import steps

    found = steps.main(runs=1, duration=0.2, out=tmp_path)
    tips = [history.position(history.scene.rods[0].start)[-1] for _, _, history in found]
    assert np.ptp(tips, axis=0).max() < 1e-6 and abs(tips[0][0]) > 1e-3
    assert all(iterations < 6 for _, iterations, _ in found)


@pytest.mark.slow
@pytest.mark.serial
def test_orders_quick(tmp_path):
    """Schemes have their orders with joints, damping and driven supports too; meshes 2p."""
    import orders

    temporal, spatial = orders.main(quick=True, out=tmp_path)
    assert len(temporal) == 7
    for (scene, scheme), observed in temporal.items():
        for query, order in observed.items():
            assert order == pytest.approx(orders.SCHEMES[scheme], rel=0.11), (scene, scheme, query)
    for degree, order in spatial.items():
        assert order > 2 * degree - (0.1 if degree < 3 else 1.0), degree
    assert "| 4 | 4, 8 |" in (tmp_path / "orders.md").read_text(encoding="utf-8")
