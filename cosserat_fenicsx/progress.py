"""Progress of long runs on rank 0: a bar in a terminal, lines of text elsewhere, nothing for short runs."""

import math
import sys
import threading
import time

_PATIENCE = 2.0  # s before a bar appears
_LINE_EVERY = 10.0  # s between plain lines
_REDRAWN = 0.5  # s between texts of `MeshProgress` in a terminal


class Progress:
    """Context manager that shows the progress of a path or a motion.

    Args:
        targets: the requested load factors or times (s), in their order.
        wanted: True, False, or None to show it in runs of more than two seconds.
        comm: MPI communicator; only rank 0 shows anything.
        quantity: the name of the quantity that advances.
    """

    def __init__(self, targets, wanted, comm, quantity="load factor"):
        self._quantity = quantity
        self._show = comm.rank == 0 and wanted is not False
        self._now = wanted is True
        self._terminal = sys.stderr.isatty()
        way = [0.0, *targets]
        self._way = sum(abs(b - a) for a, b in zip(way[:-1], way[1:], strict=True)) or 1.0
        self._bar = None

    def __enter__(self):
        self._began = self._last = time.monotonic()
        return self

    def start(self, what):
        """Start a run over all targets; `what` describes it."""
        self._what, self._done, self._eta = what, 0.0, 0.0
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
            # a path that turns back is longer than its targets tell
            share = f"{100 * self._done / self._way:.0f} %" if self._done <= 1.001 * self._way else "it turns back"
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


class MeshProgress:
    """Context manager that says which mesh an eigenproblem is solved on, and for how long it has run.

    The number of meshes is not known in advance, and one may take minutes: a thread tells the time.

    Args:
        what: name of the computation; tol: its relative accuracy.
        wanted, comm: see `Progress`.
    """

    def __init__(self, what, tol, wanted, comm):
        self._what, self._tol, self._now = what, tol, wanted is True
        self._terminal = sys.stderr.isatty()
        self._text, self._ended = what, threading.Event()
        show = comm.rank == 0 and wanted is not False
        self._thread = threading.Thread(target=self._tell, daemon=True) if show else None

    def __enter__(self):
        self._began = time.monotonic()
        if self._thread:
            self._thread.start()
        return self

    def on(self, elements, reached):
        """The computation begins on a mesh.

        Args:
            elements: the largest number per rod; reached: estimated relative error so far, infinite where unknown.
        """
        error = f", estimated error {reached:.1e} of {self._tol:g}" if math.isfinite(reached) else ""
        self._text = f"{self._what}: {elements} elements per rod{error}"
        if self._now and self._thread and not self._terminal:
            print(self._line(), file=sys.stderr, flush=True)

    def _line(self):
        return f"{self._text}, {time.monotonic() - self._began:.0f} s"

    def _tell(self):
        if self._terminal:
            if self._ended.wait(0.0 if self._now else _PATIENCE):
                return
            from rich.console import Console

            with Console(stderr=True).status(self._line()) as status:
                while not self._ended.wait(_REDRAWN):
                    status.update(self._line())
            return
        while not self._ended.wait(_LINE_EVERY):
            print(self._line(), file=sys.stderr, flush=True)

    def __exit__(self, *exception):
        self._ended.set()
        if self._thread:
            self._thread.join()
