"""Progress of long runs on rank 0: a bar in a terminal, lines of text elsewhere, nothing for short runs."""

import itertools
import math
import sys
import threading
import time
from functools import cached_property

from cosserat_fenicsx.ranks import are_apart

_PATIENCE = 2.0  # s before a bar appears
_LINE_EVERY = 10.0  # s between plain lines
_LONG = 120.0  # s that are left of a motion from which on plain lines tell them
_REDRAWN = 0.5  # s between texts of `_Clocked` in a terminal
_PLANNED = 1.0  # s before a plan is printed, and so before a bar


def _shown(wanted, comm):
    """Whether this rank shows progress: the cases of a study show none, since the study does."""
    return comm.rank == 0 and wanted is not False and not are_apart()


class Progress:
    """Context manager that shows, on rank 0, the progress of a path or a motion over its load factors or times (s), in
    their order; wanted: True, False, or None to show it in runs of more than two seconds."""

    def __init__(self, targets, wanted, comm, quantity="load factor"):
        self._quantity, self._show, self._now = quantity, _shown(wanted, comm), wanted is True
        self._terminal = sys.stderr.isatty()
        self._targets, self._bar, self._meshes = targets, None, 0

    def __enter__(self):
        self._began = self._last = time.monotonic()
        return self

    @cached_property
    def _way(self):
        return sum(abs(b - a) for a, b in itertools.pairwise([0.0, *self._targets])) or 1.0

    def on_mesh(self):
        """The runs that follow are on another mesh, of which at least two are needed."""
        self._meshes += 1

    def start(self, what):
        """Start a run over all targets; `what` describes it."""
        mesh = f"mesh {self._meshes}, " if self._meshes else ""
        again = "compared with the one before, " if self._meshes > 1 else ""
        self._what, self._done, self._eta = f"{mesh}{again}{what}", 0.0, 0.0
        if self._bar is not None:
            self._bar.reset(self._task)

    def at(self, point):
        """The run has reached a point of a path."""
        self.reached(point.load_factor)

    def reached(self, eta):
        """The run has reached a load factor, or a time (s)."""
        self._done += abs(eta - self._eta)
        self._eta = eta
        now = time.monotonic()
        if not self._show or (now - self._began < _PATIENCE and not self._now):
            return
        if self._terminal:
            self._draw()
        elif now - self._last >= _LINE_EVERY or (self._now and self._last == self._began):
            self._last = now
            # a path that turns back is longer than its targets suggest
            share = f"{100 * self._done / self._way:.0f} %" if self._done <= 1.001 * self._way else "it turns back"
            left = (now - self._began) * (self._way / max(self._done, 1e-300) - 1)
            if self._quantity != "load factor" and left > _LONG:
                minutes, hours = round(left / 60), round(left / 3600)
                share += f", some {minutes} minutes left" if hours < 3 else f", some {hours} hours left"
            print(f"{self._what}: {self._quantity} {self._eta:.6g}, {share}", file=sys.stderr)

    def _draw(self):
        from rich.markup import escape

        if self._bar is None:
            from rich.console import Console
            from rich.progress import Progress as Bar

            self._bar = Bar(console=Console(stderr=True), transient=True)
            self._bar.start()
            self._task = self._bar.add_task("", total=1.0)
        self._bar.update(self._task, completed=min(self._done / self._way, 1.0),
                         description=f"{escape(self._what)}, {self._quantity} {self._eta:.4g}")  # fmt: skip

    def __exit__(self, *exception):
        if self._bar is not None:
            self._bar.stop()


class Plan:
    """Context manager that prints on rank 0 what is about to be done, and how long it may take: at once, or, where
    progress is not asked for (`wanted`, see `Progress`), in runs that have not ended after a second."""

    def __init__(self, text, wanted, comm):
        patience = 0.0 if wanted is True else _PLANNED
        self._text, self._timer = text, None
        if _shown(wanted, comm):
            self._timer = threading.Timer(patience, self._tell)
            self._timer.daemon = True

    def _tell(self):
        print(self._text, file=sys.stderr, flush=True)

    def __enter__(self):
        if self._timer:
            self._timer.start()
        return self

    def __exit__(self, *exception):
        if self._timer:
            self._timer.cancel()
            self._timer.join()


class _Clocked:
    """Base of progress that a thread shows, since one step may take minutes: the text of `_line()` of subclasses."""

    def __init__(self, wanted, comm):
        self._now, self._terminal = wanted is True, sys.stderr.isatty()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._tell, daemon=True) if _shown(wanted, comm) else None

    def __enter__(self):
        self._began = time.monotonic()
        if self._thread:
            self._thread.start()
        return self

    def _say(self):
        """Print the line at once, where progress was asked for outside a terminal."""
        if self._now and self._thread and not self._terminal:
            print(self._line(), file=sys.stderr, flush=True)

    def _tell(self):
        if self._terminal:
            if not self._ended.wait(0.0 if self._now else _PATIENCE):
                self._draw()
            return
        while not self._ended.wait(_LINE_EVERY):
            print(self._line(), file=sys.stderr, flush=True)

    def _draw(self):
        """Show it in a terminal until it has ended."""
        from rich.console import Console
        from rich.markup import escape

        with Console(stderr=True).status(escape(self._line())) as status:
            while not self._ended.wait(_REDRAWN):
                status.update(escape(self._line()))

    def __exit__(self, *exception):
        self._ended.set()
        if self._thread:
            self._thread.join()


class StageProgress(_Clocked):
    """Context manager that shows what a computation is at, and the elapsed time; how long it takes is not known. what:
    name of the computation. wanted, comm: see `Progress`."""

    def __init__(self, what, wanted, comm):
        super().__init__(wanted, comm)
        self._what = self._text = what

    def at(self, what):
        """Say what begins, in a few words."""
        self._text = f"{self._what}: {what}"
        self._say()

    def _line(self):
        return f"{self._text}, {time.monotonic() - self._began:.0f} s"


class MeshProgress(StageProgress):
    """`StageProgress` of an eigenproblem on one mesh after the other, whose number is not known. what: name of the
    computation; tol: its relative accuracy. wanted, comm: see `Progress`."""

    def __init__(self, what, tol, wanted, comm):
        super().__init__(what, wanted, comm)
        self._tol = tol

    def on(self, elements, reached):
        """It begins on a mesh of at most `elements` elements per rod; reached: the estimated error so far."""
        error = f", estimated error {reached:.1e} of {self._tol:g}" if math.isfinite(reached) else ""
        self.at(f"{elements} elements per rod{error}")


class CaseProgress(_Clocked):
    """Context manager that shows how many cases of a study, of `total`, are done, on all ranks; counts: returns how
    many are done, and how many of these have failed; wanted: see `Progress`."""

    def __init__(self, total, counts, wanted, comm):
        super().__init__(wanted, comm)
        self._total, self._counts = total, counts

    def _line(self):
        done, failed = self._counts()
        failures = f", {failed} failed" if failed else ""
        return f"study: {done} of {self._total} cases{failures}, {time.monotonic() - self._began:.0f} s"

    def _draw(self):
        from rich.console import Console
        from rich.progress import Progress as Bar

        with Bar(console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task("study", total=self._total)
            while not self._ended.wait(_REDRAWN):
                bar.update(task, completed=self._counts()[0], description=self._line())

    def __exit__(self, *exception):
        super().__exit__(*exception)
        self._say()
