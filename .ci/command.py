"""Running commands; one that fails raises `Failed`, which says in words which it was."""

import os
import shlex
import signal
import subprocess


class Failed(Exception):
    """What did not work, in words."""


def sh(*command, **options):
    """Run a command to its end; whatever ends the wait for it ends all processes that it has started."""
    words, limit = [str(part) for part in command], options.pop("timeout", None)
    # A group of its own, since what runs in a container is not the command's child only.
    with subprocess.Popen(words, stdin=subprocess.DEVNULL, start_new_session=True, **options) as process:
        try:
            output, _ = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            _end(process)
            raise Failed(f"not done after {limit / 60:g} minutes: {shlex.join(words)}") from None
        except BaseException:
            _end(process)
            raise
    if process.returncode:
        if output:  # what was to be read, and now explains
            print(output, flush=True)
        raise Failed(f"exit code {process.returncode} from: {shlex.join(words)}")
    return subprocess.CompletedProcess(words, 0, output)


def _end(process):
    os.killpg(process.pid, signal.SIGTERM)
    try:
        process.wait(10)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)


def ask(*command):
    return sh(*command, stdout=subprocess.PIPE, text=True).stdout
