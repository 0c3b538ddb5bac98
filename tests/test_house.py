"""The structure of the package: allowed imports, the wheel and the plain checkout, the length of files."""

import ast
import functools
import re
import subprocess
import sys
from pathlib import Path

import pytest

import cosserat_fenicsx as cf

pytestmark = [pytest.mark.serial, pytest.mark.once]
ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "cosserat_fenicsx"


@functools.cache
def imports(file):
    """All modules that a file imports, inside functions too."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def inside(file):
    return {name.removeprefix("cosserat_fenicsx.") for name in imports(file) if name.startswith("cosserat_fenicsx.")}


def outside(file):
    return {name.split(".")[0] for name in imports(file)}


def test_forms_know_ufl_alone():
    for file in (ROOT / "forms").glob("*.py"):
        assert outside(file) <= {"ufl", "collections", "functools", "cosserat_fenicsx"}, file
        assert all(name.startswith("forms") for name in inside(file)), file


#: Modules that all subpackages may import; and the other subpackages that each subpackage may import.
SHARED = set(
    "analytic checks code_cache compat errors interrupts kinds names new_files numerics parts progress "
    "quantities ranks strands turning units".split()
)
ROOMS = {
    "scene": {"pictures"},
    "signals": set(),
    "actions": {"scene", "forms"},
    "algebra": set(),
    "models": {"scene", "forms", "algebra"},
    "results": {"scene", "pictures", "algebra"},
    "storage": {"scene", "results"},
    "pictures": {"scene"},
    "statics": {"scene", "models", "algebra", "results"},
    "dynamics": {"scene", "models", "algebra", "results", "storage", "statics"},
    "studies": {"results", "storage"},
    "well": {"algebra", "actions", "scene", "models", "statics", "results", "storage", "pictures"},
    "drilling": {"actions", "well", "scene", "results", "storage", "pictures", "algebra", "dynamics"},
    "files": {"drilling", "well", "scene", "statics", "dynamics", "storage"},
    "cli": {"files", "drilling", "well", "scene", "models", "statics", "dynamics", "results", "storage", "pictures"},
}
#: Files that combine scenes, models, solvers and results; all other solver files import none of scene, models and
#: results.
FITTERS = {
    "statics": "critical meshes linear_buckling natural_modes small_motions refinement sensitivity solve problem "
               "cases pair path/recorder".split(),
    "dynamics": "time_loop simulate start pace".split(),
}  # fmt: skip


def rooms_known_in(file):
    return {name.split(".")[0] for name in inside(file)} - {"__version__"}


def test_data_flows_one_way():
    rooms = {folder.name for folder in PACKAGE.iterdir() if (folder / "__init__.py").is_file()}
    assert rooms == {*ROOMS, "forms"} and (PACKAGE / "forms").samefile(ROOT / "forms")
    assert {file.stem for file in PACKAGE.glob("[a-z]*.py")} == SHARED
    for file in PACKAGE.glob("[a-z]*.py"):
        assert rooms_known_in(file) <= SHARED, file
    for room, others in ROOMS.items():
        for file in (PACKAGE / room).rglob("*.py"):
            assert rooms_known_in(file) <= SHARED | {room} | others, file


#: Rooms from below to above: none imports one above it, but for `Scene.plot`.
ORDER = ("forms", "scene", "signals", "pictures", "actions", "algebra", "models", "results", "storage", "statics",
         "dynamics", "studies", "well", "drilling", "files", "cli")  # fmt: skip


def test_no_import_runs_upwards():
    """Imports inside functions and for type checkers count; no circle of files is left."""
    assert set(ORDER) == {*ROOMS, "forms"}
    upwards = {(a, b) for a, others in ROOMS.items() for b in others if ORDER.index(b) > ORDER.index(a)}
    assert upwards == {("scene", "pictures")}  # `Scene.plot`, see below
    files = {".".join(x.relative_to(PACKAGE).with_suffix("").parts): x for x in PACKAGE.rglob("*.py")}
    files = {name.removesuffix(".__init__"): file for name, file in files.items() if name != "__init__"}
    reached = {name: inside(file) & files.keys() - {name} for name, file in files.items()}
    for between in files:
        for others in reached.values():
            if between in others:
                others |= reached[between]
    circles = {frozenset(x for x in reached[name] if name in reached[x]) for name in files if name in reached[name]}
    assert not circles, sorted(map(sorted, circles))


def test_scenes_know_no_solver_library():
    for file in (PACKAGE / "scene").glob("*.py"):
        assert outside(file).isdisjoint({"dolfinx", "ufl", "petsc4py", "mpi4py"}), file
        assert file.name == "scene.py" or "pictures" not in rooms_known_in(file), "only for Scene.plot"


def test_solvers_know_the_protocol_of_models_alone():
    for room, fitters in FITTERS.items():
        assert all((PACKAGE / room / f"{name}.py").is_file() for name in fitters)
        for file in (PACKAGE / room).rglob("*.py"):
            if str(file.relative_to(PACKAGE / room).with_suffix("")) not in fitters:
                assert rooms_known_in(file).isdisjoint({"scene", "models", "results", "storage"}), file


def test_solvers_alone_know_the_algebra():
    """All other rooms know of it how C is compiled and called, and the C structures of a mesh."""
    for file in PACKAGE.rglob("*.py"):
        if file.relative_to(PACKAGE).parts[0] not in ("algebra", "statics", "dynamics"):
            assert all(name.startswith("algebra.building") for name in inside(file) if name.startswith("algebra")), file


def test_no_module_takes_the_name_of_something_public():
    """Importing such a module would replace the public object of the same name."""
    modules = {file.stem for file in PACKAGE.glob("*.py")} | {file.name for file in PACKAGE.iterdir() if file.is_dir()}
    for name in modules & set(cf.__all__):
        assert getattr(cf, name).__name__ == f"cosserat_fenicsx.{name}"
    assert {name for name in dir(cf) if not name.startswith("__")} == set(cf.__all__)


def test_what_one_file_alone_says():
    """Versions of libraries, though demos/evidence/peers/ records those of its programs; and which ranks work together:
    within a study a rank is alone, and what takes all ranks by itself would wait for the others for ever."""
    for file in [*PACKAGE.rglob("*.py"), *(ROOT / "forms").glob("*.py"), *(ROOT / "demos").rglob("*.py")]:
        text = file.read_text(encoding="utf-8")
        told = re.findall(r"\b(?!cf\b|cffi\b|found\b)\w+\.__version__|getVersion|version_info", text)
        assert not told or file.name == "compat.py" or file.parent.name == "peers", f"{file}: {told}"
        if PACKAGE in file.parents and file.parent.name != "cli" and file.name not in ("ranks.py", "pool.py"):
            assert "MPI.COMM_WORLD" not in text, f"{file}: use ranks.communicator(comm)"


def test_files_stay_small():
    """And lines of C; ruff tells those of Python."""
    c = [*PACKAGE.rglob("*.c"), *PACKAGE.rglob("*.h")]
    for file in [*c, *PACKAGE.rglob("*.py"), *(ROOT / "forms").glob("*.py"), *(ROOT / "tests").glob("*.py")]:
        lines = file.read_text(encoding="utf-8").splitlines()
        assert len(lines) <= 700 and (file not in c or max(map(len, lines)) <= 120), file


def test_a_plain_checkout_works(tmp_path):
    """forms/ is found under its name within the package, through a link; other folders of the checkout are not.
    Optional libraries are imported only when asked for."""
    code = f"""
import importlib.util, sys
sys.path.insert(0, {str(ROOT)!r})
import cosserat_fenicsx as cf
cf.solve, cf.read_path
print({{"pyvista", "matplotlib", "meshio", "vtk", "pandas", "xarray", "h5py"}} & set(sys.modules))
import cosserat_fenicsx.forms.spatial as f
print(f.__file__)
print(importlib.util.find_spec("cosserat_fenicsx.demos"))"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8", cwd=tmp_path)
    optional, file, demos = done.stdout.splitlines()
    assert optional == "set()" and demos == "None" and (ROOT / "forms" / "spatial.py").samefile(file), done.stderr
