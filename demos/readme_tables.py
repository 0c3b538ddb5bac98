"""Put the tables that `make tables` has left in out/ between their markers in README.md."""

import re
from pathlib import Path

README = Path(__file__).parent.parent / "README.md"


def main(out="out"):
    """Replace what stands between <!-- name --> and <!-- /name --> by out/name.md."""
    text = README.read_text(encoding="utf-8")
    for name in ("accuracy", "overhead", "rungs", "choice", "scaling"):
        table = (Path(out) / f"{name}.md").read_text(encoding="utf-8").strip()
        text = re.sub(
            f"<!-- {name} -->.*<!-- /{name} -->", f"<!-- {name} -->\n{table}\n<!-- /{name} -->", text, flags=re.S
        )
    README.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
