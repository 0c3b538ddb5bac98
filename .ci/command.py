"""Running commands; one that fails raises `Failed`, which says in words which it was."""

import shlex
import subprocess


class Failed(Exception):
    """What did not work, in words."""


def sh(*command, **options):
    words = [str(part) for part in command]
    try:
        return subprocess.run(words, check=True, stdin=subprocess.DEVNULL, **options)
    except subprocess.CalledProcessError as error:
        if error.stdout:  # what was to be read, and now explains
            print(error.stdout, flush=True)
        raise Failed(f"exit code {error.returncode} from: {shlex.join(words)}") from None
    except subprocess.TimeoutExpired as error:
        raise Failed(f"not done after {error.timeout / 60:g} minutes: {shlex.join(words)}") from None


def ask(*command):
    return sh(*command, stdout=subprocess.PIPE, text=True).stdout
