"""Put the tables that `make tables`, `make figure3` and their like
have left in out/ between their markers in README.md."""

import re
from pathlib import Path

README = Path(__file__).parents[2] / "README.md"
TABLES = (
    "accuracy",
    "overhead",
    "rungs",
    "choice",
    "scaling",
    "orders",
    "figure3",
    "work_precision",
    "work_precision_motion",
)


def main(out="out"):
    """Replace the text between <!-- name --> and <!-- /name --> by out/name.md, where this exists."""
    text = README.read_text(encoding="utf-8")
    for name in TABLES:
        file = Path(out) / f"{name}.md"
        if file.exists():
            found = file.read_text(encoding="utf-8").strip()
            if name.startswith("work_precision"):
                # the tables of all solvers stay in out/, and in demos/evidence/work_precision.md
                found = found.partition("\n\n| problem | solver")[0]
            table = f"<!-- {name} -->\n{found}\n<!-- /{name} -->"
            text = re.sub(f"<!-- {name} -->.*<!-- /{name} -->", lambda _, table=table: table, text, flags=re.DOTALL)
    README.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
