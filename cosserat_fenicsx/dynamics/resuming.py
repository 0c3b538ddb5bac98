"""`resume` continues a motion from the folder it was written to; `read_history` reads the states saved so far."""

import cosserat_fenicsx.compat  # noqa: F401, I001  first: its message says what is missing where dolfinx is

import os
from pathlib import Path as FilePath

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.checks import File
from cosserat_fenicsx.checks import instance, refuse, warn
from cosserat_fenicsx.dynamics.simulate import check_counts, pace_of, positive_time
from cosserat_fenicsx.dynamics.simulate import solvers_of
from cosserat_fenicsx.dynamics.schemes import SCHEMES
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.dynamics.time_loop import marks_of
from cosserat_fenicsx.models.connections import Connections
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.base import Scales
from cosserat_fenicsx.dynamics.time_loop import TimeLoop
from cosserat_fenicsx.ranks import communicator
from cosserat_fenicsx.results.export import saved
from cosserat_fenicsx.results.history import History
from cosserat_fenicsx.storage import checkpoints, entries
from cosserat_fenicsx.storage.runfolder import RunFolder
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.statics.path.recorder import assembled
from cosserat_fenicsx.storage.stored_history import StoredHistory


def resume(
    folder: File,
    scene: Scene | None = None,
    *,
    duration: float | None = None,
    progress: bool | None = None,
    comm: MPI.Comm | None = None,
) -> History:
    """Continue a motion from the folder that `simulate(..., folder=...)` writes, to the same digits.

    It does not matter what ended the run: a killed process, Ctrl-C, a full disk. All saved states are kept. The run
    continues from the last checkpoint of the solver and computes what came after it again. Checkpoints are two seconds
    of computing time apart, or fifty times as long as it takes to write one, whichever is longer. In serial, with the
    same libraries, every number is bit by bit that of an uninterrupted run; in parallel it agrees to rounding.
    A motion that fails again in the same way, such as where steps fail however short they are, needs another
    `simulate`, with `start=` if need be.

    Args:
        folder: its name.
        scene: the `Scene` of the motion; it is compared with the fingerprint in the folder. None for the scene stored
            in the folder, which is missing where a part of it is a function written in Python or of a class of your
            own. It is stored as data, so that a folder cannot run code.
        duration: s; None for the last one requested. With a longer one a step still ends at every earlier end, and the
            error may grow at the rate that `tol` set before; a motion computed in a plane must stay in it.
        progress, comm: as of `simulate`; with the same number of ranks.

    Returns:
        History with all states from the start; at once where the motion is complete.

    Raises:
        SceneError: no such folder, another scene, a shorter duration, another number of ranks, another process that
            computes this motion, or no readable checkpoint.
        NotConverged, Interrupted, NotStored: as of `simulate`.
    """
    comm = communicator(comm)
    if duration is not None:
        positive_time("duration", duration, "resume")
    kept, scene = _open(folder, scene, comm, duration)
    until = duration or kept.durations[-1]
    check_counts("resume", until, kept.asked["dt"], kept.asked["save_every"])
    _check_plane(kept, scene, until)
    if kept.ranks != comm.size:
        raise SceneError(
            f"{kept.place} was computed by {kept.ranks} rank(s), and here are {comm.size}: expected as many"
        )
    if _memory(kept, _history(kept, scene, comm))["t"] >= until:
        return _history(kept, scene, comm)
    kept.hold()
    try:
        return _go_on(kept, scene, until, comm, progress)
    finally:
        kept.release()


def _check_plane(kept, scene, until):
    """Refuse a longer duration in which the scene leaves the plane that the motion was computed in."""
    if kept.told["model"] != "planar":
        return
    before, (after, why) = scene.over(kept.asked["duration"]).plane, scene.over(until).flatness
    if after is not None and not np.allclose(after.axes[2], before.axes[2], rtol=0, atol=1e-9):
        why = f"the scene moves in {after.words}"
    if why:
        raise SceneError(
            f"resume.duration = {until:g}: {kept.place} was computed in {before.words}, and until then {why}: expected "
            "a shorter duration, or a motion in space, by another simulate(..., model='spatial')"
        )


def _go_on(kept, scene, until, comm, progress):
    asked, ends = kept.asked, [t for t in kept.durations if t < until]
    marks = marks_of(scene, until, asked["save_every"], ends)
    scene_over, layout = scene.over(asked["duration"]), Layout.of(scene, asked["elements"])
    scheme, load_factor = asked["scheme"], asked["load_factor"]
    model = kept.told["model"]
    with solvers_of(scene_over, layout, asked["degree"], scheme, load_factor, comm, model) as (problem, stepper):
        history = _history(kept, scene, comm, problem.model.expansion())
        stepper.rho_inf = asked["rho_inf"]
        problem.begin()
        stepper.begin()
        pace = pace_of(asked["duration"], tol=asked["tol"], dt=asked["dt"], scheme=scheme)
        pace.watch(scene, asked["duration"], load_factor, stepper.impulse_error)
        motion = TimeLoop(problem, stepper, pace, history, kept)
        memory = _memory(kept, history, motion)
        alike = np.array_equal(memory["nodes"], problem.model.slots)
        if not comm.allreduce(alike, op=MPI.LAND):
            raise SceneError(
                f"{kept.place}: its nodes are numbered differently here: expected the release of dolfinx that it was "
                "computed with"
            )
        history.go_on_after(memory["saved"])
        if until > kept.durations[-1]:
            kept.extend(until, scene)
        return motion.over(marks, asked["save_every"] is None, progress)


def read_history(folder: File, scene: Scene | None = None, *, comm: MPI.Comm | None = None) -> History:
    """The states that a motion has saved so far; another process may still be computing it.

    Args:
        folder: as of `resume`; or the file that `History.save` wrote.
        scene: as of `resume`; None for a file, which holds its scene.
        comm: MPI communicator with any number of ranks; default all.

    Returns:
        History.

    Raises:
        SceneError: no such folder or file, another scene, or a file that is damaged or of a newer release.
    """
    comm = communicator(comm)
    if isinstance(folder, str | os.PathLike) and FilePath(folder).is_file():
        if scene is not None:
            refuse("read_history", "scene", scene, f"None, since the file {folder} holds its scene")
        return saved.read(folder, History, assembled, comm)
    kept, scene = _open(folder, scene, comm)
    _, states, why = next(kept.memories())  # before the states, which another process may be writing
    history = _history(kept, scene, comm)
    if not why and states is not None and states["rows"] <= len(history) and not history.sound(states):
        raise SceneError(
            f"{kept.place}: the numbers of saved states are not those that were written (their checksum is that of "
            "others): expected the files as they were; cosserat_fenicsx.resume computes them again"
        )
    return history


def _open(folder, scene, comm, duration=None):
    """The `RunFolder`, and the scene, checked to be that of the motion up to `duration` (s)."""
    if scene is not None:
        instance("resume", "scene", scene, Scene, "a Scene, or None for the folder's own")
    kept = RunFolder(folder, comm).open()
    if kept.asked["scheme"] not in SCHEMES:
        raise SceneError(f"{kept.place}: scheme '{kept.asked['scheme']}': {nearest(kept.asked['scheme'], SCHEMES)}")
    last = kept.durations[-1]
    if duration is not None and duration < last:
        refuse("resume", "duration", duration, f"None or at least {last:g} s, the last duration requested")
    return kept, kept.scene(scene, duration or last)


def _history(kept, scene, comm, expand=None):
    layout, scales = Layout.of(scene, kept.asked["elements"]), Scales.of(scene)
    connections = Connections.of(scene, layout)
    return StoredHistory.as_told(kept.told, scene, layout, scales, comm, connections, expand).keep_in(kept.place)


def _memory(kept, history, motion=None):
    """The latest checkpoint of this rank before which all states are saved.

    Args:
        motion: the `TimeLoop` that recalls it, whose data it must be like.

    Raises:
        SceneError: there is none.
    """
    lost, like = [], {} if motion is None else motion.memory()
    for memory, states, why in kept.memories():
        if memory is not None:
            why = _wrong(memory, like)
        missing = memory is None and not why
        reasons = [text for text in history.comm.allgather(why) if text]
        if history.comm.allreduce(missing, op=MPI.LOR) or reasons:
            lost += reasons[:1]
        elif not history.comm.allreduce(memory["saved"] <= len(history), op=MPI.LAND):
            continue
        elif not history.sound(states):
            lost.append(f"{history.folder}: the numbers of saved states are not those that were written")
        elif motion is not None and (found := _not_recalled(motion, memory)):
            lost.append(f"checkpoint: {found}")
        else:
            if lost and motion is not None and history.comm.rank == 0:
                warn(f"{lost[0]}: the motion is continued from its start, which computes them again")
            return memory
    raise SceneError(
        f"{kept.place}: no checkpoint can be read (checkpoint.npz and start.npz are missing or damaged"
        f"{''.join(f'; {text}' for text in lost[:1])}): expected a new run by simulate; read_history shows the states "
        "that were saved"
    )


def _not_recalled(motion, memory):
    """Let a `TimeLoop` go on from a checkpoint; why it cannot, in words, or None. One of several ranks cannot fail
    alone, since this is collective: there all exceptions are raised."""
    if motion.model.comm.size == 1:
        return checkpoints.not_recalled(motion.recall, memory)
    motion.recall(memory)
    return None


def _wrong(memory, like):
    """What is wrong with the data of a checkpoint, which should be like others, "" where nothing is."""
    try:
        entries.checked(memory, {"saved": entries.AN_INDEX, "t": entries.A_NUMBER})
    except ValueError as problem:
        return f"checkpoint: {problem}"
    if not isinstance(memory.get("nodes"), np.ndarray):
        return "checkpoint: nodes is missing"
    found = checkpoints.unlike(memory, like)
    return f"checkpoint: {found}" if found else ""
