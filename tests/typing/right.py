"""What a user writes; no type checker finds an error."""

import numpy as np

import cosserat_fenicsx as cf

steel = cf.Material(E=210e9, nu=0.3, density=7850)
rod = cf.Rod(cf.Line((0, 0, 0), [0, 0, 20]), cf.Circle(0.2), steel, name="column")
piped = cf.Rod(cf.Arc(np.zeros(3), (1, 0, 0), 1.5), [(1.0, cf.Tube(0.1, 0.08)), (None, cf.Profile("IPE 200"))], steel)
tapered = cf.Rod(cf.Spline([(0, 0, 0), (1, 0, 0), (2, 1, 0)]), lambda s: cf.Circle(0.2 - 0.01 * s), steel)
k = cf.Stiffness.offset((1e6, 1e6), 1e7, (1e3, 1e3), 1e3, centroid=(0.01, 0), mass=3.0)
scene = cf.Scene(
    [rod],
    [cf.Clamp(rod.start), cf.Roller("column.end", normal=(1, 0, 0))],
    [
        cf.Force(rod.end, (0, 0, -cf.euler_load(rod))),
        cf.Moment("column.end", lambda t: (0.0, t, 0.0)),
        cf.LineForce("column", cf.signals.AlongTable([0, 20], [(0, 0, 0), (1, 0, 0)])),
        cf.LineForce(rod, cf.signals.Along(lambda s: (s, 0.0, 0.0)), permanent=True),
        cf.Force(rod.at(3), cf.signals.Ramp((1, 0, 0), end=2)),
        cf.Weight(),
        cf.Wall(rod, point=(0, 0, 0), direction=(0, 0, 1), clearance=1 * cf.units.inch),
        cf.PointMass(rod.end, 3.0),
    ],
    joints=[cf.Joint("column.end", "beam.start", release=(0, 1, 0))],
    title="Column",
)
path: cf.Path = cf.solve(scene, (0, 1), tol=1e-6, steps=cf.StepControl(first=0.1), until=lambda path: len(path) > 3)
cf.solve(scene, [0.5, 1], elements=4)
cf.solve(scene, 1.0, branch=1)
cf.solve(scene, np.linspace(0, 1, 3))
tip: np.ndarray = path.displacement(rod.end)[:, 2]
last: cf.Path = path[-1]
force, moment = path.reaction("column.start")
print(tip.max(), path.load_factors[-1], path.stable.all(), [event.load_factor for event in path.events], force[0])
print(path.fields(-1, "column")["bending_moment"].max(), path.error.max(), path.largest()["tension"].size)
history: cf.History = cf.simulate(scene, 2.0, dt=0.01, start=path, save_every=0.1)
path.write("path.csv", rod="column")
path.to_dict()
print(history.times[-1], history.balance.max(), history.velocity("column.end").shape, history.energy[0])
found: cf.Buckling = cf.buckling(scene, 3)
print(found.load_factors[0], cf.modes(scene, 2).frequencies[0])
from_file = cf.read("column.toml")
file_scene, settings = from_file.scene, from_file.settings
cf.solve(file_scene, **settings)
try:
    cf.solve(file_scene)
except cf.NotConverged as failure:
    print(failure.path)
