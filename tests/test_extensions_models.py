"""Formulations, contact laws and loads that are defined outside the package, each in one file of tests/extensions."""

import numpy as np
import pytest
from extensions.augmented import Augmented

import cosserat_fenicsx as cf

SECTION = cf.Stiffness((1e4, 1e4), 2e4, (10.0, 8.0), 7.0, mass=1.0, inertia=(0.1, 0.1, 0.2))
ROD = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), SECTION, name="column")
BENT = cf.Scene([ROD], [cf.Clamp(ROD.start)], [cf.Force(ROD.end, (3.0, 4.0, -15.0))])


def test_a_formulation(tmp_path):
    """By its name and as a class; the penalty vanishes at the solution, which is that of the multiplier form."""
    options = {"elements": 4, "model": "spatial"}
    path, same = (cf.solve(BENT, [0.5, 1.0], formulation=x, **options) for x in ("augmented", Augmented))
    expected = cf.solve(BENT, [0.5, 1.0], formulation="multiplier", **options)
    np.testing.assert_allclose(path.position(ROD.end), expected.position(ROD.end), rtol=1e-9)
    np.testing.assert_array_equal(path.position(ROD.end), same.position(ROD.end))
    np.testing.assert_allclose(path.moment(ROD.start), expected.moment(ROD.start), rtol=1e-7)
    assert path.formulation == "augmented" and any("a multiplier and a penalty" in why for why in path.why)
    path.save(tmp_path / "path.h5")
    assert cf.read_path(tmp_path / "path.h5").formulation == "augmented"
    with pytest.raises(cf.SceneError, match="did you mean 'augmented'"):
        cf.solve(BENT, [1.0], formulation="augmentd")
