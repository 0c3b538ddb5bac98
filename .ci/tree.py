"""A Debian tree that is entered with chroot, and the steps of a Dockerfile in it. Needs root and a private mount
namespace."""

import configparser
import contextlib
import os
import re
import shutil
from pathlib import Path
from urllib.parse import unquote, urlparse

from command import Failed, ask, sh
from dockerfile import sources


def account(tree, name):
    """(uid, gid, home) of a user of the tree."""
    for line in (tree / "etc/passwd").read_text().splitlines():
        fields = line.split(":")
        if fields[0] == name:
            return int(fields[2]), int(fields[3]), fields[5]
    raise Failed(f"the tree has no user {name}")


def settings():
    """What downloads need on this machine: proxy, certificate and pip settings, as environment variables."""
    pip = configparser.RawConfigParser()
    pip.read(["/etc/pip.conf", *(os.path.expanduser(name) for name in ("~/.pip/pip.conf", "~/.config/pip/pip.conf"))])
    found = {
        "PIP_" + name.upper().replace("-", "_"): " ".join(value.split())
        for name, value in (pip.items("global") if pip.has_section("global") else [])
    }
    wanted = re.compile(r"(?i)(\w+_proxy|PIP_\w+|SSL_CERT_\w+|\w+_CA_BUNDLE)")
    return found | {name: value for name, value in os.environ.items() if wanted.fullmatch(name)}


def vacant(place):
    """Whether nothing of the tree's own would be hidden by a mount here."""
    return not os.path.exists(place) or not (os.listdir(place) if os.path.isdir(place) else os.path.getsize(place))


def bind(tree, path, *options):
    """Show a path of this machine in the tree."""
    place = Path(f"{tree}{path}")
    if path.is_dir():
        place.mkdir(parents=True, exist_ok=True)
    else:
        place.parent.mkdir(parents=True, exist_ok=True)
        place.touch()
    sh("mount", *(options or ["-o", "bind,ro"]), path, place)
    return place


@contextlib.contextmanager
def machine(tree):
    """The kernel's file systems, this machine's network settings and certificates, in the tree."""
    mounts = []
    try:
        for path in ("/proc", "/sys", "/dev"):
            mounts.append(bind(tree, Path(path), "--rbind"))
        for path in ("/etc/resolv.conf", "/etc/hosts"):
            mounts.append(bind(tree, Path(path)))
        # A copy of the certificates: installing ca-certificates writes there.
        certificates = tree / "etc/ssl/certs"
        certificates.mkdir(parents=True, exist_ok=True)
        sh("mount", "-t", "tmpfs", "-o", "mode=755", "tmpfs", certificates)
        mounts.append(certificates)
        if Path("/etc/ssl/certs").is_dir():
            for path in Path("/etc/ssl/certs").iterdir():
                if path.is_file():
                    shutil.copyfile(path, certificates / path.name)
        for word in " ".join(settings().values()).split():
            url = urlparse(word)
            path = Path(unquote(url.path) if url.scheme == "file" else word)
            # The pages of an index folder may refer to files beside it.
            for path in [path.parent, path] if url.scheme == "file" else [path]:
                if path.is_absolute() and path.exists() and vacant(f"{tree}{path}"):
                    mounts.append(bind(tree, path))
                    break
        yield
    finally:
        for place in reversed(mounts):
            sh("umount", "--recursive", "--lazy", place)


def enter(tree, step, command, **options):
    """Run a command in the tree as a step's user, in its directory and environment."""
    uid, gid, home = account(tree, step.user)
    with machine(tree):
        inside = ["/bin/sh", "-c", 'cd "$0" && exec "$@"', step.workdir, *command]
        env = settings() | {"HOME": home} | step.env
        return sh("chroot", f"--userspec={uid}:{gid}", "--groups=", tree, *inside, env=env, **options)


def bootstrap(tree, image):
    name, _, suite = image.partition(":")
    if name != "debian" or not suite:
        raise Failed(f"FROM: not understood: {image}")
    release = re.search(r"^VERSION_CODENAME=(\w+)", Path("/etc/os-release").read_text(), re.M)[1]
    targets = ["apt-get", "indextargets", "--format", "$(REPO_URI)"]
    targets += ["Created-By: Packages", "Origin: Debian", f"Codename: {release}"]
    mirrors = ask(*targets).split()
    if not mirrors:  # apt knows an archive's origin once it has its lists
        sh("apt-get", "update")
        mirrors = ask(*targets).split()
    if not mirrors:
        raise Failed("apt on this machine names no Debian mirror")
    kept = [line for line in ask("apt-config", "dump").splitlines() if re.match(r"Acquire::(\w+::Proxy|Check-)", line)]
    sh("mmdebstrap", "--quiet", "--variant=minbase", *(f"--aptopt={line}" for line in kept), suite, tree, mirrors[0])
    # As the image has it: what is installed need not stay as an archive too, and no file waits for the disk.
    (tree / "etc/apt/apt.conf.d/99clean").write_text('APT::Keep-Downloaded-Packages "false";\n')
    (tree / "etc/dpkg/dpkg.cfg.d/99speed").write_text("force-unsafe-io\n")


def perform(tree, step):
    print(f"--- {step.word} {step.text}", flush=True)
    if step.word == "FROM":
        bootstrap(tree, step.text)
    elif step.word == "WORKDIR":
        Path(f"{tree}{step.workdir}").mkdir(parents=True, exist_ok=True)
    elif step.word == "COPY":
        pairs, owner = sources(step)
        uid, gid, _ = account(tree, owner)
        for source, target in pairs:
            place = Path(f"{tree}{target}")
            for parent in reversed(place.parents):
                if not parent.exists():
                    parent.mkdir()
                    os.chown(parent, uid, gid)
            shutil.copy(source, place)
            os.chown(place, uid, gid)
    elif step.word == "RUN":
        enter(tree, step, ["/bin/sh", "-c", step.text])
