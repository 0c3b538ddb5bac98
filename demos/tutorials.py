"""The notebooks of docs/tutorials/: run them, and store in them what they print and draw.

python demos/tutorials.py              all of them
python demos/tutorials.py column       some

Edit the text and the programs in Jupyter, then run this: pictures are stored with few colours, and nothing that depends
on the machine or on the time.
"""

import argparse
import base64
import io
import os
import sys
from pathlib import Path

import nbclient
import nbformat

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "tutorials"
NAMES = ("column", "frame", "soft_arm", "well", "strength", "stick_slip")  # in the order in which they are read


def ran(name):
    """The notebook `name` after all of its cells, each in the folder of the notebook."""
    notebook = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    surroundings = {"PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])}
    place = {"metadata": {"path": str(FOLDER)}}
    client = nbclient.NotebookClient(
        notebook, timeout=300, kernel_name="python3", coalesce_streams=True, resources=place
    )
    client.execute(env={**os.environ, **surroundings})
    return notebook


def printed(notebook):
    """What the cells of a notebook print, and what they write to stderr: warnings, progress of what takes long."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    return tuple(
        "".join(output["text"] for output in outputs if output.get("name") == name) for name in ("stdout", "stderr")
    )


def pictures(notebook):
    """The data (with key image/png) of the outputs of a notebook that are pictures."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    return [output["data"] for output in outputs if "image/png" in output.get("data", {})]


def stored(notebook, name):
    """Write a notebook that ran."""
    sys.path.append(str(ROOT / "demos" / "evidence"))
    from put_in_docs import kept

    for data in pictures(notebook):
        small = io.BytesIO()
        kept(io.BytesIO(base64.b64decode(data["image/png"])), small, most=(760, 1200), colours=64)
        data.clear()  # of a JPEG, and of words
        data["image/png"] = base64.b64encode(small.getvalue()).decode()
    for cell in notebook.cells:
        cell.metadata.clear()
        if "outputs" in cell:  # without the progress of what took long
            cell.outputs = [output for output in cell.outputs if output.get("name") != "stderr"]
    notebook.metadata.clear()
    notebook.metadata.update(
        kernelspec={"display_name": "Python 3", "language": "python", "name": "python3"},
        language_info={"name": "python"},
    )
    nbformat.write(notebook, FOLDER / f"{name}.ipynb")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", choices=[*NAMES, []], metavar="NAME", help="; ".join(NAMES))
    for name in parser.parse_args().names or NAMES:
        stored(ran(name), name)
