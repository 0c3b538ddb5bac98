"""Whether a folder may be taken for a new motion: files of a user's own that have the same names stay as they are."""

import json

from cosserat_fenicsx.errors import SceneError

#: The files that say what a folder holds.
HEADS = ("motion.json", "drilling.json", "study.json")
# Keys of a scene of rods.
_OF_SCENES = {"rods", "supports", "loads", "joints", "velocities"}


def check_vacant(place, where, head, names):
    """Refuse a folder that holds something else, or files of some names that no motion wrote.

    Files of a run that was ended before its first step are not refused, and replaced.

    Args:
        place: the folder, a Path, which need not exist. where: function and argument, for messages.
        head: the one of `HEADS` that will be written.
        names: of the files that a motion writes; .json files are looked into, others must be empty.

    Raises:
        SceneError: naming the first of them.
    """
    for other in HEADS:
        if other != head and (place / other).exists():
            raise SceneError(
                f"{where} = {str(place)!r}: it holds {other}, and so another motion or a study: expected a new name"
            )
    for name in names:
        file = place / name
        if file.exists() and not (_of_a_motion(file) if name.endswith(".json") else file.stat().st_size == 0):
            raise SceneError(
                f"{where} = {str(place)!r}: it holds {name}, which no motion wrote: expected a new name, or a folder "
                "without files of that name"
            )


def _of_a_motion(file):
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, RecursionError):
        return False
    if not isinstance(data, dict):
        return False
    return (
        {"format", "cosserat_fenicsx"} <= data.keys()
        or data.keys() == {"missing"}
        or (_OF_SCENES <= data.keys() or data.get("type") == "Drilling")
    )
