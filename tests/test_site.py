"""The site: it builds, and at 400 and at 1280 pixels, in headless Chromium, no page scrolls sideways, code and tables
keep to their boxes, and pictures can be read."""

import os
import re
import subprocess
import sys
from pathlib import Path

import chromium
import pytest

pytestmark = [pytest.mark.serial, pytest.mark.once, pytest.mark.pages]
ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = (
    "index", "first_steps", "gallery", "wells", "drilling", "string_stability", "speed", "failures", "mathematics",
    "scene_files",
)  # fmt: skip
WIDE, NARROW = 1280, 400
DRAWN_NARROW = {path.name for path in (DOCS / "pictures" / "narrow").iterdir()}
#: Of what is measured on a page.
MEASURED = """(() => {
    const width = document.documentElement.clientWidth
    const all = (selector) => [...document.querySelectorAll(selector)]
    const over = (element) => element.scrollWidth - element.clientWidth
    const scrolls = (element) => ['auto', 'scroll'].includes(getComputedStyle(element).overflowX)
    const boxed = (element) => {
        for (let e = element.parentElement; e && !e.matches('.content'); e = e.parentElement)
            if (scrolls(e)) return true
        return false
    }
    const outside = all('article *').filter((e) => {
        const box = e.getBoundingClientRect()
        return box.width && (box.right > width + 1 || box.left < -1) && !boxed(e)
    })
    return {
        width,
        page: [document.documentElement, document.body, document.querySelector('.content')].map(over),
        outside: outside.slice(0, 5).map((e) => e.outerHTML.slice(0, 200)),
        code: all('article pre').map((e) => [over(e), scrolls(e), e.textContent.slice(0, 60)]),
        tables: all('article table').map((e) => [over(e.parentElement), boxed(e)]),
        pictures: all('article img').map((e) => {
            const name = (e.currentSrc || e.src).split('_images/')[1]
            return [name, e.getBoundingClientRect().width, e.naturalWidth, boxed(e)]
        }),
    }
})()"""


def looked_at(shown, page, folder):
    """{width: what is measured on a page}; pictures of its upper end are in the folder."""
    found = {}
    shown.open(page)
    for width in (NARROW, WIDE):
        shown.resize(width, 900)
        shown.frame()
        shown.value("Promise.allSettled([...document.images].map((image) => image.decode()))")
        found[width] = shown.value(MEASURED)
        (folder / f"{page.stem}_{width}.png").write_bytes(shown.screenshot())
    return found


def built(place):
    """The site: that of `make docs` if nothing it is made of has changed since; else built anew, without warnings."""
    made = [file for folder in (DOCS, ROOT / "cosserat_fenicsx", ROOT / "forms") for file in folder.rglob("*.*")]
    made = [file for file in (*made, ROOT / "CHANGELOG.md") if not {"api", "__pycache__"} & {*file.parts}]
    site = ROOT / "out" / "docs"
    index = site / "searchindex.js"  # the last file that is written
    if index.exists() and index.stat().st_mtime > max(file.stat().st_mtime for file in made):
        return site
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "-d", place / "kept"]
    done = subprocess.run([*command, DOCS, place / "site"], capture_output=True, encoding="utf-8", env=os.environ)
    assert done.returncode == 0, done.stderr
    return place / "site"


def test_the_site_and_ten_pages_of_it(tmp_path):
    """It builds without warnings, and needs nothing from elsewhere. `make docs` installs what it takes."""
    pytest.importorskip("myst_nb")
    site, pictures = built(tmp_path), tmp_path / "pictures"
    pictures.mkdir()
    for page in site.glob("**/*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.search(r'<(script|img|iframe)[^>]* src="https?:|<link[^>]* href="https?:', text), page
    if chromium.PROGRAM is None:
        pytest.skip("the site builds; to look at its pages takes chromium")
    with chromium.Page(site / "index.html") as shown:
        for name in PAGES:
            for width, found in looked_at(shown, site / f"{name}.html", pictures).items():
                check(found, width, f"{name}, {width} pixels")
        wrong = [error for error in shown.errors if not error.startswith(("file:", "data:"))]
    assert not wrong, "errors, or requests to a network"
    assert {path.name for path in pictures.iterdir()} == {f"{name}_{x}.png" for name in PAGES for x in (NARROW, WIDE)}


def check(found, width, where):
    assert found["width"] == width and found["page"] == [0, 0, 0], (where, found["outside"])
    assert not found["outside"], where
    assert all(scrolls for _, scrolls, _ in found["code"]), where
    assert width == NARROW or [text for over, _, text in found["code"] if over > 0] == [], where
    assert all(over <= 0 or inside for over, inside in found["tables"]), where
    for picture, across, pixels, inside in found["pictures"]:
        assert pixels > 0, f"{where}: {picture} is missing"
        assert 340 <= across <= width or (inside and across <= 1100), (where, picture, across)
    # the charts that are drawn for narrow pages are shown there, and nowhere else
    shown = {picture for picture, *_ in found["pictures"]}
    names = {Path(picture).name for picture in shown}
    expected = {f"narrow/{name}" for name in names & DRAWN_NARROW} if width == NARROW else set()
    assert {picture for picture in shown if picture.startswith("narrow/")} == expected, where
