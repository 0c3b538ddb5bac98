"""The demos run, under mpirun too, and give the numbers that they state."""

import re
from pathlib import Path

import numpy as np
import pytest
from conftest import COMM
from known_numbers import deviation

import cosserat_fenicsx as cf
from cosserat_fenicsx.cli.main import main

DEMOS = Path(__file__).parent.parent / "demos"


@pytest.mark.ranks
def test_eccentric_cantilever(tmp_path_all, capsys):
    import eccentric_cantilever

    path, error = eccentric_cantilever.main(tmp_path_all, load_factors=(0.5, 0.9, 1.1))
    assert error < 1e-6 and path.stable.all()
    printed = capsys.readouterr().out
    if COMM.rank == 0:
        assert "2.200615" in printed and "beyond its pole" in printed
        # delta at eta = 0.9 with each of the four: on 8 P2 elements to 4e-5
        (row,) = (line for line in printed.splitlines() if "eta = 0.9" in line)
        np.testing.assert_allclose([float(x) for x in re.findall(r"2\.\d{7}", row)], 4 * [2.2006154], rtol=4e-5)
        assert "a multiplier at every node" in printed and "steps of the continuation" in printed
        for name in ("cantilever.xdmf", "cantilever.h5", "figure.png", "rod.png"):
            assert (tmp_path_all / name).stat().st_size > 5000
    else:
        assert printed == ""
    COMM.barrier()


@pytest.mark.ranks
def test_eccentric_cantilever_in_one_way(tmp_path_all):
    """The options of the command line choose the formulation, the degree and the mesh."""
    import eccentric_cantilever

    arguments = ["--formulation", "multiplier", "--degree", "3", "--elements", "4", "-o", str(tmp_path_all)]
    path, error = eccentric_cantilever.main(**eccentric_cantilever.options(arguments), load_factors=(0.5, 1.0))
    assert (path.formulation, path.degree, path.elements, path.model) == ("multiplier", 3, (4,), "spatial")
    assert error < 1e-4
    with pytest.raises(SystemExit):
        eccentric_cantilever.options(["--formulation", "none"])


@pytest.mark.serial
def test_animation_quick(tmp_path):
    import animation

    path = animation.main(tmp_path, quick=True)
    assert (tmp_path / "column.gif").stat().st_size > 20_000
    assert path.load_factors[-1] == animation.FAR and path.error.max() < 1e-6


@pytest.mark.slow
def test_bare_dolfinx():
    """dolfinx and SNES by hand find what the package finds with the same elements."""
    import bare_dolfinx
    import eccentric_cantilever

    by_hand = {round(eta, 3): delta for eta, iterations, delta in bare_dolfinx.main() if iterations < 10}
    rod, scene = eccentric_cantilever.column()
    mesh = {"formulation": "multiplier", "degree": 2, "elements": 8, "model": "spatial"}
    path = cf.solve(scene, [0.5, 0.9, 1.0, 2.0], **mesh)
    delta = path.displacement(rod.end)[:, 0] / rod.length
    np.testing.assert_allclose([by_hand[eta] for eta in path.load_factors], delta, rtol=1e-9)
    assert len((DEMOS / "bare_dolfinx.py").read_text(encoding="utf-8").splitlines()) <= 70


@pytest.mark.slow
@pytest.mark.serial
def test_motion_quick(capsys):
    """The motions that are no problems of demos/benchmarks."""
    import motion

    names = ["right_angle_cantilever", "damped_column", "whirling_shaft", "released_column"]
    for check in motion.main(names, out=None, quick=True):
        assert deviation(check) <= check.allowed, check
    printed = capsys.readouterr().out
    published = {"flying_spaghetti_2d", "flying_spaghetti_3d", "spin_up"}
    assert {demo.__name__ for demo in motion.DEMOS} == {*names, *published}
    assert all(name in printed for name in names)


@pytest.mark.ranks
def test_motion(tmp_path_all, capsys):
    """The shortest motion, with its picture, on any number of processes."""
    import motion

    (check,) = motion.main(["released_column"], tmp_path_all, quick=True)
    assert deviation(check) <= check.allowed, check
    printed = capsys.readouterr().out
    if COMM.rank == 0:
        assert "released_column" in printed
        assert (tmp_path_all / "released_column.png").stat().st_size > 50_000
    else:
        assert printed == ""
    COMM.barrier()


@pytest.mark.slow
@pytest.mark.serial
def test_a_small_heap():
    import heap

    history, checks = heap.six_rods()
    assert all(deviation(check) <= check.allowed for check in checks), checks
    assert np.diff(history.dissipated).min() >= 0


@pytest.mark.slow
@pytest.mark.serial
def test_an_overhand_knot():
    import knot

    path, checks = knot.at_rest()
    assert all(deviation(check) <= check.allowed for check in checks), checks
    assert path.stable.all()


STRINGS = sorted((DEMOS / "strings").glob("*.toml"))


@pytest.mark.serial
@pytest.mark.once
@pytest.mark.pages
def test_the_demos_of_strings_give_their_numbers(capsys):
    import strings

    names = {demo.__name__ for demo in strings.STRINGS} | {"stability_map"}
    assert names == {file.stem for file in STRINGS}
    for check in strings.main(out=None):
        assert deviation(check) <= check.allowed, check
    assert "Drill-strings in motion" in capsys.readouterr().out


@pytest.mark.serial
@pytest.mark.once
@pytest.mark.pages
def test_a_coarse_map_agrees_with_the_linear_theory(capsys):
    import strings_map

    assert all(deviation(check) == 0 for check in strings_map.main(quick=True))
    told = capsys.readouterr().out
    assert "25 simulations of 120 s on 1 rank(s)" in told and "the bit oscillates in 12, a mode grows in 4" in told


@pytest.mark.serial
@pytest.mark.once
def test_the_command_line_explains_strings(capsys):
    for file in STRINGS:
        assert main(["explain", str(file)]) == 0
    told = capsys.readouterr().out
    for words in (
        "String, drill pipe: 3000 m, 261.97 N/m in air, impedance 296.38 N m s/rad in torsion",
        "Model: axial and torsional: the hook moves.",
        "Motion: 36234 steps of 0.003312 s, 305 places along the string.",
        "Drive: 40 rpm, PI(Kp 38000 N m s/rad, Ki 100000 N m/rad), inertia 2900 kg m^2.",
        "Bit: none, the lower end is free.",
        "Asked for: stability at 20 speeds and 20 weights on bit.",
    ):
        assert words in told, words


@pytest.mark.serial
@pytest.mark.once
@pytest.mark.pages
def test_the_command_line_maps_the_stability(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    assert main(["run", str(DEMOS / "strings" / "stability_map.toml"), "--duration", "5", "-o", str(tmp_path)]) == 0
    assert "20 speeds from 40 to 192 rpm" in capsys.readouterr().out
    assert {"stability.csv", "stability.png", "drilling.csv", "map.png"} <= {file.name for file in tmp_path.iterdir()}
