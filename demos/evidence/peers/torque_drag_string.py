"""torque-drag's soft string; see `speak` for requests and answers, `welleng_string` for the problem.

Its weight follows from diameters and densities, which are chosen for the weight in mud that is asked for.
"""

from importlib.metadata import version
from math import pi
from types import SimpleNamespace

import torque_drag
from speak import serve

_INNER = 0.05  # m, any


def prepare(problem, configuration):
    names = {"inclination": "inc", "azimuth": "azi", "md": "md"}
    well = SimpleNamespace(**{ours: problem[name] for ours, name in names.items()}, tvd=problem["md"])
    outer = 2 * problem["radius"]
    sizes = {"od_pipe": outer, "id_pipe": _INNER, "length_pipe": problem["md"][-1], "od_annular": 0.2159}
    density = problem["weight"] / (9.81 * pi / 4 * (outer**2 - _INNER**2))
    case = "hoisting" if problem["out"] else "lowering"

    def solve():
        found = torque_drag.calc(well, sizes, {"rhof": 0.0, "rhod": density}, case=case, fric=problem["friction"])
        return [[1000 * found.force[case][0]]]

    return solve


if __name__ == "__main__":
    serve(prepare, {"torque-drag": version("torque-drag")})
