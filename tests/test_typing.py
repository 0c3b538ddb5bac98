"""What editors and type checkers see of the public interface."""

import inspect
import sys
from pathlib import Path

import pytest

import cosserat_fenicsx as cf

pytestmark = [pytest.mark.serial, pytest.mark.once]
HERE = Path(__file__).parent
UNNAMED = ("matplotlib", "rich", "IPython", "PIL", "traitlets", "pyvista", "pandas", "xarray")


FUNCTIONS = [
    found
    for module in (cf, cf.well, cf.drilling)
    for name in module.__all__
    if inspect.isfunction(found := getattr(module, name))
]


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda function: function.__name__)
def test_functions_are_annotated(function):
    signature = inspect.signature(function)
    for parameter in (*signature.parameters.values(),):
        assert parameter.annotation is not inspect.Parameter.empty, parameter
    assert signature.return_annotation is not inspect.Signature.empty


def test_a_type_checker_finds_the_mistakes_and_no_others(monkeypatch, tmp_path):
    """Libraries that no annotation of the public interface names are left out: they take half of the time."""
    api = pytest.importorskip("mypy.api")
    monkeypatch.setenv("MYPYPATH", str(Path(cf.__file__).parent.parent))
    files = [HERE / "typing" / f"{name}.py" for name in ("right", "wrong")]
    config = tmp_path / "mypy.ini"
    config.write_text(f"[mypy]\n[mypy-{','.join(f'{name}.*' for name in UNNAMED)}]\nfollow_imports = skip\n")
    options = [f"--config-file={config}", f"--python-executable={sys.executable}", "--cache-dir=/dev/null"]
    options += ["--follow-imports=silent", "--no-error-summary", "--hide-error-context"]
    found, problem, _ = api.run([*options, *map(str, files)])
    assert not problem, problem
    for file in files:
        own = [line for line in found.splitlines() if f"{file.name}:" in line and ": error: " in line]
        lines = sorted({int(line.split(f"{file.name}:")[1].split(":")[0]) for line in own})
        text = file.read_text(encoding="utf-8").splitlines()
        assert lines == [i for i, line in enumerate(text, 1) if "# wrong" in line], found
