"""A lock on a folder that one process writes to at a time."""

import fcntl
import os

from cosserat_fenicsx.errors import SceneError


class FolderLock:
    """A lock that the system releases where the process ends, however it does.

    Args:
        place: the folder; what: that the folder holds, for messages.
    """

    def __init__(self, place, what):
        self._place, self._what, self._lock = place, what, None

    def take(self):
        """Lock the folder itself, since its files may be replaced.

        Raises:
            SceneError: another process has locked it.
        """
        self._lock = os.open(self._place, os.O_RDONLY)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.release()
            raise SceneError(
                f"{self._place}: another process is at work on this {self._what}: expected it to end first"
            ) from None
        except OSError:
            pass  # a file system without locks

    def release(self):
        """Unlock the folder."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None
