"""Frequency response, friction at the wall in small motions, damping of strings, high-frequency oscillations."""

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx import drilling, well
from cosserat_fenicsx.cli.main import main
from cosserat_fenicsx.drilling.linear.excitation import equivalent_slope

pytestmark = [pytest.mark.serial, pytest.mark.once]
TRUTHS = json.loads((Path(__file__).parent / "reference" / "string_response.json").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Falling(drilling.BitLaw):
    """A torque that falls evenly with the speed, N m s/rad."""

    slope: float

    def torque(self, speed, weight):
        return 5e3 + self.slope * min(speed, 20.0)


def part(
    length,
    GJ=941162.1464157262,
    rhoJ=0.09324815246769404,
    EA=701023457.1261743,
    rhoA=26.71375795359451,
    radius=0.08,
    **more,
):
    stiffness = cf.Stiffness(shear=(1e9, 1e9), axial=EA, bending=(1e6, 1e6), torsion=GJ, mass=rhoA,
                             inertia=(rhoJ / 2, rhoJ / 2, rhoJ))  # fmt: skip
    return well.Component(length, stiffness, 150.0, radius, **more)


def three_sections(slope=-100.0, **more):
    given = TRUTHS["frequency response of three sections, torsion"]["input"]
    string = well.DrillString([part(*row[:3]) for row in given["parts"]], order="top down")
    drive = drilling.TopDrive(6.0, given["I"], drilling.PI(given["Kp"], given["Ki"]))
    bit = drilling.BitOnRock(Falling(slope), inertia=given["Ib"])
    return drilling.Drilling(string, drive, bit, drag=drilling.ViscousDrag(torsion=given["parts"][0][3]), **more)


def lying(length=3000.0, turns=6.0, hook=None, friction=None, **more):
    """A pipe that lies in a horizontal hole, pressed on its wall by 150 N/m."""
    path = well.WellPath.from_survey([0, length], [90, 90], [0, 0], degrees=True)
    hole = well.Borehole(path, well.HoleSection(length, 0.2159, 0.25))
    friction = friction or drilling.WallFriction(0.3, 0.2, 0.3)
    string = well.DrillString([part(length)])
    return drilling.Drilling(string, drilling.TopDrive(turns), hole=hole, hook=hook, friction=friction, **more)


def of_response(name):
    given = TRUTHS["frequency response of three sections, torsion"]
    r = drilling.frequency_response(three_sections(), given["input"]["frequencies_Hz"])
    answers = {f"{x} per torque on bit": x for x in ("drive speed", "bit speed", "surface torque")}
    found = r.impedance if name.startswith("string") else r.transfer("torque on bit", answers[name])
    return found, [complex(*row[name]) for row in given["truth"]]


def of_wall(kind):
    given = TRUTHS["wall friction linearised"]["truth"]["modes, upper end held, lower end free"]
    found = drilling.stability(lying(), [6.0], modes=3, kind=kind).roots[0, 0]
    modes = [row for row in given if row["kind"] == kind]
    return found, [complex(x["growth (1/s)"], 2 * math.pi * x["frequency (Hz)"]) for x in modes]


def of_limit_at_wall():
    rate, truth = TRUTHS["wall friction linearised"]["truth"][
        "slowest rotation at which the torsion modes decay with a drag rate of d0"
    ]
    return drilling.limit_speed(lying(drag=drilling.ViscousDrag(torsion=rate)), up_to=1.5, points=6), truth


def one_mode():
    given = TRUTHS["HFTO of one mode"]["input"]
    m, w = given["m"], given["w"]
    string = drilling.Discs((100.0, m), (m * w**2,), (2 * given["zeta"] * w * m,))
    bit = drilling.BitOnRock(drilling.Stribeck(given["Ts"], given["Td"], given["speed"]))
    return drilling.Drilling(string, drilling.TopDrive(given["Om"]), bit)


def of_hfto():
    truth = TRUTHS["HFTO of one mode"]["truth"]
    answer = drilling.stability(one_mode(), [14.0], up_to=500)
    found = answer.hfto()
    half = -7.0 * equivalent_slope(found.scene.bit.law.resistance(None), 14.0, 7.0)
    bits = truth["amplitude of the bit's speed by balance of power (rad/s), over the mean speed"]
    return (
        [answer.growth[0, 0, 0], *found.amplitude, *found.value("over_mean"), half,
         drilling.limit_speed(one_mode(), up_to=500)],
        [truth["growth of small motions (1/s)"], *bits,
         truth["below a = Om: -I/pi = 2 (Ts - Td) exp(-Om/speed) I1(a/speed), at a = Om/2"],
         truth["rotation above which it decays"]],
    )  # fmt: skip


def of_reflection():
    given = TRUTHS["drive reflection"]["input"]
    drive = drilling.TopDrive(8.0, given["I"], drilling.PI(given["Kp"], given["Ki"]))
    string = well.DrillString([part(given["L"])])
    Zd = drilling.frequency_response(drilling.Drilling(string, drive), given["frequencies_Hz"]).drive_impedance
    (rows,) = TRUTHS["drive reflection"]["truth"].values()
    return -(given["Z"] - Zd) / (given["Z"] + Zd), [x * np.exp(1j * np.radians(angle)) for x, angle in rows]


@pytest.mark.parametrize("row, tolerance", [
    (lambda: of_response("string impedance at the surface"), 1e-8),
    (lambda: of_response("drive speed per torque on bit"), 1e-8),
    (lambda: of_response("bit speed per torque on bit"), 1e-8),
    (lambda: of_response("surface torque per torque on bit"), 1e-8),
    (lambda: of_wall("torsion"), 1e-12),
    (lambda: of_wall("axial"), 1e-12),
    (of_limit_at_wall, 1e-9),
    (of_hfto, 1e-9),
    (of_reflection, 1e-12),
], ids=["impedance", "drive", "bit", "torque", "wall torsion", "wall axial", "wall limit", "hfto",
        "reflection"])  # fmt: skip
def test_truths(row, tolerance, truth, request):
    truth(f"small motions of a string: {request.node.callspec.id}", *map(np.atleast_1d, row()), tolerance)


def test_discs_answer_as_their_matrices_do():
    """With dampers between them, and PI control: all sources and answers."""
    J, k, c, b = (300.0, 5.0, 9.0, 40.0), (470.0, 300.0, 800.0), (40.0, 5.0, 20.0), (1.0, 0.5, 0.2, 8.0)
    drive = drilling.TopDrive(6.0, 1000.0, drilling.PI(800.0, 900.0))
    bit = drilling.BitOnRock(Falling(-7.0), inertia=11.0)
    f = np.array([0.05, 0.3, 1.0, 4.0])
    r = drilling.frequency_response(drilling.Drilling(drilling.Discs(J, k, c, b), drive, bit), f)
    ends = np.diff(np.eye(4), axis=0)
    for n, s in enumerate(2j * np.pi * f):
        Z = np.diag(s * np.array(J) + b) + ends.T @ np.diag(np.array(c) + np.array(k) / s) @ ends
        Z[3, 3] += 11.0 * s - 7.0
        top = 1000.0 * s + 800.0 + 900.0 / s
        of_bit = np.linalg.solve(Z + np.diag([top, 0, 0, 0]), [0, 0, 0, -1.0])
        of_drive = np.linalg.solve(Z, [1.0, 0, 0, 0])
        for source, answer, truth in (
            ("torque on bit", "bit speed", of_bit[3]), ("torque on bit", "drive speed", of_bit[0]),
            ("torque on bit", "surface torque", -top * of_bit[0]), ("drive speed", "surface torque", 1 / of_drive[0]),
            ("drive speed", "bit speed", of_drive[3] / of_drive[0]), ("surface torque", "bit speed", of_drive[3]),
            ("surface torque", "torque on bit", -7.0 * of_drive[3]),
        ):  # fmt: skip
            assert r.transfer(source, answer)[n] == pytest.approx(truth, rel=1e-9), (
                source,
                answer,
            )  # a slope by differences


def test_a_bit_that_cuts_couples_torsion_and_axial_motion():
    """The answers to torque and weight on bit against both equations at the bit; a string without end hides nothing."""
    law = drilling.Cutting(0.108, 60e6, 0.6, 5)
    bit = drilling.BitOnRock(law, 60e3, inertia=50.0, mass=300.0)
    string, drive = well.DrillString([part(900.0)]), drilling.TopDrive(12.0, control=drilling.Matched())
    scene = drilling.Drilling(string, drive, bit, drag=drilling.ViscousDrag(2.0, 4.0))
    f = np.array([0.3, 1.0, 3.0])
    turned, moved = (drilling.frequency_response(scene, f, kind=kind, unstable=True) for kind in ("torsion", "axial"))
    eq, s = turned.equation, 2j * np.pi * f
    E, rho = 1 - np.exp(-s * eq.delay), eq.penetration / eq.speed
    Zt, Za = (g.impedance_at_bit(s) + g.inertia * s for g in eq.guides)
    for n in range(len(f)):
        A = [
            [Za[n] + eq.ka * E[n] / s[n], -eq.ka * rho * E[n] / s[n]],
            [eq.kt * E[n] / s[n], Zt[n] - eq.kt * rho * E[n] / s[n]],
        ]
        pushed, twisted = np.linalg.solve(A, [[-1.0, 0.0], [0.0, -1.0]]).T
        assert turned.transfer("torque on bit", "bit speed")[n] == pytest.approx(twisted[1], rel=1e-11)
        assert moved.transfer("weight on bit", "bit velocity")[n] == pytest.approx(pushed[0], rel=1e-11)


def test_heave_reaches_a_bit_on_rock():
    """Slowly a top that moves down by u presses a rigid bit by EA u/L, and a bit on soft rock by less."""
    string, bit = well.DrillString([part(2000.0)]), drilling.BitOnRock(drilling.Stribeck(4e3, 4e3), 50e3)
    scene = drilling.Drilling(string, drilling.TopDrive(6.0), bit)
    f, spring = 1e-3, 701023457.1261743 / 2000
    for stiffness in (math.inf, 2e6):
        rock = replace(scene, bit=replace(bit, rock_stiffness=stiffness))
        r = drilling.frequency_response(rock, f, kind="axial")
        pressed = r.transfer("top velocity", "weight on bit")[0] * 2j * math.pi * f  # by displacement
        assert pressed == pytest.approx(1 / (1 / spring + 1 / stiffness), rel=1e-4)
        assert r.transfer("top velocity", "hook load")[0] == pytest.approx(-r.impedance[0], rel=1e-14)
        assert r.transfer("weight on bit", "hook load")[0] == pytest.approx(-spring / (spring + stiffness), rel=1e-3)


@pytest.mark.parametrize("kind", ["torsion", "axial"])
def test_strings_damped_by_kelvin_and_voigt(kind):
    """s^2 + tau w^2 s + w^2 = 0 for every mode w without damping; the growth of a motion by elements is that, too."""
    tau, turns = 2e-2, kind == "torsion"
    hook = None if turns else drilling.Hook(speed=0.05)
    scene = drilling.Drilling(well.DrillString([part(800.0, damping_time=tau)]), drilling.TopDrive(5.0), hook=hook)
    w = 2 * np.pi * drilling.natural_frequencies(scene, 2, kind=kind)
    found = drilling.stability(scene, [5.0], modes=2, kind=kind).roots[0, 0]
    assert found == pytest.approx(-tau * w**2 / 2 + 1j * w * np.sqrt(1 - (tau * w / 2) ** 2), rel=1e-12)
    history = drilling.simulate(scene, 12.0, dt=5e-3)
    off = history.bit_speed - 5.0 if turns else history.bit_velocity + 0.05
    peaks = np.flatnonzero((np.abs(off[1:-1]) > np.abs(off[:-2])) & (np.abs(off[1:-1]) > np.abs(off[2:])))[8:] + 1
    growth = np.polyfit(history.times[peaks], np.log(np.abs(off[peaks])), 1)[0]
    assert growth == pytest.approx(found[0].real, rel=2e-3)
    assert np.abs(history.balance).max() < 1e-6 * history.kinetic.max()


def test_friction_of_a_string_that_slides():
    """mu N r^2/V around, and mu' along, of a string that does not rotate; refused at rest, and beside rotation."""
    r, N, V, friction = 0.08, 150.0, 0.4, drilling.WallFriction(0.3, 0.2, 0.3)
    sliding = lying(hook=drilling.Hook(speed=-V), turns=0.0)
    axial, torsion = (drilling.stability(sliding, [0.0], modes=2, kind=kind) for kind in ("axial", "torsion"))
    slope = friction.resistance.slope(V)
    assert axial.growth[0, 0] == pytest.approx([-slope * N / 26.71375795359451 / 2] * 2, rel=1e-12)
    fed = drilling.stability(lying(bit=drilling.BitOnRock(drilling.Stribeck(0.0, 0.0))), [6.0], modes=2).hfto()
    assert (
        np.isnan(fed.amplitude).tolist() == [True] * 2
        and fed.unbounded == 0
        and "2 modes grow that friction at the wall feeds" in str(fed)
    )
    rate = friction.coefficient(V) * N * r**2 / V / 0.09324815246769404
    assert torsion.growth[0, 0, -1] == pytest.approx(-rate / 2, rel=1e-12)
    for scene, told in (
        (lying(turns=0.0), "at rest friction holds it"),
        (lying(hook=drilling.Hook(speed=-V)), "friction couples torsion and axial motion"),
        (lying(hook=drilling.Hook(speed=-V), turns=0.0,
               friction=drilling.WallFriction(0.3, 0.2, 1.0, of_rotation=True)),
         "of_rotation=False"),
    ):  # fmt: skip
        with pytest.raises(cf.SceneError, match=told):
            drilling.frequency_response(scene, [1.0])
    slow = drilling.stability(lying(hook=drilling.Hook(speed=-0.04)), [6.0], modes=1)
    assert "sliding changes it by about 0.69 %" in slow.cautions[0]


def test_the_wall_force_is_that_of_the_well():
    """In a curved well with some weight on bit: pieces are fine enough, and friction that falls feeds it."""
    path = well.WellPath.from_survey([0, 800, 1400, 3000], [0, 0, 60, 60], [0, 0, 20, 20], degrees=True)
    hole = well.Borehole(path, well.HoleSection(3000, 0.2159, 0.25))
    string = well.DrillString([well.Collar(200.0, "NC46-65"), well.DrillPipe(size="5 in 19.50 lb/ft")])
    bit = drilling.BitOnRock(drilling.Stribeck(0.7, 0.5, 3.0, radius=0.1), 80e3, inertia=20.0)
    scene = drilling.Drilling(string, drilling.TopDrive(8.0), bit, hole=hole, mud=well.Mud(1200.0),
                              friction=drilling.WallFriction(0.3, 0.2, 0.3),
                              drag=drilling.ViscousDrag(0.8))  # fmt: skip
    from cosserat_fenicsx.drilling.linear import characteristic as pieces

    roots = drilling.stability(scene, [8.0], up_to=0.7).roots[0, 0]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pieces, "_SAME", 5e-3)
        patch.setattr(pieces, "_CELLS", 600)
        fine = drilling.stability(scene, [8.0], up_to=0.7).roots[0, 0]
    assert np.abs(roots - fine).max() < 4e-5
    constant = replace(scene, friction=drilling.WallFriction(0.2))
    assert (fine.real > drilling.stability(constant, [8.0], up_to=0.7).growth[0, 0] + 0.05).all()
    slow = drilling.stability(scene, [4.0], up_to=0.7)
    assert len(slow.hfto()) == slow.unstable_modes[0, 0] > 0
    weight = drilling.limit_weight(scene, 8.0, up_to=0.7)
    at_limit = drilling.stability(scene, [8.0], [weight], up_to=0.7).growth
    assert np.nanmax(at_limit) == pytest.approx(0.0, abs=1e-7)


def test_unstable_states_and_unknown_names_are_refused():
    falling = three_sections(-250.0)
    with pytest.raises(cf.SceneError, match=r"unstable, a mode of .* grows by .*unstable=True"):
        drilling.frequency_response(falling, [1.0, 8.0])
    r = drilling.frequency_response(falling, [1.0, 8.0], unstable=True)
    assert "The steady state is unstable" in r.cautions[0] and "unstable" in r.summary()
    for source, answer, told in (
        ("torque", "bit speed", "torque on bit"), ("bit speed", "drive speed", "source"),
        ("torque on bit", "torque on bit", "answer"), ("drive speed", "hook load", "answer"),
    ):  # fmt: skip
        with pytest.raises(cf.SceneError, match=told):
            r.transfer(source, answer)
    cutting = drilling.BitOnRock(drilling.Cutting(0.1, 60e6, 0.6, 5), 60e3)
    for told, call in {
        "frequencies": lambda: drilling.frequency_response(falling, [0.0]),
        "kind": lambda: drilling.frequency_response(falling, [1.0], kind="lateral"),
        "frequency_response.speed": lambda: drilling.frequency_response(
            replace(falling, drive=drilling.TopDrive(control=drilling.Motor(5e3))), [1.0]),
        "its modes move axially": lambda: drilling.stability(replace(falling, bit=cutting), [6.0], kind="axial"),
        "the rock holds a bit at rest": lambda: drilling.frequency_response(falling, [1.0], speed=0.0),
        "follows from its speed": lambda: drilling.stability(replace(falling, bit=cutting), [6.0]).hfto(),
        "damping_time": lambda: part(10.0, damping_time=-1.0),
    }.items():  # fmt: skip
        with pytest.raises(cf.SceneError, match=told):
            call()


def test_results_are_told_drawn_and_stored(tmp_path):
    pytest.importorskip("matplotlib")
    r = drilling.frequency_response(three_sections(), np.linspace(0.05, 10.0, 400))
    text = str(r)
    assert "surface torque" in text and max(map(len, text.splitlines())) <= 100 and len(text.splitlines()) <= 30
    assert r.mode_of(8.0).rotation is not None and abs(r.mode_of(8.0).root.imag / 2 / math.pi - 8.0) < 0.3
    with pytest.raises(cf.SceneError, match="mode_of.frequency = 10.1: expected at most 10 Hz"):
        r.mode_of(10.1)
    table = r.to_dataframe("field")
    assert table["surface torque per torque on bit"][9] == pytest.approx(
        abs(r.transfer("torque on bit", "surface torque")[9])
    )
    r.save(tmp_path / "r.h5")
    again = cf.read_result(tmp_path / "r.h5")
    assert (again.value("impedance_size") == np.abs(r.impedance)).all()
    r.plot(tmp_path / "bode.png", units="field")
    kept = drilling.stability(one_mode(), [14.0], up_to=500).hfto()
    kept.plot(tmp_path / "hfto.png")
    assert "180 Hz, bit speed" in " ".join(str(kept).split()) and "times the mean" in str(kept)
    assert (tmp_path / "bode.png").stat().st_size > 1e4 < (tmp_path / "hfto.png").stat().st_size


def test_a_file_that_asks_for_a_response(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    (tmp_path / "scene.toml").write_text("""
[string]
components = [
    { type = "Collar", size = "NC46-65", length = 200.0, damping_time = 2e-5 },
    { type = "DrillPipe", size = "5 in 19.50 lb/ft", length = 1000.0 },
]
[drive]
speed = "100 rpm"
[bit]
law = { type = "Stribeck", static = "6 kN m", dynamic = "5.8 kN m", speed = "3 rad/s" }
[drag]
torsion = 0.3
[response]
frequencies = { from = "0.1 Hz", to = "8 Hz", count = 200 }
[stability]
speeds = ["100 rpm"]
up_to = "40 Hz"
""")  # fmt: skip
    assert main(["explain", str(tmp_path / "scene.toml")]) == 0
    assert "Asked for: frequency response in torsion." in capsys.readouterr().out
    assert main(["run", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert "200 frequencies from 0.1 to 8 Hz" in told and "all modes up to 40 Hz" in told
    files = {file.name for file in (tmp_path / "out").iterdir()}
    assert {"response.csv", "response.png", "stability.csv"} <= files and "drilling.csv" not in files
