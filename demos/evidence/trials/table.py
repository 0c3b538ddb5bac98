"""The table in Markdown: a row per trial, a column per method, a legend, and a sentence on each trial."""

from harness import in_words

from trials import methods
from trials.cells import MISSING, NOT, RIGHT, SAID, SILENT, STOPPED

#: Marks in front of a cell's number, also used in the picture.
MARKS = {RIGHT: "\N{CHECK MARK}", SAID: "!", STOPPED: "\N{BLACK SQUARE}", SILENT: "\N{BALLOT X}", NOT: "", MISSING: ""}
MEANINGS = {
    RIGHT: "the answer is right, as the trial means it",
    SAID: (
        "the answer is wrong, and the method itself says that it is not to be trusted (unstable, no number, a warning)"
    ),
    STOPPED: (
        "no answer: the method gave up, and said so, or had none in the time that the map gives it; the number is the"
        " load factor that it reached"
    ),
    SILENT: "an answer is returned as if it were right, and it is wrong",
    NOT: "the method does not have what the trial asks for",
    MISSING: "the program is not installed here (`make work-precision` installs it)",
}


def text(data):
    """Markdown of failures.json."""
    columns, rows = methods.shown(data)
    lines = [
        f"| trial | {' | '.join(method.title.replace(chr(10), ' ').replace('- ', '-') for method in columns)} |",
        "|---" * (len(columns) + 1) + "|",
    ]
    for trial in rows:
        cells = [data["cells"].get(f"{trial.key}/{method.key}") for method in columns]
        lines.append(f"| {trial.title.replace(chr(10), ' ')} | {' | '.join(map(_cell, cells))} |")
    lines += ["", "In every cell a verdict and the number that it rests on:", ""]
    lines += [f"- {MARKS[verdict] or _EMPTY[verdict]} **{verdict}**: {words}." for verdict, words in MEANINGS.items()]
    lines += ["", "The methods:", ""]
    lines += [f"- **{method.title.replace(chr(10), ' ').replace('- ', '-')}**: {method.what}." for method in columns]
    lines += ["", "The trials, and the unit of their numbers:", ""]
    for trial in rows:
        lines.append(f"- **{trial.title.replace(chr(10), ' ')}**: {trial.tried} Number: {unit(data, trial)}.")
    told = "; ".join(f"{name} {release}" for name, release in sorted(data["programs"].items()))
    lines += ["", f"Nothing here is random. {in_words(data['machine'])}{'; ' + told if told else ''}."]
    return "\n".join(lines)


_EMPTY = {NOT: "-", MISSING: "?"}


def unit(data, trial):
    """The unit of a trial's numbers, as its cells have it."""
    units = {cell["unit"] for key, cell in data["cells"].items() if key.startswith(f"{trial.key}/")}
    words = sorted(units - {"", "load factor reached"}) or ["load factor reached"]
    return " or ".join(words) + (
        "; where it stopped, the load factor reached" if words[0] != "limit load" else ", reached or reported"
    )


def _cell(plain):
    if plain is None:
        return ""
    cell = methods.Cell.of(plain)
    if cell.verdict in _EMPTY:
        return _EMPTY[cell.verdict]
    mark = MARKS[cell.verdict]
    return f"{mark} {cell.number}" if cell.value is not None else mark
