"""Cases of a study, computed here or by an executor: new processes, a dask cluster, ranks of mpi4py.futures."""

import contextlib
import itertools
import pickle
import queue
import sys
import time
import traceback
from concurrent.futures import BrokenExecutor, Executor
from pathlib import Path

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.errors import CosseratError, InstallationError, SceneError
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.ranks import apart
from cosserat_fenicsx.studies.outcome import to_data

# Cases that an executor is given ahead of those that are done, several for each of a thousand workers; seconds between
# looks for Ctrl-C.
_AHEAD, _LOOK = 4000, 0.2
_SENDABLE = "arguments that pickle takes: numbers, texts, arrays, scenes, functions of modules"


def computed(task, case):
    """What a case gives, as a part of the row that is stored: its result or its failure in words, and seconds.

    Raises:
        InstallationError: it needs what is not installed.
    """
    return computed_at_once(task, [case])[0]


def computed_at_once(task, cases):
    """`computed` of several cases: at once by a task that takes `many`, which returns a text for a case that fails."""
    began = time.monotonic()
    try:
        with apart():
            if hasattr(task, "many"):
                told = task.many(cases)
                found = [{"failure": x} if isinstance(x, str) else {"result": to_data(x)} for x in told]
            else:
                found = [{"result": to_data(task(**unshared(case)))} for case in cases]
    except InstallationError:
        raise
    except (Exception, SystemExit) as problem:
        found = len(cases) * [{"failure": _sentence(problem)}]
    seconds = (time.monotonic() - began) / len(cases)
    return [{**x, "seconds": seconds} for x in found]


def _sentence(problem):
    """The exception in words, with its line unless it is an error of this package, which says what is wrong."""
    said = f"{type(problem).__name__}: {problem}" if str(problem) else type(problem).__name__
    if isinstance(problem, CosseratError):
        return said
    place = traceback.extract_tb(problem.__traceback__)[-1]
    return f"{said} ({Path(place.filename).name}, line {place.lineno})"


def unshared(value):
    """A case, or a part of one, with lists, dicts and arrays of its own, which a task may change."""
    if isinstance(value, np.ndarray):
        return value.copy()
    if type(value) in (list, tuple):
        return type(value)(map(unshared, value))
    return {name: unshared(part) for name, part in value.items()} if type(value) is dict else value


def _in_worker(task, case):
    """`computed` in a worker of an executor, where PETSc must not wait for other ranks."""
    if "petsc4py.PETSc" not in sys.modules:
        import petsc4py
        from mpi4py import MPI

        petsc4py.init(comm=MPI.COMM_SELF)  # it starts on all ranks together otherwise, which mpi4py.futures never does
    return computed(task, case)


@contextlib.contextmanager
def executor_of(task, workers, executor):
    """The executor of a study, or None; one that is made for `workers` ends with it. A SceneError where both are given,
    for something that is no executor, or a task that new processes cannot import."""
    if executor is None and not workers:
        yield None
        return
    if executor is not None and workers:
        refuse("study", "workers", workers, "none with an executor, which has its own")
    if workers:
        from concurrent.futures import ProcessPoolExecutor
        from multiprocessing import get_context

        try:
            pickle.dumps(task)
        except Exception as problem:
            raise SceneError(
                f"study.task: new processes cannot get it ({problem}): expected a function of a module, or an executor "
                "that takes others, such as a dask Client"
            ) from None
        # processes that are forked would share this one's MPI
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            try:
                yield pool
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
        return
    executor = executor.get_executor() if hasattr(executor, "get_executor") else executor  # a dask Client
    if not isinstance(executor, Executor):
        refuse("study", "executor", executor, "a concurrent.futures.Executor or a dask Client")
    yield executor


def by_executor(executor, task, cases, numbers):
    """(number of a case, what `computed` gives) by an executor, as they are done; the rest is canceled at an exception;
    numbers: an iterator of those to compute."""
    pending, done = {}, queue.SimpleQueue()  # `wait` would look at all that are pending, for each that is done
    try:
        while True:
            for i in itertools.islice(numbers, _AHEAD - len(pending)):
                future = executor.submit(_in_worker, task, cases[i])
                pending[future] = i
                future.add_done_callback(done.put)
            if not pending:
                return
            obey()
            try:
                future = done.get(timeout=_LOOK)
            except queue.Empty:
                continue
            i = pending.pop(future)
            try:
                found = future.result()
            except (pickle.PicklingError, AttributeError, TypeError) as problem:
                raise SceneError(
                    f"study.cases[{i}]: the executor cannot send it or its result ({problem}): expected {_SENDABLE}"
                ) from None
            yield i, found
    except BrokenExecutor as problem:
        raise RuntimeError(
            f"a worker of the executor ended at case {min([i, *pending.values()])} or near it ({problem}): a folder "
            "keeps what was computed, and the same call continues from it"
        ) from problem
    finally:
        for future in pending:
            future.cancel()
