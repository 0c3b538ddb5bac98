"""welleng's soft string; see `speak` for requests and answers. An answer has one row: the hook load, N.

The problem has md (m), inc and azi (degrees), weight in mud (N/m), friction, radius of contact (m) and whether the
string is pulled out, else run in. The sample is one call of `TorqueDrag`, which gives all cases at once.
"""

from importlib.metadata import version

from speak import serve
from welleng.architecture import BHA, WellBore
from welleng.survey import Survey
from welleng.torque_drag import TorqueDrag


def prepare(problem, configuration):
    md = problem["md"]
    survey = Survey(md=md, inc=problem["inc"], azi=problem["azi"], deg=True)
    hole = WellBore("hole", 0.0, md[-1], method="top_down")
    hole.add_section(bottom=md[-1], id=0.2159, coeff_friction_sliding=problem["friction"])
    string = BHA("string", 0.0, md[-1], method="top_down")
    string.add_section(bottom=md[-1], od=2 * problem["radius"], unit_weight=problem["weight"], density=7.85)
    case = "pickup" if problem["out"] else "slackoff"
    return lambda: [[float(TorqueDrag(survey, hole, string, fluid_density=0.0).tension[case][0])]]


if __name__ == "__main__":
    serve(prepare, {"welleng": version("welleng")})
