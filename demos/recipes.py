"""The recipes of docs/recipes_*.md: each is run, and what it prints is compared with what its page shows.

python demos/recipes.py                all of them; what they write goes to out/recipes/PAGE/
python demos/recipes.py wells motion   those of some pages
python demos/recipes.py --update       puts what they print today into the pages
"""

import argparse
import ast
import contextlib
import io
import re
import shutil
import sys
from pathlib import Path

from cosserat_fenicsx.pictures.charts import draw_both

ROOT = Path(__file__).resolve().parents[1]
PAGES = {page.stem.removeprefix("recipes_"): page for page in sorted((ROOT / "docs").glob("recipes_*.md"))}
_NUMBER = re.compile(r"-?\d+(?:\.\d*)?(?:e[+-]?\d+)?")


def programs(text, language="python"):
    """The fenced blocks of a page in a language, as matches: [1] the block, [2] the block `text` right below, or None,
    which shows what it prints."""
    return list(re.finditer(rf"```{language}\n(.*?)```(?:\n\n```text\n(.*?)```)?", text, re.DOTALL))


def prints(program, name, names):
    """What a program prints, run in the working directory with these global names."""
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(program, name, "exec", dont_inherit=True), names)
    return printed.getvalue()


def alike(printed, shown):
    """Whether two texts have the same words, and numbers that differ by at most one in the last digit that is shown.

    Whole numbers without a power of ten must be the same.
    """
    if _NUMBER.sub("#", printed).split() != _NUMBER.sub("#", shown).split():
        return False
    for found, expected in zip(_NUMBER.findall(printed), _NUMBER.findall(shown), strict=True):
        digits, _, power = expected.partition("e")
        last = 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))
        if abs(float(found) - float(expected)) > (1.01 * last if {"e", "."} & set(expected) else 0.0):
            return False
    return True


def draw_again(program, names):
    """Draw the charts that a program wrote with a width, once more for wide and for narrow pages.

    Args:
        names: the global names that the program left.
    """
    for call in ast.walk(ast.parse(program)):
        if isinstance(call, ast.Call) and "width" in (given := {x.arg: x for x in call.keywords}):
            given["width"].value = ast.Name("width")
            file = next(x for x in ast.walk(call) if str(getattr(x, "value", "")).endswith(".png"))
            name, file.value = file.value, None
            draw_both(eval(f"lambda width: {ast.unparse(call)}", names), name)


def run(page, folder):
    """Run the recipes of a page in a folder, which is emptied first; their charts are drawn for narrow pages, too.

    Returns:
        list of (match, printed): see `programs`, and what each printed.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    with contextlib.chdir(folder):
        found = []
        for match in programs(page.read_text(encoding="utf-8")):
            names = {"__name__": "program"}
            found.append((match, prints(match[1], page.name, names)))
            draw_again(match[1], names)
        return found


def updated(text, ran):
    """The text of a page with what its recipes printed."""
    for match, printed in reversed(ran):
        shown = f"\n\n```text\n{printed}```" if printed else ""
        text = text[: match.start()] + f"```python\n{match[1]}```" + shown + text[match.end() :]
    return text


def main(names=(), out="out/recipes", update=False):
    """Run the recipes of pages, and say which print something else than their page shows.

    Args:
        names: of pages, such as "wells"; none for all.
        out: folder for the files that they write, one folder a page.
        update: put what they print into the pages.

    Returns:
        how many print something else.
    """
    wrong = 0
    for name in names or PAGES:
        page = PAGES[name]
        ran = run(page, Path(out) / name)
        other = [printed for match, printed in ran if not alike(printed, match[2] or "")]
        print(f"{page.name}: {len(ran)} recipes, {len(other)} print something else than shown", *other, sep="\n")
        wrong += len(other)
        if update:
            page.write_text(updated(page.read_text(encoding="utf-8"), ran), encoding="utf-8")
    return wrong


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="PAGE", help=", ".join(PAGES))
    parser.add_argument("--update", action="store_true", help="put what they print into the pages")
    options = parser.parse_args()
    if unknown := set(options.names) - set(PAGES):
        parser.error(f"no page of recipes is named {', '.join(sorted(unknown))}: known: {', '.join(PAGES)}")
    sys.exit(int(main(options.names, update=options.update) > 0))
