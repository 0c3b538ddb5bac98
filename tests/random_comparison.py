"""The package against the independent solutions of bvp.py on random scenes: true errors, tolerances and estimates,
of positions, rotations, contact forces n and moments m.

As a script: python tests/random_comparison.py [how many] [first seed] (make random).
"""

import sys
import time
from collections import Counter

import bvp
import numpy as np
import random_scenes

import cosserat_fenicsx as cf
from cosserat_fenicsx.results.compared import NAMES

TOLERANCES = (1e-4, 1e-6, 1e-8)
# Errors up to this may be those of the references.
LEAST = 1e-10
_PLACES = np.linspace(0, 1, 201)


def true_errors(path, rod, drawn, truth):
    """(4,) largest errors of positions, rotations, n and m along the rod, each over its size as in `Path.errors`."""
    s = _PLACES * drawn.length
    exact = truth(s)
    found, _ = path.sample(-1, rod, _PLACES)
    off = found - (exact["r"].T + drawn.start)
    displacement = size(exact["r"].T - drawn.rest(s).T)
    q = path.motion(rod, _PLACES)[-1, :, 3:]
    turned = 2 * np.minimum(size(q - exact["q"].T, largest=False), size(q + exact["q"].T, largest=False)).max()
    rotation = max(2 * size(exact["q"][1:].T), displacement / drawn.length)
    n, m = (np.array([query(rod.at(x))[-1] for x in s]) for query in (path.force, path.moment))
    force = max(size(exact["n"].T), size(exact["m"].T) / drawn.length)
    errors = [size(off) / displacement, turned / rotation, size(n - exact["n"].T) / force]
    return np.array([*errors, size(m - exact["m"].T) / size(exact["m"].T)])


def size(vectors, *, largest=True):
    """The largest norm of vectors (n, k), or all of them (n,)."""
    norms = np.linalg.norm(vectors, axis=1)
    return norms.max() if largest else norms


def compare(drawn, tolerances=TOLERANCES):
    """One scene.

    Returns:
        (verdict of the reference, [(tol, outcome, true errors (4,), estimates (4,), (4,) which estimates are those
        of rounding, seconds of processor time)]). Where several equilibria exist, the reference is the one
        nearest to the package's result, and the outcome is "other branch".
    """
    rod, scene = drawn.scene()
    problem, rows = drawn.problem(), []
    try:
        truth = bvp.equilibrium(problem)
        verdict = truth.verdict
    except bvp.NoTruth as error:
        truth, verdict = None, f"no truth: {error}"
    for tol in tolerances:
        began = time.process_time()
        try:
            path = cf.solve(scene, [1.0], tol=tol)
        except cf.NotConverged as refusal:
            nothing = np.full(4, np.nan)
            rows.append((tol, f"not converged: {refusal}", nothing, nothing, nothing > 0, time.process_time() - began))
            continue
        spent = time.process_time() - began
        said = "converged" if path.stable[-1] else "unstable"
        errors = np.full(4, np.inf) if truth is None else true_errors(path, rod, drawn, truth)
        if errors[0] > 1e-3:
            try:
                errors = true_errors(path, rod, drawn, bvp.at(problem, path.moment(rod.start)[-1]))
                said += ", other branch"
            except bvp.NoTruth:
                pass
        told = np.array(path.errors)[:, -1]
        rows.append((tol, said, errors, told, path.rounding_errors[:, -1] >= told, spent))
    return verdict, rows


def main(count=200, first=0):
    kinds, ratios = Counter(), {name: [] for name in NAMES}
    print("seed  slender  truth: tol, true errors of r, q, n, m, estimates, s, what happened")
    for drawn in random_scenes.scenes(count, first):
        verdict, rows = compare(drawn)
        for tol, said, errors, estimates, rounding, spent in rows:
            right = (errors <= max(tol, 1e-10)) | (rounding & (errors <= estimates))
            outcome = "right" if right.all() else "wrong" if np.isfinite(errors).all() else "-"
            kinds[f"{verdict.split(':')[0]} | {said.split(':')[0]} | {outcome}"] += 1
            for name, error, estimate, noise in zip(NAMES, errors, estimates, rounding, strict=True):
                if error > LEAST and not noise:
                    ratios[name].append(estimate / error)
            numbers = " ".join(f"{x:.1e}" for x in (*errors, *estimates))
            print(
                f"{drawn.seed:4d} {drawn.slenderness:7.0f} {verdict}: {tol:.0e} {numbers} {spent:.2f} {said}",
                flush=True,
            )
    for kind, number in kinds.most_common():
        print(f"{number:5d}  {kind}")
    for name, found in ratios.items():
        if found:
            print(
                f"estimate over true error of {name} in {len(found)} answers: least {min(found):.2g}, median"
                f" {np.median(found):.2g}, largest {max(found):.2g}; {np.mean(np.less(found, 1)):.1%} below 1"
            )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
