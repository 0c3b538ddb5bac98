"""The demos run, under mpirun too, and give the numbers that they state."""

import sys
from pathlib import Path

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
