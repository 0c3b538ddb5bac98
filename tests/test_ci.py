"""The images of .ci: which base serves, when a suite is due, and what a failure means for the whole run."""

import os
import sys
import time
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
sys.path.append(str(ROOT / ".ci"))

import engine  # noqa: E402
from command import Failed, ask, sh  # noqa: E402
from verdict import DEVELOPMENT, verdict  # noqa: E402

pytestmark = [pytest.mark.serial, pytest.mark.once]
RECORDED = DEVELOPMENT["sid"]


@pytest.fixture
def debian():
    loader = SourceFileLoader("debian", str(ROOT / ".ci" / "debian"))
    module = module_from_spec(spec_from_loader("debian", loader))
    loader.exec_module(module)
    return module


@pytest.mark.parametrize(("suite", "version", "failure", "word", "code"), [
    ("trixie", "0.9.0", None, "passed", 0),
    ("trixie", "0.9.0", "pytest", "FAILED", 1),
    ("trixie", None, "mmdebstrap", "FAILED", 1),
    ("sid", f"{RECORDED}.post0", None, "passed", 0),
    ("sid", f"{RECORDED}.post0", "pytest", "FAILED", 1),
    ("sid", None, "mmdebstrap", "SKIPPED", 0),
    ("sid", "9.1.0", "pytest", "WARNING", 0),
    ("sid", "9.1.0", None, "passed", 0),
])  # fmt: skip
def test_a_failure_counts_where_success_is_recorded(suite, version, failure, word, code):
    words, found = verdict(suite, version, failure)
    assert words.startswith(word) and found == code
    assert all(part in words for part in (suite, version or "", failure or ""))
    assert ("update DEVELOPMENT" in words) == (version == "9.1.0" and not failure)


FAKE = """#!/bin/sh
echo "$@" >> "$LOG"
case " $* " in
    *" overlay "*" images "*) [ -z "$NO_OVERLAY" ] ;;
    *" inspect "*) grep -q " commit " "$LOG" ;;
    *" from scratch "*) echo container ;;
esac
"""


@pytest.fixture
def log(tmp_path, monkeypatch):
    """Words of the commands that were given to a buildah and an mmdebstrap that only write these down."""
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "buildah").write_text(FAKE)
    (tools / "mmdebstrap").write_text('#!/bin/sh\necho mmdebstrap "$@" >> "$LOG"\n[ -z "$UNREACHABLE" ]\n')
    (tools / "apt-get").write_text("#!/bin/sh\necho mirror\n")
    (tools / "apt-config").write_text("#!/bin/sh\necho 'Acquire::http::Proxy \"p\";'\n")
    for tool in tools.iterdir():
        tool.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tools}:{os.environ['PATH']}")
    monkeypatch.setenv("LOG", str(tmp_path / "log"))
    return tmp_path / "log"


def test_a_base_is_made_once_and_anew_when_it_is_old(tmp_path, log, monkeypatch, capsys):
    engine.Engine(tmp_path / "cache").base("sid", days=7)
    said = log.read_text()
    assert "--variant=minbase" in said and "Acquire::http::Proxy" in said and "commit --quiet --rm" in said
    assert said.count("mmdebstrap") == 1 and "debian:sid" in said

    made = engine.Engine(tmp_path / "cache")
    made.base("sid", days=7)
    assert log.read_text().count("mmdebstrap") == 1

    week = time.time() - 8 * 86400
    os.utime(tmp_path / "cache/sid/base", (week, week))
    monkeypatch.setenv("UNREACHABLE", "1")
    made.base("sid", days=7)
    assert "debian:sid of 8 days ago serves, as it could not be made anew: exit code 1" in capsys.readouterr().out
    with pytest.raises(Failed, match="mmdebstrap"):
        made.base("trixie", days=7)

    monkeypatch.delenv("UNREACHABLE")
    made.base("sid", days=7)
    made.base("sid", days=7)
    assert log.read_text().count("mmdebstrap") == 4


def test_layers_are_copies_where_overlays_cannot_be(tmp_path, log, monkeypatch):
    monkeypatch.setenv("NO_OVERLAY", "1")
    engine.Engine(tmp_path / "cache").build("trixie", "run", "certificates:/etc/ssl/certs")
    built = [line for line in log.read_text().splitlines() if " bud " in line][0]
    assert built.startswith("--storage-driver vfs") and "--target run --build-arg SUITE=trixie" in built


def test_the_development_branch_is_tested_once_a_day_and_when_it_may_have_broken(debian, tmp_path):
    (tmp_path / "cosserat_fenicsx").mkdir()
    compat, other = tmp_path / "cosserat_fenicsx/compat.py", tmp_path / "cosserat_fenicsx/other.py"
    compat.write_text("A = 1")
    other.write_text("B = 1")
    (tmp_path / ".ci").mkdir()
    for name in ("Dockerfile", ".ci/dpkg.cfg", ".ci/debian-packages.txt"):
        (tmp_path / name).write_text("C = 1")
    stamp = tmp_path / "tested"
    assert debian.is_due("sid", stamp, tmp_path)
    stamp.write_text(debian.served(tmp_path))
    assert not debian.is_due("sid", stamp, tmp_path) and debian.is_due("trixie", stamp, tmp_path)
    other.write_text("B = 2")
    assert not debian.is_due("sid", stamp, tmp_path)
    other.write_text("from cosserat_fenicsx import compat")
    assert debian.is_due("sid", stamp, tmp_path)
    stamp.write_text(debian.served(tmp_path))
    (tmp_path / "Dockerfile").write_text("C = 2")
    assert debian.is_due("sid", stamp, tmp_path)
    stamp.write_text(debian.served(tmp_path))
    os.utime(stamp, (time.time() - 90000,) * 2)
    assert debian.is_due("sid", stamp, tmp_path)


def test_the_run_goes_on_without_the_development_branch(debian, tmp_path, log, monkeypatch, capsys):
    monkeypatch.setenv("UNREACHABLE", "1")
    monkeypatch.chdir(ROOT)
    debian.main(tmp_path / "cache", ["sid"])
    assert "=== SKIPPED: debian:sid cannot be had today: exit code 1 from: mmdebstrap" in capsys.readouterr().out
    with pytest.raises(SystemExit) as ended:
        debian.main(tmp_path / "cache", ["trixie", "sid"])
    assert ended.value.code == 1
    said = capsys.readouterr().out
    assert "=== FAILED on debian:trixie: exit code 1 from: mmdebstrap" in said and "debian:sid" not in said
    assert not list(tmp_path.glob("cache/*/tested"))


def test_a_failed_command_is_named_and_its_output_shown(capsys):
    with pytest.raises(Failed, match=r"exit code 3 from: sh -c 'echo seen; exit 3'"):
        ask("sh", "-c", "echo seen; exit 3")
    assert "seen" in capsys.readouterr().out


def test_a_command_that_takes_too_long_ends_with_all_it_has_started(tmp_path):
    with pytest.raises(Failed, match="not done after 0.005 minutes: sh -c"):
        sh("sh", "-c", f"(sleep 1; touch {tmp_path}/late) & wait", timeout=0.3)
    time.sleep(1)
    assert not (tmp_path / "late").exists()
