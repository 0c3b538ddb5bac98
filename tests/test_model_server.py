"""The model server of demos/: UM-Bridge's client gets values, gradients and products with the Jacobian, or why not."""

import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import cosserat_fenicsx as cf

pytestmark = [pytest.mark.serial, pytest.mark.once, pytest.mark.slow]
umbridge = pytest.importorskip("umbridge")
SERVER = Path(__file__).parent.parent / "demos" / "model_server.py"
AT = [210e9, 0.2, 3e3, -60e3]
CONFIG = {"elements": 6, "degree": 3}  # one mesh, so that differences are those of its equations


@pytest.fixture(scope="module")
def model():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    process = subprocess.Popen([sys.executable, str(SERVER), "--port", str(port)], stdout=subprocess.DEVNULL)
    try:
        for _ in range(300):
            try:
                socket.create_connection(("127.0.0.1", port), 1).close()
                break
            except OSError:
                assert process.poll() is None, "the server has ended"
                time.sleep(0.1)
        yield umbridge.HTTPModel(f"http://127.0.0.1:{port}", "column")
    finally:
        process.terminate()
        process.wait()


def test_values_are_those_of_solve(model):
    import model_server

    assert (model.get_input_sizes(), model.get_output_sizes()) == ([4], [3, 3])
    assert model.supports_gradient() and model.supports_apply_jacobian() and not model.supports_apply_hessian()
    path = cf.solve(model_server.column(*AT), [1.0], **CONFIG)
    tip, moment = model([AT], CONFIG)
    np.testing.assert_allclose(tip, path.displacement("column.end")[0], rtol=1e-12)
    np.testing.assert_allclose(moment, np.cross([tip[0], 0, 20 + tip[2]], [AT[2], 0, AT[3]]), rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("output", [0, 1])
def test_derivatives_are_differences_of_values(model, output):
    steps = np.diag(1e-4 * np.abs(AT))

    def value(at):
        return np.array(model([list(map(float, at))], CONFIG)[output])

    differences = np.column_stack([(value(AT + h) - value(AT - h)) / 2e-4 / abs(x) for h, x in zip(steps, AT)])
    scaled = [model.apply_jacobian(output, 0, [AT], row.tolist(), CONFIG) for row in np.diag(np.abs(AT))]
    size = np.abs(scaled).max()
    np.testing.assert_allclose(scaled, (differences * np.abs(AT)).T, atol=1e-6 * size)
    weights = [1.0, -2.0, 0.5]
    gradient = model.gradient(output, 0, [AT], weights, CONFIG) * np.abs(AT)
    np.testing.assert_allclose(gradient, np.transpose(scaled).T @ weights, atol=1e-12 * size)


def test_refusals_reach_the_client_in_words(model):
    with pytest.raises(Exception, match=r"SceneError: .*E = -1"):
        model([[-1.0, *AT[1:]]], CONFIG)
    with pytest.raises(Exception, match="TypeError"):
        model([AT], {"elementss": 4})
