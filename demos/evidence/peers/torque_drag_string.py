"""torque-drag's soft string; see `speak` for requests and answers, `welleng_string` for the problem.

It takes stations as dicts, diameters in inches (of 1/39.37 m) and densities in g/cm^3, and finds the weight from these:
the density is chosen for the weight in mud that is asked for.
"""

from importlib.metadata import version
from math import pi

import torque_drag
from speak import serve

_INCHES = 39.37  # in a metre
_INNER = 0.05  # m, any


def prepare(problem, configuration):
    names = "md", "inc", "azi"
    rows = list(zip(*(problem[name] for name in names), strict=True))
    stations = []
    for row, before in zip(rows, [rows[0], *rows], strict=False):
        steps = {name: b - a for name, a, b in zip(names, before, row, strict=True)}
        stations.append({**dict(zip(names, row, strict=True)), "delta": steps})
    outer = 2 * problem["radius"]
    pipe = {"od": outer * _INCHES, "id": _INNER * _INCHES, "shoe": problem["md"][-1], "length": problem["md"][-1]}
    sizes = {"pipe": pipe, "odAnn": 0.2159 * _INCHES}
    density = problem["weight"] / (9.81 * pi / 4 * (outer**2 - _INNER**2)) / 1000
    case = "hoisting" if problem["out"] else "lowering"
    friction = [problem["friction"]] * len(stations)

    def solve():
        found = torque_drag.calc(stations, sizes, {"rhof": 0.0, "rhod": density}, case=case, fric=friction)
        return [[1000 * found.force[case][0]]]

    return solve


if __name__ == "__main__":
    serve(prepare, {"torque-drag": version("torque-drag")})
