"""Parts of scenes: what fields take follows from annotations, and classes register themselves."""

import math
import pydoc
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx import parts, units
from cosserat_fenicsx.dimensions import DIMENSIONS, MOST, in_si
from cosserat_fenicsx.drilling.bit_laws import BitLaw
from cosserat_fenicsx.parts import Part, members

pytestmark = [pytest.mark.serial, pytest.mark.once]


@dataclass(frozen=True)
class TwoTorques(BitLaw):
    """A law for these tests, at the top of a module as a user's own."""

    low: parts.Torque
    high: parts.Torque = 1.0


@dataclass(frozen=True)
class _Hidden(BitLaw):
    low: parts.Torque


@dataclass(frozen=True)
class Everything(Part):
    length: parts.Length = 1.0
    pull: Annotated[parts.ForceSize, parts.between(-10, 10, "a pull")] | None = None
    count: parts.Count = 1
    plain: float = 0.0
    whole: int = 0
    name: str = ""
    flag: bool = False
    start: Literal["rest", "steady"] = "rest"
    point: Annotated[parts.Numbers, parts.Several("length")] = (0.0, 0.0, 0.0)
    turning: parts.InTime[parts.AngularVelocity] = 0.0
    law: BitLaw | None = None
    lengths: tuple[parts.Length, ...] = ()
    stiff: parts.Stiffness = math.inf
    anything: object = None


def test_help_shows_the_part_and_not_its_dataclass():
    text = pydoc.render_doc(cf.Spring, renderer=pydoc.plaintext)
    assert "Spring(station, stiffness=0.0, rotational=0.0, direction=None)" in text and "rotational: c, N m/rad" in text
    assert "__" not in text and "typing" not in text


def test_classes_register_themselves():
    known = members(BitLaw)
    assert list(known)[:3] == ["Stribeck", "Cutting", "Lobes"] and known["TwoTorques"] is TwoTorques
    assert "_Hidden" not in known and "BitLaw" not in known
    assert cf.drilling.BitOnRock(TwoTorques("1 kN m")).law == TwoTorques(1e3, 1.0)

    @dataclass(frozen=True)
    class Local(BitLaw):
        """A class inside a function cannot be found again by its name."""

    assert "Local" not in members(BitLaw)


def test_a_name_stands_for_one_class():
    code = "from dataclasses import dataclass\nclass {0}(BitLaw): pass\n"
    for name, again in (("Stribeck", False), ("TwoTorques", True)):
        where = {"BitLaw": BitLaw, "__name__": __name__ if again else "elsewhere"}
        if again:  # a module that is loaded again
            exec(code.format(name), where)
        else:
            with pytest.raises(TypeError, match="cosserat_fenicsx.drilling.bit_laws has a bit law of this name"):
                exec(code.format(name), where)
    BitLaw._members["TwoTorques"] = TwoTorques


@pytest.mark.parametrize(
    ("given", "normal"),
    [
        ({"length": "8 1/2 in"}, 0.2159),
        ({"length": 3}, 3.0),
        ({"pull": None}, None),
        ({"pull": "2 lbf"}, 2 * units.lbf),
        ({"count": 3.0}, 3),
        ({"point": ["1 ft", 0, 2]}, (0.3048, 0.0, 2.0)),
        ({"point": np.ones(3)}, (1.0, 1.0, 1.0)),
        ({"turning": "60 rpm"}, 2 * math.pi),
        ({"turning": math.sin}, math.sin),
        ({"lengths": ["1 m", 2]}, (1.0, 2.0)),
        ({"stiff": "5 MN/m"}, 5e6),
        ({"stiff": math.inf}, math.inf),
        ({"start": "steady"}, "steady"),
        ({"law": None}, None),
    ],
)
def test_values_in_their_normal_form(given, normal):
    (name,) = given
    found = getattr(Everything(**given), name)
    assert found == (pytest.approx(normal, rel=1e-12) if isinstance(normal, float) else normal)
    assert type(found) is type(normal) and replace(Everything(**given)) == Everything(**given)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"length": 0}, r"Everything.length = 0: expected a positive number \(m\)"),
        ({"length": 1e-70}, r"expected a positive number \(m\) from 1e-60 to 1e\+60"),
        ({"length": "3 kN"}, r"Everything.length = '3 kN': kN is a unit of force, expected one of length"),
        ({"length": None}, r"Everything.length = None: expected a positive number \(m\)"),
        ({"length": True}, r"Everything.length = True: expected a positive number \(m\)"),
        ({"pull": 11.0}, r"Everything.pull = 11.0: expected a pull from -10 to 10 \(N\)"),
        ({"count": 1.5}, r"Everything.count = 1.5: expected a whole number from 1"),
        ({"count": 0}, r"Everything.count = 0: expected a whole number from 1"),
        ({"plain": math.inf}, r"Everything.plain = inf: expected a finite number"),
        ({"plain": "1 m"}, r"Everything.plain = '1 m': expected a finite number"),
        ({"whole": 0.5}, r"Everything.whole = 0.5: expected a whole number"),
        ({"name": 3}, r"Everything.name = 3: expected a text"),
        ({"flag": 1}, r"Everything.flag = 1: expected True or False"),
        ({"start": "walk"}, r"Everything.start = 'walk': expected 'rest' or 'steady'"),
        ({"start": []}, r"Everything.start = \[\]: expected 'rest' or 'steady'"),
        ({"point": (1, 2)}, r"Everything.point = \(1, 2\): expected 3 finite numbers \(m\)"),
        ({"point": ["1 s", 0, 0]}, r"Everything.point\[0\] = '1 s': s is a unit of time, expected one of length"),
        ({"turning": (1.0,)}, r"Everything.turning = \(1.0,\): expected a finite number \(rad/s\)"),
        ({"turning": {}}, r"Everything.turning = {}: expected .* or a function of time that gives one"),
        ({"law": cf.drilling.Hook()}, r"expected Stribeck\(...\), Cutting\(...\), Lobes\(...\).* or .*\(...\)"),
        ({"lengths": [1, -1]}, r"Everything.lengths\[1\] = -1: expected a positive number \(m\)"),
        ({"lengths": 1}, r"Everything.lengths = 1: expected a list, each a positive number \(m\)"),
        ({"stiff": math.nan}, r"Everything.stiff = nan: expected a positive number or infinity \(N/m\)"),
    ],
)
def test_values_that_are_refused(given, words):
    with pytest.raises(cf.SceneError, match=words):
        Everything(**given)


def test_text_with_units_is_accepted_in_python_as_in_files():
    assert cf.drilling.TopDrive("60 rpm", "2900 kg m^2").speed == pytest.approx(2 * math.pi)
    assert (
        cf.drilling.BitOnRock(cf.drilling.Stribeck("6 kN m", "4 kft-lbf", "30 rpm"), "20 klbf").weight == 20 * units.kip
    )
    assert cf.drilling.Hook("5 MN/m", "10 m/h") == cf.drilling.Hook(5e6, 10 / 3600)
    assert cf.drilling.WallFriction(0.3, 0.2, "10 rpm", of_rotation=True).speed == 10 * units.rpm
    assert cf.drilling.WallFriction(0.3, 0.2, "10 ft/min").speed == pytest.approx(0.0508)
    with pytest.raises(cf.SceneError, match="WallFriction.speed = '10 rpm': rpm is a unit of rotation"):
        cf.drilling.WallFriction(0.3, 0.2, "10 rpm")


def test_dimensions():
    for name, dimension in DIMENSIONS.items():
        assert dimension.units[dimension.si] == 1.0 and dimension.field in dimension.units, name
        assert in_si("x", f"2 {dimension.field}", name) == 2 * dimension.units[dimension.field]
    assert MOST["N"] == 1e10 and "J" not in MOST
