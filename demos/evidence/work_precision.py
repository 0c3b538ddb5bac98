"""Speed against accuracy: this package and its peers on the same problems, one chart each (`make work-precision`).

    python demos/evidence/work_precision.py            everything, at most half an hour; continues an interrupted run
    python demos/evidence/work_precision.py --fresh    discards existing samples
    python demos/evidence/work_precision.py --problems sweep
    python demos/evidence/work_precision.py --quick    a few configurations, at most a minute; nothing is installed

Writes to out/: work_precision.json (every sample), work_precision.md (the table), work_precision_*.png.

Every peer runs in a separate process and environment, on one thread. A sample is the processor time of one warm
solution from the unloaded state. The first round takes three samples of every configuration (one of slow ones), later
rounds the others, in a changing order, so that peers alternate, until a configuration has five; configurations that
decide a ratio that is asked for get 25. Results are medians.
"""

import json
import random
import time
from collections import Counter, namedtuple
from pathlib import Path

import work_precision_chart as chart
import work_precision_table as table
from harness import command, record, save
from peers.configurations import PEERS, configurations, kind, model
from peers.environments import OWN, Missing, fingerprint
from peers.problems import error, problems
from peers.process import Peer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from waiting import waits

SAMPLES, SEED = 5, 2026  # smallest number of samples of a row; of the random order
DECIDING = 25  # samples of a row on which a ratio that is asked for depends
#: Time limits of a request, s: here it may compile a form; the last two compile, relax or are whole programs.
LIMITS = {OWN: 40.0, "Exudyn": 4.0, "OpenSeesPy": 4.0, "PyElastica": 20.0, "CalculiX": 20.0}
SLOW_PEERS = ("PyElastica", "CalculiX")
QUICK_LIMIT = 5.0  # s, of all peers in a quick run
SLOW = 0.5  # s: from here on there is no warm-up run, and no repetition where the same peer has something better
BUDGET = 20 * 60.0  # s of measuring; a round that would begin later is left out, and the table says so


#: What is measured: the peers, the problems, functions for their errors, for the configurations of a peer and for
#: their names, the number of samples at first, and whether all fast configurations of this package get all samples.
Panel = namedtuple("Panel", "peers problems error configurations kind model first whole")
STATICS = Panel(PEERS, problems, error, configurations, kind, model, 3, True)


class Record:
    """The measurements so far of a `Panel`, in a file complete at any time; fresh: ignore an existing one."""

    def __init__(self, file, fresh=False, panel=None):
        self.panel = panel or STATICS
        self.file, self.rows, self.spent, self._saved = file, {}, 0.0, 0.0
        self.about = {"machine": record(), "seed": SEED, "samples": SAMPLES}
        self.about |= {"deciding": DECIDING, "limits_s": LIMITS}
        self.missing, self.waits, self.versions = {}, [], {}
        if file.exists() and not fresh:
            self._continue(json.loads(file.read_text(encoding="utf-8")))

    def _continue(self, before):
        machine = before["about"]["machine"]
        same = all(machine.get(key) == self.about["machine"][key] for key in ("cpu", "platform"))
        prints = {peer: fingerprint(peer) for peer in self.panel.peers}
        if not same or any(row["fingerprint"] != prints[row["peer"]] for row in before["samples"]):
            print(f"{self.file}: from another machine or other sources, so everything is measured again", flush=True)
            return  # compared samples must be of one run
        for row in before["samples"]:
            self.rows[self.key(row["problem"], row["peer"], row["configuration"])] = row
        self.spent, self.versions = before["spent_s"], before["versions"]

    @staticmethod
    def key(problem, peer, configuration):
        return json.dumps([problem, peer, configuration], sort_keys=True)

    def row(self, problem, peer, configuration):
        """The row of a configuration, added if missing."""
        key = self.key(problem, peer, configuration)
        if key not in self.rows:
            name, spatial = self.panel.kind(peer, configuration)
            self.rows[key] = {
                "problem": problem, "peer": peer, "kind": name, "spatial": spatial, "configuration": configuration,
                "model": self.panel.model(peer, configuration), "fingerprint": fingerprint(peer),
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
        save(self.file, told)


def start(peers, install, found):
    """The peers' processes by name; peers that are missing are recorded and left out."""
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


def sample(peer, row, found, wanted, limits):
    """Take more samples of a row, or record why this failed."""
    problem = found.panel.problems()[row["problem"]]
    slow = bool(row["seconds"]) and min(row["seconds"]) > SLOW
    cold = row["peer"] in SLOW_PEERS
    began = time.monotonic()
    rest = wanted - len(row["seconds"])
    more = rest if row["seconds"] else min(found.panel.first, rest)
    # a single sample, as a quick run takes, is no measurement: nothing has to be warm
    visit = {"warm": 0, "samples": 1} if slow or cold or wanted == 1 else {"warm": 1, "samples": more}
    answer = peer.ask(problem, row["configuration"], **visit, limit=limits[peer.name])
    found.spent += time.monotonic() - began
    if "failed" in answer:
        row["failed"] = None if row["seconds"] else answer["failed"]  # a single sample just beyond the time limit
    else:
        row["seconds"] += answer["seconds"]
        row["error"] = found.panel.error(row["problem"], row["model"], answer["tip"])
        row["failed"] = None
    if "versions" in answer:
        found.versions[peer.name] = answer["versions"]


def worth(row, rows, whole):
    """Whether more samples are useful: not if another row of the same kind (of its peer, if it is slow) has a smaller
    error and half the time; its point in the chart then has fewer samples. If `whole`, all of this package's rows below
    SLOW are repeated."""
    if row["failed"] or not row["seconds"]:
        return not row["failed"]
    slow = min(row["seconds"]) > SLOW
    if whole and row["peer"] == OWN and not slow:
        return True
    return not any(
        1.5 * min(r["seconds"]) < min(row["seconds"]) and r["error"] <= row["error"]
        for r in rows
        if r["seconds"] and (slow or r["kind"] == row["kind"])
    )


def measure(started, names, found, *, quick, wanted, limits, budget):
    """Rounds of samples, until every row has `wanted` of them or the time limit is reached."""
    rows = [
        found.row(name, peer, configuration)
        for peer in started
        for name in names
        for configuration in found.panel.configurations(peer, name, quick)
    ]
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns) as bar:
        for name in names:  # one after the other, so that all points of a chart are measured at about the same time
            here = [row for row in rows if row["problem"] == name]
            like = {peer: [row for row in here if row["peer"] == peer] for peer in started}
            for number in range(wanted):
                todo = [r for r in here if len(r["seconds"]) < wanted and worth(r, like[r["peer"]], found.panel.whole)]
                if todo and number and found.spent > budget:
                    print(f"{name}: the time is spent, {len(todo)} rows keep fewer samples", flush=True)
                    break
                random.Random(SEED + number).shuffle(todo)
                _round(todo, like, started, found, wanted, limits, bar, f"{name}, round {number + 1}")
    return rows


def decide(started, rows, found, limits):
    """More samples, in alternation, of the rows on which the ratios that are asked for depend."""
    for number in range(DECIDING):
        todo = [row for row in table.deciding(rows) if len(row["seconds"]) < DECIDING and not row["failed"]]
        if not todo:
            return
        print(f"what decides a ratio, round {number + 1}: {len(todo)} rows", flush=True)
        random.Random(SEED - number).shuffle(todo)
        for row in todo:
            sample(started[row["peer"]], row, found, min(DECIDING, len(row["seconds"]) + SAMPLES), limits)
            found.write()


def _round(todo, like, started, found, wanted, limits, bar, name):
    """Samples of every row for which more are useful."""
    task, told = bar.add_task(name, total=len(todo)), time.monotonic()
    for i, row in enumerate(todo):
        bar.update(task, description=f"{name}: {row['peer']}", completed=i)
        if not bar.console.is_terminal and time.monotonic() - told > 30:  # lines instead of the bar
            told = time.monotonic()
            print(f"{name}: {i} of {len(todo)}", flush=True)
        if worth(row, like[row["peer"]], found.panel.whole):
            sample(started[row["peer"]], row, found, wanted, limits)
            found.write()
    bar.update(task, description=name, completed=len(todo))


def run(found, peers, budgets, *, quick, wanted, limits, after=None):
    """All samples of the problems in `budgets` ({name: s of measuring until then}); returns the rows. after: what is
    measured at last, a function of the started peers and the rows. Raises SystemExit: Ctrl-C; the samples are kept."""
    started, rows = start(peers, not quick, found), []
    try:
        for name, budget in budgets.items():
            rows += measure(started, [name], found, quick=quick, wanted=wanted, limits=limits, budget=budget)
        if after and not quick:
            after(started, rows)
    except KeyboardInterrupt:
        raise SystemExit(f"\nbroken off; {found.file} keeps the samples, the same command goes on from them") from None
    finally:
        for peer in started.values():
            peer.end()
        found.write(now=True)
    return rows


def concluded(found, rows, text):
    """Write the table beside the samples, and print it; returns the stem of the files."""
    stem, told = found.file.stem, text(found, rows)
    found.file.with_suffix(".md").write_text(told + "\n", encoding="utf-8")
    print(told)
    return stem


def main(out="out", quick=False, fresh=False, peers=PEERS, names=None, wanted=None):
    """Measure, write the JSON, the table and the charts.

    Args:
        out: folder.
        quick: few configurations, nothing is installed.
        fresh: forget earlier samples.
        peers, names: which peers and problems; default all (a quick run: all peers on two problems).
        wanted: samples of every configuration, at least.

    Returns:
        The `Record`.
    """
    out = Path(out)
    names = names or (("sweep", "bend") if quick else tuple(problems()))
    found = Record(out / ("work_precision_quick.json" if quick else "work_precision.json"), fresh or quick)
    limits = {peer: QUICK_LIMIT if quick and peer != OWN else limit for peer, limit in LIMITS.items()}
    wanted = wanted or (2 if quick else SAMPLES)

    def after(started, rows):
        decide(started, rows, found, limits)
        found.waits = waits(started, rows)

    rows = run(found, peers, dict.fromkeys(names, BUDGET), quick=quick, wanted=wanted, limits=limits, after=after)
    stem = concluded(found, rows, table.text)
    pictures = chart.draw(found, rows, out, stem)
    told = Counter(row["failed"] is not None for row in rows)
    print(
        f"\n{told[False]} configurations answered, {told[True]} did not; written: {found.file}, {stem}.md,"
        f" {', '.join(pictures)}"
    )
    return found


if __name__ == "__main__":
    command(__doc__, main, {"quick": True}, fresh=True,
            problems={"nargs": "+", "choices": tuple(problems()), "dest": "names", "help": "only these"})  # fmt: skip
