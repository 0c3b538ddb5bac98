"""Where methods fail: every cell of this package holds what it promises, and the map's command works."""

import json
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.serial
sys.path.append(str(Path(__file__).parent.parent / "demos"))

from trials import catalogue, cells, chains, methods, own, secant
from trials.rotation_vector import RotationVector

#: What is not right, by trial and method: verdicts that are allowed. A jump may end anywhere, if it is said.
_SAID = {cells.SAID, cells.STOPPED}
_JUMPS = {(trial, method.key): _SAID for trial in ("jump_1.1", "jump_1.5", "jump_4") for method in own.OWN[1:]}
ALLOWED = {
    **_JUMPS,
    **{("flutter", method.key): {cells.SAID} for method in own.OWN if method.key != "determinate"},
    **{("limit", key): {cells.STOPPED} for key in ("planar", "mixed", "displacement")},
    **{(trial, key): {cells.STOPPED} for trial in ("inextensible", "lu") for key in ("displacement", "multiplier")},
    ("locking", "multiplier"): {cells.SAID},
    ("slender", "multiplier"): {cells.STOPPED},
    **{(trial, "determinate"): {cells.NOT} for trial in ("limit", "quadrature", "flutter")},
    ("through", "planar"): {cells.NOT},
    ("quadrature", "default"): {cells.NOT},
    **{(trial, "multiplier"): {cells.NOT} for trial in ("limit", "objectivity")},
}


@pytest.mark.parametrize("method", own.OWN, ids=lambda method: method.key)
@pytest.mark.parametrize(
    "trial",
    [pytest.param(t, id=t.key, marks=[pytest.mark.slow] if t.key == "ten" else []) for t in catalogue.QUICK],
)
def test_own_cell(trial, method):
    cell = methods.cell(trial, method)
    assert cell.verdict in ALLOWED.get((trial.key, method.key), {cells.RIGHT}), cell
    if method.default:
        assert cell.verdict != cells.SILENT, cell
    if cell.verdict == cells.STOPPED:
        assert cell.note
    if trial.key == "limit" and cell.verdict != cells.NOT:
        assert cell.value == pytest.approx(1.0, abs=1e-3)


def test_what_is_written_for_comparison_fails_as_it_is_known_to():
    """Rotation vectors, truncated rotations, bare loops: if these became right, the map would say nothing."""
    vector, (beam, mcre), bare = RotationVector(), chains.CHAINS, methods.BY_KEY["bare"]
    of = catalogue.BY_KEY
    path = methods.cell(of["order"], vector)
    assert path.verdict == cells.SILENT and 1e-5 < path.value < 1e-3
    assert methods.cell(of["truncated"], mcre).verdict == cells.SILENT
    assert methods.cell(of["truncated"], beam).verdict == cells.RIGHT
    assert methods.cell(of["truncated"], secant.Secant()).verdict == cells.RIGHT
    assert methods.cell(of["pole"], secant.Secant()).number == "inf"
    for trial, verdict in (("residual", cells.SILENT), ("line_search", cells.STOPPED), ("clamp", cells.SILENT),
                           ("lu", cells.STOPPED), ("quadrature", cells.SILENT), ("jump_1.5", cells.SILENT)):  # fmt: skip
        assert methods.cell(of[trial], bare).verdict == verdict, trial


def test_the_command_is_broken_off_and_goes_on(tmp_path, monkeypatch, capsys):
    """The quick map of a few methods; programs that are not installed are cells that say so."""
    import failures

    few = [methods.BY_KEY[key] for key in ("determinate", "rotation_vector", "secant")]
    monkeypatch.setattr(methods, "METHODS", few)
    whole, asked = methods.cell, []

    def broken(trial, method):
        if len(asked) == 30:
            raise KeyboardInterrupt
        asked.append(trial.key)
        return whole(trial, method)

    monkeypatch.setattr(methods, "cell", broken)
    with pytest.raises(KeyboardInterrupt):
        failures.main(tmp_path, quick=True)
    half = json.loads((tmp_path / "failures_quick.json").read_text(encoding="utf-8"))
    assert len(half["cells"]) == 30 and not half["complete"]

    monkeypatch.setattr(methods, "cell", whole)
    data = failures.main(tmp_path, quick=True)
    assert "30 cells kept" in capsys.readouterr().err
    assert data["complete"] and len(data["cells"]) == len(few) * len(catalogue.QUICK) and data["machine"]["dolfinx"]
    assert all(data["cells"][key] == cell for key, cell in half["cells"].items())
    table = (tmp_path / "failures_quick.md").read_text(encoding="utf-8")
    assert all(trial.tried in table for trial in catalogue.QUICK) and "silently wrong" in table
    assert (tmp_path / "failures_quick.png").stat().st_size > 50000


def test_a_program_that_is_not_there_says_so(monkeypatch, tmp_path):
    from trials import programs

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for program in programs.PROGRAMS:
        missing = type(program)(
            program.key, {"element": "planar", "elements": 2}, {"element": "spatial", "elements": 2}, 2, ("free",)
        )
        assert methods.cell(catalogue.BY_KEY["truncated"], missing).verdict == cells.MISSING
