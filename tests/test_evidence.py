"""What measures accuracy, cost and failures (demos/evidence/) runs, and measures right results."""

import importlib
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


@pytest.fixture(autouse=True)
def one_picture(monkeypatch):
    """Charts are drawn once, and not for wide pages and narrow ones."""
    import harness

    monkeypatch.setattr(harness, "draw_both", lambda plot, file: plot(file=file))


def lies_and_falls(found):
    """What lies on the wall stays there and loses energy, what falls is above it."""
    lies, falls = (history for _, history in found.values())
    on, above = (history.wall_forces(history.scene.loads[0]).normal[1:] for history in (lies, falls))
    balanced = np.abs(lies.balance).max() < 1e-6 * np.abs(lies.work).max()
    return (on > 0).all() and (above == 0).all() and lies.dissipated[-1] > 0 and balanced


def chosen_well(found):
    """The automatic choice and the choice by hand, which depends on the measured times, are as accurate as asked."""
    (rows, ratio) = found["eccentric_cantilever"]
    (_, model, *_, error, estimate), (_, by_hand, *_, picked, _) = rows
    right = model == "determinate" and by_hand in ("determinate", "planar") and ratio > 0
    return right and error <= estimate <= 1e-6 and picked <= 1e-6


def a_million(found):
    measured = min(found[what] for what in ("case", "start", "wall", "seconds", "reading")) > 0
    return measured and found["files"] == 2 and found["stored"] > 200


def covered(found):
    """The errors are within their estimates."""
    ((_, _, row),), sweeps, operations = found
    assert len(operations) == 3 and {model for _, model in operations} == {"rod"}
    within = all(row["covered"]) and max(row["errors"]) < 1e-5 and max(row["estimates"]) <= 1e-4
    return within and len(sweeps) == 1 and sweeps[0][-1] <= 1e-4


#: Scripts on small cases: their arguments, whether they have found what is right, and words of their table. Times are
#: not tested.
QUICK = {
    "overhead": ({"runs": 1}, lambda found: np.max(found[2]) < 1e-10, ()),
    "first_runs": ({"runs": 1, "kinds": ["a column in a plane"]}, lambda found: all(
        files in (4, 5) and first[0] > following[0] > 0 for first, following, files in found.values()), ()),
    "cases": ({"cases": 8, "calls": 2, "runs": 1}, lambda found: all(x < 1e-12 and not left for x, left in found), ()),
    "wall_in_motion": ({"runs": 1, "duration": 0.02, "length": 250.0, "elements": 40}, lies_and_falls, ()),
    "rods_in_wells": ({"quick": True}, covered, (
        "| P | trip in | ", "the models that answered: 3 rod.", "| largest | ")),
    "accuracy": ({"quick": True}, bool, ("| mixed | P3 | 4.9e-07", "EA = GA = infinity", "eta = 0 to 9")),
    "choice": ({"runs": 1, "scenes": 1, "counts": (2, 4, 8)}, chosen_well, ()),
    "many_rods": ({"sizes": (0,)}, lambda found: all(
        rods == 63 and min(times) > 0 and error <= 1e-6 and memory > 50 for rods, *times, error, memory in found),
        ("BLAS: lib", "| ms a rod, of 1000 rods | - | 2.5 | - |")),
    "million_cases": ({"count": 200, "samples": 1}, a_million, (" h |", "| 1000, 2000 |")),
    "ranks": ({"sizes": (16,), "rounds": 1, "ranks": (1, 2)}, lambda found: all(
        unknowns == 448 and list(seconds) == [1, 2] and apart < 1e-9 for unknowns, seconds, apart in found), ()),
}  # fmt: skip
FAST = list(QUICK)[:5]
ONCE, SLOW = pytest.mark.once, pytest.mark.slow


@pytest.mark.parametrize(
    "name", [*FAST[:2], *(pytest.param(x, marks=[ONCE] if x in FAST else [ONCE, SLOW]) for x in [*QUICK][2:])]
)
def test_quick(name, tmp_path, monkeypatch):
    if name == "ranks" and shutil.which("mpirun") is None:
        pytest.skip("needs mpirun")
    given, right, words = QUICK[name]
    script = importlib.import_module(name)
    if name == "first_runs":  # which compiles all anew
        monkeypatch.setenv("COSSERAT_FENICSX_CFLAGS", "-O0")
    if name == "choice":
        given = given | {"scenes": script.SCENES[: given["scenes"]]}
    found = script.main(out=tmp_path, **given)
    assert len(found) and right(found), found
    text = (tmp_path / f"{name}.md").read_text(encoding="utf-8") if words else ""
    assert all(said in text for said in words), text


@pytest.mark.skipif(not shutil.which("gcc"), reason="needs gcc")
def test_sanitizers_find_what_is_read_out_of_bounds(tmp_path, monkeypatch):
    import sanitizers

    (tmp_path / "third.h").write_text("double third(const double *x, int n);\n")
    (tmp_path / "third.c").write_text("double third(const double *x, int n) { return x[n]; }\n")
    test = tmp_path / "test_third.py"
    test.write_text(
        "from pathlib import Path\nimport pytest\nfrom cosserat_fenicsx.algebra.building import module\n"
        "@pytest.mark.parametrize('n', [2, 3])\n"
        f"def test(n):\n    ffi, lib = module(Path({str(tmp_path / 'third.c')!r}))\n"
        "    assert lib.third(ffi.new('double[]', [1.0, 2.0, 3.0]), n) == 3\n"
        f"    Path({str(tmp_path / 'passed')!r}).write_text(f'{{n}}')\n"
    )
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "none"))
    code, said = sanitizers.main([str(test)], tmp_path / "out")
    if code < 0 and "Sanitizer" not in said:
        pytest.skip(f"Python ends by signal {-code} with this compiler's libraries of the sanitizers")
    assert (tmp_path / "passed").read_text() == "2", said
    assert code and "heap-buffer-overflow" in said and "third.c:1 in third" in said


@pytest.mark.once
def test_mutants_quick(monkeypatch):
    """A wrong sign in the direction of a line is found by the tests of curves, and they pass without it."""
    import mutants

    assert mutants.quickly() == ["killed", "survived"]
    monkeypatch.setattr(mutants, "PARTS", {"forms": mutants.PARTS["forms"], "C": mutants.PARTS["C"]})
    chosen = mutants.chosen(mutants.ROOT, 30, seed=0)
    assert chosen == mutants.chosen(mutants.ROOT, 30, seed=0) and {x.part for x in chosen} == {*mutants.PARTS}
    lines = {
        "a/b.py": {"2": ["t::slow", "t::quick"], "9": ["t::other"]},
        "a/c.py": {"1": ["u::c"]},
        "d.py": {"1": ["v"]},
    }
    seconds = {"t::slow": 5.0, "t::quick": 1.0, "t::other": 0.1, "u::c": 0.2, "v": 0.0}
    for file, tests in (("a/b.py", ["t::quick", "t::slow", "t::other"]),
                        ("a/x.c", ["t::other", "u::c", "t::quick", "t::slow"])):  # fmt: skip
        assert mutants.tests_for(mutants.Mutant("C", file, 3, "sign", 0, "", ""), lines, seconds) == tests
    said = "0.25s setup    t::a\n1.00s call     t::a\n2.00s call     t::b[x]\nFAILED t::b[x] - assert 1 - 2\n"
    assert mutants.read_durations(said) == ({"t::a": 1.25, "t::b[x]": 2.0}, {"t::a"})


@pytest.mark.once
def test_rungs_quick(tmp_path):
    """All models valid for a scene give the same tip; cheaper ones have fewer unknowns."""
    import rungs

    scenes = [(rungs.eccentric_cantilever, ((3, 4), None)), (rungs.lee_frame, ((4, 8),)), (rungs.spring, ((4, 24),))]
    for (name, mesh), rows in rungs.main(runs=1, out=tmp_path, scenes=scenes).items():
        sizes = {row[0]: row[1] for row in rows}
        assert mesh or sizes.pop("auto") == min(sizes.values()), name
        assert list(sizes)[-1] == "spatial" and list(sizes.values()) == sorted(set(sizes.values())), name
        assert all(error < 2e-6 for _, _, _, _, error, _ in rows), rows


@pytest.mark.once
@pytest.mark.slow
def test_scaling_quick(tmp_path):
    """The numbers of unknowns, and the rod in plain C: its tip moves as far as that of such a rod. Times are not
    tested."""
    import scaling

    rows = scaling.main(sizes=(4, 16), out=tmp_path, runs=1, of_modes=((4, 0.5),))
    assert rows[:, 0].tolist() == [112, 448] and (rows[:, 1:] > 0).all()
    seconds, moved = scaling.floor(steps=1)
    assert seconds > 0 and moved == pytest.approx(1e-6 * ((1 - 1 / (4 * scaling.FEW**2)) / 3 + 1 / 4e3), rel=1e-9)
    text = (tmp_path / "scaling.md").read_text(encoding="utf-8")
    assert "| planar P1 |" in text and "asked at most" in text and "nan" not in text


@pytest.mark.once
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


@pytest.mark.once
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
        "material": SimpleNamespace(youngs_modulus=1e6, shear_modulus=1e6 / 3, density=1000.0), "friction": 0.0,
        "nodes": lambda n: np.linspace(points[0], points[-1], n + 1),
    } | rod  # fmt: skip
    return SimpleNamespace(
        rods=(SimpleNamespace(**given),), duration=duration, gravity=gravity, obstacles=(), quasi_static=quasi_static,
        self_contact=False, slowest_frequency=lambda: 1.0,
    )  # fmt: skip


@pytest.mark.once
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
    across = np.array([(0, 0, 0), (0.5, 0, 0), (0.5, 0, 0.5)])
    with pytest.raises(NotImplementedError, match="a clamp at the end of a rod across its line at rest"):
        suite.solve(of_the_suite(1.0, centerline=across, end=SimpleNamespace(value="clamped")), 4, 2)


@pytest.mark.once
def test_contact_in_scenarios_of_another_suite():
    """A rod on a slope below and above the friction that the larger coefficient holds; and how rods are bent."""
    import cosseratbench_suite as suite

    floor = SimpleNamespace(kind="plane", point=(0, 0, -0.02), normal=(0, 0, 1), friction=0.1)
    for slope, moves in ((0.25, 0.0), (0.4, 0.1 * 9.81 * (0.2 / 2 - (1 - math.exp(-2 * 0.2)) / 4))):  # v' + 2 v = 0.981
        given = of_the_suite(0.2, True, (9.81 * slope, 0, -9.81), start=SimpleNamespace(value="free"), friction=0.3)
        given.obstacles = (floor,)
        _, (nodes,), _ = suite.solve(given, 2, 21)
        assert nodes[-1, 0, 0] == pytest.approx(moves, abs=3e-4) and abs(nodes[-1, :, 2]).max() < 2e-3
    helix = np.stack([f(np.linspace(0, 9, 40)) for f in (np.cos, np.sin, lambda x: 0.2 * x)], axis=1)
    first, turns = suite._turns(helix, np.array([(1.0, 0, 0), (1.0, 1.0, 0)]))
    assert suite._bent(first, turns, 1.0) == pytest.approx(helix, abs=1e-12)
    assert np.ptp(suite._bent(first, turns, 0.0)[:, [0, 2]], axis=0) == pytest.approx(0, abs=1e-12)


@pytest.mark.once
def test_tables_and_pictures_are_put_into_the_documentation(tmp_path):
    """And every table has its place there."""
    import put_in_docs
    from PIL import Image

    for name, (page, *pictures) in put_in_docs.PAGES.items():
        text = (EVIDENCE.parents[1] / "docs" / page).read_text(encoding="utf-8")
        assert text.count(f"<!-- {name} -->\n") == text.count(f"<!-- /{name} -->\n") == 1
        assert all(picture in text for picture in pictures)

    out, docs = tmp_path / "out", tmp_path / "docs"
    for folder in (out / "benchmarks", docs / "pictures" / "narrow", docs / "tables", docs / "evidence"):
        folder.mkdir(parents=True)
    image = np.full((300, 400, 3), 255, dtype=np.uint8)
    image[100:200, 150:250] = 0
    for name, picture in (("figure3", image), ("figure3_narrow", image[::-1]), ("benchmarks/bend", image.repeat(8, 1))):
        Image.fromarray(picture).save(out / f"{name}.png")
    for file, text in (
        (docs / "evidence" / "figure3.md", "before\n<!-- figure3 -->\nold\n<!-- /figure3 -->\nafter\n"),
        (docs / "benchmarks.md", "<!-- benchmarks -->\n<!-- /benchmarks -->\n"),
        (out / "figure3.md", "| figure3 |\n"), (out / "failures.md", "| failures |\n"),
        (out / "benchmarks.md", "![bend](benchmarks/bend.png)\n"),
    ):  # fmt: skip
        file.write_text(text, encoding="utf-8")
    put_in_docs.main(["figure3", "failures", "orders", "benchmarks"], out, docs)
    page = (docs / "evidence" / "figure3.md").read_text(encoding="utf-8")
    assert page == "before\n<!-- figure3 -->\n| figure3 |\n<!-- /figure3 -->\nafter\n"
    assert "![bend](pictures/benchmarks/bend.png)" in (docs / "benchmarks.md").read_text(encoding="utf-8")
    assert "# Where methods fail" in (docs / "tables" / "failures.md").read_text(encoding="utf-8")
    for name, size in (("figure3.png", (123, 123)), ("narrow/figure3.png", None), ("benchmarks/bend.png", (600, None))):
        found = Image.open(docs / "pictures" / name).size
        assert all(x in (None, y) for x, y in zip(size or found, found, strict=True)), (name, found)


@pytest.mark.once
def test_strings_beside_other_methods(tmp_path):
    """Errors fall to those of the reference numbers or are those of the methods' orders; peers are not asked."""
    import soft_string
    import work_precision_string as motion

    rows, silent = soft_string.measure(install=False)
    own = [row for row in rows if row[1] == "cosserat_fenicsx"]
    assert len(own) == 12 and all(error <= float(told.split("=")[1]) for _, _, told, error, _ in own)
    assert all(error < 1e-11 for _, _, told, error, _ in own if told == "tol = 1e-12") and len(silent) <= 2
    assert "| cosserat_fenicsx | tol = 1e-12 |" in "\n".join(soft_string.lines(rows, silent))
    found = {row[:2]: row[2] for row in motion.main(out=tmp_path, quick=True)}
    bounds = {motion.WAVES: 2e-4, motion.ELEMENTS: 2e-3, motion.UPWIND: 3e-3}
    assert all(max(off.values()) < bounds[method] for (method, _), off in found.items())
    assert found[motion.UPWIND, 500]["peak"] < found[motion.UPWIND, 250]["peak"] / 2
    assert (tmp_path / "work_precision_string_quick.png").stat().st_size > 20000


@pytest.mark.once
def test_random_strings_quick(tmp_path):
    """A string of 1.9 km with a PI control: nothing is off, with both models, and of the growth of small motions it is
    told that its modes are too close together to be compared."""
    import random_strings

    rows, refused = random_strings.main(quick=True, out=tmp_path)
    assert {what for _, what, _ in rows} >= {"models differ", "resumed differs", "response at low frequency"}
    assert all(ratio <= 1 for _, _, ratio in rows) and len(rows) >= 11
    assert ["modes are too close together" in x for x in refused] == [True]
    assert "| resumed differs | 2 | 0 | 0 |" in (tmp_path / "random_strings.md").read_text(encoding="utf-8")


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
    ("trial", "method"), [pytest.param(t, m, id=f"{t.key}-{m.key}") for t in catalogue.QUICK for m in own.OWN]
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


@pytest.mark.once
def test_a_small_step_alone_is_no_convergence():
    """Without an independent contact force, Newton's method bends a slender rod in one step, which stretches it; the
    next, small step corrects this. What rounding puts out of reach is refused."""
    for slenderness, elements in ((1e3, 64), (1e4, 128), (1e4, 256)):
        problem = problems.column([0.5, 0.9], slenderness)
        rod, scene = problems.scene_of(problem)
        path = cf.solve(scene, problem["load_factors"], model="spatial", formulation="displacement", elements=elements)
        found, truth = path.displacement(rod.end)[:, 1], problems.column_truth(problem)[:, 1]
        assert found == pytest.approx(truth, rel=1e-3) and found[0] == pytest.approx(truth[0], rel=1e-4)
    problem = problems.column([0.5], 1e5)
    with pytest.raises(cf.NotConverged, match="rounding errors alone may amount to .* Ask for the formulation 'mixed'"):
        cf.solve(problems.scene_of(problem)[1], [0.5], model="spatial", formulation="displacement", tol=1e-4)


@pytest.mark.once
def test_a_word_on_stability_is_held_against_becks_column():
    """Verdicts for answers that are right, wrong with a warning, and wrong without one."""

    class Word:
        def __init__(self, stable, said=""):
            self.answer = cells.Answer(np.zeros((5, 3)), said, stable=np.array(stable))

        def solve(self, problem):
            return self.answer

    right, early = ([load < bound for load in (5, 10, 15, 20, 25)] for bound in (20.05, 9.87))
    for word, verdict in (
        (Word(right), cells.RIGHT), (Word(early), cells.SILENT), (Word([True] * 5), cells.SILENT),
        (Word(early, "unstable, may flutter"), cells.SILENT), (Word([True] * 5, "it may flutter"), cells.SAID),
        (Word(early, "such an equilibrium may be stable"), cells.SAID),
    ):  # fmt: skip
        assert catalogue.BY_KEY["flutter"].run(word).verdict == verdict


@pytest.mark.once
@pytest.mark.slow
def test_what_is_written_for_comparison_fails_as_it_is_known_to():
    """Rotation vectors, truncated rotations and bare loops fail as expected, so that the comparison has a meaning."""
    vector, (beam, mcre), bare, other = RotationVector(), chains.CHAINS, methods.BY_KEY["bare"], secant.Secant()
    found = {(trial, method): methods.cell(catalogue.BY_KEY[trial], method) for trial, method in (
        ("order", vector), ("objectivity", vector), ("steps", vector), ("flutter", beam), ("truncated", mcre),
        ("truncated", beam), ("truncated", other), ("pole", other), *((trial, bare) for trial in (
            "residual", "line_search", "clamp", "lu", "quadrature", "jump_1.5")))}  # fmt: skip
    right = {("steps", vector), ("truncated", beam), ("truncated", other)}
    stopped = {("line_search", bare), ("lu", bare)}
    for key, cell in found.items():
        if key[0] != "pole":
            told = cells.RIGHT if key in right else cells.STOPPED if key in stopped else cells.SILENT
            assert cell.verdict == told, key
    assert 1e-5 < found["order", vector].value < 1e-3 and found["pole", other].number == "inf"
    # the error by the number of steps is a hundredth of that by the mesh, and also converges with the mesh
    assert found["steps", vector].value > 1e-6
    assert all("of order 2.0 in the mesh" in found[trial, vector].note for trial in ("order", "steps"))


@pytest.mark.once
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


@pytest.mark.once
@pytest.mark.slow
def test_quick_work_precision(tmp_path, capsys):
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


@pytest.mark.once
@pytest.mark.slow
def test_quick_work_precision_of_motions(tmp_path, capsys):
    """Every scheme is as accurate as its step allows; Exudyn is included if installed."""
    import work_precision_motion
    from peers.environments import OWN

    from cosserat_fenicsx.dynamics.schemes import SCHEMES

    found = work_precision_motion.main(out=tmp_path, quick=True)
    own, theirs = ([row for row in found.rows.values() if (row["peer"] == OWN) == here] for here in (True, False))
    assert {row["configuration"]["scheme"] for row in own} == set(SCHEMES)
    bounds = {"momentum": 2.5e-3, "energy": 1e-2, "triple-jump": 6e-4}
    assert all(row["error"] < bounds.get(row["configuration"]["scheme"], 5e-2) for row in own), own
    assert ("Exudyn" in found.missing) != bool(theirs)
    assert all(row["failed"] or row["error"] < 0.1 for row in theirs), theirs
    assert (tmp_path / "work_precision_motion_quick.png").stat().st_size > 20000
    assert "| Flying spaghetti in space, ends at t = 10 s | cosserat_fenicsx: energy |" in capsys.readouterr().out


@pytest.mark.once
@pytest.mark.slow
def test_broken_off_run_goes_on(tmp_path, monkeypatch):
    """Samples are kept, unless sources have changed; an interruption prints how to continue."""
    import work_precision
    from peers.environments import OWN

    file, sample, left = tmp_path / "work_precision.json", work_precision.sample, iter(range(1))

    def broken(*arguments):
        if next(left, None) is None:
            raise KeyboardInterrupt
        sample(*arguments)

    few = [{"model": "determinate", "formulation": "mixed", "degree": 2, "elements": n} for n in (1, 2)]
    monkeypatch.setattr(work_precision, "waits", lambda *_: [])
    monkeypatch.setattr(work_precision, "STATICS", work_precision.STATICS._replace(configurations=lambda *_: few))
    run = {"out": tmp_path, "peers": (OWN,), "names": ("single",)}
    with monkeypatch.context() as patch, pytest.raises(SystemExit, match="goes on"):
        patch.setattr(work_precision, "sample", broken)
        work_precision.main(**run, wanted=1)
    (first,) = [row["seconds"] for row in json.loads(file.read_text())["samples"] if row["seconds"]]
    rows = work_precision.main(**run, wanted=2).rows.values()
    assert [len(row["seconds"]) for row in rows] == [2, 2] and first[0] in [row["seconds"][0] for row in rows]
    monkeypatch.setattr(work_precision, "fingerprint", lambda peer: "other")
    assert not work_precision.Record(file).rows and not work_precision.Record(file, fresh=True).rows


@pytest.mark.once
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


@pytest.mark.once
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


@pytest.mark.once
def test_what_is_not_installed_is_named(tmp_path, monkeypatch):
    from peers.environments import Missing, command
    from trials import programs

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for peer in ("Exudyn", "OpenSeesPy", "PyElastica", "CalculiX"):
        with pytest.raises(Missing, match=f"{peer} is not installed yet"):
            command(peer, install=False)
    planar, spatial = ({"element": element, "elements": 2} for element in ("planar", "spatial"))
    for program in programs.PROGRAMS:
        missing = type(program)(program.key, planar, spatial, 2, ("free",))
        assert methods.cell(catalogue.BY_KEY["truncated"], missing).verdict == cells.MISSING


@pytest.mark.once
def test_ratios_that_are_asked_for():
    """Of each side the fastest that is accurate enough; by tol it is the true error that counts. The frontier has no
    result that another beats in both."""
    from harness import judged
    from work_precision_chart import frontier
    from work_precision_table import ASKED, called, cheapest, deciding, ratios

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
    rows = [{"error": e, "seconds": [s] * 5} for e, s in ((1e-2, 1), (1e-4, 3), (1e-6, 2), (1e-9, 9))]
    assert cheapest(rows, 1e-3) is rows[2] and cheapest(rows, 1e-8) is rows[3] and cheapest(rows, 1e-10) is None
    assert frontier(rows) == [rows[3], rows[2], rows[0]]


@pytest.mark.once
def test_truths_are_told_with_their_errors(tmp_path):
    import truths

    (row,) = truths.main("lifted_from", tmp_path, "test_obstacles.py")
    assert row[0] == "obstacles" and 0 < row[2] < 1e-6 and row[3] == 1e-5
    assert "| obstacles | rod lifted from a plane, moment at its level end |" in (tmp_path / "truths.md").read_text()
    with pytest.raises(RuntimeError, match="the tests fail"):
        truths.compared("no test has this name", "test_obstacles.py")


def test_targets_that_are_missed_are_told(tmp_path):
    import targets

    given = [target for target in targets.TARGETS if not callable(target.found)]
    missed = targets.main(1, [*given, targets.Target("", "less", lambda runs: 3.0, 2.0, "too few")], tmp_path)
    text = (tmp_path / "targets.md").read_text("utf-8")
    assert "|  | less | 2 | **3.00, missed** | too few |" in text and missed[-1]
    assert f"{len(missed)} targets, {sum(missed)} missed" in text and not all(missed)
    with pytest.raises(LookupError, match="no row has"):
        targets.largest("no such truth")
