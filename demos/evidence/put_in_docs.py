"""Put into the documentation what the measurements and the gallery have left in out/.

    python demos/evidence/put_in_docs.py accuracy orders      these tables and their pictures
    python demos/evidence/put_in_docs.py gallery wells strings whirl recipes    the pictures of these
    python demos/evidence/put_in_docs.py column    that of `demos/eccentric_cantilever.py -o out/column`
    python demos/evidence/put_in_docs.py benchmarks    the verification manual, with a small picture of each problem

A table replaces what stands between <!-- name --> and <!-- /name --> in a page of docs/; one that is too long for that
has a page of its own in docs/tables/. Pictures are cut to what is drawn, reduced to few colours and put in
docs/pictures/; those for pages of 400 pixels, which demos write beside them (pictures/charts.py), in its folder
narrow/.
"""

import argparse
import io
import re
from pathlib import Path

import numpy as np
from PIL import Image

from cosserat_fenicsx.pictures.charts import narrow

ROOT = Path(__file__).resolve().parents[2]
#: The tables of the documentation, each with its page and pictures.
PAGES = {
    "accuracy": ("evidence/accuracy.md",),
    "orders": ("evidence/accuracy.md",),
    "figure3": ("evidence/figure3.md", "figure3.png"),
    "rungs": ("evidence/cost.md",),
    "choice": ("evidence/cost.md",),
    "scaling": ("evidence/cost.md",),
    "many_rods": ("evidence/cost.md",),
    "million_cases": ("evidence/cost.md",),
    "ranks": ("evidence/cost.md",),
    "steps": ("evidence/cost.md",),
    "wall_in_motion": ("evidence/motion.md",),
    "overhead": ("evidence/cost.md",),
    "cases": ("evidence/cost.md",),
    "first_runs": ("evidence/cost.md",),
    "work_precision": ("evidence/other_programs.md", "work_precision_sweep.png"),
    "work_precision_motion": ("evidence/other_programs.md", "work_precision_motion.png"),
    "work_precision_string": ("evidence/other_programs.md", "work_precision_string.png"),
    "soft_string": ("evidence/wells.md", "soft_string.png"),
    "rods_in_wells": ("evidence/wells.md",),
    "benchmarks": ("benchmarks.md",),
    "mutants": ("evidence/tests.md",),
    "truths": ("evidence/truths.md",),
    "targets": ("evidence/truths.md",),
}
#: The tables with a page of their own: its title and pictures.
ALONE = {
    "failures": ("Where methods fail: the table", "failures.png"),
    "work_precision": ("Speed against accuracy: all times",),
    "cosseratbench": ("The scenarios of cosseratbench",),
}
#: The pictures of the gallery: of `make heap`, and by the files of the scenes.
GALLERY = ["heap.png", *(f"{file.stem}.png" for file in sorted((ROOT / "demos").glob("**/*.toml")))]
#: The pictures that recipes write, as their pages show them.
RECIPES = {
    picture: f"{page.stem.removeprefix('recipes_')}/{picture}"
    for page in sorted((ROOT / "docs").glob("recipes_*.md"))
    for picture in re.findall(r"\(pictures/(\w+\.png)\)", page.read_text(encoding="utf-8"))
}
#: The other pictures, by the folders of `out` that hold them: their names in the documentation, and their files.
FOLDERS = {
    "wells": {
        "volve_f12_broomstick.png": "volve_f12/depth_sweep.png",
        "volve_f12_stiff_and_soft.png": "volve_f12/stiff_and_soft.png",
        "well_p_rod.png": "well_p_rod/trip_out_3d.png",
        "assembly.png": "assembly/assembly.png",
        "bent_motor.png": "bent_motor/bent_motor.png",
        "build_rate.png": "bent_motor/build_rate.png",
        "helix.png": "helix/static_3d.png",
        "strength.png": "strength/strength.png",
        "cable_in_conduit.png": "cable_in_conduit/cable.png",
    },
    "strings": {
        "stick_slip.png": "stick_slip/drilling.png",
        "autodriller.png": "autodriller/drilling.png",
        "mud_motor.png": "mud_motor/drilling.png",
        "motor_power_curve.png": "mud_motor/power_curve.png",
        "oscillation_tool.png": "oscillation_tool/drilling.png",
        "off_bottom_map.png": "off_bottom/map.png",
        "stopped_block_map.png": "stopped_block/map.png",
        "stability_map.png": "stability_map.png",
    },
    "whirl": {"whirl.png": "whirl.png"},
    "curved_string": {"curved_string.png": "curved_string.png"},
    "column": {"eccentric_cantilever_delta.png": "figure.png"},
    "recipes": RECIPES,
    "frames": {f"{name}.png": f"{name}.png" for name in ("gridshell", "lattice", "net")},
}
#: Of the tables here, all pictures of a folder of `out` are kept, small, in a folder of docs/pictures/.
MANY = ("benchmarks",)
WIDTH, COLOURS, MARGIN = 1100, 256, 12  # pixels, number, pixels
NARROW = 800, 4000  # pixels, of a picture for narrow pages
SMALL, FEW = 600, 96  # pixels, colours
_LARGER = 1.6  # most that mixed colours may add to a file
#: Pictures with more small texts than others, and their sizes in pixels.
LARGE = {"failures.png": (1380, 1380)}


def kept(picture, file, most=(WIDTH, WIDTH), colours=COLOURS):
    """Write the picture (.png) as the documentation keeps it: without white margins, at most 1100 pixels wide and high,
    or `most` (width, height). Neighbouring colours of the palette are mixed, else bars of colours have bands; not where
    large areas have one colour, which makes the file much larger."""
    image = Image.open(picture).convert("RGB")
    rows, columns = np.nonzero((np.asarray(image) < 250).any(axis=2))
    box = columns.min() - MARGIN, rows.min() - MARGIN, columns.max() + MARGIN, rows.max() + MARGIN
    image = image.crop((max(box[0], 0), max(box[1], 0), min(box[2], image.width), min(box[3], image.height)))
    image.thumbnail(most, Image.Resampling.LANCZOS)
    palette = image.quantize(colours, Image.Quantize.FASTOCTREE)
    palette.putpalette([255 if value > 252 else value for value in palette.getpalette()])  # white is kept white
    written = {}
    for dither in (Image.Dither.NONE, Image.Dither.FLOYDSTEINBERG):
        image.quantize(palette=palette, dither=dither).save(found := io.BytesIO(), "PNG", optimize=True)
        written[dither] = found.getvalue()
    plain, mixed = written.values()
    Path(file).write_bytes(mixed if len(mixed) < _LARGER * len(plain) else plain)


def main(names, out="out", docs=ROOT / "docs"):
    """Put the tables and pictures of these names into the documentation, where they exist in `out`."""
    out, docs = Path(out), Path(docs)
    for name in names:
        page, *pictures = PAGES.get(name, (None,))
        title, *more = ALONE.get(name, (None,))
        drawn = {picture: picture for picture in (GALLERY if name == "gallery" else pictures + more)}
        drawn |= {picture: f"{name}/{file}" for picture, file in FOLDERS.get(name, {}).items()}
        for picture, file in drawn.items():
            if (out / file).exists():
                kept(out / file, docs / "pictures" / picture, LARGE.get(picture, (WIDTH, WIDTH)))
            if narrow(out / file).exists():
                kept(narrow(out / file), docs / "pictures" / "narrow" / picture, NARROW)
        for picture in sorted((out / name).glob("*.png")) if name in MANY else ():
            (docs / "pictures" / name).mkdir(exist_ok=True)
            kept(picture, docs / "pictures" / name / picture.name, (SMALL, SMALL), FEW)
        if not (out / f"{name}.md").exists():
            continue
        found = (out / f"{name}.md").read_text(encoding="utf-8").strip()
        found = found.replace("](benchmarks/", "](pictures/benchmarks/")
        if title:
            (docs / "tables" / f"{name}.md").write_text(f"# {title}\n\n{found}\n", encoding="utf-8")
        if page:
            # of the speed against accuracy only the summary: the times of all solvers follow it
            found = found.partition("\n\n| problem | solver")[0]
            table = f"<!-- {name} -->\n{found}\n<!-- /{name} -->"
            text = (docs / page).read_text(encoding="utf-8")
            text = re.sub(f"<!-- {name} -->.*<!-- /{name} -->", lambda _, table=table: table, text, flags=re.DOTALL)
            (docs / page).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = sorted({*PAGES, *ALONE, *FOLDERS, "gallery"})
    parser.add_argument("names", nargs="+", choices=names, metavar="NAME")
    main(parser.parse_args().names)
