"""What all measurements share: times, tables, verdicts, the machine, files that a later run goes on from, options."""

import argparse
import datetime
import json
import os
import platform
import statistics
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path

import numpy as np

from cosserat_fenicsx import compat
from cosserat_fenicsx.pictures.charts import draw_both, draw_chart
from cosserat_fenicsx.ranks import launched

#: The heads of the cells of `judged`, after that of the number found.
HEADS = "asked at most | "


def timed(task, clock=time.process_time):
    """(what a task returns, seconds): by default of processor time."""
    began = clock()
    found = task()
    return found, clock() - began


def repeated(task, runs):
    """(what a task returns at last, its median processor time (s) of some runs)."""
    found = [timed(task) for _ in range(runs)]
    return found[-1][0], statistics.median(spent for _, spent in found)


def in_turns(tasks, runs):
    """Processor times (s) of tasks that take turns, (runs, number of tasks): ratios within a row are of one time."""
    return np.array([[timed(task)[1] for task in tasks] for _ in range(runs)])


def whole_process(words, told="", limit=None, **settings):
    """Run a command to its end: (output as bytes, exit code, processor time with that of its own processes, wall clock
    time), s. told: its input; limit: s, after which it is killed; settings: of `subprocess.Popen`."""
    began = time.perf_counter()
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(words, **pipes, **settings)
    watch = threading.Timer(limit or threading.TIMEOUT_MAX, process.kill)
    watch.daemon = True
    watch.start()
    process.stdin.write(told.encode())
    process.stdin.close()
    said = process.stdout.read()
    process.stdout.close()
    _, status, used = os.wait4(process.pid, 0)
    watch.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    return said, process.returncode, used.ru_utime + used.ru_stime, time.perf_counter() - began


def apart(file, number, before=()):
    """What the function `one` of a `command` in a file finds for a number, in its own process, started by `before`."""
    # a copy of the environment, without what MPI has put into this process's since it was started
    words = [*before, sys.executable, file, "--one", str(number)]
    done = subprocess.run(words, env=dict(os.environ), capture_output=True, text=True, timeout=600)
    if done.returncode:
        raise SystemExit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def orders(errors, counts):
    """Observed orders of errors between successive numbers of steps or elements."""
    with np.errstate(divide="ignore", invalid="ignore"):  # errors may be zero
        return np.log(np.divide(errors[:-1], errors[1:])) / np.log(np.divide(counts[1:], counts[:-1]))


# -- tables ------------------------------------------------------------------------------------------------------------


def table(heads, rows):
    """Lines of a Markdown table. heads: in one text, such as "degree | error"; rows: of cells, as texts or numbers."""
    yield f"| {heads} |"
    yield "|" + "---|" * (heads.count("|") + 1)
    for row in rows:
        yield f"| {' | '.join(map(str, row))} |"


def write(name, lines, out):
    """Write the lines to `name`.md in the folder `out`, where put_in_docs.py finds them; returns them as one text."""
    text = "\n".join(lines)
    Path(out).mkdir(parents=True, exist_ok=True)
    (Path(out) / f"{name}.md").write_text(text + "\n", encoding="utf-8")
    return text


def share(number):
    """A ratio as text, below one as a fraction: 1/4.3; a dash for None."""
    if number is None:
        return "-"
    return f"1/{1 / number:.3g}" if number < 1 else f"{number:.3g}"


def judged(found, most, form=None):
    """The last three cells of a row: what was found (a ratio; or a number of another unit, with the format `form`; or
    None), what is asked at most, and whether it is met."""
    verdict = "-" if found is None else "met" if found <= most else "missed"
    number = "-" if found is None else format(found, form) if form else share(found)
    return " | ".join((number, f"{most:g}" if form else share(most), verdict))


def drawn(make, file):
    """Write the Figure that `make()` returns to a file, for wide pages and for narrow ones."""
    draw_both(partial(draw_chart, make), file)


# -- the machine -------------------------------------------------------------------------------------------------------


def record():
    """The conditions of a measurement, as a dict of strings and numbers for JSON. Returns date (UTC, ISO 8601), cpu
    (model), cores (that this process may use), platform, and the releases by the names dolfinx, petsc, numpy,
    python."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "cpu": _cpu(),
        "cores": cores,
        "platform": platform.platform(),
        **{name.lower(): release for name, release in map(str.split, compat.version().split(", "))},
    }


def in_words(found=None):
    """One line for the foot of a table or a chart, from `record`: by default that of now."""
    found = found or record()
    return (
        f"dolfinx {found['dolfinx']}, PETSc {found['petsc']}, numpy {found['numpy']}, Python {found['python']}; "
        f"{found['cpu']}, {found['cores']} cores; {found['date'][:10]}"
    )


def _cpu():
    """The processor's name: Linux has it in /proc/cpuinfo."""
    listed = Path("/proc/cpuinfo")
    lines = listed.read_text(encoding="utf-8").splitlines() if listed.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


# -- files that a later run continues from -----------------------------------------------------------------------------


def resumed(file, data, keys, fresh):
    """The results of an interrupted run in a file of `save`, if a run with this data (with "machine", of `record`) can
    continue from them, since `keys` are the same in both; else None."""
    try:
        before = None if fresh else json.loads(Path(file).read_text(encoding="utf-8"))
        same = before and not before["complete"] and all(before[key] == data[key] for key in keys)
        if same and all(before["machine"][k] == data["machine"][k] for k in data["machine"].keys() - {"date", "cores"}):
            print(f"goes on from {file}", end=": ", file=sys.stderr)
            return before
    except (OSError, ValueError, KeyError):
        pass
    return None


def save(file, data):
    """Replace a file of JSON in one step, so that a killed process leaves a complete one."""
    new = Path(file).with_suffix(".new")
    new.parent.mkdir(parents=True, exist_ok=True)
    new.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    os.replace(new, file)


# -- the command line --------------------------------------------------------------------------------------------------


def command(about, main, quick, *, fresh=False, one=None, **more):
    """Run `main` with the options of the command line.

    Args:
        about: the docstring of the command. quick: arguments of `main` with `--quick`.
        fresh: whether `main` continues an earlier run, unless `--fresh` is given.
        one: a function of a number that `--one` calls instead in a process of its own; its result is printed as JSON.
        more: further options of `main`, with their arguments of `ArgumentParser.add_argument`.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a short run, such as a test takes")
    parser.add_argument("-o", "--out", default="out", help="folder for what is written (default: out)")
    if fresh:
        parser.add_argument("--fresh", action="store_true", help="continue no earlier run")
    if one:
        parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    for name, settings in more.items():
        parser.add_argument(f"--{name}", **settings)
    given = vars(parser.parse_args())
    number, short = given.pop("one", None), given.pop("quick")
    try:
        if number is not None:
            found = one(number)
            if launched()[0] == 0:
                print(json.dumps(found))
        else:
            main(**(quick if short else {}), **given)
    except KeyboardInterrupt:
        told = "broken off" + ("; what is done is kept, and the same command goes on from there" if fresh else "")
        print(f"\n{told}", file=sys.stderr)
        sys.exit(130)
