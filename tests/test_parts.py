"""Parts of scenes: their fields, their classes, scenes as plain data and back, and scene files that are damaged."""

import copy
import json
import math
import pydoc
import random
import tomllib
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pytest
import ufl
from test_drilling import FILE as WHOLE

import cosserat_fenicsx as cf
from cosserat_fenicsx import parts, units
from cosserat_fenicsx.cli import drilling, well
from cosserat_fenicsx.cli.main import parser
from cosserat_fenicsx.quantities import DIMENSIONS, MOST, in_si
from cosserat_fenicsx.drilling.bit_laws import BitLaw
from cosserat_fenicsx.files import read
from cosserat_fenicsx.parts import NotData, Part, from_data, members, to_data
from cosserat_fenicsx.scene import action

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


@pytest.mark.parametrize(("given", "normal"), [
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
])  # fmt: skip
def test_values_in_their_normal_form(given, normal):
    (name,) = given
    found = getattr(Everything(**given), name)
    assert found == (pytest.approx(normal, rel=1e-12) if isinstance(normal, float) else normal)
    assert type(found) is type(normal) and replace(Everything(**given)) == Everything(**given)


@pytest.mark.parametrize(("given", "words"), [
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
])  # fmt: skip
def test_values_that_are_refused(given, words):
    with pytest.raises(cf.SceneError, match=words):
        Everything(**given)


def test_text_with_units_is_accepted_in_python_as_in_files():
    assert cf.drilling.TopDrive("60 rpm", "2900 kg m^2").speed == pytest.approx(2 * math.pi)
    law = cf.drilling.Stribeck("6 kN m", "4 kft-lbf", "30 rpm")
    assert cf.drilling.BitOnRock(law, "20 klbf").weight == 20 * units.kip
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


STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)
MATRIX = np.diag([3e6, 4e6, 9e6, 5.0, 6.0, 7.0]) + np.diag([0.1] * 3, 3) + np.diag([0.1] * 3, -3)


def everything():
    """A scene with an item of every class of the package."""
    curves = (
        cf.Line((0, 0, 0), (0.1, 0.2, 1.7)),
        cf.Arc((0, 0, 0), (1.3, 0, 0), 1.1, axis=(0.3, 1.0, 0)),
        cf.Helix((0, 0, 0), (1.0, 0, 0), 3.0, 0.2),
        cf.Spline([(0, 0, 0), (1, 0.1, 0), (2, 0, 0.3), (3, 0.5, 0)], d1=(0, 1, 0.2)),
        cf.UniformCurvature(2.0, (0.3, 0.1, 0.7), frame=(0.5, 0.1, 0.7, 0.3) / np.sqrt(0.84)),
        cf.Line((5, 0, 0), (6, 0, 0)),
        cf.Line((6, 0, 0), (6, 1, 0)),
    )
    sections = (
        cf.Circle(0.1), cf.Tube(0.2, 0.1), cf.Rectangle(0.1, 0.2),
        cf.Stiffness((1e6, float("inf")), 1e7, (10.0, 12.0), 8.0, mass=2.0, inertia=(0.1, 0.2, 0.3)),
        [(0.7, cf.Circle(0.2)), (None, cf.Circle(0.1))], cf.Stiffness(matrix=MATRIX, mass=1.0),
        cf.Profile("IPE 200"),
    )  # fmt: skip
    rods = [
        cf.Rod(curve, section, STEEL, name=f"rod {i}", damping=cf.Damping(drag=0.3) if i == 1 else None)
        for i, (curve, section) in enumerate(zip(curves, sections, strict=True))
    ]
    supports = [
        cf.Clamp(rods[0].start), cf.Pin(rods[1].start), cf.Hinge(rods[2].start, (0.1, 0.7, 0.2)),
        cf.Roller(rods[3].at(0.3), (0.6, 0.7, 0.1)),
        cf.Prescribed(rods[4].start, cf.signals.Ramp((0, 0.1, 0), 0.0, 2.0), (0, 0, 0)),
    ]  # fmt: skip
    end = rods[0].end
    loads = [
        cf.Force(end, (0, 0, -1.0)), cf.Moment(end, cf.signals.Sine((0, 1.0, 0), 2.0, phase=0.3)),
        cf.EccentricForce(end, (1.0, 0, 0), (0.1, 0.2)),
        cf.FollowerForce(end, cf.signals.Triangle((1.0, 0, 0), 0, 1.0, 3.0)),
        cf.FollowerMoment(end, cf.signals.Table([0, 1.0], [(0, 0, 0), (1.0, 0, 0)])),
        cf.LineForce(rods[1], cf.signals.AlongTable([0, 1.0], [(0, 0, 0), (0, 0, 1.0)]), permanent=True),
        cf.LineMoment(rods[2], cf.signals.AlongPieces([(0.5, (0, 0, 1.0))])), cf.Weight(permanent=True),
        cf.Force(end, cf.signals.Step((0, 0, 1.0), 0.5), jumps=(0.7,)),
        cf.Force(end, cf.signals.RunUp((0, 0, 1.0), 0.0, 0.5)),
        cf.Foundation(rods[1], 3.0, direction=(0.3, 0.4, 0.7)), cf.Spring(end, 3.0, rotational=0.1),
        cf.Dashpot(end, 3.0), cf.Drag(rods[1], 0.3, 0.1, current=(0.1, 0, 0)), cf.PointMass(end, 3.0),
        cf.Wall(rods[5], (5, 0, 0), (1, 0, 0), 0.1),
        cf.Actuation(rods[1], cf.signals.AlongPieces([(0.5, (0, 0, 1.0))]), cf.signals.Sine((0, 0, 0.1), 2.0)),
        cf.Thermal(rods[1], 1e-5, cf.signals.Ramp(3.0), gradient=(1.0, 2.0)), cf.Growth(rods[2], 1.1, permanent=True),
        cf.Pretension(rods[3], force=3.0), cf.Pretension(rods[4], rest_length=0.9, permanent=False),
        cf.Tendon(rods[1], (0.1, 0.2), cf.signals.Ramp(3.0)), cf.Tendon(rods[2], cf.Helical(0.1, -0.5, 0.3), 2.0),
        cf.Tendon(rods[3], (0.1, 0.2), shortening=0.01, axial=5e4),
    ]  # fmt: skip
    joints = [cf.Joint(rods[5].end, rods[6].start, release=(0.2, 0.5, 0.9))]
    velocities = [cf.InitialVelocity(rods[5], linear=(0, 1.0, 0), angular=(0, 0, 0.3))]
    return cf.Scene(rods, supports, loads, joints, "everything", velocities)


def test_back_to_the_last_digit(tmp_path):
    """From JSON, and from a scene file."""
    scene = everything()
    data = to_data(scene)
    cf.write(scene, tmp_path / "everything.toml")
    assert to_data(cf.read(tmp_path / "everything.toml").scene) == data
    text = json.dumps(data)
    again = from_data(cf.Scene, json.loads(text))
    assert json.dumps(to_data(again)) == text
    for one, other in zip(scene.rods, again.rods, strict=True):
        s = np.linspace(0, one.length, 7)
        assert np.array_equal(one.curve.position(s), other.curve.position(s))
        assert np.array_equal(one.curve.frame(s), other.curve.frame(s))
        assert all(map(np.array_equal, one.stiffness_at(s)[:4], other.stiffness_at(s)[:4]))
    assert again.title == "everything" and again.loads[0].station.rod is again.rods[0]


def test_what_has_no_form_as_data_is_named():
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Circle(0.1), STEEL, name="rod")
    cone = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), lambda s: cf.Circle(0.1 + 0.01 * s), STEEL, name="cone")

    class Own(cf.PointAction):
        station = rod.end
        work = staticmethod(lambda point, test, f: ufl.dot(f, test.phi_r))

        def data(self, rod, s):
            return (action.vector((0, 0, 1.0), "N"),)

    for scene, words in (
        (cf.Scene([cone]), r"rods\[0\].section: a function written in Python"),
        (cf.Scene([rod], loads=[cf.Force(rod.end, lambda t: (t, 0, 0))]), r"loads\[0\].force: a function"),
        (cf.Scene([rod], loads=[Own()]), r"loads\[0\]: a part of the class Own cannot"),
    ):
        with pytest.raises(NotData, match=words):
            to_data(scene)


@pytest.mark.parametrize("damage", [
    None, [], {}, {"title": "", "rods": 3}, {"type": "os.system"},
    {"title": "", "rods": [{"type": "Popen", "args": "true"}], "supports": [], "loads": [], "joints": [],
     "velocities": []},
    {"title": "", "rods": [{"type": "Circle", "diameter": 1.0}], "supports": [], "loads": [], "joints": [],
     "velocities": []},
])  # fmt: skip
def test_data_of_anything_else_are_refused(damage):
    with pytest.raises(cf.SceneError):
        from_data(cf.Scene, damage)


FILES = sorted((Path(__file__).parent.parent / "demos").glob("**/*.toml"))
VALUES = [
    [], {}, "", "x", "column.end", True, 0, -1, 1e308, -1e308, 1e-308, float("nan"), float("inf"), 10**400, [0, 0, 0],
    [1e300] * 3, [1, 2], [[]], {"type": []}, {"type": "Circle"}, "é\u0000", 5e-324, ["a"] * 3, None, [10**400] * 3,
    "rod@1e400", "column@-1", "column@nan",
]  # fmt: skip


def places(table, place=()):
    """The keys that lead to every value of nested tables and lists."""
    if place:
        yield place
    inside = table.items() if isinstance(table, dict) else enumerate(table) if isinstance(table, list) else ()
    for key, value in inside:
        yield from places(value, (*place, key))


def damaged(table, chance):
    """A copy with one to three keys deleted, renamed or doubled, or values replaced or scaled."""
    table = copy.deepcopy(table)
    for _ in range(chance.choice((1, 1, 2, 3))):
        *way, key = chance.choice(list(places(table)) or [()])
        inner = table
        for step in way:
            inner = inner[step]
        how = chance.choice(("replace", "replace", "delete", "rename", "double", "scale"))
        number = type(inner[key]) in (int, float) and abs(inner[key]) < 1e150
        if how == "delete":
            del inner[key]
        elif how == "rename" and isinstance(inner, dict):
            inner[chance.choice(("typ", "forc", f"{key}s", "", str(key).upper()))] = inner.pop(key)
        elif how == "double" and isinstance(inner, list):
            inner.append(copy.deepcopy(inner[key]))
        elif how == "scale" and number:
            inner[key] *= chance.choice((1e-12, 1e12, -1, 1e150))
        else:
            inner[key] = copy.deepcopy(chance.choice(VALUES))
        if not table:
            break
    return table


@pytest.mark.parametrize("seed", range(4))
def test_damaged_files(seed, monkeypatch):
    """Of rods, wells and strings in motion: a scene, which can be explained, or words."""
    chance, refused = random.Random(seed), 0
    tables = {file: tomllib.loads(file.read_text(encoding="utf-8")) for file in FILES}
    tables[FILES[0].with_name("whole.toml")] = tomllib.loads(WHOLE)
    strings = {file for file, table in tables.items() if "drive" in table}
    wells = {file for file, table in tables.items() if "well" in table} - strings
    groups = [sorted(group) for group in (tables.keys() - strings - wells, wells, strings)]
    commands = parser()
    for _ in range(300):
        file = chance.choice(chance.choice(groups))
        table = damaged(tables[file], chance)
        monkeypatch.setattr(read.tomllib, "loads", lambda stream, table=table: copy.deepcopy(table))
        options = commands.parse_args(["explain", str(file)])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", cf.SceneWarning)
            warnings.simplefilter("error", RuntimeWarning)
            try:
                found = cf.read(file if file in FILES else FILES[0])
                if isinstance(found, cf.RodScene):
                    assert found.scene.cautions is not None and found.scene.flatness
                else:
                    (drilling if file in strings else well).explain(options, found)
            except cf.SceneError as problem:
                refused += 1
                assert len(str(problem)) < 3000
    assert 60 < refused < 300
