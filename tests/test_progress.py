"""Progress: lines of text without a terminal, from rank 0 only, and nothing if not wanted."""

import io

import pytest
from conftest import COMM, column

import cosserat_fenicsx as cf
from cosserat_fenicsx import progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize("wanted, seen", [(True, True), (False, False), (None, False)])
def test_lines(wanted, seen, capsys):
    _, scene = column()
    cf.solve(scene, [0.5, 1.0], elements=4, progress=wanted)
    text = capsys.readouterr().err
    assert ("determinate, 16 unknowns: load factor" in text) == (seen and COMM.rank == 0)


def test_bar_in_a_terminal(monkeypatch):
    screen = Terminal()
    monkeypatch.setattr(progress.sys, "stderr", screen)
    monkeypatch.setattr(progress, "_PATIENCE", 0.0)
    _, scene = column()
    cf.solve(scene, [0.5, 1.0], elements=4)
    assert ("16 unknowns" in screen.getvalue()) == (COMM.rank == 0)


def test_the_bar_shows_names_as_they_are(monkeypatch):
    """A name such as that of a film is no markup."""
    screen = Terminal()
    monkeypatch.setattr(progress.sys, "stderr", screen)
    with progress.Progress([2.0], True, COMM) as bar:
        bar.start("a [/red] film [bold].gif")
        bar.reached(1.0)
    assert ("a [/red] film [bold].gif" in screen.getvalue()) == (COMM.rank == 0)
