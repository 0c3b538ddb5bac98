"""The error bar of a whole path, found at a few of its points, holds at all of them and is no fable."""

from pathlib import Path

import numpy as np
import pytest
from conftest import column

import cosserat_fenicsx as cf
from cosserat_fenicsx.scenefile import read_scene

pytestmark = pytest.mark.serial  # estimates know no ranks
DEMOS = Path(__file__).parent.parent / "demos"
_PLACES = np.linspace(0, 1, 101)


def demo(name):
    return read_scene(DEMOS / f"{name}.toml")[0]


def positions(path):
    """(points, places of all rods, 3) displacements over the unit of length."""
    return np.concatenate([path.motion(rod, _PLACES)[:, :, :3] for rod in path.scene.rods], axis=1)


@pytest.mark.parametrize("tol", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize(
    ("scene", "etas"),
    [
        (column()[1], np.linspace(0.05, 4, 30)),
        (demo("bend_45"), np.linspace(0.25, 1, 4)),
        (demo("lees_frame"), np.linspace(0.18, 1.8, 10)),
        (demo("helical_spring"), np.linspace(0.2, 1, 5)),
        (demo("riser"), np.linspace(0.1, 1, 10)),
        (demo("tripod"), np.linspace(0.25, 1, 4)),
    ],
    ids=["column", "bend", "Lee's frame", "spring", "riser", "tripod"],
)
def test_every_point_of_a_path(scene, etas, tol):
    path = cf.solve(scene, list(etas), tol=tol)
    truth = positions(cf.solve(scene, list(etas), model=path.model, degree=4, elements=3 * max(path.elements)))
    off = np.linalg.norm(positions(path) - truth, axis=2).max(axis=1) / np.linalg.norm(truth, axis=2).max(axis=1)
    assert (np.maximum(off, 1e-11) <= np.maximum(path.error, 1e-11)).all() and path.error.max() <= tol
    assert (path.error <= 30 * np.maximum(off, 1e-11)).all()
