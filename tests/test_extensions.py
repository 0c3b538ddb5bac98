"""Scene parts, quantities, criteria, laws and operations defined outside the package, in tests/extensions."""

import csv
import importlib
import json
import subprocess
import sys
import tomllib
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from conftest import column
from extensions.gust import Gust
from extensions.held_in_band import HeldInBand
from extensions.own_criteria import BendingEnergy, Sway
from extensions.pull_rotating import PullRotating
from extensions.sampled_speed import LimitedSpeed
from extensions.stribeck_wall import StribeckCurve

import cosserat_fenicsx as cf
from cosserat_fenicsx.cli.main import main
from cosserat_fenicsx.drilling import BitLaw, FrictionLaw, SampledControl
from cosserat_fenicsx.files.read import from_tables, place_of, places, schema_of_files
from cosserat_fenicsx.parts import from_data, to_data
from cosserat_fenicsx.results import compared

pytestmark = pytest.mark.serial
DEMOS = Path(__file__).parent.parent / "demos"
FILES = sorted(DEMOS.glob("**/*.toml"))
MAST = """use = ["extensions.gust"]

[[rods]]
name = "mast"
curve = { type = "Line", start = [0, 0, 0], end = [0, 0, "20 ft"] }
section = { type = "Tube", outer_diameter = "4 in", inner_diameter = "3 in" }
material = { E = "210 GPa", density = "7.85 g/cm^3" }

[[supports]]
type = "Clamp"
station = "mast.start"

[[loads]]
type = "Gust"
rod = "mast"
strength = "2 kN/m"
height = "10 m"

[solve]
load_factors = [0.5, 1.0]
elements = 4
"""


@pytest.fixture
def mast(tmp_path):
    file = tmp_path / "mast.toml"
    file.write_text(MAST, encoding="utf-8")
    return file


def test_a_load_of_ones_own(mast, tmp_path):
    found = cf.read(mast)
    (rod,), (load,) = found.scene.rods, found.scene.loads
    assert load == Gust(rod, 2000.0) and rod.length == pytest.approx(6.096)
    path = found.run()
    by_hand = cf.Scene([rod], [cf.Clamp(rod.start)], [Gust(rod, "2 kN/m")])
    assert np.array_equal(path.position(rod.end), cf.solve(by_hand, [0.5, 1.0], elements=4).position(rod.end))
    force, _ = path.reaction(rod.start)
    # the integral of 2000 (z/10)^(1/7) over the mast
    assert -force[-1][0] == pytest.approx(2000 * 10 / (8 / 7) * 0.6096 ** (8 / 7), rel=1e-3)
    own = MAST.replace("use = [", 'use = ["extensions.own_criteria", ')
    mast.write_text(own.replace("elements = 4", 'tol = 1e-3\nbound = ["bending_energy"]'), encoding="utf-8")
    bounded = cf.read(mast).run()
    assert bounded.bounded == ("bending_energy",) and bounded.errors.bending_energy.max() <= 1e-3
    path.save(tmp_path / "path.h5")
    assert cf.read_path(tmp_path / "path.h5").position("mast.end") == pytest.approx(path.position("mast.end"), abs=0)


def test_a_motion_with_it_goes_on(mast, tmp_path):
    scene = cf.read(mast).scene
    whole = cf.simulate(scene, 0.04, dt=0.01, elements=2)
    cf.simulate(scene, 0.02, dt=0.01, elements=2, folder=tmp_path / "run")
    again = cf.resume(tmp_path / "run", duration=0.04)
    assert np.array_equal(again.position("mast.end"), whole.position("mast.end"))


@pytest.mark.once
def test_it_is_written_and_refused_by_its_fields(mast, tmp_path):
    found = cf.read(mast)
    data = to_data(found.scene)
    assert data["use"] == ["extensions.gust"] and data["loads"][0]["power"] == 1 / 7
    cf.write(found, tmp_path / "again.toml")
    assert to_data(cf.read(tmp_path / "again.toml")) == to_data(found)
    force = cf.Force("mast.end", lambda t: (t, 0, 0))
    with pytest.raises(Exception, match=r"loads\[0\].force: a function written in Python cannot be stored as data"):
        cf.write(replace(found, loads=(force,)), tmp_path / "again.toml")
    for old, new, words in (
        ("2 kN/m", "2 kN", r"line 16, column 1: loads\[0\]: Gust.strength = '2 kN': kN is a unit of force"),
        ('height = "10 m"', "power = 2", r"line 17, column 1: loads\[0\]: Gust.power = 2: expected a number from 0 to"),
        ("height =", "hight =", r"line 17, column 1: loads\[0\] \(Gust\): unknown key 'hight', did you mean 'height'"),
        ('"Gust"', '"Gusts"', r"line 14, column 1: loads\[0\].type = 'Gusts': did you mean 'Gust'"),
        ("extensions.gust", "extensions.gusts", r"line 1, column 8: use\[0\] = 'extensions.gusts': cannot be imported"),
        ("[solve]", "[solved]", r"line 19, column 1: the file: unknown key 'solved', did you mean 'solve'"),
        ("[[supports]]", "[solve]\n[[supports]]", r"line 20, column 1: \[solve\] is given twice, first at line 9,"),
    ):
        assert old in MAST
        mast.write_text(MAST.replace(old, new), encoding="utf-8")
        with pytest.raises(cf.SceneError, match=words):
            cf.read(mast)


@pytest.mark.once
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_scene_written_reads_back_equal(file, tmp_path):
    jsonschema = pytest.importorskip("jsonschema")
    known = jsonschema.Draft202012Validator(SCHEMA)
    tables = tomllib.loads(file.read_text(encoding="utf-8"))
    known.validate(tables)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cf.SceneWarning)
        found = cf.read(file)
        cf.write(found, tmp_path / "again.toml")
        again = cf.read(tmp_path / "again.toml")
    assert type(again) is type(found) and to_data(again) == to_data(found)
    assert to_data(from_data(type(found), json.loads(json.dumps(to_data(found))))) == to_data(found)
    known.validate(tomllib.loads((tmp_path / "again.toml").read_text(encoding="utf-8")))


SCHEMA = schema_of_files()


@pytest.mark.once
def test_the_schema_refuses_what_the_reader_refuses(capsys):
    jsonschema = pytest.importorskip("jsonschema")
    assert main(["schema", "extensions.gust"]) == 0
    schema = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator.check_schema(schema)
    known = jsonschema.Draft202012Validator(schema)
    tables = tomllib.loads(MAST)
    known.validate(tables)
    for where, value in (
        (("rods", 0, "section", "outer_diameter"), -1.0), (("rods", 0, "section", "outer_diameter"), True),
        (("loads", 0, "type"), "Gusts"), (("loads", 0, "strength"), [1.0]), (("loads", 0, "power"), 2.0),
        (("supports", 0, "station"), 3), (("solve", "tolerance"), 1e-3), (("solve", "elements"), 2.5),
    ):  # fmt: skip
        changed = json.loads(json.dumps(tables))
        inner = changed
        for key in where[:-1]:
            inner = inner[key]
        inner[where[-1]] = value
        assert not known.is_valid(changed), where
        with pytest.raises(cf.SceneError):
            from_tables(changed, DEMOS)


@pytest.mark.once
def test_functions_of_time_have_units():
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, "2 m")), cf.Circle("1 cm"), cf.Material("1 GPa"))
    force = cf.Force(rod.end, cf.signals.Ramp(("1 kN", 0, 0), end="2 s")).force
    assert force(1.0) == (500.0, 0.0, 0.0) and force.jumps == (0.0, 2.0)
    drive = cf.drilling.TopDrive(cf.signals.Table(["0 s", 10], ["0 rpm", "120 rpm"]))
    assert drive.signal()(5.0) == pytest.approx(60 * cf.units.rpm)
    assert cf.drilling.TopDrive(cf.signals.Ramp("60 rpm", end=5.0)).signal()(2.5) == pytest.approx(30 * cf.units.rpm)
    with pytest.raises(cf.SceneError, match="TopDrive.speed = '60 s': s is a unit of time"):
        cf.drilling.TopDrive(cf.signals.Ramp("60 s"))


@pytest.mark.once
def test_places_in_files():
    text = """# a comment with [brackets]
a.b = 1
"quoted key" = [1, { x = 2, "y z" = [
  3, # three
  4,
] }]
[[t]]
s = '''a
[no] = table'''
[[t]]
[t.u]
v = "]}#"
"""
    found = places(text)
    inner = [("quoted key", 1, "y z", 1), ("t", 1), ("t", 0, "s"), ("t", 1, "u", "v"), ("a", "b")]
    assert [place_of(text, where) for where in inner] == [(5, 3), (10, 1), (8, 1), (12, 1), (2, 1)]
    assert place_of(text, ("t", 0, "s", "further")) == (8, 1) and ("no",) not in found
    assert place_of(text, ("nowhere",)) is None


@pytest.fixture
def path(tmp_path, monkeypatch):
    """Solved and saved before the extension is imported."""
    _, scene = column()
    solved = cf.solve(scene, [0.5, 1.0], elements=2)
    assert "sway" not in solved.quantities and "slope" not in solved.to_dict()["rods"]["column"]
    solved.save(tmp_path / "before.h5")
    monkeypatch.syspath_prepend(Path(__file__).parent / "extensions")
    monkeypatch.setattr(cf.Path, "_quantities", cf.Path._quantities)  # forgotten after the test
    importlib.import_module("sway")
    yield cf.read_path(tmp_path / "before.h5")
    del sys.modules["sway"]


def test_a_quantity_of_a_path(path, tmp_path):
    expected = np.hypot(*path.displacement("column.end")[:, :2].T)
    assert path.quantities["sway"].unit == "m" and path.quantities["sway"].axes == ("point",)
    np.testing.assert_array_equal(path.value("sway"), expected)
    np.testing.assert_allclose(path.value("sway", "field"), expected / cf.units.foot, rtol=1e-15)
    path.write(tmp_path / "path.csv", units={"length": "ft"})
    with (tmp_path / "path.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["sway of the tip (ft)"]) for row in rows] == path.value("sway", "field").tolist()
    told = path.to_dict()
    assert told["units"]["sway"] == "m" and told["sway"].tolist() == expected.tolist()
    assert path.to_dataframe()["sway of the tip (m)"].tolist() == expected.tolist()


def test_a_quantity_along_rods(path, tmp_path):
    tree = path.to_xarray("field")
    assert tree["column"]["slope"].attrs["units"] == "deg" and tree["sway"].attrs["units"] == "ft"
    assert tree["column"]["position"].attrs["units"] == "ft"
    angle = np.degrees(path.rotation_angle("column.end"))
    np.testing.assert_allclose(tree["column"]["slope"].values[:, -1], angle, rtol=1e-6)
    path.save(tmp_path / "again.h5")
    path.write(tmp_path / "path.xdmf")
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "again.h5") as store, h5py.File(tmp_path / "path.h5") as series:
        assert store["sway"].attrs["units"] == "m" and store["rods/column/slope"].shape == tree["column/slope"].shape
        np.testing.assert_array_equal(series["slope_1"], tree["column/slope"].values[1])


def test_its_own_chart(path):
    pytest.importorskip("matplotlib")
    with pytest.raises(cf.SceneError, match="value.'sways'.: expected one of .*sway"):
        path.value("sways")
    with pytest.raises(cf.SceneError, match="path.vtu: units is not for the ending '.vtu'"):
        path.write("path.vtu", units="field")
    (panel,) = path.plot_quantity("sway", units="field").axes
    assert panel.get_ylabel() == "sway of the tip (ft)" and len(panel.lines) == 2
    np.testing.assert_allclose(panel.lines[1].get_ydata(), path.value("sway", "field").max())


def pressed_column():
    """A cantilever under a force that compresses it, beside its axis."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((1e4, 1e4), 1e4, (1.0, 1.0), 1.0), name="column")
    return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0.5, 0, -2.0)), cf.Moment(rod.end, (0, 0.5, 0))])


def test_criteria_of_errors(tmp_path):
    """Their errors are those from a path that is a hundred times as accurate, and `tol` bounds them alone."""
    scene = pressed_column()
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
    path = cf.solve(pressed_column(), (0.0, 1.0), tol=1e-4, bound=["position", sway])
    fine = cf.solve(pressed_column(), path.load_factors.tolist(), tol=1e-9)
    assert len(path) > 4 and path.error.max() <= 1e-4
    off = np.abs(sway.values(path) - sway.values(fine)) / sway.sizes(fine)
    assert (off <= path.errors.sway + 1e-9).all()


def test_unknown_ones(tmp_path, monkeypatch):
    """In `bound`, and in a file that is read where the class is not defined: its errors are kept under its name."""
    with pytest.raises(cf.SceneError, match="bound: 'swy': did you mean 'sway'"):
        cf.solve(pressed_column(), [1.0], bound=["swy"])
    with pytest.raises(cf.SceneError, match="expected a name or a Criterion"):
        cf.solve(pressed_column(), [1.0], bound=[3])
    with pytest.raises(TypeError, match="expected a Python name"):
        type("Bad", (compared.Criterion,), {"name": "not a name"})
    path = cf.solve(pressed_column(), [1.0], bound=["sway"], tol=1e-3)
    path.save(tmp_path / "path.h5")
    monkeypatch.delitem(compared.CRITERIA, "sway")
    back = cf.read_path(tmp_path / "path.h5")
    assert (back.errors.sway == path.errors.sway).all() and "sway" in str(back)


PATH = cf.well.WellPath.from_survey([0, 600, 1200, 2500], [0, 0, 50, 50], [0, 0, 120, 120])
HOLE = cf.well.Borehole(PATH, cf.well.HoleSection(2500, "8.5 in", 0.3))
STRING = cf.well.DrillString([cf.well.Collar(90, "NC46-65"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
MUD = cf.well.Mud("10 ppg")
OPERATION = PullRotating("20 klbf", "2 m/min", "40 rpm")
WELL = """use = ["extensions.pull_rotating"]

[well]
stations = [[0, 0, 0], [600, 0, 0], [1200, 50, 120], [2500, 50, 120]]
sections = [{ to = 2500, diameter = "8.5 in", friction = 0.3 }]

[string]
components = [
    { type = "Collar", size = "NC46-65", length = 90 },
    { type = "DrillPipe", size = "5 in 19.50 lb/ft" },
]

[mud]
density = "10 ppg"

[[operations]]
type = "PullRotating"
overpull = "20 klbf"
speed = "2 m/min"
rpm = 40

[torque_and_drag]
model = "soft"
"""


@pytest.mark.once
def test_an_operation():
    """The answer is that of `BackReam` with a weight on bit below zero."""
    answer = cf.well.torque_and_drag(HOLE, STRING, OPERATION, mud=MUD, model="soft")
    same = cf.well.BackReam(OPERATION.speed, OPERATION.rpm, weight=-OPERATION.overpull)
    expected = cf.well.torque_and_drag(HOLE, STRING, same, mud=MUD, model="soft")
    assert (answer.hook_load, answer.surface_torque) == (expected.hook_load, expected.surface_torque)
    assert OPERATION.overpull == 20 * cf.units.kip and OPERATION.name == "pull rotating"
    assert "pull rotating" in repr(answer) and "pull rotating" in str(answer)
    rate = answer.sensitivity("operation.torque", "surface_torque")
    assert rate.derivatives["operation.torque"] == pytest.approx(1.0)
    with pytest.raises(cf.SceneError, match=r"PullRotating.overpull = -1: expected a pull \(N\), positive"):
        PullRotating(-1, 0.1, 40)


@pytest.mark.once
def test_its_sweep_is_kept_and_drawn(tmp_path):
    """Another overpull is another sweep; the folder holds whole objects."""
    given = {"mud": MUD, "model": "soft", "folder": tmp_path / "sweep", "progress": False}
    first = cf.well.depth_sweep(HOLE, STRING, [OPERATION], [1000.0, 2500.0], **given)
    rows = given["folder"] / "rows.0.jsonl"
    lines = rows.read_bytes().splitlines(keepends=True)
    rows.write_bytes(b"".join(lines[:-1]))  # as a run that was ended leaves it
    again = cf.well.depth_sweep(HOLE, STRING, [OPERATION], [1000.0, 2500.0], **given)
    np.testing.assert_array_equal(again.hook_load, first.hook_load)
    assert rows.read_bytes() == b"".join(lines)
    with pytest.raises(cf.SceneError, match="holds another sweep"):
        cf.well.depth_sweep(HOLE, STRING, [PullRotating(1e5, 0.1, 40)], [1000.0, 2500.0], **given)
    figure = first.plot()
    assert any("pull rotating" in text.get_text() for axes in figure.axes for text in axes.get_legend().get_texts())


@pytest.mark.once
def test_its_scene_file(tmp_path):
    """The answer is that in Python; a scene that is written reads back equal; a wrong key is refused with its line."""
    file = tmp_path / "well.toml"
    file.write_text(WELL, encoding="utf-8")
    scene = cf.read(file)
    assert scene.operations == (OPERATION,)
    (answer,) = scene.run()
    expected = cf.well.torque_and_drag(HOLE, STRING, OPERATION, mud=MUD, model="soft")
    assert answer.hook_load == pytest.approx(expected.hook_load, rel=1e-12)
    data = json.loads(json.dumps(to_data(scene)))
    assert data["use"] == ["extensions.pull_rotating"] and to_data(from_data(type(scene), data)) == data
    file.write_text(WELL.replace("overpull", "overpul"), encoding="utf-8")
    with pytest.raises(cf.SceneError, match=r"line 18, column 1.*overpul.*did you mean 'overpull'"):
        cf.read(file)


TORSION, BOTH = "torsion", "axial and torsional"
COLLAR = cf.well.Collar(length=100.0, outer_diameter=0.165, inner_diameter=0.057)
PIPE = cf.well.DrillPipe(length=900.0, outer_diameter=0.127, inner_diameter=0.1086)
MOVING = cf.well.DrillString((COLLAR, PIPE))
BEND = cf.well.WellPath.from_survey([0, 200, 600, 1000], [0, 0, 40, 40], [0, 0, 0, 0], degrees=True)
BENT_HOLE = cf.well.Borehole(BEND, (cf.well.HoleSection(1000.0, 0.25, friction=0.3),))


def scene(law=None, *, weight=50e3, control=cf.drilling.Stiff(), inertia=0.0, **more):
    bit = None if law is None else cf.drilling.BitOnRock(law, weight=weight, inertia=20.0, mass=200.0)
    more |= {"mud": cf.well.Mud(1200.0)} if "hole" in more else {}
    return cf.drilling.Drilling(
        MOVING, cf.drilling.TopDrive(6.0, inertia, control), bit, drag=cf.drilling.ViscousDrag(0.2, 0.2), **more
    )


def same(one, other, rtol):
    """Rows of two motions, to a share of the largest value of each column."""
    one, other = (np.nan_to_num(x.rows) for x in (one, other))
    assert (np.abs(one - other) <= rtol * np.abs(other).max(axis=0)).all()


@dataclass(frozen=True)
class _Falling(BitLaw):
    """`Stribeck` once more, as a function."""

    law: BitLaw

    @property
    def needs_weight(self):
        return self.law.needs_weight

    def torque(self, speed, weight):
        return self.law.torque(speed, weight if self.needs_weight else None)


@dataclass(frozen=True)
class _Wall(FrictionLaw):
    """`WallFriction` once more, as a function."""

    law: FrictionLaw
    of_rotation: bool = False
    of_hole: bool = False

    def coefficient(self, slip):
        return self.law.coefficient(slip)


BIT_LAWS = [
    cf.drilling.Stribeck(6e3, 4e3, 2.0),
    cf.drilling.Stribeck(1.0, 0.7, 2.0, radius=0.1),
    cf.drilling.Stribeck(6e3, 4e3),
]


@pytest.mark.once
@pytest.mark.parametrize("law", BIT_LAWS)
@pytest.mark.parametrize("model", [TORSION, BOTH])
def test_a_bit_law_as_a_function(law, model):
    """It sticks, slips and follows the weight on bit as the law in closed form."""
    options = {"model": model, "progress": False} | ({"elements": 60} if model == BOTH else {})
    moves = {"hook": cf.drilling.Hook(stiffness=5e6, speed=-1e-3)} if model == BOTH else {}
    expected, found = (cf.drilling.simulate(scene(x, **moves), 6.0, **options) for x in (law, _Falling(law)))
    assert expected.bit_speed.max() > 6.0 and (expected.bit_speed[10:] == 0).any()
    same(found, expected, 1e-6)
    # Newton's method needs a few; what drops at once is halved in on
    assert law is BIT_LAWS[-1] or found.counts["iterations"] < 12 * len(found.rows)


@pytest.mark.once
def test_a_bit_law_as_a_function_starts_steadily_and_is_linearised():
    law = cf.drilling.Stribeck(1.0, 0.7, 2.0, radius=0.1)
    stiff = scene(_Falling(law))
    for model in (TORSION, BOTH):
        history = cf.drilling.simulate(replace(stiff, start="steady"), 0.5, model=model, progress=False)
        assert history.torque_on_bit == pytest.approx(law.torque(6.0, 50e3), rel=1e-3)
        assert np.ptp(history.bit_speed) < 0.01
    speeds, weights = [2.0, 6.0], [30e3, 60e3]
    expected, found = (cf.drilling.stability(x, speeds, weights, up_to=2.0) for x in (scene(law), stiff))
    np.testing.assert_allclose(found.roots, expected.roots, rtol=1e-6)
    expected, found = (
        (cf.drilling.limit_speed(x, up_to=2.0), cf.drilling.limit_weight(x, 3.0, up_to=2.0))
        for x in (scene(law), stiff)
    )
    assert found == pytest.approx(expected, rel=1e-5)


@pytest.mark.once
@pytest.mark.parametrize("model", [TORSION, BOTH])
def test_held_in_band(model):
    """With a narrow band it is the law that drops at once; with a wide one the bit needs more to leave it."""
    options = {"model": model, "progress": False} | ({"elements": 60} if model == BOTH else {})
    histories = {
        law: cf.drilling.simulate(scene(law), 8.0, **options)
        for law in (cf.drilling.Stribeck(6e3, 4e3), HeldInBand(6e3, 4e3, 1e-5), HeldInBand("6 kN m", "4 kN m", 0.5))
    }
    expected, narrow, wide = histories.values()
    np.testing.assert_allclose(narrow.bit_angle, expected.bit_angle, atol=0.1)
    assert narrow.bit_speed.max() == pytest.approx(expected.bit_speed.max(), rel=0.02)
    assert wide.torque_on_bit.max() == pytest.approx(6e3, rel=1e-9)  # all of it, while it moves within the band
    assert wide.bit_speed.max() == pytest.approx(expected.bit_speed.max(), rel=0.02)
    wide.plot()


@pytest.mark.once
def test_wall_friction_as_a_function():
    """Against rotation alone, and against axial and rotary slip together."""
    law = cf.drilling.WallFriction(0.3, 0.2, 0.05)
    turned = cf.drilling.WallFriction(1.0, 0.6, 1.0, of_rotation=True, of_hole=True)
    for ours, given in ((law, {}), (turned, {"of_rotation": True, "of_hole": True})):
        for model in (TORSION, BOTH):
            options = {"model": model, "dt": 0.01, "progress": False}
            more = {"hole": BENT_HOLE, "hook": cf.drilling.Hook(speed=-0.05) if model == BOTH else None}
            expected, found = (
                cf.drilling.simulate(scene(friction=x, **more), 4.0, **options) for x in (ours, _Wall(ours, **given))
            )
            assert np.abs(expected.lost_at_wall[-1]) > 1e3
            same(found, expected, 1e-5)


@pytest.mark.once
@pytest.mark.parametrize("model", [TORSION, BOTH])
def test_stribeck_curve(model):
    """It drags more at high speed than its kinetic friction alone, and takes as much as the ledger says."""
    curve = StribeckCurve(0.3, 0.2, "0.1 m/s", viscous=0.1)
    options = {"model": model, "dt": 0.01, "progress": False}
    film, bare = (
        cf.drilling.simulate(scene(friction=x, hole=BENT_HOLE), 8.0, **options)
        for x in (curve, replace(curve, viscous=0.0))
    )
    assert film.surface_torque[-200:].mean() > 1.02 * bare.surface_torque[-200:].mean()
    assert abs(film.balance[-1]) < 1e-3 * film.work_of_drive[-1]
    steady = cf.drilling.simulate(replace(scene(friction=curve, hole=BENT_HOLE), start="steady"), 1.0, **options)
    assert np.ptp(steady.surface_torque) < 1e-2 * steady.surface_torque.mean()


@pytest.mark.once
@pytest.mark.parametrize("model", [TORSION, BOTH])
def test_a_control_called_once_a_sample(model, tmp_path):
    """With short samples it is the PI control; a motion that is resumed has the same digits."""
    options = {"model": model, "dt": 1e-3, "progress": False}
    gains = {"Kp": 2000.0, "Ki": 1000.0}
    law = cf.drilling.Stribeck(3e3, 2e3, 2.0)
    ours = scene(law, control=LimitedSpeed(**gains, most=1e5, sample=2e-3), inertia=2000.0)
    theirs = scene(law, control=cf.drilling.PI(**gains), inertia=2000.0)
    whole, expected = (cf.drilling.simulate(x, 6.0, **options) for x in (ours, theirs))
    expected_speed = np.interp(whole.times, expected.times, expected.drive_speed)
    assert np.abs(whole.drive_speed - expected_speed).max() < 0.05
    limited = replace(ours, drive=replace(ours.drive, control=replace(ours.drive.control, most=1500.0)))
    assert cf.drilling.simulate(limited, 6.0, **options).surface_torque.max() < expected.surface_torque.max()
    cf.drilling.simulate(ours, 2.503, folder=tmp_path / "run", **options)
    resumed = cf.resume(tmp_path / "run", ours, duration=6.0, progress=False)
    np.testing.assert_array_equal(resumed.rows, whole.rows)


DRIVE = """
use = ["extensions.held_in_band", "extensions.sampled_speed", "extensions.stribeck_wall"]

[well]
stations = [[0, 0, 0], [200, 0, 0], [600, 40, 0], [1000, 40, 0]]
sections = [{ to = 1000.0, diameter = 0.25, friction = 0.3 }]

[string]
components = [
    { type = "Collar", length = 100.0, outer_diameter = 0.165, inner_diameter = 0.057 },
    { type = "DrillPipe", outer_diameter = 0.127, inner_diameter = 0.1086 },
]

[mud]
density = 1200.0

[drive]
speed = "60 rpm"
inertia = 2000.0
control = { type = "LimitedSpeed", Kp = 2e3, Ki = 1e3, most = "20 kN m" }

[bit]
weight = "50 kN"
law = { type = "HeldInBand", static = "3 kN m", dynamic = "2 kN m" }

[wall_friction]
type = "StribeckCurve"
static = 0.3
kinetic = 0.2
speed = "0.1 m/s"

[simulate]
duration = 1.0
"""


def test_all_three_in_a_scene_file_stored_and_resumed(tmp_path):
    """Another process, which has not imported them, goes on from the folder to the same digits."""
    (tmp_path / "rig.toml").write_text(DRIVE)
    found = cf.read(tmp_path / "rig.toml")
    assert found.scene.bit.law == HeldInBand(3e3, 2e3) and found.scene.friction == StribeckCurve(0.3, 0.2, 0.1)
    assert found.scene.drive.control == LimitedSpeed(2e3, 1e3, 2e4)
    found.run(folder=tmp_path / "run", duration=0.5, progress=False).plot(tmp_path / "run.png")
    code = f"import cosserat_fenicsx as cf; cf.resume({str(tmp_path / 'run')!r}, duration=1.0, progress=False)"
    path = [str(Path(__file__).parent), *sys.path]
    subprocess.run([sys.executable, "-c", f"import sys; sys.path[:0] = {path!r}; {code}"], check=True)
    resumed, whole = cf.resume(tmp_path / "run"), found.run(profile_every=0.5 / 400, progress=False)
    np.testing.assert_array_equal(resumed.rows, whole.rows)
    for name, wrong, words in (
        ("HeldInBand", "HeldInBan", "'HeldInBan': did you mean 'HeldInBand'"),
        ('"2 kN m"', '"2 kN"', "HeldInBand.dynamic = '2 kN': .*N m"),
        ('"3 kN m"', '"1 kN m"', "line 24, column 30: .*HeldInBand.static = 1000.0: expected at least the dynamic"),
    ):
        (tmp_path / "wrong.toml").write_text(DRIVE.replace(name, wrong))
        with pytest.raises(cf.SceneError, match=words):
            cf.read(tmp_path / "wrong.toml")


@pytest.mark.once
def test_a_control_called_once_a_sample_in_the_linear_theory():
    """It stands for its gains, where it has some."""
    control = LimitedSpeed(2000.0, 1000.0, most=1e5)
    law = cf.drilling.Stribeck(6e3, 4e3, 2.0)
    ours, theirs = (scene(law, control=x, inertia=2000.0) for x in (control, cf.drilling.PI(2000.0, 1000.0)))
    ours = replace(ours, drive=replace(ours.drive, control=replace(control, sample=1e-6)))  # late by nothing
    roots = (cf.drilling.stability(x, [6.0], up_to=1.0).roots for x in (ours, theirs))
    np.testing.assert_allclose(*roots, rtol=1e-5)

    @dataclass(frozen=True)
    class Blind(SampledControl):
        def torque(self, state, now):
            return 1e3, state

    blind = cf.drilling.TopDrive(6.0, 2000.0, Blind())
    with pytest.raises(cf.SceneError, match="acts in drilling.simulate, unless Blind has gains"):
        cf.drilling.stability(replace(ours, drive=blind), [6.0])


@pytest.mark.once
@pytest.mark.parametrize(("torque", "words"), [
    (lambda speed, weight: -speed, "torque = -1e-06: expected a number, not negative, at the speed 1e-06"),
    (lambda speed, weight: speed * weight, "torque = nan: expected a number, not negative"),
    (lambda speed, weight: 1 / 0, "torque raised ZeroDivisionError .* at the speed 0"),
    (lambda speed, weight: 1e3 * (speed > 0), "torque = 0 at the speed 0: expected the largest value at rest"),
])  # fmt: skip
def test_laws_that_fail_are_refused_in_words(torque, words):
    Law = dataclass(frozen=True)(type("_Law", (BitLaw,), {"torque": lambda self, *given: torque(*given)}))
    for model in (TORSION, BOTH):
        with pytest.raises(cf.SceneError, match=words):
            cf.drilling.simulate(scene(Law()), 1.0, model=model)
    with pytest.raises(cf.SceneError, match="expected a WallFriction, of which the rod's wall"):
        cf.drilling.mixed_scene(scene(friction=StribeckCurve(0.3, 0.2, 0.1), hole=BENT_HOLE), 900.0)


@pytest.mark.once
def test_a_law_with_an_array():
    """It cannot be hashed, and is sampled anew."""

    @dataclass(frozen=True, eq=False)
    class Table(BitLaw):
        values: np.ndarray
        __hash__ = None

        def torque(self, speed, weight):
            return np.interp(speed, *self.values)

    law, same_law = Table(np.array([[0.0, 2.0, 50.0], [6e3, 4e3, 4e3]])), cf.drilling.Stribeck(6e3, 4e3)
    history = cf.drilling.simulate(scene(law), 6.0, progress=False)
    assert history.torque_on_bit.max() == pytest.approx(same_law.static, rel=1e-3) and history.bit_speed.max() > 6.0


@pytest.mark.once
def test_a_law_that_fails_during_the_motion():
    @dataclass(frozen=True)
    class Fails(BitLaw):
        needs_weight = True

        def torque(self, speed, weight):
            return 4e3 if weight == 50e3 else 1 / 0

    with pytest.raises(cf.SceneError, match="Fails.torque raised ZeroDivisionError"):
        cf.drilling.simulate(scene(Fails(), hook=cf.drilling.Hook(5e6, -1e-3)), 2.0, model=BOTH, progress=False)


@pytest.mark.once
def test_controls_that_fail_are_refused_in_words():
    @dataclass(frozen=True)
    class Changing(SampledControl):
        def torque(self, state, now):
            return 1e3, (now.time,)

    with pytest.raises(cf.SceneError, match=r"Changing.torque = .*expected a state of 0 numbers at t = 0 s"):
        cf.drilling.simulate(scene(control=Changing(), inertia=2000.0), 1.0)
    with pytest.raises(cf.SceneError, match="expected the drive's own .* for a sampled control"):
        scene(control=Changing())
