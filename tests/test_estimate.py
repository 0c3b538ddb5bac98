"""The estimated error of a path, computed at a few of its points, holds at all of them and is not far too large."""

from pathlib import Path

import numpy as np
import pytest
from conftest import column

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial  # estimates do not depend on ranks
DEMOS = Path(__file__).parent.parent / "demos"
_PLACES = np.linspace(0, 1, 101)


def demo(name):
    return cf.read(DEMOS / f"{name}.toml").scene


def positions(path):
    """(points, places of all rods, 3) displacements over the unit of length."""
    return np.concatenate([path.motion(rod, _PLACES)[:, :, :3] for rod in path.scene.rods], axis=1)


@pytest.mark.parametrize("tol", [1e-4, 1e-5, 1e-6, 1e-8])
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
    sizes = np.linalg.norm(truth, axis=2).max(axis=1)
    off, nothing = np.linalg.norm(positions(path) - truth, axis=2).max(axis=1) / sizes, 1e-11 * sizes.max() / sizes
    told = path.errors.position
    assert (off <= np.maximum(told, nothing)).all() and path.error.max() <= tol
    assert (told <= 30 * np.maximum(off, nothing)).all()


@pytest.mark.parametrize(
    "etas", [(0.0, 1.0), [0.0, 0.5, 1.0], np.linspace(-1, 1, 9), [1e-12, 1e-3, 0.3, 0.6, 1.0]], ids=str
)
def test_points_without_load(etas):
    """Where nothing moves the estimated error is negligible."""
    rod, scene = column()
    path = cf.solve(scene, etas if isinstance(etas, tuple) else list(etas))
    assert path.error.max() <= 1e-6 and max(path.elements) <= 16


def test_a_smooth_rod_does_not_hide_another():
    """A long beam under a line load, whose deflection P4 represents
    exactly, next to a short arc that is pulled straight."""

    def stiff(bending):
        return cf.Stiffness((1e6, 1e6), 1e6, (bending, bending), bending)

    long = cf.Rod(cf.Line((0, 0, 0), (300.0, 0, 0)), stiff(1e3), name="long")
    arc = cf.Rod(cf.Arc((0, 0, 0), (np.sin(0.5), 0, -np.cos(0.5)), 1.0, axis=(0, 1, 0)), stiff(1.0), name="arc")
    held = [cf.Clamp(long.start), cf.Prescribed(long.end, rotation=(0, 0, 0)), cf.Roller(long.end, (0, 0, 1)),
            cf.Roller(long.end, (0, 1, 0)), cf.Clamp(arc.start),
            cf.Prescribed(arc.end, displacement=(0.03, 0, 0), rotation=(0, 0, 0))]  # fmt: skip
    scene = cf.Scene([long, arc], held, [cf.LineForce(long, (0, 0, 384e3 / 300.0**4))])
    etas = np.linspace(-0.98, 1, 20).tolist()
    path, truth = cf.solve(scene, etas, tol=1e-6), positions(cf.solve(scene, etas, elements=64))
    off = np.linalg.norm(positions(path) - truth, axis=2).max(axis=1) / np.linalg.norm(truth, axis=2).max(axis=1)
    assert (off <= np.maximum(path.errors.position, 1e-11)).all() and path.error.max() <= 1e-6


def test_an_interrupted_search_hands_over_what_is_complete(monkeypatch):
    from cosserat_fenicsx.statics.path import recorder

    def stop():
        raise KeyboardInterrupt

    _, scene = column()
    corrected = recorder.Tracing.corrected
    monkeypatch.setattr(
        recorder.Tracing,
        "corrected",
        lambda *arguments: monkeypatch.setattr(recorder, "obey", stop) or corrected(*arguments),
    )
    with pytest.raises(cf.Interrupted) as stopped:
        cf.solve(scene, np.linspace(0.1, 0.9, 8).tolist())
    assert len(stopped.value.path) == 8
