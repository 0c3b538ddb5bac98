"""The four kinds of computations that a folder may hold, and ways to end them at any of their writes."""

import errno
import os
import shutil
import signal
import sys
from dataclasses import dataclass
from pathlib import Path

import fake_string
import numpy as np
from ended_motions import SMALL
from moving_scenes import flying_in_space

import cosserat_fenicsx as cf
from cosserat_fenicsx.dynamics import simulate
from cosserat_fenicsx.storage import files
from cosserat_fenicsx.storage.store import Store, read

HOLE = cf.well.Borehole(
    cf.well.WellPath.from_survey([0, 500, 1000], [0, 0, 30], [0, 0, 0]), cf.well.HoleSection(1000.0, 0.2159, 0.2)
)
STRING = cf.well.DrillString([cf.well.DrillPipe(size="5 in 19.50 lb/ft")])


def third(i):
    if i == 3:
        raise ValueError("three")
    return {"third": i / 3, "array": [i, 0.1 * i]}


def study(folder, upto=12):
    return cf.study(third, {"i": range(upto)}, folder=folder, progress=False)


def sweep(folder, tol=1e-4):
    return cf.well.depth_sweep(
        HOLE,
        STRING,
        [cf.well.TripOut(), cf.well.TripIn()],
        [600.0, 800.0, 1000.0],
        mud=cf.well.Mud(1200.0),
        model="soft",
        tol=tol,
        folder=folder,
        progress=False,
    )


def rods(folder, dt=0.05):
    return cf.simulate(flying_in_space()[1], 1.0, dt=dt, folder=folder, progress=False, **SMALL)


def string(folder, dt=0.01):
    return cf.drilling.simulate(fake_string.scene(), 5.0, dt=dt, folder=folder, profile_every=0.5, progress=False)


def goes_on(folder):
    return cf.resume(folder, progress=False)


def of_study(found):
    return [repr(x) for x in found.results] + [failure.why for failure in found.failures]


def of_sweep(found):
    """To 13 digits: where the system puts arrays decides how BLAS sums, in the last one of error estimates."""
    return {name: [f"{x:.13g}" for x in values.ravel()] for name, values in found.values.items()}


@dataclass(frozen=True)
class User:
    """A kind of computation: how it begins, goes on and is read; another one of its kind; the digits of its result."""

    begin: object
    go_on: object
    read: object
    other: object
    digits: object
    call: str
    what: str


USERS = {
    "rods": User(rods, goes_on, cf.read_history, lambda folder: rods(folder, 0.1),
             lambda x: [np.array(x._file.rows[name]).tobytes() for name in x._file.rows.dtype.names if len(x)],
             "simulate", "motion"),
    "string": User(string, goes_on, cf.read, lambda folder: string(folder, 0.02),
               lambda x: [x.rows.tobytes(), x._along().tobytes()], "drilling.simulate", "motion of a drill-string"),
    "study": User(study, study, study, lambda folder: study(folder, 13), of_study, "study", "study"),
    "sweep": User(sweep, goes_on, read, lambda folder: sweep(folder, 1e-3), of_sweep, "depth_sweep", "sweep"),
}  # fmt: skip


def use(monkeypatch, apart=0.0):
    """The pendulum in place of strings, and checkpoints as often as can be."""
    fake_string.use(monkeypatch)
    monkeypatch.setattr("cosserat_fenicsx.drilling.motion.CHUNK", 37)
    monkeypatch.setattr(Store, "APART", apart)
    monkeypatch.setattr(Store, "SELDOM", 0)


def at_write(monkeypatch, number, end):
    """Call `end()` in the middle of a write of any file of a folder, the first being 0; returns all writes so far."""
    done = []

    def counted(module, name, part):
        whole = getattr(module, name)

        def write(*given):
            done.append(name)
            if len(done) == number + 1:
                part(*given)
                end()
            return whole(*given)

        monkeypatch.setattr(module, name, write)

    def half_of_table(stream, place, data):
        os.pwrite(stream.fileno(), bytes(data)[: len(data) // 2], place)

    def half_of_line(self, row):
        (self.place / f"rows.{self.comm.rank}.jsonl").open("ab").write(files.sealed(row)[:20])

    counted(files, "_write", half_of_table)
    counted(files, "replace", lambda file, data: file.with_name(f"{file.name}.new").write_bytes(bytes(data)[:100]))
    counted(Store, "_append", half_of_line)
    return done


def interrupt():
    raise KeyboardInterrupt


def full():
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def in_a_child(action):
    """Run `action()` in a copy of this process, which ends; returns its exit status."""
    sys.stdout.flush()
    child = os.fork()
    if not child:
        action()
        os._exit(0)
    return os.waitpid(child, 0)[1]


def mutated(folder, chance, other):
    """Damage one of the files of a folder at random: its bytes, or all of it; returns what was done.

    Args:
        other: the folder of another computation of the same kind.
    """
    file = chance.choice(sorted(folder.iterdir()))
    data = file.read_bytes()
    place = chance.randrange(max(1, min(len(data), chance.choice((100, 10**9)))))
    size = chance.choice((1, 4, 40))
    noise = bytes(chance.randrange(256) for _ in range(size))
    ways = {
        "truncated": lambda: data[:place],
        "overwritten": lambda: data[:place] + noise + data[place + size :],
        "longer": lambda: data[:place] + noise + data[place:],
        "shorter": lambda: data[:place] + data[place + size :],
        "twice": lambda: data * 2,
        "zeros": lambda: data + bytes(size),
        "emptied": lambda: b"",
        "digit": lambda: data.replace(b"1", b"2", 1),
        "swapped": lambda: data[place:] + data[:place],
        "of another": lambda: (other / file.name).read_bytes() if file.name in names else b"",
        "missing": None,
    }
    names = {x.name for x in other.iterdir()} - {"stored.json"}  # with which it is that computation
    way = chance.choice(list(ways))
    file.unlink() if way == "missing" else file.write_bytes(ways[way]())
    return f"{file.name} {way} at {place}"


def copy(folder, place):
    shutil.rmtree(place, ignore_errors=True)
    return Path(shutil.copytree(folder, place))


def written(folder):
    """{name: bytes} of the files in a folder."""
    return {file.name: file.read_bytes() for file in Path(folder).iterdir()}


assert simulate  # loaded before any copy of this process is made
