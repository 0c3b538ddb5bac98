"""What measures accuracy, cost and failures (demos/evidence/) runs, and measures right results."""

import json
import math
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from trials import catalogue, cells, chains, methods, own, problems, secant
from trials.rotation_vector import RotationVector

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
EVIDENCE = Path(__file__).parent.parent / "demos" / "evidence"


def test_overhead_quick(tmp_path):
    """The bare loop and `solve` give the same digits; times are not tested."""
    import overhead

    _, _, difference = overhead.main(runs=1, out=tmp_path)
    assert np.max(difference) < 1e-10


def test_cases_quick(tmp_path):
    """Compiled cases and `solve` give the same digits; times are not tested."""
    import cases

    for difference, left in cases.main(cases=8, calls=2, runs=1, out=tmp_path):
        assert difference < 1e-12 and not left


def test_first_runs_quick(tmp_path):
    """Elements (in older releases of dolfinx), forms and two kinds of loads of a column, and the package's own C."""
    import first_runs

    ((first, following, files),) = first_runs.main(runs=1, out=tmp_path, kinds=["a column in a plane"]).values()
    assert files in (4, 5) and first[0] > following[0] > 0


def test_mutants_quick():
    """A wrong sign in the direction of a line is found by the tests of curves, and they pass without it."""
    import mutants

    assert mutants.quickly() == ["killed", "survived"]
    chosen = mutants.chosen(mutants.ROOT, 30, seed=0)
    assert chosen == mutants.chosen(mutants.ROOT, 30, seed=0) and {x.part for x in chosen} == {*mutants.PARTS}
    lines = {
        "a/b.py": {"2": ["t::slow", "t::quick"], "9": ["t::other"]},
        "a/c.py": {"1": ["u::c"]},
        "d.py": {"1": ["v"]},
    }
    seconds = {"t::slow": 5.0, "t::quick": 1.0, "t::other": 0.1, "u::c": 0.2, "v": 0.0}
    for file, tests in {
        "a/b.py": ["t::quick", "t::slow", "t::other"],
        "a/x.c": ["t::other", "u::c", "t::quick", "t::slow"],
    }.items():
        met = mutants.tests_for(mutants.Mutant("C", file, 3, "sign", 0, "", ""), lines, seconds)
        assert met == tests
    said = "0.25s setup    t::a\n1.00s call     t::a\n2.00s call     t::b[x]\nFAILED t::b[x] - assert 1 - 2\n"
    assert mutants.read_durations(said) == ({"t::a": 1.25, "t::b[x]": 2.0}, {"t::a"})


@pytest.mark.slow
def test_accuracy_quick(tmp_path):
    import accuracy

    text = accuracy.main(quick=True, out=tmp_path)
    assert "| mixed | P3 | 4.9e-07" in text and "EA = GA = infinity" in text and "eta = 0 to 9" in text


def test_rungs_quick(tmp_path):
    """All models valid for a scene give the same tip; cheaper ones have fewer unknowns."""
    import rungs

    scenes = [(rungs.eccentric_cantilever, ((3, 4), None)), (rungs.lee_frame, ((4, 8),)), (rungs.spring, ((4, 24),))]
    for (name, mesh), rows in rungs.main(runs=1, out=tmp_path, scenes=scenes).items():
        sizes = {row[0]: row[1] for row in rows}
        assert mesh or sizes.pop("auto") == min(sizes.values()), name
        assert list(sizes)[-1] == "spatial" and list(sizes.values()) == sorted(set(sizes.values())), name
        assert all(error < 2e-6 for _, _, _, _, error, _ in rows), rows


@pytest.mark.slow
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
def test_many_rods_quick(tmp_path):
    """Rods, times, an estimate below the tolerance, and memory; a table with its verdicts."""
    import many_rods

    ((rods, *times, error, memory),) = many_rods.main(sizes=(0,), out=tmp_path)
    assert rods == 63 and min(times) > 0 and error <= 1e-6 and memory > 50
    text = (tmp_path / "many_rods.md").read_text(encoding="utf-8")
    assert "BLAS: lib" in text and "| ms a rod, of 1000 rods | - | 2.5 | - |" in text


@pytest.mark.slow
def test_million_cases_quick(tmp_path):
    """Every part is measured; on paper, each core of a job array computes, and the sum is that of the cases."""
    import million_cases

    found = million_cases.main(count=200, samples=1, out=tmp_path)
    assert min(found[what] for what in ("case", "start", "wall", "seconds", "reading")) > 0
    assert found["files"] == 2 and found["stored"] > 200
    text = (tmp_path / "million_cases.md").read_text(encoding="utf-8")
    assert f"| {1e6 * found['case'] / 3600:.0f} h |" in text and "| 1000, 2000 |" in text


@pytest.mark.slow
def test_scaling_quick(tmp_path):
    """The numbers of unknowns, and the rod in plain C: its tip moves as far as that of such a rod. Times are not
    tested."""
    import scaling

    rows = scaling.main(sizes=(4, 16), out=tmp_path, runs=1)
    assert rows[:, 0].tolist() == [112, 448] and (rows[:, 1:] > 0).all()
    seconds, moved = scaling.floor(steps=1)
    assert seconds > 0 and moved == pytest.approx(1e-6 * ((1 - 1 / (4 * scaling.FEW**2)) / 3 + 1 / 4e3), rel=1e-9)
    text = (tmp_path / "scaling.md").read_text(encoding="utf-8")
    assert "| planar P1 |" in text and "asked at most" in text and "nan" not in text


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("mpirun") is None, reason="needs mpirun")
def test_ranks_quick(tmp_path):
    """One rank and two find the same; times are not tested."""
    import ranks

    ((unknowns, seconds, apart),) = ranks.main(sizes=(16,), rounds=1, out=tmp_path, ranks=(1, 2))
    assert unknowns == 448 and list(seconds) == [1, 2] and apart < 1e-9


@pytest.mark.slow
def test_steps_quick(tmp_path):
    """Models and schemes give the same motion; most steps reuse a tangent; a hinge lets the rod move farther. Times
    are not tested."""
    import steps

    found, few = steps.main(runs=1, duration=0.2, out=tmp_path)
    clamped, hinged, jointed = (place[1] for _, _, place in few)
    assert 0 < clamped < hinged and clamped < jointed
    tips = [history.position(history.scene.rods[0].start)[-1] for _, _, history in found]
    assert np.ptp(tips, axis=0).max() < 1e-6 and abs(tips[0][0]) > 1e-3
    assert all(iterations < 6 for _, iterations, _ in found)


def test_wall_in_motion_quick(tmp_path):
    """What lies on the wall stays there and loses energy, what falls is above it; times are not tested."""
    import wall_in_motion

    found = wall_in_motion.main(runs=1, duration=0.02, length=250.0, elements=40, out=tmp_path)
    lies, falls = (history for _, history in found.values())
    wall = [history.scene.loads[0] for history in (lies, falls)]
    assert (lies.wall_forces(wall[0]).normal[1:] > 0).all() and (falls.wall_forces(wall[1]).normal[1:] == 0).all()
    assert lies.dissipated[-1] > 0 and np.abs(lies.balance).max() < 1e-6 * np.abs(lies.work).max()


@pytest.mark.slow
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


def of_the_suite(duration, quasi_static=False, gravity=(0, 0, 0), **rod):
    """A scenario as cosseratbench describes it: one rod of 1 m, clamped at its start."""

    def end(value):
        return SimpleNamespace(value=value)

    points = np.array([(0, 0, 0), (0.5, 0, 0), (1.0, 0, 0)])
    given = {
        "centerline": points, "radius": 0.02, "length": 1.0, "normal": (0, 0, 1), "loads": (), "start": end("clamped"),
        "end": end("free"), "start_motion": None, "end_motion": None,
        "material": SimpleNamespace(youngs_modulus=1e6, shear_modulus=1e6 / 3, density=1000.0),
        "nodes": lambda n: np.linspace(points[0], points[-1], n + 1),
    } | rod  # fmt: skip
    return SimpleNamespace(
        rods=(SimpleNamespace(**given),), duration=duration, gravity=gravity, obstacles=(), quasi_static=quasi_static,
        slowest_frequency=lambda: 1.0,
    )  # fmt: skip


def test_scenarios_of_another_suite():
    """An equilibrium, a motion from a given shape, and an end that is driven."""
    import cosseratbench_suite as suite

    force, stiffness = 7.5e-3, 1e6 * math.pi * 0.02**4 / 4
    load = SimpleNamespace(force=(0, 0, -force), at=SimpleNamespace(value="end"))
    times, (nodes,), (d1,) = suite.solve(of_the_suite(10.0, True, loads=(load,)), 8, 3)
    assert times.tolist() == [0, 5, 10] and nodes.shape == (3, 9, 3) and d1.shape == (3, 8, 3)
    assert -nodes[-1, -1, 2] == pytest.approx(force / (3 * stiffness), rel=1e-3) and nodes[0, -1, 2] == 0
    s = np.linspace(0, 1, 9)
    bent = np.stack([s, 1e-4 * s**2, 0 * s], axis=1)
    times, (nodes,), (d1,) = suite.solve(of_the_suite(0.02, nodes=lambda n: bent), 8, 3)
    np.testing.assert_allclose(nodes[0], bent, atol=1e-9)
    assert 0 < nodes[-1, -1, 1] < 0.999e-4 and np.abs(np.sum(d1 * np.diff(nodes, axis=1), axis=2)).max() < 1e-12
    turn = SimpleNamespace(times=(0.0, 0.1), displacement=np.zeros((2, 3)), rotation=((0, 0, 0), (0.5, 0, 0)),
                           slides_along=(1, 0, 0), axis=np.array([1.0, 0, 0]))  # fmt: skip
    driven = of_the_suite(0.2, True, end=SimpleNamespace(value="clamped"), end_motion=turn)
    _, _, (d1,) = suite.solve(driven, 4, 3)
    assert math.atan2(d1[-1, -1, 1], d1[-1, -1, 2]) == pytest.approx(-0.5 * 7 / 8, abs=0.05)
    across = of_the_suite(1.0, centerline=np.array([(0, 0, 0), (0, 0, 0.5), (1.0, 0, 0)]))
    with pytest.raises(NotImplementedError, match="a clamp at the start of a rod across the line between its ends"):
        suite.solve(across, 4, 2)


def test_tables_and_pictures_are_put_into_the_documentation(tmp_path):
    import put_in_docs
    from PIL import Image

    out, docs = tmp_path / "out", tmp_path / "docs"
    for folder in (out, docs / "pictures" / "narrow", docs / "tables", docs / "evidence"):
        folder.mkdir(parents=True)
    (docs / "evidence" / "figure3.md").write_text(
        "before\n<!-- figure3 -->\nold\n<!-- /figure3 -->\nafter\n", encoding="utf-8"
    )
    for name in ("figure3", "failures"):
        (out / f"{name}.md").write_text(f"| {name} |\n", encoding="utf-8")
    image = np.full((300, 400, 3), 255, dtype=np.uint8)
    image[100:200, 150:250] = 0
    Image.fromarray(image).save(out / "figure3.png")
    Image.fromarray(image[::-1]).save(out / "figure3_narrow.png")
    (out / "benchmarks").mkdir()
    Image.fromarray(image.repeat(8, axis=1)).save(out / "benchmarks" / "bend.png")
    (docs / "benchmarks.md").write_text("<!-- benchmarks -->\n<!-- /benchmarks -->\n", encoding="utf-8")
    (out / "benchmarks.md").write_text("![bend](benchmarks/bend.png)\n", encoding="utf-8")
    put_in_docs.main(["figure3", "failures", "orders", "benchmarks"], out, docs)
    assert "![bend](pictures/benchmarks/bend.png)" in (docs / "benchmarks.md").read_text(encoding="utf-8")
    assert Image.open(docs / "pictures" / "benchmarks" / "bend.png").width == 600
    page = (docs / "evidence" / "figure3.md").read_text(encoding="utf-8")
    assert page == "before\n<!-- figure3 -->\n| figure3 |\n<!-- /figure3 -->\nafter\n"
    assert "# Where methods fail" in (docs / "tables" / "failures.md").read_text(encoding="utf-8")
    assert Image.open(docs / "pictures" / "figure3.png").size == (123, 123)
    assert (docs / "pictures" / "narrow" / "figure3.png").exists()


def test_every_table_has_its_place_in_the_documentation():
    import put_in_docs

    for name, (page, *pictures) in put_in_docs.PAGES.items():
        assert text_in(page).count(f"<!-- {name} -->\n") == text_in(page).count(f"<!-- /{name} -->\n") == 1
        assert all(picture in text_in(page) for picture in pictures)


def text_in(page):
    return (EVIDENCE.parents[1] / "docs" / page).read_text(encoding="utf-8")


def test_soft_strings_of_this_package():
    """Peers are not asked; errors fall to those of the reference numbers, times are not tested."""
    import soft_string

    rows, silent = soft_string.measure(install=False)
    own = [row for row in rows if row[1] == "cosserat_fenicsx"]
    assert len(own) == 12 and all(error <= float(told.split("=")[1]) for _, _, told, error, _ in own)
    assert all(error < 1e-11 for _, _, told, error, _ in own if told == "tol = 1e-12") and len(silent) <= 2
    assert "| cosserat_fenicsx | tol = 1e-12 |" in "\n".join(soft_string.lines(rows, silent))


def test_stick_slip_of_waves_elements_and_upwind(tmp_path):
    """Errors are those of the methods' orders; times are not tested."""
    import work_precision_string

    found = {row[:2]: row[2] for row in work_precision_string.main(out=tmp_path, quick=True)}
    bounds = {
        work_precision_string.WAVES: 2e-4,
        work_precision_string.ELEMENTS: 2e-3,
        work_precision_string.UPWIND: 3e-3,
    }
    assert all(max(off.values()) < bounds[method] for (method, _), off in found.items())
    assert found[work_precision_string.UPWIND, 500]["peak"] < found[work_precision_string.UPWIND, 250]["peak"] / 2
    assert (tmp_path / "work_precision_string_quick.png").stat().st_size > 20000


def test_rods_in_wells_quick(tmp_path):
    """Errors are within their estimates; steps and times are not tested."""
    import rods_in_wells

    rows, sweeps = rods_in_wells.main(quick=True, out=tmp_path)
    ((_, _, found),) = rows
    assert all(found["covered"]) and max(found["errors"]) < 1e-5 and max(found["estimates"]) <= 1e-4
    assert len(sweeps) == 1 and sweeps[0][-1] <= 1e-4
    assert "| P | trip in | " in (tmp_path / "rods_in_wells.md").read_text(encoding="utf-8")


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
@pytest.mark.parametrize(
    ("trial", "method"),
    [pytest.param(t, m, id=f"{t.key}-{m.key}") for t in (*catalogue.QUICK, catalogue.BY_KEY["roll"]) for m in own.OWN
     if t.key != "roll" or m.default],
)  # fmt: skip
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
    monkeypatch.setattr(catalogue, "QUICK", catalogue.QUICK[:6])
    whole, asked = methods.cell, []

    def broken(trial, method):
        if len(asked) == 10:
            raise KeyboardInterrupt
        asked.append(trial.key)
        return whole(trial, method)

    monkeypatch.setattr(methods, "cell", broken)
    with pytest.raises(KeyboardInterrupt):
        failures.main(tmp_path, quick=True)
    half = json.loads((tmp_path / "failures_quick.json").read_text(encoding="utf-8"))
    assert len(half["cells"]) == 10 and not half["complete"]

    monkeypatch.setattr(methods, "cell", whole)
    data = failures.main(tmp_path, quick=True)
    assert "10 cells kept" in capsys.readouterr().err
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


@pytest.mark.slow
def test_quick(tmp_path, capsys):
    """This package's results are as accurate as their degree allows; every peer gives a result or a reason why not."""
    import work_precision
    from peers.configurations import PEERS
    from peers.environments import OWN

    found = work_precision.main(out=tmp_path, quick=True)
    told = json.loads((tmp_path / "work_precision_quick.json").read_text())
    assert {"date", "cpu", "cores", "platform"} <= told["about"]["machine"].keys() and told["about"]["seed"] == 2026
    rows = told["samples"]
    own = [row for row in rows if row["peer"] == OWN]
    assert {row["configuration"]["model"] for row in own} == {"determinate", "planar", "spatial"}
    for row in own:
        bound = {(2, 4): 1e-3, (4, 4): 1e-8, (4, 16): 1e-12}
        configuration = row["configuration"]
        assert row["error"] < bound[configuration["degree"], configuration["elements"]], row
        assert len(row["seconds"]) == 2 and min(row["seconds"]) > 0
    for peer in set(PEERS) - {OWN}:
        answers = [row for row in rows if row["peer"] == peer]
        assert peer in found.missing or answers
        assert all(row["failed"] or (row["seconds"] and row["error"] < 0.1) for row in answers), peer
    printed = capsys.readouterr().out
    assert "forced to spatial against the fastest planar peer" in printed
    assert all(f"{peer} is missing" in printed for peer in found.missing)
    for name in ("sweep", "sweep_spatial", "bend"):
        assert (tmp_path / f"work_precision_quick_{name}.png").stat().st_size > 20000


@pytest.mark.slow
def test_quick_motion(tmp_path, capsys):
    """Every scheme is as accurate as its step allows; Exudyn is included if installed."""
    import work_precision_motion
    from peers.environments import OWN

    from cosserat_fenicsx.dynamics.schemes import SCHEMES

    found = work_precision_motion.main(out=tmp_path, quick=True)
    rows = list(found.rows.values())
    own = [row for row in rows if row["peer"] == OWN]
    assert {row["configuration"]["scheme"] for row in own} == set(SCHEMES)
    bounds = {"momentum": 2.5e-3, "energy": 1e-2, "triple-jump": 6e-4}
    assert all(row["error"] < bounds.get(row["configuration"]["scheme"], 5e-2) for row in own), own
    theirs = [row for row in rows if row["peer"] != OWN]
    assert ("Exudyn" in found.missing) != bool(theirs)
    assert all(row["failed"] or row["error"] < 0.1 for row in theirs), theirs
    assert (tmp_path / "work_precision_motion_quick.png").stat().st_size > 20000
    assert "| Flying spaghetti in space, ends at t = 10 s | cosserat_fenicsx: energy |" in capsys.readouterr().out


@pytest.mark.slow
def test_broken_off_run_goes_on(tmp_path, monkeypatch):
    """Samples are kept, unless sources have changed; an interruption prints how to continue."""
    import work_precision
    from peers.environments import OWN

    file = tmp_path / "work_precision.json"
    monkeypatch.setattr(work_precision, "waits", lambda *_: [])
    few = [{"model": "determinate", "formulation": "mixed", "degree": 2, "elements": n} for n in (1, 2)]
    panel = work_precision.STATICS._replace(configurations=lambda *_: few)
    monkeypatch.setattr(work_precision, "STATICS", panel)
    run = {"out": tmp_path, "peers": (OWN,), "names": ("single",)}

    with monkeypatch.context() as patch:
        patch.setattr(work_precision, "sample", _after(1, work_precision.sample))
        with pytest.raises(SystemExit, match="goes on"):
            work_precision.main(**run, wanted=1)
    (first,) = [row["seconds"] for row in json.loads(file.read_text())["samples"] if row["seconds"]]
    rows = work_precision.main(**run, wanted=2).rows.values()
    assert [len(row["seconds"]) for row in rows] == [2, 2] and first[0] in [row["seconds"][0] for row in rows]
    monkeypatch.setattr(work_precision, "fingerprint", lambda peer: "other")
    assert not work_precision.Record(file).rows
    assert not work_precision.Record(file, fresh=True).rows


def _after(count, sample):
    left = iter(range(count))

    def broken(*arguments):
        if next(left, None) is None:
            raise KeyboardInterrupt
        sample(*arguments)

    return broken


def test_truths_belong_to_their_models():
    """References for the 45-degree bend and the paper's column, with and without shear."""
    from peers import problems

    rest = 100 * np.array([np.sin(np.pi / 4), 1 - np.cos(np.pi / 4), 0])
    tip = problems.truth("bend", "Reissner")[0] + rest
    np.testing.assert_allclose(tip, (47.15043857, 15.68480053, 53.47485879), atol=2e-8)
    rigid = problems.truth("bend", "shear-rigid")[0] + rest
    assert 1e-3 < np.linalg.norm(rigid - tip) < 1e-2
    assert problems.truth("single", "Reissner")[0, 1] == pytest.approx(2.200615447828, abs=1e-9)
    assert problems.error("bend", "Reissner", problems.truth("bend", "Reissner")) == 0


def test_a_peer_that_hangs_or_dies_is_reported():
    from peers.process import Peer

    script = "import sys, time, json\nfor line in sys.stdin:\n    c = json.loads(line)['configuration']\n"
    script += "    time.sleep(c['sleep'])\n    sys.exit(3) if c['die'] else print('{\"seconds\": [1.0]}', flush=True)"
    with Peer("cosserat_fenicsx") as peer:
        peer.words = [sys.executable, "-c", script]

        def ask(sleep, die):
            return peer.ask({}, {"sleep": sleep, "die": die}, warm=0, samples=1, limit=2.0)

        assert ask(60, False) == {"failed": "time limit of 2 s"}
        assert ask(0, False) == {"seconds": [1.0]}
        assert ask(0, True) == {"failed": "the process ended with code 3"}


def test_a_missing_peer_is_named(tmp_path, monkeypatch):
    from peers.environments import Missing, command

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for peer in ("Exudyn", "OpenSeesPy", "PyElastica", "CalculiX"):
        with pytest.raises(Missing, match=f"{peer} is not installed yet"):
            command(peer, install=False)


def test_time_at_an_accuracy():
    """The cheapest result that is accurate enough is taken; the frontier has no result that another beats in both."""
    from work_precision_chart import frontier
    from work_precision_table import cheapest

    rows = [
        {"error": error, "seconds": [seconds] * 5} for error, seconds in ((1e-2, 1), (1e-4, 3), (1e-6, 2), (1e-9, 9))
    ]
    assert cheapest(rows, 1e-3) is rows[2] and cheapest(rows, 1e-8) is rows[3] and cheapest(rows, 1e-10) is None
    assert frontier(rows) == [rows[3], rows[2], rows[0]]


def test_ratios_that_are_asked_for():
    """Of each side the fastest that is accurate enough; by tol it is the true error that counts."""
    from harness import judged
    from work_precision_table import ASKED, called, deciding, ratios

    def row(peer, kind, seconds, error, **configuration):
        return {
            "problem": "sweep", "peer": peer, "kind": kind, "spatial": "spatial" in kind, "seconds": [seconds],
            "error": error, "configuration": configuration,
        }  # fmt: skip

    rows = [
        row("cosserat_fenicsx", "auto, by tol", 1.0, 1e-6, model="auto", tol=1e-2),
        row("cosserat_fenicsx", "auto, by tol", 3.0, 1e-9, model="auto", tol=1e-6),
        row("cosserat_fenicsx", "spatial, mixed", 2.0, 1e-9, model="spatial", degree=4, elements=2),
        row("Exudyn", "planar 3-node", 4.0, 1e-8, elements=8),
        row("Exudyn", "planar 3-node", 4.5, 1e-8, elements=9),
        row("OpenSeesPy", "spatial CBDI", 20.0, 1e-8, elements=8),
    ]
    found = {(words, accuracy): ratio for words, accuracy, _, _, ratio, _ in ratios(rows)}
    plane, space, both, automatic = (words for words, *_ in ASKED)
    assert found[plane, 1e-5] == 1 / 4 and found[plane, 1e-7] == 2 / 4 and found[space, 1e-7] == 2 / 20
    assert found[both, 1e-3] == 2 / 4 and found[automatic, 1e-5] == 1 / 4 and found[automatic, 1e-7] == 3 / 4
    assert deciding(rows) == [rows[i] for i in (0, 3, 4, 2, 5, 1)]
    assert called(rows[0]) == "auto, tol 1e-02" and judged(None, 0.5) == "- | 1/2 | -"
    assert judged(1 / 4, 1 / 5) == "1/4 | 1/5 | missed" and judged(0.4, 0.5, ".2f") == "0.40 | 0.5 | met"


def test_truths_are_told_with_their_errors(tmp_path):
    import truths

    (row,) = truths.main("lifted_from", tmp_path)
    assert row[0] == "obstacles" and 0 < row[2] < 1e-6 and row[3] == 1e-5
    assert "| obstacles | rod lifted from a plane, moment at its level end |" in (tmp_path / "truths.md").read_text()
    with pytest.raises(RuntimeError, match="the tests fail"):
        truths.compared("no test has this name")
