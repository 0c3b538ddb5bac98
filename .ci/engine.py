"""buildah, which builds and runs images without a daemon, with all that it stores in one folder."""

import contextlib
import json
import re
import subprocess
import tempfile
import time
from pathlib import Path

from command import Failed, ask, sh


class Engine:
    """Images and containers in a folder.

    Args:
        folder: where images are kept, for one process at a time (`.ci/debian` holds a lock).
    """

    def __init__(self, folder):
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        # What is mounted is counted here; the mounts of a run that was killed are gone, and so are its counts.
        self._run = tempfile.TemporaryDirectory(prefix="buildah-")
        self._driver = "overlay"
        # Layers as overlays where the file system allows them, else as whole copies.
        if subprocess.run([*self._start(), "images"], capture_output=True).returncode:
            self._driver = "vfs"
        self.do("rm", "--all")

    def _start(self):
        place = ["--root", self.folder / f"storage-{self._driver}", "--runroot", self._run.name]
        return ["buildah", "--storage-driver", self._driver, *map(str, place)]

    def do(self, *words, **options):
        return sh(*self._start(), *words, **options)

    def ask(self, *words):
        return ask(*self._start(), *words).strip()

    def has(self, image):
        found = subprocess.run([*self._start(), "inspect", "--type", "image", image], capture_output=True)
        return found.returncode == 0

    def base(self, suite, days):
        """Make debian:SUITE, as the Dockerfile names it, where it is missing or older than so many days."""
        image, made = f"debian:{suite}", self.folder / suite / "base"
        made.parent.mkdir(exist_ok=True)
        age = (time.time() - made.stat().st_mtime) / 86400 if made.exists() and self.has(image) else None
        if age is not None and age <= days:
            return
        try:
            with tempfile.TemporaryDirectory(dir=self.folder) as place:
                archive = Path(place) / "base.tar"
                bootstrap(suite, archive)
                container = self.ask("from", "scratch")
                self.do("add", "--quiet", container, archive, "/")
                self.do("commit", "--quiet", "--rm", container, image)
            made.touch()
        except Failed as failure:
            if age is None:
                raise
            print(f"--- {image} of {age:.0f} days ago serves, as it could not be made anew: {failure}", flush=True)

    def build(self, suite, stage, certificates):
        """A stage of the Dockerfile as it is ("run" or "test"), on debian:SUITE; returns the image's name."""
        image = f"cosserat-{stage}:{suite}"
        words = ["--isolation", "chroot", "--pull-never", "--layers", "--volume", certificates, "--target", stage]
        self.do("bud", *words, "--build-arg", f"SUITE={suite}", "--tag", image, ".")
        self.do("rmi", "--prune", stdout=subprocess.DEVNULL)  # layers that no step uses any longer
        return image

    def size(self, image):
        """What an image takes on disk with its base, in words such as "1.8 GB"."""
        (found,) = json.loads(self.ask("images", "--json", image))
        return found["size"]

    @contextlib.contextmanager
    def container(self, image, *volumes):
        """A function that runs a command in a new container of the image, with these folders of this machine."""
        name = self.ask("from", "--pull-never", image)
        shown = [word for volume in volumes for word in ("--volume", volume)]

        def run(*command, **options):
            return self.do("run", "--isolation", "chroot", *shown, name, "--", *command, **options)

        try:
            yield run
        finally:
            self.do("rm", name, stdout=subprocess.DEVNULL)


def bootstrap(suite, archive):
    """The files of a minimal Debian, from the mirror that apt of this machine uses."""
    release = re.search(r"^VERSION_CODENAME=(\w+)", Path("/etc/os-release").read_text(), re.MULTILINE)[1]
    targets = ["apt-get", "indextargets", "--format", "$(REPO_URI)"]
    targets += ["Created-By: Packages", "Origin: Debian", f"Codename: {release}"]
    mirrors = ask(*targets).split()
    if not mirrors:  # apt knows an archive's origin once it has its lists
        sh("apt-get", "update")
        mirrors = ask(*targets).split()
    if not mirrors:
        raise Failed("apt on this machine names no Debian mirror")
    kept = [line for line in ask("apt-config", "dump").splitlines() if re.match(r"Acquire::(\w+::Proxy|Check-)", line)]
    # As Debian's image has it: what is installed need not stay as an archive too, and no file waits for the disk.
    clean = """--customize-hook=echo 'APT::Keep-Downloaded-Packages "false";' > "$1/etc/apt/apt.conf.d/99clean\""""
    options = [*(f"--aptopt={line}" for line in kept), "--dpkgopt=force-unsafe-io", clean]
    sh("mmdebstrap", "--quiet", "--variant=minbase", *options, suite, archive, mirrors[0])
