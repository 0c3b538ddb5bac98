"""The documentation: its links lead somewhere, its programs run, its scenes are read, its site builds."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from recipes import PAGES as RECIPES
from recipes import alike, prints, programs, updated

import cosserat_fenicsx as cf
from cosserat_fenicsx.parts import FAMILIES, members
from cosserat_fenicsx.results.compared import CRITERIA
from cosserat_fenicsx.results.result import Result

pytestmark = [pytest.mark.serial, pytest.mark.once]
ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(DOCS.glob("**/*.md"))]
TUTORIALS = sorted((DOCS / "tutorials").glob("*.ipynb"))


def text_of(page):
    """The text of a page, of a notebook its Markdown."""
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".ipynb":
        text = "\n\n".join("".join(x["source"]) for x in json.loads(text)["cells"] if x["cell_type"] == "markdown")
    return text


def blocks(language):
    """The fenced blocks of all pages in a language: (page's name, text, what the block `text` below says)."""
    found = [(page.name, match[1], match[2]) for page in PAGES for match in programs(text_of(page), language)]
    assert found, language
    return found


def test_the_readme_is_short():
    lines = text_of(ROOT / "README.md").splitlines()
    assert len(lines) <= 90 and max(map(len, lines)) <= 120


def headings(page):
    """The anchors of a page, as in a browser."""
    words = re.findall(r"^#+ (.*)$", text_of(page), re.M)
    return {re.sub(r"[^\w\- ]", "", word.lower()).replace(" ", "-") for word in words}


@pytest.mark.parametrize("page", [*PAGES, *TUTORIALS], ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"```.*?```", "", text_of(page), flags=re.S)):
        name, _, anchor = link.partition("#")
        if not link.startswith("https://"):
            target = (page.parent / name).resolve() if name else page
            assert target.exists() and ROOT in target.parents, link
            assert not anchor or anchor in headings(target), link


def test_recipes_and_terms_are_found():
    """Every recipe is in the index of concepts; the terms of the glossary are in order, each with a page to read on."""
    asked = [(page, words) for page in RECIPES.values() for words in re.findall("^## (.*)$", text_of(page), re.M)]
    index, terms = " ".join(text_of(DOCS / "concepts.md").split()), []
    assert len(asked) >= 40 and all(words.endswith("?") for _, words in asked)
    assert all(match[2] for page in RECIPES.values() for match in programs(text_of(page)))
    assert [words for page, words in asked if f"[{words}]({page.name}#" not in index] == []
    for term, said in re.findall(r"^(\w.*)\n((?:  .*\n|\n)+)", text_of(DOCS / "glossary.md").partition(":::")[2], re.M):
        assert re.search(r"\]\(\w+\.md", said) and 1 <= len(re.findall(r"[.:](?:\s|$)", said)) <= 5, term
        terms.append(term.lower())
    assert len(terms) >= 50 and terms == sorted(terms)


def test_pictures_are_small_and_shown():
    shown = "".join(map(text_of, PAGES))
    for picture in (DOCS / "pictures").glob("**/*.*"):
        most = 3_000_000 if picture.suffix == ".gif" else 150_000
        place = picture.relative_to(DOCS).as_posix().replace("/narrow/", "/")  # those have the names of the others
        assert picture.stat().st_size <= most and place in shown, picture


def test_every_public_name_is_in_the_reference():
    listed, packages = {}, {}
    for package, names in re.findall(r"currentmodule:: (\S+)\n(.*?)```", text_of(DOCS / "api.md"), re.S):
        listed.setdefault(package, []).extend(re.findall(r"^   (\w+)$", names, re.M))
    for module in (cf, cf.well, cf.drilling, cf.signals):
        packages[module.__name__] = sorted({*module.__all__} - {"well", "drilling", "signals"})
    assert {package: sorted(names) for package, names in listed.items()} == packages


def test_what_recipes_print_is_compared():
    shown = "tip 1.25 m\nforce 2e+03 N, 12 steps\n"
    assert alike("tip 1.26 m\nforce 3e+03 N, 12 steps\n", shown)
    for other in ("tip 1.27 m", "tip -1.25 m", "end 1.25 m", "tip 1.25", "tip 1.25 m 3"):
        assert not alike(shown.replace("tip 1.25 m", other), shown)
    assert not alike(shown.replace("12 steps", "13 steps"), shown)
    page = "# A\n\n```python\nprint(1)\n```\n\nfirst\n\n```python\nprint(2)\n```\n\n```text\n3\n```\n"
    ran = [(match, prints(match[1], "page", {})) for match in programs(page)]
    assert updated(page, ran) == page.replace("```\n\nfirst", "```\n\n```text\n1\n```\n\nfirst").replace("3", "2")


PROGRAMS = [x for x in blocks("python") if re.search(r"import cosserat_fenicsx|from cosserat_fenicsx import", x[1])]


@pytest.fixture
def forgotten(monkeypatch):
    """Quantities and criteria that a program defines are forgotten after it."""
    criteria = dict(CRITERIA)
    kinds = [Result]
    for kind in kinds:  # and of those that are appended
        kinds += kind.__subclasses__()
        monkeypatch.setattr(kind, "_quantities", kind._quantities)
    yield
    CRITERIA.clear()
    CRITERIA.update(criteria)


@pytest.mark.pages
@pytest.mark.usefixtures("forgotten")
@pytest.mark.parametrize(("page", "program", "shown"), PROGRAMS, ids=[page for page, _, _ in PROGRAMS])
def test_programs_run(page, program, shown, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for package in (cf, cf.well, cf.drilling):  # all is imported now, and none of it into the copies below
        assert all(hasattr(package, name) for name in package.__all__)
    for family in list(FAMILIES.values()):  # whose members other tests find as they were
        members(family)
        monkeypatch.setattr(family, "_members", dict(family._members))
        monkeypatch.setattr(family, "_twice", set(family._twice))
    names = {"__name__": "program"}
    printed = prints(program, page, names)
    if shown:
        assert alike(printed, shown), printed
        for picture in re.findall(r'"(\w+\.png)"', program):
            assert (tmp_path / picture).stat().st_size > 10_000 and f"pictures/{picture}" in text_of(DOCS / page)
        return
    if "column" in program:
        assert "2.2006154" in printed and (tmp_path / "cantilever.png").stat().st_size > 20_000
    if "whirl" in names:
        middle = names["history"].position(names["rod"].at(6.0))[:, :2]
        assert np.hypot(*middle.T) == pytest.approx(0.01153104608640505, rel=1e-3)  # the exact beam
    elif "wall" in names:  # a collar that turns on the low side slips at the angle of friction
        _, y, z = names["history"].position(names["pipe"].at(6.0)).T
        assert np.arctan2(y, z)[names["history"].times > 2].mean() == pytest.approx(np.arctan(0.3), rel=0.02)
    elif {"history", "rod"} <= set(names):
        end = names["history"].position(names["rod"].start)[-1]
        assert end == pytest.approx((40.6897, 0.1578, -3.0316), abs=1e-4)


@pytest.mark.parametrize(("page", "scene"), [x[:2] for x in blocks("toml") if "my_rig" not in x[1]])
def test_scene_files_are_read(page, scene, tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(scene, encoding="utf-8")
    for name, beside in (("fit_readings.csv", "rig.csv"), ("portal.inp", "portal.inp")):
        shutil.copy(Path(__file__).parent / "reference" / name, tmp_path / beside)
    assert cf.read(file).title


@pytest.mark.pages
@pytest.mark.parametrize("file", TUTORIALS, ids=lambda file: file.stem)
def test_tutorials_print_what_they_show(file):
    """`demos/tutorials.py` puts in what they print and draw today."""
    nbformat = [pytest.importorskip(library) for library in ("nbclient", "ipykernel", "openpyxl", "nbformat")][-1]
    import tutorials

    assert file.stem in tutorials.NAMES and len(TUTORIALS) == len(tutorials.NAMES)
    stored, ran = nbformat.read(file, as_version=4), tutorials.ran(file.stem)
    words, beside = tutorials.printed(ran)
    assert words == tutorials.printed(stored)[0] and "Warning" not in beside
    pictures = tutorials.pictures(stored)
    assert len(tutorials.pictures(ran)) == len(pictures) >= 2
    assert all(len(picture["image/png"]) < 55_000 for picture in pictures)  # 40 kB in base 64
    assert file.stem != "column" or "2.200615447828 m" in words


def test_the_survey_of_the_tutorial_is_that_of_the_demo():
    pytest.importorskip("openpyxl")
    here, there = (
        cf.well.WellPath.from_xlsx(DOCS / "tutorials" / "survey.xlsx"),
        cf.well.WellPath.from_csv(ROOT / "demos" / "wells" / "volve_f12.csv"),
    )
    assert here.md == pytest.approx(there.md, abs=0.01 * cf.units.foot)  # two decimals
    assert here.inclination.tolist() == there.inclination.tolist() and here.azimuth.tolist() == there.azimuth.tolist()
