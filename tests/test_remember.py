"""What is remembered of a scene depends on the scene and the arguments alone, and ends with the scene."""

import gc
import weakref

import pytest
from conftest import column

import cosserat_fenicsx as cf
from cosserat_fenicsx.models.choose import choose
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.signature import Signature
from cosserat_fenicsx.remember import per_scene

pytestmark = pytest.mark.serial


def test_the_same_is_found_once():
    _, scene = column()
    layout = Layout.of(scene, 3)
    assert Layout.of(scene, 3) is layout and layout.finer(scene, 2.0) is layout.finer(scene, 2.0)
    assert choose(scene) is choose(scene) and choose(scene, model="spatial").model == "spatial"
    arguments = {"formulation": "mixed", "model": "planar"}
    assert Signature.of(scene, layout, degree=4, **arguments) is Signature.of(scene, layout, degree=4, **arguments)
    assert Signature.of(scene, layout, degree=1, **arguments).degree == 1
    with pytest.raises(cf.SceneError, match="degree = True"):
        Signature.of(scene, layout, degree=True, **arguments)


def test_nothing_is_kept_of_a_scene_that_is_gone():
    calls = []

    @per_scene
    def doubled(scene, numbers):
        calls.append(numbers)
        return [2 * x for x in numbers]

    _, scene = column()
    assert doubled(scene, (1, 2)) is doubled(scene, (1, 2)) and calls == [(1, 2)]
    assert doubled(scene, [1, 2]) == doubled(scene, [1, 2]) and len(calls) == 3  # a list may change
    for k in range(1000):
        doubled(scene, (k,))
    gone = weakref.ref(scene)
    del scene
    gc.collect()
    assert gone() is None
