"""Speed against accuracy of the soft string: this package beside welleng and torque-drag, on wells with a known answer.

    python demos/evidence/soft_string.py           installs the peers in environments of their own (a minute)
    python demos/evidence/soft_string.py --quick   without peers that are not installed

Writes to out/: soft_string.md (the table), soft_string.png (the chart).

Hook loads of pulling out and running in a uniform string, bit free, coefficient of friction 0.25, in well P (turn and
horizontal) and in Volve 15/9-F-12. Peers get the exact survey at stations that are closer and closer; this package gets
the stations as they are and a tolerance. Times are processor times of one warm answer, the median of 25, on one thread.
And of a string of three components in a well of 200 stations: a call after the first, and a case of a batch.
"""

import statistics
from pathlib import Path

import numpy as np
from harness import HEADS, command, drawn, in_words, judged, repeated, table, write
from peers.environments import Missing
from peers.process import Peer

import cosserat_fenicsx as cf
from cosserat_fenicsx.pictures.charts import beside, legend

SCENES = Path(__file__).resolve().parents[1] / "wells"
#: Hook loads out and in, N, by a differential equation at 1e-13.
TRUTH = {
    "well_p": (910081.8146665769, 379604.44686990423),
    "volve_f12": (946450.3232989962, 590676.3187135797),
}
PEERS = "welleng", "torque-drag"
WEIGHT, RADIUS, FRICTION = 241.13, 0.0635, 0.25
TOLS, SPACINGS = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12), (100.0, 30.0, 10.0, 3.0, 1.0)
SAMPLES, LIMIT = 25, 60.0  # samples of each row; time limit of a request to a peer, s
CALL, CASE, CASES = 0.4, 0.1, 1000  # asked at most, ms: a call, a case of a batch of so many


def ours(path, tol):
    """(error, s) of this package: the largest relative error of both hook loads, the processor time of one."""
    hole = cf.well.Borehole(path, cf.well.HoleSection(path.length, 0.2159, FRICTION))
    string = cf.well.DrillString([cf.well.Component(weight=WEIGHT, contact_radius=RADIUS)])

    def both():
        return [cf.well.torque_and_drag(hole, string, operation, model="soft", tol=tol).hook_load
                for operation in (cf.well.TripOut(), cf.well.TripIn())]  # fmt: skip

    loads, seconds = repeated(both, SAMPLES)
    return loads, seconds / 2


def stations():
    """Rows of a table: ms of a call and of a case in a batch, of a drill-string in a well of 200 stations."""
    md, rng = np.linspace(0.0, 4000.0, 200), np.random.default_rng(3)
    inc = np.abs(np.interp(md, [0.0, 400.0, 1600.0], [0.0, 0.0, 60.0]) + np.append(0.0, rng.normal(0.0, 0.3, 199)))
    path = cf.well.WellPath.from_survey(md, inc, 40.0 + 20.0 * np.sin(md / 700.0))
    hole = cf.well.Borehole(path, [cf.well.HoleSection(2500.0, 0.2224, 0.2), cf.well.HoleSection(4000.0, 0.2159, 0.3)])
    parts = [cf.well.Bit(0.2159), cf.well.Collar(90.0, "NC46-65"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")]
    asked = hole, cf.well.DrillString(parts), cf.well.RotaryDrilling(60e3, 5e3)
    over = ["hole.sections[0].friction", "hole.sections[1].friction", "operation.weight", "mud.density"]
    values = np.array([0.2, 0.3, 60e3, 1200.0]) * rng.uniform(0.8, 1.2, (CASES, len(over)))

    def call():
        return cf.well.torque_and_drag(*asked, mud=cf.well.Mud(1200.0), model="soft")

    call().batch(over, values)  # compiles
    one, many = repeated(call, SAMPLES)[1], repeated(lambda: call().batch(over, values), 5)[1]
    return [("ms a call, 200 stations", judged(1e3 * one, CALL, ".2f")),
            (f"ms a case of {CASES} in a batch", judged(1e3 * many / CASES, CASE, ".3f"))]  # fmt: skip


def theirs(peer, path, spacing):
    """As `ours`, of a peer on stations at most `spacing` (m) apart."""
    parts = [np.linspace(a, b, max(2, int(np.ceil((b - a) / spacing)) + 1))[:-1]
             for a, b in zip(path.md[:-1], path.md[1:], strict=True)]  # fmt: skip
    md = np.append(np.concatenate(parts), path.length)
    inc, azi = path.inclination_at(md), path.azimuth_at(md)
    for i in range(len(md) - 2, -1, -1):  # a vertical station takes the azimuth of the next
        azi[i] = azi[i + 1] if inc[i] < 1e-9 else azi[i]
    inc, azi = np.degrees(inc), np.degrees(np.unwrap(azi))
    problem = {"md": md.tolist(), "inc": inc.tolist(), "azi": azi.tolist(), "weight": WEIGHT,
               "radius": RADIUS, "friction": FRICTION}  # fmt: skip
    loads, seconds = [], []
    for out in (True, False):
        reply = peer.ask({**problem, "out": out}, {}, warm=1, samples=SAMPLES if spacing >= 10 else 5, limit=LIMIT)
        if "failed" in reply:
            raise Missing(reply["failed"])
        loads.append(reply["tip"][0][0])
        seconds += reply["seconds"]
    return loads, statistics.median(seconds)


def measure(install):
    """[(well, program, setting, relative error, s)], and what could not be measured."""
    rows, silent = [], []
    paths = {name: cf.read(SCENES / f"{name}.toml").hole.path for name in TRUTH}

    def keep(name, program, setting, found):
        loads, seconds = found
        rows.append((name, program, setting, float(np.max(np.abs(np.divide(loads, TRUTH[name]) - 1))), seconds))

    for name, path in paths.items():
        for tol in TOLS:
            keep(name, "cosserat_fenicsx", f"tol = {tol:g}", ours(path, tol))
    for program in PEERS:
        try:
            with Peer(program, install) as peer:
                for name, path in paths.items():
                    for spacing in SPACINGS:
                        keep(name, program, f"every {spacing:g} m", theirs(peer, path, spacing))
        except Missing as missing:
            silent.append(f"{program}: {missing}")
    return rows, silent


def lines(rows, silent):
    """Markdown: errors and times in both wells."""
    cells = {}
    for name, program, setting, error, seconds in rows:
        cells.setdefault((program, setting), {})[name] = f"{max(error, 1e-16):.0e} | {1e3 * seconds:.2f}"
    heads = " | ".join(f"`{name}`: relative error | ms" for name in TRUTH)
    told = [(program, setting, *(found[name] for name in TRUTH)) for (program, setting), found in cells.items()]
    missing = (f"Not measured: {line}." for line in silent)
    asked = table(f"asked | found | {HEADS}", stations())
    return [*table(f"program | setting | {heads}", told), "", *asked, "", *missing, in_words()]


def chart(rows):
    """Error over time, one panel a well."""
    figure, panels, _ = beside([5.0, 5.0], 5.0)
    for panel, name in zip(panels, TRUTH, strict=True):
        for program, colour in zip(("cosserat_fenicsx", *PEERS), ("#08519c", "#d95f02", "#7570b3"), strict=True):
            here = [(seconds, error) for well, by, _, error, seconds in rows if (well, by) == (name, program)]
            if here:
                seconds, errors = zip(*here, strict=True)
                panel.loglog(1e3 * np.array(seconds), np.maximum(errors, 1e-15), "o-", color=colour, label=program)
        panel.set(xlabel=f"processor time of an answer (ms), {name}")
    legend(*panels)
    panels[0].set_ylabel("largest relative error of hook loads out and in")
    figure.suptitle("Soft string: speed against accuracy")
    return figure


def main(install=True, out="out"):
    """Measure, write table and chart; returns the rows. install: whether peers that are not there are installed."""
    rows, silent = measure(install)
    print(write("soft_string", lines(rows, silent), out))
    drawn(lambda: chart(rows), Path(out) / "soft_string.png")
    return rows


if __name__ == "__main__":
    command(__doc__, main, {"install": False})
