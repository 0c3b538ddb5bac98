"""The package against the independent solutions of bvp.py on random scenes: true errors, tolerances and estimates.

As a script: python tests/random_comparison.py [how many] [first seed] (make random).
"""

import sys
import time
from collections import Counter

import bvp
import numpy as np
import random_scenes

import cosserat_fenicsx as cf

TOLERANCES = (1e-4, 1e-6, 1e-8)
_PLACES = np.linspace(0, 1, 201)


def true_error(path, rod, drawn, truth):
    """Largest error of the positions along the rod over the largest displacement."""
    s = _PLACES * drawn.length
    found, _ = path.sample(-1, rod, _PLACES)
    exact = truth(s)["r"].T + drawn.start
    displacement = np.linalg.norm(exact - drawn.rest(s).T - drawn.start, axis=1).max()
    return np.linalg.norm(found - exact, axis=1).max() / displacement


def compare(drawn, tolerances=TOLERANCES):
    """One scene.

    Returns:
        (verdict of the reference, [(tol, outcome, true error, estimate, seconds of processor time)]). Where several
        equilibria exist, the reference is the one nearest to the package's result, and the outcome is "other branch".
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
            rows.append((tol, f"not converged: {refusal}", np.nan, np.nan, time.process_time() - began))
            continue
        spent = time.process_time() - began
        said = "converged" if path.stable[-1] else "unstable"
        error = np.inf if truth is None else true_error(path, rod, drawn, truth)
        if error > 1e-3:
            try:
                error = true_error(path, rod, drawn, bvp.at(problem, path.moment(rod.start)[-1]))
                said += ", other branch"
            except bvp.NoTruth:
                pass
        rows.append((tol, said, error, float(path.error[-1]), spent))
    return verdict, rows


def main(count=200, first=0):
    kinds, ratios = Counter(), []
    print("seed  slender  truth: tol, true error, estimate, s, what happened")
    for drawn in random_scenes.scenes(count, first):
        verdict, rows = compare(drawn)
        for tol, said, error, estimate, spent in rows:
            right = error <= max(tol, 1e-10)
            outcome = "right" if right else "wrong" if error == error else "-"
            kinds[f"{verdict.split(':')[0]} | {said.split(':')[0]} | {outcome}"] += 1
            if error > 1e-10:
                ratios.append(estimate / error)
            numbers = f"{tol:.0e} {error:.1e} {estimate:.1e} {spent:.2f}"
            print(f"{drawn.seed:4d} {drawn.slenderness:7.0f} {verdict}: {numbers} {said}", flush=True)
    for kind, number in kinds.most_common():
        print(f"{number:5d}  {kind}")
    if ratios:
        print(
            f"estimate over true error: least {min(ratios):.2g}, median {np.median(ratios):.2g}, largest"
            f" {max(ratios):.2g}"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
