"""A column as a model of UM-Bridge's protocol (HTTP and JSON), which programs of uncertainty quantification call.

    pip install umbridge
    python demos/model_server.py               serves the model "column" on port 4242 until Ctrl-C
    python demos/model_server.py --port 5000

One input, the values of `PARAMETERS`; two outputs: the displacement of the tip (m) and the moment at the foot (N m),
along inertial axes. The Jacobian is that of `Path.sensitivity`. The configuration of a request holds arguments of
`solve`. What is refused or does not converge reaches the client in words. Requests are answered one after the other:
start a server for each core, each on a port of its own.
"""

import argparse
import contextlib
import json

import numpy as np
import umbridge
from aiohttp.web import HTTPBadRequest

import cosserat_fenicsx as cf

#: The numbers of the scene that a client chooses: N/m^2, m, N, N.
PARAMETERS = ("materials[0].E", "rods.column.section.diameter", "loads[0].force[0]", "loads[0].force[2]")
#: The outputs, each (points, 3) of a path.
OUTPUTS = (lambda path: path.displacement("column.end"), lambda path: path.moment("column.start"))


def column(E, diameter, across, along):
    """The scene with these values of `PARAMETERS`: 20 m high, clamped at its foot, loaded at its tip."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20)), cf.Circle(diameter), cf.Material(E=E, nu=0.3), name="column")
    return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (across, 0, along))])


class Column(umbridge.Model):
    """See the head of this file."""

    def __init__(self):
        super().__init__("column")

    def get_input_sizes(self, config):
        return [len(PARAMETERS)]

    def get_output_sizes(self, config):
        return [3, 3]

    def __call__(self, parameters, config):
        with _in_words():
            path = cf.solve(column(*parameters[0]), [1.0], **config)
            return [query(path)[-1].tolist() for query in OUTPUTS]

    def jacobian(self, out_wrt, parameters, config):
        """(numbers of this output, parameters), SI units."""
        with _in_words():
            path = cf.solve(column(*parameters[0]), [1.0], **config)
            found = path.sensitivity(OUTPUTS[out_wrt], PARAMETERS)
            return np.column_stack([found[name][-1] for name in PARAMETERS])

    def gradient(self, out_wrt, in_wrt, parameters, sens, config):
        return (sens @ self.jacobian(out_wrt, parameters, config)).tolist()

    def apply_jacobian(self, out_wrt, in_wrt, parameters, vec, config):
        return (self.jacobian(out_wrt, parameters, config) @ vec).tolist()

    def supports_evaluate(self):
        return True

    supports_gradient = supports_apply_jacobian = supports_evaluate


@contextlib.contextmanager
def _in_words():
    """Errors of the package as the protocol's answer."""
    try:
        yield
    except (cf.CosseratError, TypeError) as problem:
        said = {"error": {"type": type(problem).__name__, "message": str(problem)}}
        raise HTTPBadRequest(text=json.dumps(said), content_type="application/json") from problem


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--port", type=int, default=4242, help="of this machine's network interfaces [4242]")
    umbridge.serve_models([Column()], parser.parse_args().port)
