"""Figure 3 of the paper: delta against eta from 0 to 2 for every model of the eccentrically compressed column.

    python demos/evidence/figure3.py            about four minutes; writes out/figure3.png, .md and .json
    python demos/evidence/figure3.py --quick    coarse meshes, for a test
    python demos/evidence/figure3.py --fresh    from the start, without results of an earlier run

An interrupted run keeps all curves and points of the solid so far, in figure3.json and figure3-*.npz; the same command
continues from there.
"""

import json
import os
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
from comparison import curves, picture, verdicts
from comparison.follow import Point
from harness import command, record, resumed, save
from mpi4py import MPI


class Store:
    """The file of the curves, rewritten after every curve and every point of the solid; one with other settings or
    releases, or of a finished run, is not continued."""

    def __init__(self, folder, settings, fresh=False):
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.file = self.folder / "figure3.json"
        self.data = {"complete": False, "machine": record(), "curves": {}}
        self.data["settings"] = json.loads(json.dumps(asdict(settings)))  # as a file returns them
        before = resumed(self.file, self.data, ["settings"], fresh)
        if before:
            self.data["curves"] = before["curves"]
            done = [name for name, curve in before["curves"].items() if curve["complete"]]
            print(f"{', '.join(done) or 'a part of the first curve'} kept", file=sys.stderr)
        else:
            for name in self.folder.glob("figure3-*.npz"):
                name.unlink()

    def curve(self, name, compute, words):
        """The curve `name`: from an earlier run, or computed, timed and stored."""
        kept = self.data["curves"].get(name)
        if not (kept and kept["complete"]):
            self.put(name, curves.timed(words, compute), complete=True)
        return self.data["curves"][name]

    def put(self, name, curve, complete=False):
        """Store a curve, or a part of it."""
        self.data["curves"][name] = {**curve, "complete": complete}
        save(self.file, self.data)

    def part_of(self, name):
        """The unfinished curve `name` and the last points of its path: (dict, list of Point), or (None, [])."""
        kept, states = self.data["curves"].get(name), self._states(name)
        if kept is None or not states.exists():
            return None, []
        with np.load(states) as arrays:
            points = [Point(float(eta), x) for eta, x in zip(arrays["eta"], arrays["x"], strict=True)]
        if points[-1].eta != kept["eta"][-1]:
            return None, []
        return {key: value for key, value in kept.items() if key != "complete"}, points

    def keep_part(self, name, curve, points):
        """Store an unfinished curve and the last points of its path."""
        new = self._states(name).with_suffix(".new.npz")
        np.savez(new, eta=[p.eta for p in points], x=[p.x for p in points])
        os.replace(new, self._states(name))
        self.put(name, curve)

    def _states(self, name):
        return self.folder / f"figure3-{name}.npz"

    def finish(self):
        """Mark the file as finished: the next run starts anew."""
        self.data["complete"] = True
        save(self.file, self.data)
        for name in self.folder.glob("figure3-*.npz"):
            name.unlink()


def compute(store, settings):
    """All curves, the quick ones first."""
    store.curve("mixed", lambda: curves.rod(settings, "mixed"), "Cosserat rod, mixed")
    store.curve("displacement", lambda: curves.rod(settings, "displacement"), "Cosserat rod, displacement")
    store.curve("arm", lambda: curves.rod(settings, "mixed", arm=True), "Cosserat rod, force on a turning arm")
    store.curve("corotational", lambda: curves.beam(settings), "co-rotational beam")
    store.curve("mcre", lambda: curves.truncated(settings), "MCRE, a reconstruction")
    for name, clamp, words in (
        ("solid_clamped", "face", "3D elasticity, foot fixed altogether"),
        ("solid", "plane", "3D elasticity"),
    ):

        def solid(name=name, clamp=clamp):
            so_far, points = store.part_of(name)
            return curves.solid(settings, lambda curve, last: store.keep_part(name, curve, last), clamp, points, so_far)

        store.curve(name, solid, words)
    store.finish()
    return store.data


def main(out="out", quick=False, fresh=False):
    """Compute, write and draw. Returns The dict that figure3.json holds."""
    if MPI.COMM_WORLD.size > 1:
        sys.exit("figure3.py: expected one process, not several: the curves follow each other")
    settings = curves.QUICK if quick else curves.FULL
    data = compute(Store(out, settings, fresh), settings)
    out = Path(out)
    table = verdicts.table(data)
    (out / "figure3.md").write_text(table + "\n", encoding="utf-8")
    picture.draw(data, out / "figure3.png")
    print(table)
    print(f"\nwritten to {out}/: figure3.png, figure3.md, figure3.json", file=sys.stderr)
    return data


if __name__ == "__main__":
    command(__doc__, main, {"quick": True}, fresh=True)
