"""What all results offer: quantities with units, files, charts, tables that fit a screen."""

import csv
import json
import re

import numpy as np
import pytest
from conftest import column, refused
from moving_scenes import SPAGHETTI
from reference_strings import pipe_and_collars

import cosserat_fenicsx as cf
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.results.screen import LINES, ROWS, SHORT, WIDTH
from cosserat_fenicsx.results.whirl import whirl_of
from cosserat_fenicsx.scene.action import actions_in_words

pytestmark = pytest.mark.serial
WELL = cf.well.WellPath.from_survey([0, 500, 1500, 2500], [0, 0, 60, 85], [0, 0, 0, 0])
HOLE = cf.well.Borehole(WELL, [cf.well.HoleSection(2500.0, 0.2159, 0.25)])
STRING = cf.well.DrillString(
    [cf.well.Bit(0.2159), cf.well.Collar(90.0, "NC46-65"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")]
)


def path():
    _, scene = column()
    return cf.solve(scene, np.linspace(0.1, 1.2, 40).tolist(), elements=2)


def history():
    rod = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), SPAGHETTI, name="rod")
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, 2.0))])
    return cf.simulate(scene, 0.1, dt=0.005, elements=2, degree=2)


def sweep():
    operations = [cf.well.TripOut(), cf.well.TripIn(), cf.well.RotateOffBottom()]
    return cf.well.depth_sweep(
        HOLE, STRING, operations, np.linspace(500, 2500, 20), mud=cf.well.Mud(1200.0), model="soft"
    )


def answer():
    return cf.well.torque_and_drag(HOLE, STRING, cf.well.TripOut(), mud=cf.well.Mud(1200.0), model="soft")


def orbit():
    """A section that rolls backward, clearance 22 mm, from 1 s on in contact."""
    times = np.linspace(0, 4, 401)
    z = 0.02 * np.exp(-40j * times)
    plane = [np.column_stack([x.real, x.imag]) for x in (z, -40j * z)]
    full = np.ones(len(times))
    return cf.drilling.Orbit(times, *plane, 0.022 * full, 10.0 * full, 0.085, np.where(times > 1, 2e3, 0.0))


#: A result of each class; and the name and the unit of one of its quantities, in field units too.
RESULTS = {
    "Path": (path, "load_factor", "1", "1"),
    "History": (history, "kinetic_energy", "J", "ft-lbf"),
    "Modes": (lambda: cf.modes(column()[1], 3), "frequency", "Hz", "Hz"),
    "ModesAlong": (lambda: cf.solve(column()[1], np.linspace(0.1, 0.6, 6).tolist(), elements=2).modes(2),
                   "lowest_frequency", "Hz", "Hz"),
    "Buckling": (lambda: cf.buckling(column()[1], 2), "critical_load_factor", "1", "1"),
    "TorqueAndDrag": (answer, "tension", "N", "klbf"),
    "DepthSweep": (sweep, "depth", "m", "ft"),
    "DrillingHistory": (lambda: cf.drilling.simulate(pipe_and_collars("PI_stiff"), 5.0), "bit_speed", "rad/s", "rpm"),
    "Stability": (lambda: cf.drilling.stability(pipe_and_collars("PI_stiff"), [9.0], up_to=2.0), "growth", "1/s",
                  "1/s"),
    "Campbell": (lambda: cf.drilling.campbell(pipe_and_collars(), 20.0, up_to=4.0), "critical_speed", "rad/s", "rpm"),
    "Orbit": (orbit, "spin", "rad/s", "rpm"),
    "Whirl": (lambda: whirl_of(orbit()), "largest", "m", "in"),
    "Study": (lambda: cf.study(lambda force: {"work": 2.0 * force}, {"force": range(60)}), "work", "1", "1"),
}  # fmt: skip


@pytest.fixture(scope="module")
def results():
    return {}


@pytest.fixture(params=RESULTS)
def found(request, results):
    """A result, computed once, with its class and the quantity."""
    make, *quantity = RESULTS[request.param]
    if request.param not in results:
        results[request.param] = make()
    return results[request.param], request.param, *quantity


def test_quantities_and_units(found):
    result, kind, name, unit, field = found
    quantity = result.quantities[name]
    assert quantity.unit == unit and Units("field").of(quantity)[0] == field and len(quantity.axes) == 1
    assert all(x.name == key and isinstance(x.axes, tuple) for key, x in result.quantities.items())
    listed = repr(result.quantities).splitlines()
    assert [line.split()[0] for line in listed] == list(result.quantities) and quantity.heading() in "".join(listed)
    factor = Units("field").of(quantity)[1]
    np.testing.assert_allclose(result.value(name, "field") * factor, result.value(name), rtol=1e-14)


def test_print_fits_a_screen(found):
    result, kind, *_ = found
    for text in (str(result), result.summary("field"), result.summary({"length": "km", "N": "kN"})):
        lines = text.splitlines()
        assert len(lines) <= LINES and max(map(len, lines)) <= WIDTH, text
        assert "e-1" not in text.replace("e-10", "") or kind in ("Path", "History", "DepthSweep"), text
    assert len(result.details().splitlines()) >= 10 and "mN m" not in str(result)


def test_dicts_frames_and_files(found, tmp_path):
    result, kind, name, unit, field = found
    told = result.to_dict("field")
    assert json.loads(json.dumps(told, default=lambda x: x.tolist()))["kind"] == kind
    assert told["units"][name] == field and result.to_dict()["units"][name] == unit
    np.testing.assert_array_equal(told[name], result.value(name, "field"))
    heading = result.quantities[name].heading(field)
    frame = pytest.importorskip("pandas") and result.to_dataframe(units="field")
    assert frame[heading].tolist() == told[name].tolist()
    result.write(tmp_path / "out.csv", units="field")
    with (tmp_path / "out.csv").open(newline="") as stream:
        assert [float(row[heading]) for row in csv.DictReader(stream)] == told[name].tolist()
    pytest.importorskip("xarray")
    data = result.to_xarray("field")
    assert data[name].attrs["units"] == field and data[name].values.ravel().tolist() == told[name].tolist()
    assert "<table>" in result._repr_html_()


def test_charts(found, tmp_path):
    pytest.importorskip("matplotlib")
    result, kind, name, _, field = found
    figure = result.plot_quantity(name, units="field")
    assert figure.axes[0].get_ylabel() == result.quantities[name].heading(Units("field").on_screen(
        result.quantities[name], result.value(name))[0])  # fmt: skip
    result.plot_quantity(name, tmp_path / "chart.png", width=400)
    assert (tmp_path / "chart.png").stat().st_size > 3000
    with pytest.raises(cf.SceneError, match="plot_quantity.'nothing'.: expected one of "):
        result.plot_quantity("nothing")


def test_saved_and_read(found, tmp_path):
    """Paths and motions come back whole; of others the quantities do, with tables and charts."""
    result, kind, name, *_ = found
    file = tmp_path / "result.h5"
    result.save(file)
    if kind in ("Path", "History"):
        also = (cf.read_path if kind == "Path" else cf.read_history)(file)
        again = cf.read_result(file)
        assert type(again) is type(result) and again.why == result.why
        for one in (result, also):
            np.testing.assert_array_equal(again.force(again.rod().end), one.force(one.rod().end))
            np.testing.assert_array_equal(again.position(again.rod().at(1.0)), one.position(one.rod().at(1.0)))
        if kind == "Path":
            assert again.conservative == result.conservative
    else:
        again = cf.read_result(file)
        assert again.kind == kind and str(again).splitlines()[0] == str(result).splitlines()[0]
        assert again.about.keys() == result._about().keys() and set(again.quantities) == set(again.to_dict()["units"])
    data = file.read_bytes()
    (tmp_path / "cut.h5").write_bytes(data[: len(data) // 2])
    with pytest.raises(cf.SceneError, match="cut.h5"):
        cf.read_result(tmp_path / "cut.h5")
    np.testing.assert_array_equal(again.value(name), result.value(name))
    assert again.plot_quantity(name) is not None


def test_empty_results_are_refused():
    path = cf.solve(column()[1], [0.5], elements=2)
    with pytest.raises(cf.SceneError, match="plot_quantity.'error'.: this result does not know it: expected one of "):
        path.plot_quantity("error")
    empty = path.at_points([])
    for method in ("to_dataframe", "to_xarray"):
        with pytest.raises(cf.SceneError, match=f"{method}: expected a result with at least one load factor"):
            getattr(empty, method)()
    with pytest.raises(cf.SceneError, match="save: expected"):
        empty.save("nothing.h5")
    assert str(empty) == "No point of the path was computed." and str(empty) in empty.details()


def test_whirl_has_the_chart_of_its_orbit():
    pytest.importorskip("matplotlib")
    found = whirl_of(orbit())
    assert [axes.get_ylabel().replace("\n", " ") for axes in found.plot(units="field").axes[::2]] == [
        "distance from the axis of the hole (in)", "normal force of the wall on a node (klbf)"
    ]  # fmt: skip
    assert len(found.orbit.plot().axes) == 2
    assert "backward whirl at -40 rad/s (-382 rpm)" in str(found) and "2 to 2 kN, mean 2 kN" in str(found)
    assert "0.7874 in in the mean" in found.summary("field") and found.value("force").tolist() == [[2e3] * 3]


STIFF = cf.Stiffness((1e4, 1e4), 1e4, (10.0, 20.0), 5.0)


def arm():
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), STIFF, name="arm")
    return cf.Scene([rod], [cf.Clamp("arm.start")], [cf.Force("arm.end", (0, 0, -1.0))])


def rows_of(path):
    return re.findall(r"^[│|] *([\d.]+) [│|]", path.details(), flags=re.M)


def test_a_long_table_leaves_out_its_middle():
    path = cf.solve(arm(), [(k + 1) / 60 for k in range(60)], elements=1, degree=2)
    path.events = [cf.Event("limit", 0.5, None, after=29)]
    rows = [row for row in rows_of(path) if row.strip(".")]
    assert len(rows) == ROWS + 2 and {"0.5", "0.516667"} < set(rows) and (rows[0], rows[-1]) == ("0.0166667", "1")
    table = path.details()
    assert table.count("...") == 2 * 8  # two gaps, in every column
    assert "42 of 60 points: path.csv has all (-o DIR; path.write('path.csv') in Python)." in table
    short = path[:ROWS]
    assert len(rows_of(short)) == ROWS and "points: path.csv" not in short.details()


def test_prescribed_motions_are_told_with_the_loads():
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), STIFF, name="arm")
    scene = cf.Scene([rod], [cf.Clamp("arm.start"), cf.Prescribed("arm.end", displacement=(0, 0, 0.1))])
    assert actions_in_words(scene) == "Prescribed motions, times the load factor: Prescribed at arm.end."


SCENE = """
[[rods]]
name = "arm"
curve = { type = "Line", start = [0, 0, 0], end = [1, 0, 0] }
section = { type = "Stiffness", shear = [1e4, 1e4], axial = 1e4, bending = [10, 20], torsion = 5, GIVEN }
"""


def test_an_offset_in_a_scene_file(tmp_path):
    file = tmp_path / "arm.toml"
    file.write_text(SCENE.replace("GIVEN", "centroid = [0.01, 0], angle = 0.2, mass = 3.0"))
    (rod,) = cf.read(file).scene.rods
    assert rod.section == cf.Stiffness.offset((1e4, 1e4), 1e4, (10, 20), 5, centroid=(0.01, 0), angle=0.2, mass=3.0)
    for left_out, given, words in (
        ("", "centre = [0.01, 0], angle = 0.2", "unknown key 'centre', did you mean 'centroid'?"),
        ("", "centroid = 0.1", "rods[0].section: Stiffness.offset.centroid = 0.1: expected 2 finite numbers (m)"),
        (" torsion = 5,", "angle = 0.1", "'torsion' is missing"),
    ):
        file.write_text(SCENE.replace("GIVEN", given).replace(left_out or "\0", ""))
        with refused(words):
            cf.read(file)


SECTION = cf.Stiffness(shear=(1e6, 1e6), axial=1e6, bending=(100.0, 100.0), torsion=80.0)


def test_the_largest_moment_is_found_beyond_a_jump_and_between_nodes():
    """A rod that is clamped inside; a beam under a line load and an end moment, by textbook."""
    rod = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), SECTION, name="rod")
    held = cf.Scene([rod], [cf.Clamp(rod.at(3))], [cf.Force(rod.end, (0, 0, 0.01))])
    found = cf.solve(held, [1.0]).largest()["bending moment"]
    assert found.size == pytest.approx(0.07, rel=1e-4) and found.station.s == pytest.approx(3)
    q, M, L = 1e-3, 4e-3, 10.0
    loads = [cf.LineForce(rod, (0, 0, -q)), cf.Moment(rod.start, (0, M, 0))]
    beam = cf.Scene([rod], [cf.Hinge(rod.start, (0, 1, 0)), cf.Roller(rod.end, (0, 0, 1))], loads)
    path = cf.solve(beam, [-1.0, 0.5], elements=2, model="planar")
    found = path.largest()["bending moment"]
    place = L / 2 - M / (q * L)
    assert found.size == pytest.approx(q * place * (L - place) / 2 + M * (1 - place / L), rel=1e-3)
    assert found.station.s == pytest.approx(place, abs=0.2) and found.point == 0
    pulled = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (2.0, 0, 0))])
    largest = cf.solve(pulled, [1.0]).largest()  # what is zero is left out
    assert set(largest) == {"tension"} and largest["tension"].size == pytest.approx(2.0)


def test_tables_break_headings_at_words_and_never_numbers(found):
    result, kind, *_ = found
    for units, rows, text in (("SI", SHORT, str(result)), ("field", SHORT, result.summary("field")),
                              ("field", ROWS, result.details("field"))):  # fmt: skip
        lines = [re.split(" *[│┃] *", line)[1:-1] for line in text.splitlines() if line[:1] in ("│", "┃")]
        heads = {word for line in text.splitlines() if line[:1] == "┃" for word in re.findall(r"[^┃\s]+", line)}
        columns = result._table(Units(units), rows).columns
        assert heads and heads <= {word for column in columns for word in column.header.split()}
        assert all(cell for line in lines[-len(columns[0]._cells) // 2 :] for cell in line), text
    if kind == "TorqueAndDrag":
        assert "torque" not in heads and "tension" in heads  # of a trip: zero
