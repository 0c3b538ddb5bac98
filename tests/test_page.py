"""The interactive file: its data, and what it shows in Chromium."""

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
from cosserat_fenicsx.results import screen

TITLE = "A </script><script>alert(1)</script> & <b>title</b>"


@pytest.fixture(scope="module")
def viewed():
    _, scene = column()
    scene = cf.Scene(scene.rods, scene.supports, scene.loads, title=TITLE)
    return cf.solve(scene, [0.3, 0.9, 1.5], elements=4)


def data_of(text):
    """The data in a file."""
    (found,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)
    return json.loads(found)


def floats(text):
    return np.frombuffer(base64.b64decode(text), "<f4")


def test_the_file_holds_positions_and_moments(viewed, tmp_path_all):
    file = tmp_path_all / "rod.html"
    viewed.write(file)
    COMM.barrier()
    text = file.read_text("utf-8")
    assert len(text) < 100_000 and "://" not in text and "<b>title" not in text
    data, rod = data_of(text), viewed.scene.rods[0]
    assert data["title"] == TITLE and data["axis"]["values"] == [0.3, 0.9, 1.5]
    (stored,) = data["rods"]
    states = floats(stored["states"]).reshape(3, stored["nodes"], -1)
    low, high = (np.array([axis[end] for axis in data["axes"]]) for end in ("low", "high"))
    assert (states[..., :3] <= high + 1e-6).all() and (states[..., :3] >= low - 1e-6).all()
    ticks = [(x, float(label)) for x, label in data["axes"][2]["ticks"]]
    metres = np.polyfit(*zip(*ticks, strict=True), 1)
    z = np.polyval(metres, states[2, :, 2])
    expected = viewed.sample(2, rod, np.linspace(0, 1, stored["nodes"]))[0]
    np.testing.assert_allclose(z, expected[:, 2], atol=1e-5)
    np.testing.assert_allclose(states[2, 0, 3], viewed.fields(2)["bending_moment"][0], rtol=1e-6)


@pytest.mark.serial
def test_many_states_are_thinned_and_the_file_says_so(viewed, monkeypatch):
    monkeypatch.setattr(viewer, "_STATES", 2)
    data = data_of(viewer.page(viewed))
    assert data["axis"]["values"] == [0.3, 1.5] and "2 of 3 load factors shown, evenly chosen" in data["notes"][0]


@pytest.mark.serial
def test_the_file_is_in_the_chosen_units(viewed):
    assert data_of(viewer.page(viewed))["units"] == {}
    data = data_of(viewer.page(viewed, units="klbf,ft"))
    assert [axis["name"] for axis in data["axes"]] == ["x (ft)", "y (ft)", "z (ft)"]
    assert data["units"]["N"] == [pytest.approx(4448.2216), "klbf"] and data["units"]["m"] == [0.3048, "ft"]
    assert "Pa" not in data["units"]


STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)


def beam():
    """A beam of 2 m that a force of 50 N at its end bends by F L^3/(3 EI), too little to be seen, at load factor 1."""
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), cf.Circle(0.05), STEEL, name="beam")
    loads = [
        cf.Force(rod.end, (0, 0, -50.0)),
        cf.FollowerMoment(rod.at(1.0), (0, 1.0, 0)),
        cf.LineForce(rod, (0, 0, -2.0)),
        cf.Weight(),
        cf.Spring(rod.at(1.5), 10.0, direction=(0, 0, 1)),
        cf.Foundation(rod, 5.0),
    ]
    supports = [cf.Clamp(rod.start), cf.Roller(rod.at(0.5), (0, 1, 0))]
    return cf.solve(cf.Scene([rod], supports, loads), [0.0, 0.5, 1.0], elements=2)


@pytest.mark.serial
def test_the_file_holds_supports_and_loads():
    path = beam()
    data = data_of(viewer.page(path))
    signs = {sign["kind"]: sign for sign in data["signs"]}
    assert list(signs) == ["clamp", "roller", "force", "moment", "line force", "everywhere", "spring"]
    nodes = data["rods"][0]["nodes"]
    assert signs["clamp"]["at"] == [0] and signs["roller"]["at"] == [0.25 * (nodes - 1)]
    assert signs["force"]["at"] == [nodes - 1] and signs["force"]["end"] == 1 and signs["force"]["top"] == 50.0
    np.testing.assert_allclose(floats(signs["force"]["vectors"]), [0, 0, 0, 0, 0, -0.5, 0, 0, -1])
    (rod,) = path.scene.rods
    assert signs["moment"]["turns"]
    moment = floats(signs["moment"]["vectors"])  # along d1, d2, d3, with which it turns
    np.testing.assert_allclose(moment, [0, 0, 0, 0, 0.5, 0, 0, 1, 0], atol=1e-7)
    line = floats(signs["line force"]["vectors"]).reshape(3, -1, 3)
    weight = 9.81 * 7850 * np.pi * 0.05**2 / 4
    np.testing.assert_allclose(line[:, :, 2].T, [[0, -1 / weight, -2 / weight]] * line.shape[1], rtol=1e-6)
    *_, small, undrawn = data["notes"]
    assert undrawn.startswith("not drawn: Foundation")
    assert small.startswith(f"displacements are at most {path.largest_displacement().max():.2g} m")
    moved = 50 * 2**3 / 3 / rod.stiffness.bending[0]
    assert data["magnify"]["start"] == 1 and max(data["magnify"]["choices"]) * moved < 2 * 2
    rest = floats(data["rods"][0]["rest"]).reshape(-1, 3)
    states = floats(data["rods"][0]["states"]).reshape(3, nodes, -1)
    np.testing.assert_allclose(states[0, :, :3], rest, atol=1e-6)


@pytest.mark.serial
def test_the_factor_of_displacements_is_checked(viewed, tmp_path_all):
    with pytest.raises(cf.SceneError, match="write.magnify = 0: expected"):
        viewed.write(tmp_path_all / "rod.html", magnify=0)
    with pytest.raises(cf.SceneError, match=r"magnify is not for the ending '.csv': expected a file .html"):
        viewed.write(tmp_path_all / "rod.csv", magnify=2)


@pytest.mark.serial
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium: apt install chromium")
def test_signs_and_magnified_displacements_are_seen(tmp_path):
    path = beam()
    path.write(tmp_path / "beam.html", magnify=200)
    with chromium.Page(tmp_path / "beam.html") as page:
        seen = lambda: pixels(page.screenshot())
        words = lambda: page.value("document.querySelector('#note').textContent")
        label = lambda text: page.value(
            f"[...document.querySelectorAll('#labels i')].filter((x) => x.textContent == {text!r})"
            ".map((x) => parseFloat(x.style.top))[0]"
        )
        assert "displacements magnified 200 times" in words()
        first, magnified = seen(), label("50 N")
        red = lambda image: int(((image[..., 0] > 130) & (image[..., 1] < 80) & (image[..., 2] < 80)).sum())
        assert red(first) > 100 and label("Weight") and label("1 N m (follows)")
        page.click("#signs")
        assert red(bare := seen()) == 0 and label("50 N") is None and changed(first, bare)
        page.click("#signs")
        assert not changed(first, seen())
        page.value(
            "(() => { const choice = document.querySelector('#magnify'); choice.value = '1';"
            "choice.dispatchEvent(new Event('change')) })()"
        )
        page.frame()
        assert "magnified" not in words() and changed(first, seen())
        across, upwards = page.value(
            "(() => { const eye = new Camera(data.box, data.view), [[a], [b]] = data.axes[0].ticks;"
            "return [b - a, eye.project([0, 0, 0])[1] - eye.project([0, 0, 1])[1]] })()"
        )
        first, second = (
            float(text) for _, text in data_of((tmp_path / "beam.html").read_text("utf-8"))["axes"][0]["ticks"][:2]
        )
        metre = upwards * across / (second - first)  # pixels
        moved = -path.displacement("beam.end")[-1, 2]
        assert magnified - label("50 N") == pytest.approx(199 * moved * metre, abs=3)
        assert page.errors == []


@pytest.mark.serial
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium: apt install chromium")
def test_slider_orbit_zoom_and_play_by_real_events(viewed, tmp_path):
    viewed.write(tmp_path / "rod.html")
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


@pytest.mark.serial
def test_tables_have_their_width_in_a_dumb_terminal(monkeypatch):
    """As under mpirun, whose output is a terminal, in an editor or a service whose TERM is dumb."""
    monkeypatch.setenv("TERM", "dumb")
    monkeypatch.setenv("FORCE_COLOR", "1")
    table = screen.Table()
    for _ in range(8):
        table.add_column("x")
    table.add_row(*["123456789012"] * 8)
    assert max(map(len, screen.as_text(table).splitlines())) == 121
