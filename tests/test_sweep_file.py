"""The folder of a sweep over depths belongs to one sweep."""

from dataclasses import dataclass

import pytest

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
PATH = cf.well.WellPath.from_survey([0, 500, 1000], [0, 0, 30], [0, 0, 0])
PIPE = cf.well.DrillPipe(size="5 in 19.50 lb/ft")
DEPTHS = [600.0, 800.0, 1000.0]


def hole(**given):
    return cf.well.Borehole(PATH, cf.well.HoleSection(1000.0, 0.2159, 0.2), **given)


def sweep(file, **given):
    given = {
        "hole": hole(),
        "string": cf.well.DrillString([PIPE]),
        "mud": cf.well.Mud(1200.0),
        "model": "soft",
        **given,
    }
    return cf.well.depth_sweep(operations=[cf.well.TripOut()], depths=DEPTHS, folder=file, progress=False, **given)


def test_every_part_of_the_hole_is_compared(tmp_path):
    """Also what only the rod depends on: hook loads by two stiffnesses of the wall differ by 1 %."""
    file = tmp_path / "sweep"
    sweep(file, hole=hole(wall_stiffness=1e10))
    with pytest.raises(cf.SceneError, match=r"another folder: hole.wall_stiffness is 1.*, where the sweep has 1000"):
        sweep(file, hole=hole(wall_stiffness=1e5))
    for name, other in {
        "string": cf.well.DrillString([cf.well.Collar(50.0, "NC46-65"), PIPE]),
        "mud": cf.well.Mud(1201.0),
        "friction": [0.3],
        "torque_convention": "fixed",
    }.items():
        given = {"hole": hole(wall_stiffness=1e10), name: other}
        with pytest.raises(cf.SceneError, match="holds another sweep|torque_convention") as refusal:
            sweep(file, **given)
        assert name in str(refusal.value)
    assert (sweep(file, hole=hole(wall_stiffness=1e10)).hook_load == sweep(None).hook_load).all()


@dataclass(frozen=True)
class Own(cf.well.Component):
    """A component of the user's own, with a field that the package does not know."""

    maker: str = ""


def test_components_of_the_users_own_are_compared_by_all_their_fields(tmp_path):
    strings = [cf.well.DrillString([Own(None, None, 200.0, 0.0635, maker=maker)]) for maker in ("one", "other")]
    sweep(tmp_path / "sweep", string=strings[0], mud=None)
    with pytest.raises(cf.SceneError, match="string.components.*maker is 'other', where the sweep has 'one'"):
        sweep(tmp_path / "sweep", string=strings[1], mud=None)
