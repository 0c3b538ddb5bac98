"""The steps of a Dockerfile: what is performed, and on which files."""

import hashlib
import os
import re
import shlex
from pathlib import Path
from typing import NamedTuple

from command import Failed, ask


class Step(NamedTuple):
    word: str  # FROM, WORKDIR, COPY, RUN or CMD
    text: str
    user: str
    workdir: str
    env: dict


def read(dockerfile, **arguments):
    """The Dockerfile's steps, each with the user, directory and environment it runs in.

    Args:
        arguments: values of its ARGs, in place of the defaults; like Docker's --build-arg.
    """
    text = re.sub(r"^\s*#.*\n", "", dockerfile.read_text(), flags=re.M).replace("\\\n", "")
    user, workdir, steps = "root", "/", []
    given, env = {}, {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"}
    for line in filter(str.strip, text.splitlines()):
        word, rest = line.split(None, 1)
        if word not in ("RUN", "CMD"):  # the shell expands what RUN says
            rest = re.sub(r"\$\{?(\w+)\}?", lambda name: (given | env).get(name[1], ""), rest)
        elif rest.startswith("--") or "<<" in rest or rest.startswith("[") != (word == "CMD"):
            raise Failed(f"{dockerfile}: not understood: {line}")
        if word == "ARG" and not steps:  # before FROM: known to FROM alone
            name, default = rest.split("=", 1)
            given[name] = arguments.get(name, default)
        elif word == "ENV":
            env = env | dict(pair.split("=", 1) for pair in shlex.split(rest))
        elif word == "USER":
            user = rest
        elif word in ("FROM", "WORKDIR", "COPY", "RUN", "CMD"):
            workdir = os.path.join(workdir, rest) if word == "WORKDIR" else workdir
            steps.append(Step(word, rest, user, workdir, env))
        else:
            raise Failed(f"{dockerfile}: not understood: {line}")
    if "CMD" in [step.word for step in steps[:-1]] or steps[-1].word != "CMD":
        raise Failed(f"{dockerfile}: the last step should be its only CMD")
    return steps


def sources(step):
    """The files a COPY step copies: (path here, path in the tree), and their owner."""
    *names, target = [word for word in step.text.split() if not word.startswith("--")]
    options = [word.split("=") for word in step.text.split() if word.startswith("--")]
    if any(name != "--chown" for name, _ in options):
        raise Failed(f"COPY: not understood: {step.text}")
    # What git tracks or would track; the checkout may belong to another user than root.
    listed = ask("git", "-c", "safe.directory=*", "ls-files", "-z", "--cached", "--others", "--exclude-standard")
    pairs = []
    for name in sorted(set(listed.split("\0")) - {""}):
        for source in map(os.path.normpath, names):
            if name == source:
                inside = os.path.basename(name) if target.endswith(("/", ".")) else ""
            elif source == "." or name.startswith(source + "/"):
                inside = os.path.relpath(name, source)
            else:
                continue
            if os.path.isfile(name):  # git also lists files that were deleted
                pairs.append((name, os.path.normpath(os.path.join(step.workdir, target, inside))))
    return pairs, (options[0][1].split(":")[0] if options else "root")


def key(before, step):
    """A hash of the steps so far, `before` being that of the previous ones, and of the files they copy."""
    digest = hashlib.sha256(repr((before, step)).encode())
    for source, target in sources(step)[0] if step.word == "COPY" else ():
        digest.update(repr((target, os.stat(source).st_mode, Path(source).read_bytes())).encode())
    return digest.hexdigest()[:24]
