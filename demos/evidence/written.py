"""Tables as Markdown files, where put_in_docs.py finds them; and options that the commands share."""

import argparse
from pathlib import Path


def write(name, lines, out):
    """Write the lines to `name`.md in the folder `out`; returns them as one text."""
    text = "\n".join(lines)
    Path(out).mkdir(parents=True, exist_ok=True)
    (Path(out) / f"{name}.md").write_text(text + "\n", encoding="utf-8")
    return text


def options(about):
    """The options of a command that measures each size in a process of its own: `quick`, and `one`, that size.

    Args:
        about: the command's help.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    return parser.parse_args()
