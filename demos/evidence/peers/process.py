"""The process of a peer, which answers requests and is ended if a sample takes too long."""

import json
import select
import subprocess
import time

from peers.environments import command, surroundings


class Peer:
    """Started at its first request, and again after it was ended; a context manager."""

    def __init__(self, name, install=True):
        self.name, self.words, self._process = name, command(name, install), None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()

    def ask(self, problem, configuration, *, warm, samples, limit):
        """The answer of `speak.serve`, or {"failed": ...} after `limit` seconds."""
        request = {"problem": problem, "configuration": configuration, "warm": warm, "samples": samples}
        process = self._running()
        try:
            process.stdin.write(json.dumps(request).encode() + b"\n")
            process.stdin.flush()
            line = self._line(process, time.monotonic() + limit)
        except BrokenPipeError:
            line = b""
        except BaseException:  # Ctrl-C: nobody will read its answer
            self.end()
            raise
        if line is None:
            self.end()
            return {"failed": f"time limit of {limit:g} s"}
        if not line:
            code = process.wait()
            self.end()
            return {"failed": f"the process ended with code {code}"}
        return json.loads(line)

    def _line(self, process, deadline):
        text = b""
        while not text.endswith(b"\n"):
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([process.stdout], [], [], left)[0]:
                return None
            piece = process.stdout.read(1 << 16)
            if not piece:
                return b""
            text += piece
        return text

    def _running(self):
        if self._process is None or self._process.poll() is not None:
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "bufsize": 0}
            self._process = subprocess.Popen(self.words, env=surroundings(self.name), start_new_session=True, **pipes)
        return self._process

    def end(self):
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process.stdin.close()
            self._process.stdout.close()
            self._process = None
