"""Mistakes of a user; a type checker finds one in every line that is marked."""

import cosserat_fenicsx as cf

rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20)), cf.Circle(0.2), cf.Material(E=210e9))
scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Froce(rod.end, (0, 0, -1))])  # wrong: the name
path = cf.solve(scene)
cf.solve(scene, 1.0, tolerance=1e-6)  # wrong: the argument
cf.solve(rod, 1.0)  # wrong: no scene
cf.solve(scene, (0, 1, 2))  # wrong: a tuple of three
cf.Circle("0.2")  # wrong: text
cf.Force(rod.end, "down")  # wrong: no vector
cf.Rod(cf.Circle(0.2), cf.Line((0, 0, 0), (0, 0, 20)))  # wrong: exchanged
path.displacemnt(rod.end)  # wrong: the method
path.position(3)  # wrong: no station
path.reaction(3)  # wrong: no support
x: int = path.position("rod.end")  # wrong: an array
