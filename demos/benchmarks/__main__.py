"""The verification manual: published problems, each solved, drawn and compared with its published numbers.

    python demos/benchmarks                         all; writes out/benchmarks.md, .json and out/benchmarks/NAME.png
    python demos/benchmarks elastica lees_frame     some; prints their table, and draws their pictures

What an interrupted run has finished is kept: the same command goes on from there. The exit code is 1 if a number
disagrees with the published one by more than is allowed.
"""

import argparse
import sys
from pathlib import Path

from manual import HEADS, cells, load, solved, text  # first: it finds the folders of what follows

from harness import record, resumed, save, table, write  # isort: skip
from known_numbers import chosen  # isort: skip


def main(names=(), out="out", fresh=False):
    """Solve the problems of these names, or all, and write or print their tables; returns {name: of `solved`}."""
    problems = load()
    asked = [x.__name__ for x in chosen("demos/benchmarks", "problem", [x.solve for x in problems.values()], names)]
    file = Path(out) / "benchmarks.json"
    data = {"machine": record(), "complete": False, "names": sorted(problems), "problems": {}}
    data = (None if names else resumed(file, data, ["names"], fresh)) or data
    results = data["problems"]
    for k, name in enumerate(asked, start=1):
        if name in results:
            continue
        print(f"{k}/{len(asked)} {name}: ", end="", file=sys.stderr, flush=True)
        found = results[name] = solved(problems[name], Path(out) / "benchmarks" / f"{name}.png")
        off = [row["quantity"] for row in found["rows"] if not row["agrees"]]
        told = f"disagrees in {', '.join(off)}" if off else "agrees"
        print(f"{told}, {found['seconds']:.2g} s", file=sys.stderr)
        if not names:
            save(file, data)
    if names:
        print("\n".join(table(HEADS, cells(problems, results))))
    else:
        save(file, data | {"complete": True})
        write("benchmarks", text(problems, results, data["machine"]), out)
    return results


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="; ".join(load()))
    parser.add_argument("-o", "--out", default="out", help="folder for what is written (default: out)")
    parser.add_argument("--fresh", action="store_true", help="continue no earlier run")
    try:
        done = main(**vars(parser.parse_args()))
    except KeyboardInterrupt:
        print("\nbroken off; what is done is kept, and the same command goes on from there", file=sys.stderr)
        sys.exit(130)
    sys.exit(int(not all(row["agrees"] for found in done.values() for row in found["rows"])))
