"""The measurement of speed against accuracy: its programs, this
package's accuracy, and the peers that are installed."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.serial
EVIDENCE = Path(__file__).parent.parent / "demos" / "evidence"


@pytest.fixture(autouse=True)
def evidence_on_the_path(monkeypatch):
    monkeypatch.setattr(sys, "path", [str(EVIDENCE), *sys.path])


@pytest.mark.slow
def test_quick(tmp_path, capsys):
    """This package's results are as accurate as their degree allows; every peer gives a result or a reason why not."""
    import work_precision
    from peers.configurations import PEERS
    from peers.environments import OWN

    found = work_precision.main(out=tmp_path, quick=True)
    told = json.loads((tmp_path / "work_precision_quick.json").read_text())
    assert {"date", "cpu", "cores", "platform"} <= told["about"]["machine"].keys() and told["about"]["seed"] == 2026
    rows = told["samples"]
    own = [row for row in rows if row["peer"] == OWN]
    assert {row["configuration"]["model"] for row in own} == {"determinate", "planar", "spatial"}
    for row in own:
        bound = {(2, 4): 1e-3, (4, 4): 1e-8, (4, 16): 1e-12}
        configuration = row["configuration"]
        assert row["error"] < bound[configuration["degree"], configuration["elements"]], row
        assert len(row["seconds"]) == 2 and min(row["seconds"]) > 0
    for peer in set(PEERS) - {OWN}:
        answers = [row for row in rows if row["peer"] == peer]
        assert peer in found.missing or answers
        assert all(row["failed"] or (row["seconds"] and row["error"] < 0.1) for row in answers), peer
    printed = capsys.readouterr().out
    assert "forced to spatial against the fastest planar peer" in printed
    assert all(f"{peer} is missing" in printed for peer in found.missing)
    for name in ("sweep", "sweep_spatial", "bend"):
        assert (tmp_path / f"work_precision_quick_{name}.png").stat().st_size > 20000


@pytest.mark.slow
def test_quick_motion(tmp_path, capsys):
    """Every scheme is as accurate as its step allows; Exudyn is included if installed."""
    import work_precision_motion
    from peers.environments import OWN

    from cosserat_fenicsx.dynamics.schemes import SCHEMES

    found = work_precision_motion.main(out=tmp_path, quick=True)
    rows = list(found.rows.values())
    own = [row for row in rows if row["peer"] == OWN]
    assert {row["configuration"]["scheme"] for row in own} == set(SCHEMES)
    bounds = {"momentum": 2.5e-3, "energy": 1e-2, "triple-jump": 6e-4}
    assert all(row["error"] < bounds.get(row["configuration"]["scheme"], 5e-2) for row in own), own
    theirs = [row for row in rows if row["peer"] != OWN]
    assert ("Exudyn" in found.missing) != bool(theirs)
    assert all(row["failed"] or row["error"] < 0.1 for row in theirs), theirs
    assert (tmp_path / "work_precision_motion_quick.png").stat().st_size > 20000
    assert "| Flying spaghetti in space, ends at t = 10 s | cosserat_fenicsx: energy |" in capsys.readouterr().out


@pytest.mark.slow
def test_broken_off_run_goes_on(tmp_path, monkeypatch):
    """Samples are kept, unless sources have changed; an interruption prints how to continue."""
    import work_precision
    from peers.environments import OWN

    file = tmp_path / "work_precision.json"
    monkeypatch.setattr(work_precision, "waits", lambda *_: [])
    few = [{"model": "determinate", "formulation": "mixed", "degree": 2, "elements": n} for n in (1, 2)]
    panel = work_precision.STATICS._replace(configurations=lambda *_: few)
    monkeypatch.setattr(work_precision, "STATICS", panel)
    run = {"out": tmp_path, "peers": (OWN,), "names": ("single",)}

    with monkeypatch.context() as patch:
        patch.setattr(work_precision, "sample", _after(1, work_precision.sample))
        with pytest.raises(SystemExit, match="goes on"):
            work_precision.main(**run, wanted=1)
    (first,) = [row["seconds"] for row in json.loads(file.read_text())["samples"] if row["seconds"]]
    rows = work_precision.main(**run, wanted=2).rows.values()
    assert [len(row["seconds"]) for row in rows] == [2, 2] and first[0] in [row["seconds"][0] for row in rows]
    monkeypatch.setattr(work_precision, "fingerprint", lambda peer: "other")
    assert not work_precision.Record(file).rows
    assert not work_precision.Record(file, fresh=True).rows


def _after(count, sample):
    left = iter(range(count))

    def broken(*arguments):
        if next(left, None) is None:
            raise KeyboardInterrupt
        sample(*arguments)

    return broken


def test_truths_belong_to_their_models():
    """References for the 45-degree bend and the paper's column, with and without shear."""
    from peers import problems

    rest = 100 * np.array([np.sin(np.pi / 4), 1 - np.cos(np.pi / 4), 0])
    tip = problems.truth("bend", "Reissner")[0] + rest
    np.testing.assert_allclose(tip, (47.15043857, 15.68480053, 53.47485879), atol=2e-8)
    rigid = problems.truth("bend", "shear-rigid")[0] + rest
    assert 1e-3 < np.linalg.norm(rigid - tip) < 1e-2
    assert problems.truth("single", "Reissner")[0, 1] == pytest.approx(2.200615447828, abs=1e-9)
    assert problems.error("bend", "Reissner", problems.truth("bend", "Reissner")) == 0


def test_a_peer_that_hangs_or_dies_is_reported():
    from peers.process import Peer

    script = "import sys, time, json\nfor line in sys.stdin:\n    c = json.loads(line)['configuration']\n"
    script += "    time.sleep(c['sleep'])\n    sys.exit(3) if c['die'] else print('{\"seconds\": [1.0]}', flush=True)"
    with Peer("cosserat_fenicsx") as peer:
        peer.words = [sys.executable, "-c", script]

        def ask(sleep, die):
            return peer.ask({}, {"sleep": sleep, "die": die}, warm=0, samples=1, limit=2.0)

        assert ask(60, False) == {"failed": "time limit of 2 s"}
        assert ask(0, False) == {"seconds": [1.0]}
        assert ask(0, True) == {"failed": "the process ended with code 3"}


def test_a_missing_peer_is_named(tmp_path, monkeypatch):
    from peers.environments import Missing, command

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for peer in ("Exudyn", "OpenSeesPy", "PyElastica", "CalculiX"):
        with pytest.raises(Missing, match=f"{peer} is not installed yet"):
            command(peer, install=False)


def test_time_at_an_accuracy():
    """The cheapest result that is accurate enough is taken; the frontier has no result that another beats in both."""
    from work_precision_chart import frontier
    from work_precision_table import cheapest

    rows = [
        {"error": error, "seconds": [seconds] * 5} for error, seconds in ((1e-2, 1), (1e-4, 3), (1e-6, 2), (1e-9, 9))
    ]
    assert cheapest(rows, 1e-3) is rows[2] and cheapest(rows, 1e-8) is rows[3] and cheapest(rows, 1e-10) is None
    assert frontier(rows) == [rows[3], rows[2], rows[0]]


def test_ratios_that_are_asked_for():
    """Of each side the fastest that is accurate enough; by tol it is the true error that counts."""
    from harness import judged
    from work_precision_table import ASKED, called, deciding, ratios

    def row(peer, kind, seconds, error, **configuration):
        return {
            "problem": "sweep", "peer": peer, "kind": kind, "spatial": "spatial" in kind, "seconds": [seconds],
            "error": error, "configuration": configuration,
        }  # fmt: skip

    rows = [
        row("cosserat_fenicsx", "auto, by tol", 1.0, 1e-6, model="auto", tol=1e-2),
        row("cosserat_fenicsx", "auto, by tol", 3.0, 1e-9, model="auto", tol=1e-6),
        row("cosserat_fenicsx", "spatial, mixed", 2.0, 1e-9, model="spatial", degree=4, elements=2),
        row("Exudyn", "planar 3-node", 4.0, 1e-8, elements=8),
        row("Exudyn", "planar 3-node", 4.5, 1e-8, elements=9),
        row("OpenSeesPy", "spatial CBDI", 20.0, 1e-8, elements=8),
    ]
    found = {(words, accuracy): ratio for words, accuracy, _, _, ratio, _ in ratios(rows)}
    plane, space, both, automatic = (words for words, *_ in ASKED)
    assert found[plane, 1e-5] == 1 / 4 and found[plane, 1e-7] == 2 / 4 and found[space, 1e-7] == 2 / 20
    assert found[both, 1e-3] == 2 / 4 and found[automatic, 1e-5] == 1 / 4 and found[automatic, 1e-7] == 3 / 4
    assert deciding(rows) == [rows[i] for i in (0, 3, 4, 2, 5, 1)]
    assert called(rows[0]) == "auto, tol 1e-02" and judged(None, 0.5) == "- | 1/2 | -"
    assert judged(1 / 4, 1 / 5) == "1/4 | 1/5 | missed" and judged(0.4, 0.5, ".2f") == "0.40 | 0.5 | met"
