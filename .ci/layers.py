"""A cache of trees: as they were after every RUN of root, named by a hash of the steps so far."""

import contextlib
import fcntl
import os
import subprocess
import time

from command import Failed, remove, sh
from dockerfile import key
from tree import perform


@contextlib.contextmanager
def locked(cache):
    """The cache for one user at a time, without what a run that was killed left behind."""
    cache.mkdir(parents=True, exist_ok=True)
    with open(cache / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        _tidy(cache)
        try:
            yield
        finally:
            _tidy(cache)


def _tidy(cache):
    subprocess.run(["umount", "--recursive", "--lazy", cache / "scratch/tree"], stderr=subprocess.DEVNULL)
    for name in ("new", "scratch"):
        remove(cache / name)


def cached(steps, cache, days):
    """The tree after the last RUN of root and the steps that remain, from the cache as far as it is there.

    Args:
        days: a tree older than this is made anew; where that fails, the old one serves.
    """
    layers, remaining = _layers(steps)
    folders = [cache / name for name, _ in layers]
    age = max((_days(folder) for folder in folders if folder.exists()), default=0.0)
    if age > days:
        try:
            _make(layers, cache, anew=True)
        except (Failed, OSError) as error:
            print(f"--- the tree of {age:.0f} days ago serves, as it could not be made anew: {error}", flush=True)
            remove(cache / "new")
    _make(layers, cache)
    for old in cache.iterdir():
        if old not in (*folders, cache / "lock"):
            remove(old)
    return folders[-1], remaining


def _days(folder):
    return (time.time() - folder.stat().st_mtime) / 86400


def _layers(steps):
    """[(name, its steps)], and the steps after the last layer."""
    layers, name, waiting = [], "", []
    for step in steps:
        name = key(name, step)
        waiting.append(step)
        if step.word == "RUN" and step.user == "root":
            layers.append((name, waiting))
            waiting = []
    return layers, waiting


def _make(layers, cache, *, anew=False):
    """Make the layers that are not there, or all of them."""
    below = None
    for name, steps in layers:
        if anew or not (cache / name).exists():
            new = cache / "new"  # a half-made tree never gets a layer's name
            new.mkdir()
            if below:
                sh("cp", "-a", f"{below}/.", new)
            for step in steps:
                perform(new, step)
            os.utime(new)  # its age counts from here
            remove(cache / name)
            new.rename(cache / name)
        below = cache / name


def scratch(layer, cache):
    """A tree like the layer that may be changed: an overlay where the file system allows it, else a copy."""
    place = cache / "scratch"
    for name in ("upper", "work", "tree"):
        (place / name).mkdir(parents=True)
    tree = place / "tree"
    options = f"lowerdir={layer},upperdir={place}/upper,workdir={place}/work"
    if subprocess.run(["mount", "-t", "overlay", "overlay", "-o", options, tree], stderr=subprocess.DEVNULL).returncode:
        sh("cp", "-a", f"{layer}/.", tree)
    return tree
