"""What solvers take from outside the package, each in one file of tests/extensions: criteria of errors."""

import numpy as np
import pytest
from extensions.own_criteria import BendingEnergy, Sway

import cosserat_fenicsx as cf
from cosserat_fenicsx.results import compared

pytestmark = pytest.mark.serial


def column():
    """A cantilever under a force that compresses it, beside its axis."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((1e4, 1e4), 1e4, (1.0, 1.0), 1.0), name="column")
    return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0.5, 0, -2.0)), cf.Moment(rod.end, (0, 0.5, 0))])


def test_criteria_of_errors(tmp_path):
    """Their errors are those from a path that is a hundred times as accurate, and `tol` bounds them alone."""
    scene = column()
    fine = cf.solve(scene, [0.5, 1.0], tol=1e-10)
    path = cf.solve(scene, [0.5, 1.0], tol=1e-3, bound=["bending_energy", Sway])
    assert path.bounded == ("bending_energy", "sway") and path.judged[4:] == path.bounded
    for criterion in (BendingEnergy(), Sway()):
        true = np.abs(criterion.values(path) / criterion.values(fine) - 1)
        told = getattr(path.errors, criterion.name)
        assert (true <= told + 1e-12).all() and (0 < told).all() and (told <= 1e-3).all()
    assert (path.error == np.maximum(path.errors.bending_energy, path.errors.sway)).all()
    assert "bending energies" in str(path) and (path.to_dict()["error_sway"] == path.errors.sway).all()
    path.save(tmp_path / "path.h5")
    back = cf.read_path(tmp_path / "path.h5")
    assert back.bounded == path.bounded
    np.testing.assert_array_equal(back.errors, path.errors)


def test_an_object_with_arguments_and_a_range_of_load_factors():
    """All points of a range, of which few are solved on the last two meshes."""
    sway = Sway("column.end")
    path = cf.solve(column(), (0.0, 1.0), tol=1e-4, bound=["position", sway])
    fine = cf.solve(column(), path.load_factors.tolist(), tol=1e-9)
    assert len(path) > 4 and path.error.max() <= 1e-4
    off = np.abs(sway.values(path) - sway.values(fine)) / sway.sizes(fine)
    assert (off <= path.errors.sway + 1e-9).all()


def test_unknown_ones(tmp_path, monkeypatch):
    """In `bound`, and in a file that is read where the class is not defined: its errors are kept under its name."""
    with pytest.raises(cf.SceneError, match="bound: 'swy': did you mean 'sway'"):
        cf.solve(column(), [1.0], bound=["swy"])
    with pytest.raises(cf.SceneError, match="expected a name or a Criterion"):
        cf.solve(column(), [1.0], bound=[3])
    with pytest.raises(TypeError, match="expected a Python name"):
        type("Bad", (compared.Criterion,), {"name": "not a name"})
    path = cf.solve(column(), [1.0], bound=["sway"], tol=1e-3)
    path.save(tmp_path / "path.h5")
    monkeypatch.delitem(compared.CRITERIA, "sway")
    back = cf.read_path(tmp_path / "path.h5")
    assert (back.errors.sway == path.errors.sway).all() and "sway" in str(back)


def test_in_a_scene_file(tmp_path):
    """`use` names the module that defines them."""
    (tmp_path / "column.toml").write_text(
        """
use = ["extensions.own_criteria"]
solve = { load_factors = [1.0], tol = 1e-3, bound = ["sway"] }
supports = [{ type = "Clamp", station = "column.start" }]
loads = [{ type = "Force", station = "column.end", force = [0.5, 0, -2.0] }]

[materials.soft]
E = 1e6
nu = 0.3

[[rods]]
name = "column"
curve = { type = "Line", start = [0, 0, 0], end = [0, 0, 1] }
section = { type = "Circle", diameter = 0.067 }
material = "soft"
""",
        encoding="utf-8",
    )
    path = cf.read(tmp_path / "column.toml").run()
    assert path.bounded == ("sway",) and path.errors.sway.max() <= 1e-3
