"""The comparison of methods (demos/evidence/failures.py): this package's results are right, and the command works."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
sys.path.append(str(Path(__file__).parent.parent / "demos" / "evidence"))

from trials import catalogue, cells, chains, methods, own, problems, secant
from trials.rotation_vector import RotationVector

#: Verdicts other than "right" that are allowed, by trial and method. One large step may end anywhere, with a warning.
_SAID = {cells.SAID, cells.STOPPED}
_JUMPS = {(trial, method.key): _SAID for trial in ("jump_1.1", "jump_1.5", "jump_4") for method in own.OWN[1:]}
ALLOWED = {
    **_JUMPS,
    **{("flutter", method.key): {cells.SAID} for method in own.OWN if method.key != "determinate"},
    **{("limit", key): {cells.STOPPED} for key in ("planar", "mixed", "displacement", "multiplier")},
    **{(trial, "displacement"): {cells.STOPPED} for trial in ("inextensible", "lu", "slender")},
    ("line_search", "default"): {cells.NOT},
    **{(trial, "determinate"): {cells.NOT} for trial in ("limit", "quadrature", "flutter")},
    ("through", "planar"): {cells.NOT},
    ("quadrature", "default"): {cells.NOT},
}


@pytest.mark.slow
@pytest.mark.parametrize("method", own.OWN, ids=lambda method: method.key)
@pytest.mark.parametrize(
    "trial",
    [pytest.param(t, id=t.key) for t in (*catalogue.QUICK, catalogue.BY_KEY["roll"])],
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


@pytest.mark.parametrize(("slenderness", "elements"), [(1e3, 64), (1e4, 128), (1e4, 256)])
def test_a_small_step_alone_is_no_convergence(slenderness, elements):
    """Without an independent contact force, Newton's method bends a slender rod in
    one step, which stretches it; the next, small step corrects this."""
    problem = problems.column([0.5, 0.9], slenderness)
    rod, scene = problems.scene_of(problem)
    path = cf.solve(scene, problem["load_factors"], model="spatial", formulation="displacement", elements=elements)
    assert path.displacement(rod.end)[:, 1] == pytest.approx(problems.column_truth(problem)[:, 1], rel=1e-3)
    assert path.displacement(rod.end)[0, 1] == pytest.approx(problems.column_truth(problem)[0, 1], rel=1e-4)


def test_what_rounding_puts_out_of_reach_is_refused():
    problem = problems.column([0.5], 1e5)
    with pytest.raises(cf.NotConverged, match="rounding errors alone may amount to .* Ask for the formulation 'mixed'"):
        cf.solve(problems.scene_of(problem)[1], [0.5], model="spatial", formulation="displacement", tol=1e-4)


def test_a_word_on_stability_is_held_against_becks_column():
    """Verdicts for answers that are right, wrong with a warning, and wrong without one."""
    loads = (5, 10, 15, 20, 25)

    def verdict(stable, said=""):
        class Word:
            def solve(self, problem):
                return cells.Answer(np.zeros((5, 3)), said, stable=np.array(stable))

        return catalogue.BY_KEY["flutter"].run(Word()).verdict

    assert verdict([load < 20.05 for load in loads]) == cells.RIGHT
    assert verdict([load < 9.87 for load in loads]) == cells.SILENT
    assert verdict([load < 9.87 for load in loads], "unstable, may flutter") == cells.SILENT
    assert verdict([load < 9.87 for load in loads], "such an equilibrium may be stable") == cells.SAID
    assert verdict([True] * 5, "it may flutter") == cells.SAID and verdict([True] * 5) == cells.SILENT


@pytest.mark.slow
def test_what_is_written_for_comparison_fails_as_it_is_known_to():
    """Rotation vectors, truncated rotations and bare loops fail as expected, so that the comparison has a meaning."""
    vector, (beam, mcre), bare = RotationVector(), chains.CHAINS, methods.BY_KEY["bare"]
    of = catalogue.BY_KEY
    path = methods.cell(of["order"], vector)
    assert path.verdict == cells.SILENT and 1e-5 < path.value < 1e-3 and "of order 2.0 in the mesh" in path.note
    assert methods.cell(of["objectivity"], vector).verdict == cells.SILENT
    # the error by the number of steps is a hundredth of that by the mesh, and also converges with the mesh
    steps = methods.cell(of["steps"], vector)
    assert steps.verdict == cells.RIGHT and steps.value > 1e-6 and "of order 2.0 in the mesh" in steps.note
    assert methods.cell(of["flutter"], beam).verdict == cells.SILENT
    assert methods.cell(of["truncated"], mcre).verdict == cells.SILENT
    assert methods.cell(of["truncated"], beam).verdict == cells.RIGHT
    assert methods.cell(of["truncated"], secant.Secant()).verdict == cells.RIGHT
    assert methods.cell(of["pole"], secant.Secant()).number == "inf"
    for trial, verdict in (("residual", cells.SILENT), ("line_search", cells.STOPPED), ("clamp", cells.SILENT),
                           ("lu", cells.STOPPED), ("quadrature", cells.SILENT),
                           ("jump_1.5", cells.SILENT)):  # fmt: skip
        assert methods.cell(of[trial], bare).verdict == verdict, trial


@pytest.mark.slow
def test_the_command_is_broken_off_and_goes_on(tmp_path, monkeypatch, capsys):
    """The quick comparison of a few methods; programs that are not installed are marked as such."""
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
