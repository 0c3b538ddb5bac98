"""What measures accuracy and cost (demos/evidence/) runs, and measures right results."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.serial
EVIDENCE = Path(__file__).parent.parent / "demos" / "evidence"


@pytest.fixture(autouse=True)
def evidence_on_the_path(monkeypatch):
    monkeypatch.setattr(sys, "path", [str(EVIDENCE), *sys.path])


def test_overhead_quick(tmp_path):
    """The bare loop and `solve` give the same digits; times are not tested."""
    import overhead

    _, _, difference = overhead.main(runs=1, out=tmp_path)
    assert np.max(difference) < 1e-10


def test_first_runs_quick(tmp_path):
    """Elements (in older releases of dolfinx), forms and two kinds of loads of a column, and the package's own C."""
    import first_runs

    ((first, following, files),) = first_runs.main(runs=1, out=tmp_path, kinds=["a column in a plane"]).values()
    assert files in (4, 5) and first[0] > following[0] > 0


def test_mutants_quick():
    """A wrong sign in the direction of a line is found by the tests of curves, and they pass without it."""
    import mutants

    assert mutants.quick() == ["killed", "survived"]
    chosen = mutants.chosen(mutants.ROOT, 30, seed=0)
    assert chosen == mutants.chosen(mutants.ROOT, 30, seed=0) and {x.part for x in chosen} == {*mutants.PARTS}


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


def test_tables_and_pictures_are_put_into_the_documentation(tmp_path):
    import put_in_docs
    from PIL import Image

    out, docs = tmp_path / "out", tmp_path / "docs"
    for folder in (out, docs / "pictures", docs / "tables"):
        folder.mkdir(parents=True)
    (docs / "accuracy.md").write_text("before\n<!-- figure3 -->\nold\n<!-- /figure3 -->\nafter\n", encoding="utf-8")
    for name in ("figure3", "failures"):
        (out / f"{name}.md").write_text(f"| {name} |\n", encoding="utf-8")
    image = np.full((300, 400, 3), 255, dtype=np.uint8)
    image[100:200, 150:250] = 0
    Image.fromarray(image).save(out / "figure3.png")
    put_in_docs.main(["figure3", "failures", "orders"], out, docs)
    page = (docs / "accuracy.md").read_text(encoding="utf-8")
    assert page == "before\n<!-- figure3 -->\n| figure3 |\n<!-- /figure3 -->\nafter\n"
    assert "# Where methods fail" in (docs / "tables" / "failures.md").read_text(encoding="utf-8")
    assert Image.open(docs / "pictures" / "figure3.png").size == (123, 123)


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
