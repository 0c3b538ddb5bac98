"""The table under Figure 3: statements of the paper and the results here, point by point."""

import numpy as np
from harness import in_words

from comparison.column import Column
from comparison.curves import MANY, exact
from cosserat_fenicsx import analytic

_HEAD = "| point | the paper | found here |\n|---|---|---|"


def table(data):
    """Markdown from the data of figure3.json."""
    curves = data["curves"]
    rows = [
        eq_8(), load(curves), rod(curves), beam(curves), *solids(curves), *mcre(curves), largest(curves),
    ]  # fmt: skip
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([
        _HEAD, *lines, "",
        "delta is the transverse displacement of the tip, eta = F/P_cr. The truth of the rod is the strong form by "
        "quadrature "
        "(`analytic.reissner`). " + in_words(data["machine"]) + ".",
    ])  # fmt: skip


def percent(ratio):
    """A relative difference as text: +3.8 %."""
    return f"{100 * ratio:+.2g} %" if abs(ratio) >= 1e-5 else f"{ratio:+.0e}"


def at(curve, eta):
    """delta of a curve at one of its own load factors."""
    return curve["delta"][int(np.argmin(np.abs(np.asarray(curve["eta"]) - eta)))]


def eq_8():
    """The secant formula against the exact rod."""
    etas = (0.5, 0.7, 0.8, 0.85, 0.9, 0.95)
    high = analytic.secant_delta(np.array(etas), Column().eccentricity) / exact(etas) - 1
    found = ", ".join(f"{percent(value)} at {eta:g}" for eta, value in zip(etas, high, strict=True))
    return "eq. (8), the secant formula", "no appreciable differences for eta <= 0.9", (
        f"{found}; infinite at 1, silent beyond: a theory of second order, not the truth")  # fmt: skip


def load(curves):
    """The constant tip moment against the force on an arm."""
    etas = [eta for eta in (0.9, 1.0, 1.5) if eta in curves["arm"]["eta"]]
    pairs = [(eta, at(curves["mixed"], eta), at(curves["arm"], eta)) for eta in etas]
    found = "; ".join(f"at {eta:g} {a:.5f} m and {b:.5f} m ({percent(b / a - 1)})" for eta, a, b in pairs)
    return "the load", "called an eccentric force and an equivalent moment, as if these were one", (
        f"two loads: a constant moment F e and a force on an arm that turns give {found}")  # fmt: skip


def rod(curves):
    """The two formulations against the exact rod."""
    mixed, other = curves["mixed"], curves["displacement"]
    apart = np.abs(np.array(mixed["delta"]) / np.array(other["delta"]) - 1).max()
    words = (
        f"`displacement` (eq. (1) to the letter) and `mixed` coincide to {apart:.0e} over {len(mixed['eta'])} load "
        f"factors; against the exact rod {mixed['error']:.0e}; stable all along"
    )
    stable = mixed["stable"] and other["stable"]
    return "Cosserat rod, eq. (1)", "one of its five curves", words if stable else "unstable points were found"


def orders(beam):
    """(relative errors (meshes, etas), observed orders between the last two meshes) of the co-rotational beam."""
    truth = exact(beam["eta"])
    errors = np.array([np.array(delta) / truth - 1 for delta in beam["meshes"].values()])
    return errors, np.log2(errors[-2] / errors[-1])


def beam(curves):
    """The co-rotational beam."""
    found = curves["corotational"]
    errors, order = orders(found)
    k = found["eta"].index(0.9)
    meshes = list(found["meshes"])
    apart = ", ".join(f"{100 * abs(e):.2g} % with {n}" for n, e in zip(meshes, errors[:, k], strict=True))
    return "built-in beam (here: a co-rotational Timoshenko beam)", "one of its five curves", (
        f"tends to the same rod: at 0.9 off by {apart} elements; observed order {order.min():.2f} to {order.max():.2f} "
        "at all load factors")  # fmt: skip


def solids(curves):
    """3D elasticity against the rod under the same load, and other comparisons with it."""
    found = curves["solid"]
    etas = [eta for eta in (0.5, 0.9, 1.0, 1.5, 2.0) if eta in found["eta"]]
    arm, moment = exact(etas, arm=True), exact(etas)

    def against(truth):
        return ", ".join(
            f"{percent(at(found, eta) / value - 1)} at {eta:g}" for eta, value in zip(etas, truth, strict=True)
        )

    finer = found["finer"]
    like = exact(finer["eta"], arm=True)
    model = ", ".join(f"{percent(delta / value - 1)} at {eta:g}"
                      for eta, delta, value in zip(finer["eta"], finer["delta"], like, strict=True))  # fmt: skip
    mesh = ", ".join(
        f"{percent(at(found, eta) / delta - 1)} at {eta:g}"
        for eta, delta in zip(finer["eta"], finer["delta"], strict=True)
    )
    yield "3D elasticity", "one of its five curves", (
        f"against its like, the rod with the force on a turning arm: {model} with {finer['along']} hexahedra of second "
        "order along the bar "
        f"({finer['unknowns']} unknowns on half of it); the curve's {found['along']} along ({found['unknowns']} "
        "unknowns) differ from those, "
        f"by the mesh alone, by {mesh}, and so from the rod by {against(arm)}; against the constant moment: "
        f"{against(moment)}")  # fmt: skip
    clamped = curves["solid_clamped"]
    apart = ", ".join(f"{percent(delta / value - 1)} at {eta:g}"
                      for eta, delta, value in zip(clamped["eta"], clamped["delta"], exact(clamped["eta"], arm=True),
                                                   strict=True))  # fmt: skip
    yield "3D elasticity, the foot's face fixed altogether", "-", (
        f"{apart}, against the turning arm: a face that may not contract sideways stiffens the foot, and near eta = 1 "
        "delta shows it about "
        "tenfold; the rod, and the row above, hold the section's place and direction alone")  # fmt: skip


def mcre(curves):
    """The limit points of the reconstructed MCRE."""
    found = curves["mcre"]["elements"]
    points = ", ".join(f"{curve['limit_point']['eta']:.3f} with {n}" for n, curve in found.items() if n != "limit")
    many, end = found[str(MANY)]["limit_point"], found["limit"]["limit_point"]
    yield "MCRE (here: a reconstruction)", "one of its five curves", (
        f"loses its stability at a limit point, beyond which its path has no equilibrium: eta = {points} elements; "
        f"delta is {many['delta']:.3f} m there "
        f"with {MANY}. The truncated energy that ever shorter elements tend to has it at {end['eta']:.4f}, "
        f"{end['delta']:.3f} m")  # fmt: skip
    delta = curves["mcre"]["delta_at_0.6"]
    yield "MCRE before its limit point", "one of its five curves", (
        f"{percent(delta / exact([0.6])[0] - 1)} at 0.6 ({MANY} elements: {delta:.4f} m, the rod {exact([0.6])[0]:.4f} "
        "m): the truncated energy of "
        "a pure rotation is not zero")  # fmt: skip


def largest(curves):
    """The largest displacement of the rod."""
    rod = curves["mixed"]
    k = int(np.argmax(rod["delta"]))
    return (
        "the largest delta up to eta = 2",
        "-",
        f"{rod['delta'][k]:.2f} m at eta = {rod['eta'][k]:g}; beyond, the tip swings back under the clamp",
    )
