"""Files that services read: Binder, development containers, Read the Docs."""

import json
import re
from pathlib import Path

import pytest

pytestmark = [pytest.mark.serial, pytest.mark.once]
ROOT = Path(__file__).parent.parent
BINDER = ROOT / "binder" / "Dockerfile"


def test_the_image_of_the_notebooks():
    """It has what the image of the tests has; what it copies exists; the user is the one that Binder asks for."""
    text, first = BINDER.read_text(encoding="utf-8"), (ROOT / "Dockerfile").read_text(encoding="utf-8")
    assert all((ROOT / name).exists() for name in re.findall(r"^COPY (?:--\S+ )?(\S+)", text, re.M))
    stage = text.partition("FROM debian:trixie AS packages")[2]
    assert "ARG SUITE=trixie" in first and ".ci/debian-packages.txt" in stage
    set_there, set_here = (set(re.findall(r"\b(\w+)=(\S+)", x)) for x in (first, text))
    threads = {pair for pair in set_there if pair[0].startswith(("OMP", "OPENBLAS", "OMPI", "VTK"))}
    assert len(threads) == 4 and threads <= set_here
    assert re.search(r"^ARG NB_USER=\S+ NB_UID=1000$", text, re.M) and "--uid ${NB_UID} ${NB_USER}" in text
    assert re.search(r"pip install .* notebook jupyterlab jupyterhub", text)
    command = json.loads(re.search(r"^CMD (.*)$", text, re.M)[1])
    assert command[:2] == ["jupyter", "lab"] and (ROOT / command[-1]).is_dir()


def test_the_development_container():
    file = ROOT / ".devcontainer" / "devcontainer.json"
    found = json.loads(file.read_text(encoding="utf-8"))
    build, dockerfile = found["build"], BINDER.read_text(encoding="utf-8")
    assert (file.parent / build["dockerfile"]).resolve() == BINDER and (
        file.parent / build["context"]
    ).resolve() == ROOT
    assert f" AS {build['target']}\n" in dockerfile and f"ARG NB_USER={found['remoteUser']} " in dockerfile
    target = found["postCreateCommand"].removeprefix("make ")
    assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)


def test_read_the_docs():
    """Every package that the site needs and PyPI has not comes from conda-forge; the names of files are right."""
    yaml = pytest.importorskip("yaml")
    found = yaml.safe_load((ROOT / ".readthedocs.yaml").read_text(encoding="utf-8"))
    assert found["version"] == 2 and set(found) == {"version", "build", "conda", "python", "sphinx"}
    assert set(found["build"]) == {"os", "tools"} and "forge" in found["build"]["tools"]["python"]
    assert found["python"]["install"] == [{"method": "pip", "path": "."}]
    assert (ROOT / found["sphinx"]["configuration"]).samefile(ROOT / "docs" / "conf.py")
    environment = yaml.safe_load((ROOT / found["conda"]["environment"]).read_text(encoding="utf-8"))
    needed = re.search(r"^dependencies = (\[.*\])$", (ROOT / "pyproject.toml").read_text(encoding="utf-8"), re.M)[1]
    needed = {*json.loads(needed), "fenics-dolfinx", "h5py", "matplotlib-base", "sphinx", "furo", "myst-nb", "pip"}
    assert environment["channels"] == ["conda-forge"] and needed <= set(environment["dependencies"])
