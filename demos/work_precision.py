"""Speed against accuracy: this package and its peers on the same problems, one chart each (`make work-precision`).

    python demos/work_precision.py            all of it, at most half an hour; goes on where it was broken off
    python demos/work_precision.py --fresh    forgets the samples that are there
    python demos/work_precision.py --quick    a few configurations, at most a minute, nothing is installed

Leaves in out/: work_precision.json (every sample), work_precision.md (the table), work_precision_*.png.

Every peer is a process of its own, in an environment of its own, on one thread. A sample is processor time of the
process around one warm solution from the unloaded state; a round asks every configuration for one sample, in an order
that changes from round to round, so that peers alternate. A number is the median over at least five rounds.
"""

import argparse
import json
import random
import time
from collections import Counter
from pathlib import Path

import work_precision_chart as chart
import work_precision_table as table
from machine import record
from peers.configurations import PEERS, configurations, kind, model
from peers.environments import Missing, fingerprint
from peers.problems import error, problems
from peers.process import Peer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from waiting import waits

ROUNDS, SEED = 5, 2026
LIMIT = 20.0  # s of a request
SLOW = 2.0  # s: from here on there is no warm-up run, and no repetition where the same peer has something better
BUDGET = 25 * 60.0  # s of measuring; a round that would begin later is left out, and the table says so


class Record:
    """What was measured so far, in a file that is whole at any time.

    Args:
        file: out/work_precision.json.
        fresh: begin anew.
    """

    def __init__(self, file, fresh=False):
        self.file, self.rows, self.spent, self._saved = file, {}, 0.0, 0.0
        self.about = {"machine": record(), "seed": SEED, "rounds": ROUNDS, "limit_s": LIMIT}
        self.missing, self.waits, self.versions = {}, [], {}
        if file.exists() and not fresh:
            self._continue(json.loads(file.read_text(encoding="utf-8")))

    def _continue(self, before):
        same = ("cpu", "platform")
        if any(before["about"]["machine"].get(key) != self.about["machine"][key] for key in same):
            return  # another machine: its samples say nothing here
        prints = {peer: fingerprint(peer) for peer in PEERS}
        for row in before["samples"]:
            if row["fingerprint"] == prints[row["peer"]]:
                self.rows[self.key(row["problem"], row["peer"], row["configuration"])] = row
        self.spent, self.versions = before["spent_s"] if self.rows else 0.0, before["versions"]

    @staticmethod
    def key(problem, peer, configuration):
        return json.dumps([problem, peer, configuration], sort_keys=True)

    def row(self, problem, peer, configuration):
        """The row of a configuration, made where there is none."""
        key = self.key(problem, peer, configuration)
        if key not in self.rows:
            name, spatial = kind(peer, configuration)
            self.rows[key] = {
                "problem": problem, "peer": peer, "kind": name, "spatial": spatial, "configuration": configuration,
                "model": model(peer, configuration), "fingerprint": fingerprint(peer),
                "seconds": [], "error": None, "failed": None,
            }  # fmt: skip
        return self.rows[key]

    def write(self, now=False):
        """Save, every few seconds or at once."""
        if not now and time.monotonic() - self._saved < 5:
            return
        self._saved = time.monotonic()
        told = {"about": self.about, "versions": self.versions, "missing": self.missing, "spent_s": self.spent,
                "waits": self.waits, "samples": list(self.rows.values())}  # fmt: skip
        self.file.parent.mkdir(parents=True, exist_ok=True)
        part = self.file.with_suffix(".part")
        part.write_text(json.dumps(told, indent=1), encoding="utf-8")
        part.replace(self.file)


def start(peers, install, found):
    """The peers' processes by name; what is missing is noted and left out."""
    started = {}
    for name in peers:
        print(f"{name}: environment ...", flush=True)
        try:
            started[name] = Peer(name, install)
            found.missing.pop(name, None)
        except Missing as error:
            found.missing[name] = str(error)
            print(f"{name} is missing: {error}", flush=True)
    return started


def sample(peer, row, found, limit):
    """One more sample of a row, or why there is none."""
    problem = problems()[row["problem"]]
    slow = bool(row["seconds"]) and min(row["seconds"]) > SLOW
    cold = row["peer"] in ("PyElastica", "CalculiX")  # compiles before it is asked; a program with no warm state
    began = time.monotonic()
    answer = peer.ask(problem, row["configuration"], warm=0 if slow or cold else 1, samples=1, limit=limit)
    found.spent += time.monotonic() - began
    if "failed" in answer:
        row["failed"] = answer["failed"]
    else:
        row["seconds"] += answer["seconds"]
        row["error"] = error(row["problem"], row["model"], answer["tip"])
        row["failed"] = None
    if "versions" in answer:
        found.versions[peer.name] = answer["versions"]


def worth(row, rows):
    """Whether a slow configuration is worth another sample: nothing of its peer is faster and as accurate."""
    if row["failed"]:
        return False
    if not row["seconds"] or min(row["seconds"]) < SLOW:
        return True
    like = [r for r in rows if r["peer"] == row["peer"] and r["problem"] == row["problem"] and r["seconds"]]
    return not any(min(r["seconds"]) < min(row["seconds"]) and r["error"] <= row["error"] for r in like)


def measure(started, names, found, *, quick, rounds, limit, budget):
    """Rounds of samples, until every row has `rounds` of them or the time is spent."""
    rows = [
        found.row(name, peer, configuration)
        for peer in started
        for name in names
        for configuration in configurations(peer, name, quick)
    ]
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns) as bar:
        for number in range(rounds):
            todo = [row for row in rows if len(row["seconds"]) <= number and worth(row, rows)]
            if found.spent > budget:
                print(f"{budget / 60:.0f} minutes are spent: {number} rounds of {rounds}", flush=True)
                break
            random.Random(SEED + number).shuffle(todo)
            task = bar.add_task(f"round {number + 1} of {rounds}", total=len(todo))
            for row in todo:
                if worth(row, rows):
                    bar.update(task, description=f"round {number + 1} of {rounds}: {row['problem']}, {row['peer']}")
                    sample(started[row["peer"]], row, found, limit)
                    found.write()
                bar.advance(task)
    return rows


def main(out="out", quick=False, fresh=False, peers=PEERS, names=None, rounds=None):
    """Measure, write the JSON, the table and the charts.

    Args:
        out: folder.
        quick: few configurations, nothing is installed.
        fresh: forget earlier samples.
        peers, names: which peers and problems; default all (a quick run: all peers on two problems).
        rounds: samples of every configuration.

    Returns:
        The `Record`.
    """
    out = Path(out)
    names = names or (("sweep", "bend") if quick else tuple(problems()))
    found = Record(out / ("work_precision_quick.json" if quick else "work_precision.json"), fresh or quick)
    started = start(peers, not quick, found)
    limits = {"rounds": rounds or (2 if quick else ROUNDS), "limit": 5.0 if quick else LIMIT, "budget": BUDGET}
    try:
        rows = measure(started, names, found, quick=quick, **limits)
        if not quick:
            found.waits = waits(started, rows)
    except KeyboardInterrupt:
        raise SystemExit(f"\nbroken off; {found.file} keeps the samples, the same command goes on from them") from None
    finally:
        for peer in started.values():
            peer.end()
        found.write(now=True)
    text = table.text(found, rows)
    stem = found.file.stem
    (out / f"{stem}.md").write_text(text + "\n", encoding="utf-8")
    pictures = chart.draw(found, rows, out, stem)
    print(text)
    told = Counter(row["failed"] is not None for row in rows)
    print(f"\n{told[False]} configurations answered, {told[True]} did not; written: {found.file}, {stem}.md, {', '.join(pictures)}")
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="at most a minute, nothing is installed")
    parser.add_argument("--fresh", action="store_true", help="forget the samples of earlier runs")
    main(quick=parser.parse_args().quick, fresh=parser.parse_args().fresh)
