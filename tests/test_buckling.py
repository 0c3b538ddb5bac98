"""Linear buckling against closed forms and against the bifurcations that it estimates."""

import math
import pathlib
import re
import time

import numpy as np
import pytest
from path_scenes import clamped_ring, shallow_arch

import cosserat_fenicsx as cf

STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)


def sheared(euler, GA):
    """The critical load P of a column that is not shortened: P (1 + P/GA) = P_Euler."""
    return GA / 2 * (np.sqrt(1 + 4 * euler / GA) - 1)


@pytest.mark.parametrize("EA, GA", [(np.inf, 20.0), (1e3, 400.0), (20.0, 20.0)])
def test_shear_counts(EA, GA):
    """Against P (1 + P/GA) = P_Euler. For infinite EA `solve` finds the same events;
    from a prestressed state the estimate comes closer to its events."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((GA, GA), EA, (1.0, 2.0), 1.0))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -1.0))])
    found = cf.buckling(scene, tol=1e-6)
    assert found.load_factors == pytest.approx([sheared(np.pi**2 / 4, GA)], rel=1e-6)
    (event,) = cf.solve(scene, (0.0, 3.0), model="spatial").events
    shortened = 1 / GA - 1 / EA  # P (1 - P/EA + P/GA) = P_Euler
    exact = np.pi**2 / 4 if abs(shortened) < 1e-12 else sheared(np.pi**2 / 4, 1 / shortened)
    assert event.load_factor == pytest.approx(exact, rel=1e-7)
    near = cf.buckling(scene, load_factor=0.95 * exact).load_factors[0]
    assert abs(near - exact) <= max(0.2 * abs(found.load_factors[0] - exact), 1e-6)


def test_the_error_bar_holds_what_both_meshes_have_in_common():
    """Infinite stiffnesses are bounded: a propped column, (4.4934)^2 and twice that, at two tolerances."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((np.inf, np.inf), np.inf, (1.0, 2.0), 1.0))
    guide = [cf.Roller(rod.end, (1, 0, 0)), cf.Roller(rod.end, (0, 1, 0))]
    scene = cf.Scene([rod], [cf.Clamp(rod.start), *guide], [cf.Force(rod.end, (0, 0, -1.0))])
    found = cf.buckling(scene, 2)
    off = np.abs(found.load_factors / (4.493409457909064**2 * np.array([1, 2])) - 1)
    assert (off <= found.error).all() and (found.error < 1e-6).all()
    with pytest.raises(cf.NotConverged, match="bounds the stiffnesses"):
        cf.buckling(scene, 2, tol=1e-7)


@pytest.mark.parametrize("section", [cf.Circle(0.2), cf.Rectangle(0.2, 0.25)])
def test_euler_columns(section):
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), section, STEEL)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -cf.euler_load(rod)))])
    found = cf.buckling(scene, 4)
    ratio = max(rod.stiffness.bending) / min(rod.stiffness.bending)
    euler = np.array([1, ratio, 9, 9 * ratio])
    expected = sheared(euler, rod.stiffness.shear[0] / cf.euler_load(rod))
    np.testing.assert_allclose(found.load_factors, expected, rtol=1e-6)
    assert abs(found.load_factors / euler - 1).max() > 2e-5, "shear shows"
    assert (found.error <= 1e-5).all()
    s = np.linspace(0, 1, 4 * found.elements[0] + 1)[::4]  # element ends
    for k, axis in ((0, 0), (1, 1)):
        mode = found.mode(k, rod)[::4]
        np.testing.assert_allclose(mode[:, axis], 1 - np.cos(np.pi / 2 * s), atol=1e-4)
        np.testing.assert_allclose(np.delete(mode, axis, 1), 0, atol=1e-6)


def test_from_a_prestressed_state_it_nears_the_bifurcation():
    for out_of_plane, far in ((50.0, 3.0), (1.0, 1.0)):
        _, scene = clamped_ring(out_of_plane)
        (event, *_) = cf.solve(scene, (0.0, far), elements=16).events
        errors = []
        for share in (0.0, 0.5, 0.9, 0.99):
            found = cf.buckling(scene, load_factor=share * event.load_factor, elements=16)
            errors.append(abs(found.load_factors[0] / event.load_factor - 1))
        assert errors == sorted(errors, reverse=True) and errors[-1] < 5e-3 < errors[0]


@pytest.mark.parametrize("stiff", [dict(shear=(1e6, 1e6), axial=1e6), dict(shear=(np.inf, np.inf), axial=np.inf)])
def test_lateral_buckling(stiff):
    """P L^2/sqrt(EI GJ) = 4.0126 (Timoshenko & Gere), for either direction of the load."""
    section = cf.Stiffness(bending=(1e4, 1.0), torsion=0.7, **stiff)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section)
    for sign in (1, -1):
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, sign * np.sqrt(0.7), 0))])
        assert cf.buckling(scene).load_factors == pytest.approx([4.012599], rel=5e-4)


def test_self_weight():
    """q L^3/EI = 7.8373474 (Greenhill)."""
    section = cf.Stiffness(shear=(1e7, 1e7), axial=1e7, bending=(1.0, 1.5), torsion=0.5, mass=1 / 9.81)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section)
    found = cf.buckling(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Weight()]), 2)
    np.testing.assert_allclose(found.load_factors, [7.8373474, 1.5 * 7.8373474], rtol=1e-5)


def test_supports_by_equations():
    """Euler's pinned column, and the propped one, (4.4934)^2 EI/L^2, held by a hinge and rollers."""
    section = cf.Stiffness((1e6, 1e6), 1e6, (1.0, 4.0), 1.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0), d1=(1, 0, 0)), section)
    axis = (1, 0, 0)  # bending about d1 = x is the weak one
    guide = [cf.Roller(rod.end, (0, 1, 0)), cf.Roller(rod.end, (1, 0, 0))]
    load = [cf.Force(rod.end, (0, 0, -1.0))]
    for foot, exact in ((cf.Hinge(rod.start, axis), np.pi**2), (cf.Clamp(rod.start), 4.493409458**2)):
        found = cf.buckling(cf.Scene([rod], [foot, *guide], load))
        assert found.load_factors == pytest.approx([exact], rel=1e-4)


def test_what_pulls_does_not_buckle():
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Circle(0.02), STEEL)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, 1.0))])
    found = cf.buckling(scene, 3, elements=4)
    assert len(found.load_factors) == 0 and found.modes.shape[0] == 0


def test_refusals():
    _, _, scene = shallow_arch()
    for arguments, message in ((dict(count=0), "count = 0"), (dict(load_factor=np.inf), "buckling.load_factor = inf")):
        with pytest.raises(cf.SceneError, match=message):
            cf.buckling(scene, **arguments)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), STEEL)
    column = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -cf.euler_load(rod)))])
    with pytest.raises(cf.NotConverged, match="unstable at the load factor 1.5"):
        cf.buckling(column, load_factor=1.5)


@pytest.mark.serial
@pytest.mark.parametrize("axial", [1e3, 10.0])
def test_a_weak_rod_without_force_hides_no_critical_load(axial):
    """A weak rod at the top of a column, whose own EA is below the load."""

    def section(EA, EI):
        return cf.Stiffness((EA, EA), EA, (EI, EI), EI)

    column = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section(1e9, 1e3))
    weak = cf.Rod(cf.Line((0, 0, 1.0), (1.0, 0, 1.0)), section(axial, 1e-4 * axial))
    joint = cf.Joint(column.end, weak.start, release="all")
    supports, load = [cf.Clamp(column.start), cf.Clamp(weak.end)], cf.Force(column.end, (0, 0, -1000.0))
    found = cf.buckling(cf.Scene([column, weak], supports, [load], joints=[joint]), 2)
    assert found.load_factors[0] == pytest.approx(np.pi**2 / 4, rel=1e-4) and found.bound == found.load_factors[0]


@pytest.mark.serial
def test_critical_loads_of_slender_frames_scatter_little():
    """Their difference quotients are taken over a share of the critical load, not over a step so small that rounding
    shows."""
    steel = cf.Material(E=210e9, nu=0.3, density=7850.0)
    upright = cf.Rod(cf.Line((0, 0, 0), (0, 0, 3.0)), cf.Circle(0.01), steel)
    level = cf.Rod(cf.Line((0, 0, 3.0), (3.0, 0, 3.0)), cf.Circle(0.01), steel)
    scene = cf.Scene(
        [upright, level], [cf.Clamp(upright.start), cf.Pin(level.end)],
        [cf.Force(upright.end, (0, 0, -1.0))], joints=[cf.Joint(upright.end, level.start)],
    )  # fmt: skip
    found = np.array([cf.buckling(scene, 1, elements=n).load_factors[0] for n in (8, 10, 12, 16, 24)])
    assert np.ptp(found) < 1e-6 * found.mean()


@pytest.mark.parametrize("held", ["clamped", "hinged"])
def test_rounding_of_slender_columns_is_small_and_told(held):
    """L/d from 10^2 to 10^5 against Engesser's load with EA and GA, to first order in P/EA; EA L^2/EI is 10^11."""
    for slender in (1e2, 1e4, 1e5):
        EA = 16 * slender**2
        section = cf.Stiffness((EA / 2.6,) * 2, EA, (1.0, 1.0), 1 / 1.3)
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section)
        guide = [cf.Hinge(rod.start, (1, 0, 0)), cf.Roller(rod.end, (1, 0, 0)), cf.Roller(rod.end, (0, 1, 0))]
        supports, euler = (guide, np.pi**2) if held == "hinged" else ([cf.Clamp(rod.start)], np.pi**2 / 4)
        found = cf.buckling(cf.Scene([rod], supports, [cf.Force(rod.end, (0, 0, -1.0))]))
        x = 4 * euler / (EA / 2.6)
        off = abs(found.load_factors[0] / (euler * 2 / (1 + np.sqrt(1 + x))) - 1)
        assert off < 1e-9 and 0.8 * off <= found.error[0] < 2e-8, (slender, off, found.error)


def test_rounding_of_a_slender_column_at_a_spring_or_under_load():
    """A spring at the top, which acts in full at the load factor 0: tan a = a - a^3/k with P = a^2, again without shear
    at L/d = 10^5. About a loaded state contact forces are rounded by eps EA: that is told, or refused; P + P^2/GA =
    P_Euler + P_0^2/EA, since the extrapolated n and r' are those of the state with P_0."""
    k, a = 5.0, 2.5
    for _ in range(50):  # Newton's method
        a -= (math.tan(a) - a + a**3 / k) / (math.tan(a) ** 2 + 3 * a**2 / k)
    for slender, share in ((1e5, 0.0), (1e3, 0.9), (1e5, 0.9)):
        EA = 16 * slender**2
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((EA / 2.6,) * 2, EA, (1.0, 1.0), 1 / 1.3))
        loads = [cf.Force(rod.end, (0, 0, -1.0)), *([] if share else [cf.Spring(rod.end, k)])]
        euler = np.pi**2 / 4 if share else a * a
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], loads)
        try:
            found = cf.buckling(scene, load_factor=share * euler)
        except cf.NotConverged as refused:
            assert share and slender > 1e4 and "accuracy" in str(refused)
            continue
        P = euler + (share * euler) ** 2 / EA
        off = abs(found.load_factors[0] / (P * 2 / (1 + np.sqrt(1 + 4 * P / (EA / 2.6)))) - 1)
        assert off < (1e-5 if slender > 1e4 else 5e-8) and 0.8 * off <= found.error[0] <= 1e-5, (slender, off)


@pytest.mark.serial
@pytest.mark.parametrize("share, length, foot", [(1e-2, 1.0, "clamp"), (1e-3, 5.0, "hinge"), (1e-4, 5.0, "clamp")])
def test_a_thin_arm_beside_a_thick_column(share, length, foot):
    """A column with a joined arm whose bending stiffness is 10^-8 to 10^-16 of its own, longer than it or not, and
    first in the scene: the arm changes nothing, the units of the longest rod neither."""
    column = cf.Rod(cf.Line((0, 0, 0), (0, 0, 3.0)), cf.Circle(0.1), STEEL, name="column")
    arm = cf.Rod(cf.Line((0, 0, 3.0), (length, 0, 3.0)), cf.Circle(0.1 * share), STEEL, name="arm")
    supports = [cf.Clamp(column.start)]
    if foot == "hinge":  # free to bend out of the plane x-z, as if clamped
        supports = [cf.Hinge(column.start, (0, 1, 0)), cf.Roller(column.end, (1, 0, 0))]
    load, joint = cf.Force(column.end, (0, 0, -cf.euler_load(column))), cf.Joint(column.end, arm.start)
    found = cf.buckling(cf.Scene([arm, column], supports, [load], [joint]))
    alone = cf.buckling(cf.Scene([column], supports, [load]))
    np.testing.assert_allclose(found.load_factors, alone.load_factors, rtol=1e-7)


@pytest.mark.serial
def test_a_taut_line_has_no_critical_load(tmp_path):
    """The scene of docs/first_steps.md: two meshes and the words, not the largest mesh and a refusal."""
    text = pathlib.Path(__file__).parents[1].joinpath("docs", "first_steps.md").read_text()
    file = tmp_path / "line.toml"
    file.write_text(re.search(r"```toml\n(.*?)```", text, re.DOTALL)[1])
    scene = cf.read(file).scene
    found = cf.buckling(scene, 3)
    assert len(found) == 0 and "no critical load factor up to 18.84, where linear" in repr(found)
    before = time.process_time()
    cf.buckling(scene, 3)  # compiled by now
    assert time.process_time() - before < 2.0
