"""The trees of .ci: what is performed, which cached tree serves, and what a failure means for the whole run."""

import os
import sys
import time
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
sys.path.append(str(ROOT / ".ci"))

import layers  # noqa: E402
from command import Failed, ask  # noqa: E402
from dockerfile import read  # noqa: E402
from verdict import DEVELOPMENT, verdict  # noqa: E402

pytestmark = pytest.mark.serial
RECORDED = DEVELOPMENT["sid"]


def test_suites_differ_in_from_alone():
    (stable, *rest), (development, *same) = (read(ROOT / "Dockerfile", **given) for given in ({}, {"SUITE": "sid"}))
    assert (stable.text, development.text) == ("debian:trixie", "debian:sid")
    assert rest == same
    assert not any("SUITE" in step.env for step in rest)


@pytest.mark.parametrize("last", ["RUN true", "CMD [1]\nCMD [2]", "CMD make", "ADD . ."])
def test_what_is_not_understood_is_refused(tmp_path, last):
    (tmp_path / "Dockerfile").write_text(f"FROM debian:trixie\nRUN true\n{last}\n")
    with pytest.raises(Failed, match="Dockerfile: "):
        read(tmp_path / "Dockerfile")


@pytest.mark.parametrize(
    ("suite", "version", "failure", "word", "code"),
    [
        ("trixie", "0.9.0", None, "passed", 0),
        ("trixie", "0.9.0", "pytest", "FAILED", 1),
        ("trixie", None, "mmdebstrap", "FAILED", 1),
        ("sid", f"{RECORDED}.post0", None, "passed", 0),
        ("sid", f"{RECORDED}.post0", "pytest", "FAILED", 1),
        ("sid", None, "mmdebstrap", "SKIPPED", 0),
        ("sid", "9.1.0", "pytest", "WARNING", 0),
        ("sid", "9.1.0", None, "passed", 0),
    ],
)
def test_a_failure_counts_where_success_is_recorded(suite, version, failure, word, code):
    words, found = verdict(suite, version, failure)
    assert words.startswith(word) and found == code
    assert all(part in words for part in (suite, version or "", failure or ""))
    assert ("update DEVELOPMENT" in words) == (version == "9.1.0" and not failure)


@pytest.fixture
def steps(tmp_path):
    (tmp_path / "Dockerfile").write_text("FROM debian:sid\nRUN install\nUSER rod\nRUN make\nCMD []\n")
    return read(tmp_path / "Dockerfile")[:-1]


@pytest.fixture
def performed(monkeypatch):
    """What was performed since this list was cleared; a step whose text is in it as "no ..." fails."""
    texts = []

    def perform(tree, step):
        if f"no {step.text}" in texts:
            raise Failed(f"{step.text}: unreachable")
        texts.append(step.text)
        (tree / step.text).write_text(str(time.time_ns()))

    monkeypatch.setattr(layers, "perform", perform)
    return texts


def test_a_tree_is_made_once_and_anew_when_it_is_old(tmp_path, steps, performed, capsys):
    cache = tmp_path / "cache"
    with layers.locked(cache):
        tree, remaining = layers.cached(steps, cache, days=7)
        assert performed == ["debian:sid", "install"] and [step.text for step in remaining] == ["make"]
        first = (tree / "install").read_text()

        performed.clear()
        assert layers.cached(steps, cache, days=7)[0] == tree and not performed

        week = time.time() - 8 * 86400
        os.utime(tree, (week, week))
        performed.append("no install")
        assert layers.cached(steps, cache, days=7)[0] == tree
        assert "8 days ago serves, as it could not be made anew: install: unreachable" in capsys.readouterr().out
        assert (tree / "install").read_text() == first and not (cache / "new").exists()

        performed.clear()
        layers.cached(steps, cache, days=7)
        assert performed == ["debian:sid", "install"] and (tree / "install").read_text() != first
        assert layers.cached(steps, cache, days=7)[0] == tree and len(performed) == 2


def test_only_trees_in_use_stay(tmp_path, steps, performed):
    cache = tmp_path / "cache"
    with layers.locked(cache):
        old, _ = layers.cached(steps, cache, days=7)
        changed = [steps[0], steps[1]._replace(text="install more"), *steps[2:]]
        performed.append("no install more")
        with pytest.raises(Failed, match="unreachable"):
            layers.cached(changed, cache, days=7)
        assert old.exists()
        performed.clear()
    with layers.locked(cache):
        new, _ = layers.cached(changed, cache, days=7)
        assert new.exists() and not old.exists()


def test_the_run_goes_on_without_the_development_branch(tmp_path, monkeypatch, capsys):
    loader = SourceFileLoader("debian", str(ROOT / ".ci" / "debian"))
    debian = module_from_spec(spec_from_loader("debian", loader))
    loader.exec_module(debian)

    def unreachable(*_, **__):
        raise Failed("the mirror does not answer")

    monkeypatch.setattr(debian, "cached", unreachable)
    monkeypatch.chdir(ROOT)
    debian.main(tmp_path, ["sid"])
    assert "=== SKIPPED: debian:sid cannot be had today: the mirror does not answer" in capsys.readouterr().out
    with pytest.raises(SystemExit) as ended:
        debian.main(tmp_path, ["trixie", "sid"])
    assert ended.value.code == 1
    said = capsys.readouterr().out
    assert "=== FAILED on debian:trixie: the mirror does not answer" in said and "sid" not in said


def test_a_failed_command_is_named_and_its_output_shown(capsys):
    with pytest.raises(Failed, match=r"exit code 3 from: sh -c 'echo seen; exit 3'"):
        ask("sh", "-c", "echo seen; exit 3")
    assert "seen" in capsys.readouterr().out
