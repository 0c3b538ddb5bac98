"""What a release consists of: distributions, metadata, and the files for the services that build and show them."""

import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

import cosserat_fenicsx as cf

pytestmark = [pytest.mark.serial, pytest.mark.once]
ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "cosserat_fenicsx"
#: What no distribution holds: what is built, and the repository itself.
BUILT = shutil.ignore_patterns(".git", ".venv", "out", "build", "dist", "*.egg-info", "__pycache__", ".*_cache", "api")


@pytest.fixture(scope="module")
def distributions(tmp_path_factory):
    """The folder with the sdist, and with the wheel that was built from it."""
    folder = tmp_path_factory.mktemp("release")
    shutil.copytree(ROOT, folder / "source", symlinks=True, ignore=BUILT)  # so that nothing is left in the checkout
    words = [sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, folder / "source"]
    built = subprocess.run(words, capture_output=True, encoding="utf-8", cwd=folder)
    assert built.returncode == 0, built.stdout + built.stderr
    return folder


def test_the_sdist_holds_what_a_reader_needs(distributions):
    (archive,) = distributions.glob("*.tar.gz")
    names = {name.partition("/")[2] for name in tarfile.open(archive).getnames()}
    files = ["CHANGELOG.md", "CITATION.cff", "Dockerfile", "LICENSE", "Makefile", ".ci/debian-packages.txt"]
    files += [str(file.relative_to(ROOT)) for file in (ROOT / "docs").glob("*.md")]
    files += [str(file.relative_to(ROOT)) for file in (ROOT / "demos").rglob("*.toml")]
    files += [str(file.relative_to(ROOT)) for file in (ROOT / "tests").glob("*.py")]
    assert set(files) <= names
    assert not [name for name in names if "__pycache__" in name or name.startswith(("docs/api/", "out/", ".venv"))]


def test_the_wheel_holds_the_forms_and_works(distributions, tmp_path):
    (wheel,) = distributions.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert "cosserat_fenicsx/forms/spatial.py" in names and "cosserat_fenicsx/models/spatial.py" in names
    page = PACKAGE / "pictures" / "page"
    assert {f"cosserat_fenicsx/pictures/page/{file.name}" for file in page.iterdir()} <= set(names)
    assert {f"cosserat_fenicsx/algebra/{file.name}" for file in (PACKAGE / "algebra").glob("*.[ch]")} <= set(names)
    stubs = {f"cosserat_fenicsx/{file.relative_to(PACKAGE)}" for file in PACKAGE.rglob("*.pyi")}
    assert {"cosserat_fenicsx/py.typed", *stubs} <= set(names) and len(stubs) == 4
    assert "cosserat_fenicsx/scene/rolled_profiles.csv" in names
    assert "cosserat_fenicsx/well/standard_sizes.csv" in names
    sources = (PACKAGE / "drilling").rglob("*.[ch]")
    assert {f"cosserat_fenicsx/{file.relative_to(PACKAGE)}" for file in sources} <= set(names)
    assert not [name for name in names if not name.startswith("cosserat_fenicsx")]
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    code = (
        "import cosserat_fenicsx.forms.spatial as f, cosserat_fenicsx as cf; print(f.__file__); cf.solve, cf.well.Bit"
    )
    done = subprocess.run([sys.executable, "-S", "-c",
                           f"import sys; sys.path[:0] = {[str(tmp_path / 'site'), *sys.path]!r}; {code}"],
                          capture_output=True, encoding="utf-8", cwd=tmp_path)  # fmt: skip
    assert str(tmp_path / "site") in done.stdout, done.stderr


def test_the_description_reads_well_outside_the_repository(distributions):
    """Every link and picture is an absolute address of the release, and its file exists."""
    (wheel,) = distributions.glob("*.whl")
    (name,) = [name for name in zipfile.ZipFile(wheel).namelist() if name.endswith("METADATA")]
    text = zipfile.ZipFile(wheel).read(name).decode()
    links = re.findall(r"\]\(([^)\s]+)\)|^\[[^\]]+\]: (\S+)", text, re.MULTILINE)
    links = [one or other for one, other in links]
    own = [link for link in links if not re.match("https?://(?!.*cosserat)|#", link)]
    assert len(own) > 15
    for link in own:
        found = re.fullmatch(rf"https://\S+/(?:raw|blob)/v{re.escape(cf.__version__)}/(\S+)", link)
        assert found and (ROOT / found[1].partition("#")[0]).exists(), link


def test_the_metadata_agree():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8").splitlines()
    told = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    recipe = (ROOT / "recipe" / "recipe.yaml").read_text(encoding="utf-8")
    repository = told["urls"]["Repository"]
    assert f"version: {cf.__version__}" in citation and f"license: {told['license']['text']}" in citation
    assert f"repository-code: {repository}" in citation and f"  repository: {repository}\n" in recipe
    assert [f"  - name: {author['name']}" for author in told["authors"]] == [x for x in citation if "- name" in x]
    assert (ROOT / "LICENSE").read_text(encoding="utf-8").startswith(told["license"]["text"])
    assert f'version: "{cf.__version__}"' in recipe and f'python_min: "{told["requires-python"][2:]}"' in recipe
    required = re.findall(r"^    - ([\w-]+)", recipe.partition("  run:")[2].partition("\ntests:")[0], re.MULTILINE)
    assert {*told["dependencies"], "c-compiler", "fenics-dolfinx"} <= set(required)
    newest = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert newest[1] == cf.__version__


@pytest.mark.parametrize(("schema", "file"), [
    ("github-workflows", ".github/workflows/ci.yml"),
    ("citation-file-format", "CITATION.cff"),
    ("readthedocs", ".readthedocs.yaml"),
])  # fmt: skip
def test_the_files_of_services_fit_their_schemas(schema, file):
    pytest.importorskip("check_jsonschema")
    words = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", f"vendor.{schema}", ROOT / file]
    done = subprocess.run(words, capture_output=True, encoding="utf-8")
    assert done.returncode == 0, done.stdout


def test_the_paper_cites_what_its_list_has():
    text = (ROOT / "docs" / "paper" / "paper.md").read_text(encoding="utf-8")
    entries = re.findall(r"^@\w+\{([\w:-]+),", (ROOT / "docs" / "paper" / "paper.bib").read_text("utf-8"), re.MULTILINE)
    assert set(re.findall(r"@([\w:-]*\w)", text.partition("\n---\n")[2])) == set(entries)
    for picture in re.findall(r"\]\((\S+\.png)\)", text):
        assert (ROOT / "docs" / "paper" / picture).exists(), picture


@pytest.mark.parametrize(("changed", "words"), [
    ({"XDG_CACHE_HOME": "/proc/none"}, "set XDG_CACHE_HOME to a folder that can be written to"),
    ({"CC": "/bin/false"}, "the C compiler has failed"),
])  # fmt: skip
def test_what_the_machine_lacks_is_said(changed, words, tmp_path, monkeypatch):
    """A home that cannot be written to, no compiler: one line that tells the way on, without a traceback."""
    for name, value in ({"XDG_CACHE_HOME": str(tmp_path)} | changed).items():
        monkeypatch.setenv(name, value)
    done = subprocess.run([sys.executable, "-m", "cosserat_fenicsx", "run", ROOT / "demos" / "bend_45.toml"],
                          capture_output=True, encoding="utf-8", cwd=tmp_path)  # fmt: skip
    assert done.returncode == 2 and words in done.stderr and "Traceback" not in done.stderr, done.stderr
