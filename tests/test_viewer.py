"""The interactive .html file, in a headless Chromium: real events, no request, no error."""

import base64
import io
import json
import re
import time

import chromium
import numpy as np
import pytest
from conftest import COMM, column

import cosserat_fenicsx as cf
from cosserat_fenicsx.pictures import viewer

TITLE = "A </script><script>alert(1)</script> & <b>title</b>"


@pytest.fixture(scope="module")
def solved():
    _, scene = column()
    scene = cf.Scene(scene.rods, scene.supports, scene.loads, title=TITLE)
    return cf.solve(scene, [0.3, 0.9, 1.5], elements=4)


def data_of(text):
    """The data in a file."""
    (found,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)
    return json.loads(found)


def floats(text):
    return np.frombuffer(base64.b64decode(text), "<f4")


def test_the_file_holds_positions_and_moments(solved, tmp_path_all):
    file = tmp_path_all / "rod.html"
    solved.write(file)
    COMM.barrier()
    text = file.read_text("utf-8")
    assert len(text) < 100_000 and "://" not in text and "<b>title" not in text
    data, rod = data_of(text), solved.scene.rods[0]
    assert data["title"] == TITLE and data["axis"]["values"] == [0.3, 0.9, 1.5]
    (stored,) = data["rods"]
    states = floats(stored["states"]).reshape(3, stored["nodes"], -1)
    low, high = (np.array([axis[end] for axis in data["axes"]]) for end in ("low", "high"))
    assert (states[..., :3] <= high + 1e-6).all() and (states[..., :3] >= low - 1e-6).all()
    ticks = [(x, float(label)) for x, label in data["axes"][2]["ticks"]]
    metres = np.polyfit(*zip(*ticks, strict=True), 1)
    z = np.polyval(metres, states[2, :, 2])
    expected = solved.sample(2, rod, np.linspace(0, 1, stored["nodes"]))[0]
    np.testing.assert_allclose(z, expected[:, 2], atol=1e-5)
    np.testing.assert_allclose(states[2, 0, 3], solved.fields(2)["bending_moment"][0], rtol=1e-6)


@pytest.mark.serial
def test_many_states_are_thinned_and_the_file_says_so(solved, monkeypatch):
    monkeypatch.setattr(viewer, "_STATES", 2)
    data = data_of(viewer.page(solved))
    assert data["axis"]["values"] == [0.3, 1.5] and "2 of 3 load factors shown, evenly chosen" in data["notes"][0]


@pytest.mark.serial
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium: apt install chromium")
def test_slider_orbit_zoom_and_play_by_real_events(solved, tmp_path):
    solved.write(tmp_path / "rod.html")
    with chromium.Page(tmp_path / "rod.html") as page:
        now = lambda: page.value("document.querySelector('#now').textContent")
        seen = lambda: pixels(page.screenshot())
        assert page.value("document.title") == page.value("document.querySelector('h1').textContent") == TITLE
        assert now() == "load factor 1.5"
        first = seen()
        assert 500 < vivid(first) < 50_000, "the rod is seen, in colours"

        x, y = page.middle("#slider")
        page.drag(x, y, 0, 0)
        assert now() == "load factor 0.9"
        page.key("ArrowLeft", 37)
        assert 0.89 < float(now().split()[-1]) < 0.9
        assert changed(first, second := seen())

        page.drag(400, 300, 100, 40)
        assert changed(second, third := seen()), "turned"
        page.drag(400, 300, 60, 30, button="right")
        assert changed(third, fourth := seen()), "moved"
        page.wheel(450, 300, -300)
        assert vivid(fifth := seen()) > 1.3 * vivid(fourth), "nearer"
        page.touch(((400, 300), (470, 330)))
        assert changed(fifth, sixth := seen()), "turned by a finger"
        page.touch(((350, 300), (420, 300)), ((550, 300), (480, 300)))
        assert changed(sixth, seen()), "two fingers"
        page.click("#reset")
        page.drag(*page.middle("#slider"), 600, 0)
        assert now() == "load factor 1.5" and not changed(first, seen()), "as at first"

        page.click("#play")
        times, until = set(), time.monotonic() + 30
        while len(times) < 4 and time.monotonic() < until:
            page.frame()
            times.add(now())
        assert len(times) >= 4 and page.value("document.querySelector('#play').textContent") == "stop"
        page.click("#play")
        stopped = now()
        page.frame()
        assert now() == stopped and page.value("document.querySelector('#play').textContent") == "play"
        page.value("document.querySelector('#field').focus()")
        page.key("ArrowDown", 40)
        assert page.value("document.querySelector('#field').selectedOptions[0].textContent") == "twisting moment"
        assert page.errors == []


def pixels(png):
    """(height, width, 3) of the picture without the controls."""
    from matplotlib.image import imread

    return (imread(io.BytesIO(png))[60:520, :700, :3] * 255).astype(int)


def vivid(image):
    return (np.ptp(image, axis=2) > 60).sum()


def changed(one, other):
    return (np.abs(one - other).max(axis=2) > 40).sum() > 50
