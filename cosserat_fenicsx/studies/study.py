"""`study`: a task for many cases, each computed by one rank alone, or by an executor: new processes, a dask cluster,
ranks of mpi4py.futures."""

import contextlib
import gc
import inspect
import itertools
import json
import pickle
import queue
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import BrokenExecutor, Executor
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.checks import File, instance, refuse, whole
from cosserat_fenicsx.errors import CosseratError, InstallationError, Interrupted, SceneError
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.progress import CaseProgress
from cosserat_fenicsx.ranks import apart, communicator
from cosserat_fenicsx.storage.mark import NotMarked, mark_of
from cosserat_fenicsx.storage.store import Kind, Nowhere, Store
from cosserat_fenicsx.studies.outcome import Study, from_data, to_data


# Cases that an executor is given ahead of those that are done, several for each of a thousand workers; seconds between
# looks for Ctrl-C.
_AHEAD, _WAIT = 4000, 0.2
_SENDABLE = "arguments that pickle takes: numbers, texts, arrays, scenes, functions of modules"


def computed(task, case):
    """What a case gives, as a part of the row that is stored: its result or its failure in words, and seconds. Raises
    InstallationError: it needs what is not installed."""
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
    """(number of a case, what `computed` gives) by an executor, as done; the rest is canceled at an exception."""
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
                future = done.get(timeout=_WAIT)
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


KIND = Kind(
    what="study", home="studies.study", call="study", again="the same call of study continues from there",
    differs="it holds another study, expected the same call, or another folder", each_rank=True,
)  # fmt: skip
_COMPARABLE = "numbers, texts, arrays, functions, parts of scenes and of wells, lists and dicts of these"


def study(
    task: Callable[..., Any],
    cases: Iterable[Mapping[str, Any]] | Mapping[str, Iterable[Any]],
    *,
    folder: File | None = None,
    retry: bool = False,
    workers: int | None = None,
    executor: Any = None,
    progress: bool | None = None,
    comm: MPI.Comm | None = None,
) -> Study:
    """Call `task(**case)` for every case, on all ranks or by an executor, and gather what it returns.

    Each case is computed by one rank alone: within the task `solve`, `simulate`, `torque_and_drag` and all other
    functions of the package use the communicator of that rank by default, whatever the number of ranks. Cases are
    handed out in their order to ranks as they become free. So results do not depend on the number of ranks.

    A case whose task raises an exception is a failure of that case alone, see `Study.failures`. An
    `InstallationError` is none: what is missing for one case is missing for all.

    Args:
        task: a function of the arguments of a case, by name, or what `compile` returns; lists, dicts and arrays among
            them are its own, and may be changed. It returns a number, a text, an array of numbers or of
            texts, None, or a dict of these by name; where it computes more, it writes that to files of its own.
        cases: dicts of arguments, in a list or another iterable; or one dict {name: values}, whose product is taken,
            the last name running fastest: `{"speed": [40, 60], "weight": [50e3, 100e3]}` has four cases.
        folder: keeps every outcome as it comes, whatever ends the run; the same call continues from there, on any
            number of ranks, and computes what is missing. All ranks must see it. None keeps none.
        retry: whether cases that have failed before, by `folder`, are computed again. By default they remain failures.
        workers: compute the cases in this number of new processes instead of here, as where there is no mpirun:
            a notebook uses the cores of its machine. Each takes about two seconds to start.
        executor: compute them by this one: any `concurrent.futures.Executor`, or a dask `Client`. The folder, progress
            and what is returned stay here. The task and its cases must be such as `pickle` takes: a function of a
            module, not of a notebook (`ProcessPoolExecutor`; dask takes both). With `mpi4py.futures` one rank calls.
        progress: True, False, or None to show it in runs of more than two seconds. The cases themselves show none.
        comm: MPI communicator; default all ranks. Every rank calls with the same task and cases, every rank gets the
            same Study.

    Returns:
        Study.

    Raises:
        SceneError: cases that are none, or whose names are not the task's arguments; a folder that holds another
            study: other cases, or a task of another name, of other code, or that uses other constants. What the task
            calls in other modules is not compared, nor are lists, dicts and arrays that are made outside it.
        Interrupted: Ctrl-C; `.path` is the Study so far.
        NotStored: the folder can no longer be written to; `.path` is the Study so far.
        InstallationError: a case needs what is not installed.
        RuntimeError: the executor has broken, as where a worker was killed; a folder keeps what was computed.
    """
    comm = communicator(comm if executor is None else MPI.COMM_SELF)
    task = task.task() if hasattr(task, "task") else task  # a compiled scene
    cases, grid = cases_of(cases)
    check_task(task, cases)
    instance("study", "retry", retry, bool, "True or False")
    if workers is not None:
        whole("study", "workers", workers)
        if comm.size > 1:
            refuse("study", "workers", workers, "none with several MPI ranks, which share the cases")
    told = _told(task, cases, strictly=folder is not None)
    of_cases = json.dumps({place: found for place, found in told.items() if not place.startswith("task")})
    if len(set(comm.allgather(of_cases))) > 1:
        raise SceneError("study.cases: they differ between ranks: expected the same cases on every rank")
    if comm.size > 1:
        gc.collect()  # what ranks must free together is not left for times at which they are apart
    store = Nowhere() if folder is None else Store(folder, KIND, comm).begin(told)
    try:
        rows = _latest(store.lines(lambda row: _outcome_in(row, len(cases))))
        with executor_of(task, workers, executor) as chosen:
            run = _Run(task, cases, rows, retry, store, comm, chosen)
            rows, troubles = run.over(progress)
    finally:
        store.release()
    found = {i: (from_data(row.get("result")), row.get("failure", ""), row["seconds"]) for i, row in rows.items()}
    found = Study(cases, grid, dict(sorted(found.items())))
    found.units = dict(getattr(task, "units", {}))
    _raise_first(run.trouble, troubles, found, store)
    return found


def go_on(store, *given):
    """`resume` and `read` of a study are refused: its folder does not hold the task."""
    raise SceneError(f"{store.place}: it holds a study: expected the same call of study, which continues it")


read = go_on


def _told(task, cases, *, strictly):
    """The mark of task and cases; `strictly`: what cannot be compared is refused."""
    told = {"cases: number": len(cases)}
    for name, value in (("task", task), *((f"cases[{i}]", case) for i, case in enumerate(cases))):
        try:
            told |= mark_of(value, name)
        except NotMarked as problem:
            if strictly:
                raise SceneError(
                    f"study.{name}: a {problem} cannot be compared with what the folder holds: expected {_COMPARABLE}, "
                    "or that the task makes the others itself"
                ) from None
            told[name] = str(problem)
    return told


def _outcome_in(row, count):
    """A stored row; ValueError, LookupError or TypeError where it belongs to none of `count` cases."""
    if not 0 <= row["case"] < count or ("result" in row) == ("failure" in row):
        raise ValueError(f"case = {row['case']}: expected a result or a failure of one of {count} cases")
    row["attempt"] + row["seconds"], from_data(row.get("result"))
    return row


# Most cases that a task takes at once.
_BLOCK = 256


class _Run:
    """The computation of the missing cases; `trouble`: the exception that ended it on this rank, or None."""

    def __init__(self, task, cases, rows, retry, store, comm, executor):
        self._task, self._cases, self._rows, self._store, self._comm = task, cases, rows, store, comm
        self._executor = executor
        self._missing = [i for i in range(len(cases)) if i not in rows or (retry and "failure" in rows[i])]
        self.trouble = None

    def over(self, progress):
        """({number of the case: row} of all ranks and of the folder, the `_kind`s of trouble of all ranks)."""
        pool = TaskPool(self._comm, len(self._missing))
        before = len(self._cases) - len(self._missing)
        failed = sum("failure" in row for i, row in self._rows.items() if i not in set(self._missing))

        def counts():
            now = pool.counts()
            return before + now[0], failed + now[1]

        own = []
        with CaseProgress(len(self._cases), counts, progress, self._comm):
            try:
                self._work(pool, own)
                pool.meet()
            except BaseException as problem:  # the other ranks end their case, and learn of it below
                self.trouble = problem
                pool.stop()
                pool.meet()
        everywhere = self._comm.allgather((own, _kind(self.trouble)))
        pool.close()
        found = _latest([*self._rows.values(), *(row for rows, _ in everywhere for row in rows)])
        return found, [kind for _, kind in everywhere if kind]

    def _work(self, pool, own):
        for i, found in self._found(pool):
            row = {"case": i, "attempt": self._rows.get(i, {}).get("attempt", 0) + 1, **found}
            own.append(row)
            try:
                self._store.keep(row)
            except OSError as problem:
                raise _CannotKeep(problem.strerror or str(problem)) from problem
            pool.tell("failure" in row)

    def _found(self, pool):
        """(number of a case, what it gave), as they are computed."""
        todo = (self._missing[k] for k in pool)
        if self._executor is not None:
            yield from by_executor(self._executor, self._task, self._cases, todo)
            return
        if hasattr(self._task, "many"):
            size = max(1, min(_BLOCK, len(self._missing) // (4 * self._comm.size)))
            while block := [*itertools.islice(todo, size)]:
                obey()
                yield from zip(block, computed_at_once(self._task, [self._cases[i] for i in block]), strict=True)
            return
        for i in todo:
            obey()
            yield i, computed(self._task, self._cases[i])


class _CannotKeep(Exception):
    """An outcome cannot be written."""


def _latest(rows):
    """{number of the case: its row}: a result rather than a failure, else the last attempt."""
    return {row["case"]: row for row in sorted(rows, key=lambda row: ("result" in row, row["attempt"]))}


def _kind(trouble):
    """(exception class to be raised by all ranks, text) of what ended the work on a rank; None for nothing."""
    if trouble is None:
        return None
    for kind in (KeyboardInterrupt, _CannotKeep, InstallationError):
        if isinstance(trouble, kind):
            return kind.__name__, str(trouble)
    return RuntimeError.__name__, f"{type(trouble).__name__}: {trouble}"


def _raise_first(own, troubles, found, store):
    """Raise what ended the work, the same on all ranks."""
    if not troubles:
        return
    name, text = min(troubles, key=lambda trouble: trouble[0] == KeyboardInterrupt.__name__)
    if name == KeyboardInterrupt.__name__:
        without = "; with a folder they would be kept there, and the same call would continue from them"
        raise Interrupted(found, store.kept or without) from None
    if name == _CannotKeep.__name__:
        raise store.not_stored(OSError(0, text), found, "an outcome")
    if name == InstallationError.__name__:
        raise InstallationError(text) from own
    raise own or RuntimeError(text)


def cases_of(cases):
    """(list of dicts of arguments, {name: list of values} of their grid or None), from an iterable of dicts, or a dict
    of lists of values, whose product is taken: the last name runs fastest; else a SceneError."""
    if isinstance(cases, Mapping):
        grid = {_name(name): _values(f"cases['{name}']", values, "value") for name, values in cases.items()}
        if not grid:
            refuse("study", "cases", cases, "at least one name with a list of values")
        return [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())], grid
    expected = "dicts of arguments by name, or one dict of lists of values by name"
    found = _values("cases", cases, "case", expected)
    for i, case in enumerate(found):
        if not isinstance(case, Mapping):
            refuse("study", f"cases[{i}]", case, expected)
    return [{_name(name): value for name, value in case.items()} for case in found], None


def _name(name):
    if not isinstance(name, str):
        refuse("study", "cases", name, "names of the task's arguments, as texts")
    return name


def _values(field, values, what, expected="a list of values"):
    if isinstance(values, np.ndarray) and values.ndim == 1:
        values = values.tolist()  # Python's numbers, as those of a list are
    if isinstance(values, str | bytes | Mapping) or not isinstance(values, Iterable):
        refuse("study", field, values, expected)
    found = list(values)
    if not found:
        refuse("study", field, values, f"at least one {what}")
    return found


def check_task(task, cases):
    """Refuse a task that cannot be called with its cases, before any of them is computed."""
    if hasattr(task, "many"):
        for i, case in enumerate(cases):
            if set(case) != set(task.names):
                raise SceneError(
                    f"study.cases: case {i} has the names {', '.join(case) or '(none)'}: expected those that the scene "
                    f"is compiled over, {', '.join(task.names)}"
                )
        return
    if not callable(task):
        refuse("study", "task", task, "a function of the arguments of a case")
    try:
        signature = inspect.signature(task)
    except ValueError:  # some functions written in C do not tell
        return
    for i, case in enumerate(cases):
        try:
            signature.bind(**case)
        except TypeError as problem:
            raise SceneError(
                f"study.cases: case {i} has the names {', '.join(case) or '(none)'}, and the task refuses them "
                f"({problem}): expected the arguments of the task, {signature}"
            ) from None


# Time (s) between looks of a rank that has nothing left to do and waits for the others.
_LOOK = 0.005
_NEXT, _DONE, _FAILED = range(3)


class TaskPool:
    """Hands out the numbers below `count`, each to one rank, in ascending order. Every rank makes it, iterates over it
    until it ends, calls `meet`, and then `close`.

    The numbers are counted in memory of rank 0 by one-sided operations of MPI, which it need not answer: it computes as
    the others do. Ranks that share a computer, or a network with remote access to memory, do not wait for it; on other
    networks a rank waits until rank 0 next enters MPI, which is the end of its task at the latest.
    """

    def __init__(self, comm, count):
        self._comm, self._count, self._met, self._window = comm, count, None, None
        self._counters = np.zeros(3, np.int64)
        if comm.size > 1:
            from mpi4py import MPI

            size = self._counters.itemsize
            self._window = MPI.Win.Allocate(len(self._counters) * size if comm.rank == 0 else 0, size, comm=comm)
            if comm.rank == 0:
                self._counters = np.frombuffer(self._window.tomemory(), np.int64)
                self._counters[:] = 0
            comm.Barrier()
            self._window.Lock_all()

    def __iter__(self):
        while (number := self._add(_NEXT, 1)) < self._count:
            yield number

    def _add(self, counter, amount):
        """Add to a counter and return what it was."""
        if self._window is None:
            before = int(self._counters[counter])
            self._counters[counter] += amount
            return before
        added, before = np.array([amount], np.int64), np.empty(1, np.int64)
        self._window.Fetch_and_op(added, before, 0, counter)
        self._window.Flush(0)
        return int(before[0])

    def tell(self, failed):
        """This rank has done a task."""
        self._add(_FAILED, int(failed))
        self._add(_DONE, 1)

    def counts(self):
        """(numbers of tasks done, and of failed ones) of all ranks; on rank 0 alone."""
        return int(self._counters[_DONE]), int(self._counters[_FAILED])

    def stop(self):
        """Hand out no more, to no rank."""
        self._add(_NEXT, self._count)

    def meet(self):
        """Wait until no rank has more to do, without keeping the processor; it can be interrupted and called again."""
        if self._window is None:
            return
        self._met = self._met or self._comm.Ibarrier()
        while not self._met.Test():
            time.sleep(_LOOK)

    def close(self):
        """Give the memory back. Collective."""
        if self._window is not None:
            self._counters = self._counters.copy()
            self._window.Unlock_all()
            self._window.Free()
            self._window = None
