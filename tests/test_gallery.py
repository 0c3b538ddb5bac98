"""The gallery (demos/gallery.py): every scene gives its number, and the strong form, solved by collocation, agrees."""

from pathlib import Path

import numpy as np
import pytest
from clamped_rod import START, Problem
from scipy.integrate import solve_bvp

pytestmark = [pytest.mark.serial, pytest.mark.once, pytest.mark.pages]
DEMOS = Path(__file__).parent.parent / "demos"


@pytest.fixture(scope="module")
def gallery():
    """The paths and checks by name, each scene solved once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(DEMOS))
        import gallery

        yield {demo.__name__: gallery.run(demo, out=None) for demo in gallery.GALLERY}


def test_every_scene_gives_its_number(gallery):
    assert set(gallery) == {file.stem for file in DEMOS.glob("*.toml")}
    for name, (path, check) in gallery.items():
        assert np.abs(np.subtract(check.found, check.expected)).max() <= check.allowed, (name, check)
        assert path.stable.all() or name == "lees_frame", name


def strong_form(path, line_force=(0, 0, 0)):
    """The path's only rod at its last point by collocation, the path its first guess: it is clamped at its start and
    carries the contact force and moment of its end.

    Returns:
        a function of s (n,): the positions (n, 3), m.
    """
    (rod,) = path.scene.rods
    k, n, m = rod.stiffness, path.force(rod.end)[-1], path.moment(rod.end)[-1]
    problem = Problem(rod.length, rod.curve.frame, (*k.shear, k.axial), (*k.bending, k.torsion), tuple(n), tuple(m),
                      line_force=line_force)  # fmt: skip
    found = path.fields(len(path) - 1, rod)
    start, unit = found["position"][0], problem.units["moment"]
    guess = np.c_[(found["position"] - start) / rod.length, found["quaternion"], found["moment"] / unit].T

    def ends(a, b):
        return np.r_[a[:7] - START, b[7:] - m / unit]

    done = solve_bvp(lambda s, y: problem.slope(s, y, 1.0), ends, found["s"] / rod.length, guess, tol=1e-8,
                     max_nodes=20_000)  # fmt: skip
    assert done.success
    return lambda s: start + rod.length * done.sol(np.asarray(s) / rod.length)[:3].T


@pytest.mark.parametrize(("name", "line_force"), [("helical_spring", 0.0), ("riser", -700.0), ("soft_arm", None)])
def test_the_strong_form_reaches_the_same_end(gallery, name, line_force):
    """Within the path's own error bar; collocation is accurate to 1e-9 of the length."""
    path, _ = gallery[name]
    (rod,) = path.scene.rods
    weight = -9.81 * rod.stiffness.mass if line_force is None else line_force
    places = (rod.length, 110.0 if name == "riser" else rod.length / 2)
    reached = strong_form(path, (0, 0, weight))(places)
    expected = [path.position(rod.at(s))[-1] for s in places]
    allowed = path.error[-1] * path.largest_displacement()[-1] + 1e-9 * rod.length
    assert np.linalg.norm(reached - expected, axis=1).max() <= allowed
    assert path.error.max() <= 1e-5
