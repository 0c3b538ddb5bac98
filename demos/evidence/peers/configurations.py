"""Which configurations of which peer are measured on which problem."""

from peers.environments import OWN

_MESHES = (1, 2, 3, 4, 8, 16, 32, 64)
_TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
#: The mechanical model that an element converges to; Reissner where it is not named.
_MODELS = {"planar ANCF cable": "shear-rigid", "planar elastic": "shear-rigid", "spatial elastic": "shear-rigid",
           "planar CBDI": "shear-rigid", "spatial CBDI": "shear-rigid"}  # fmt: skip


def model(peer, configuration):
    """The mechanical model whose reference solution a configuration is compared with."""
    return "Reissner" if peer == OWN else _MODELS.get(configuration["element"], "Reissner")


def kind(peer, configuration):
    """(name of this package's model and formulation, or of the peer's element; whether it is spatial)."""
    if peer != OWN:
        return configuration["element"], configuration["element"].startswith("spatial")
    rung = configuration["model"]
    name = f"{rung}, {configuration['formulation']}" if "formulation" in configuration else f"{rung}, by tol"
    return name, rung == "spatial"


def configurations(peer, problem, quick=False):
    """Configurations of a peer on a problem (both by name), as a list of dicts."""
    found = _OF[peer](problem)
    return _thin(peer, found) if quick else found


def _thin(peer, found):
    if peer == OWN:
        kept = ({"degree": 2, "elements": 4}, {"degree": 4, "elements": 4}, {"degree": 4, "elements": 16})
        return [c for c in found if "degree" in c and c["formulation"] == "mixed" and _has(c, kept)]
    few = 1 if peer in ("PyElastica", "CalculiX") else 4
    return [c for c in found if c["elements"] in (12, 16) and c.get("substeps", 1) == 1][:few]


def _has(configuration, kept):
    return any(all(configuration[key] == value for key, value in some.items()) for some in kept)


def _own(problem):
    rungs = ("determinate", "spatial") if problem == "bend" else ("determinate", "planar", "spatial")
    pairs = [*((rung, "mixed") for rung in rungs), ("spatial", "displacement"), ("spatial", "multiplier")]
    fixed = [
        {"model": rung, "formulation": formulation, "degree": degree, "elements": elements}
        for rung, formulation in pairs
        for degree in (1, 2, 3, 4)
        for elements in _MESHES
    ]
    return fixed + [{"model": rung, "tol": tol} for rung in ("auto", "spatial") for tol in _TOLERANCES]


def _substeps(problem):
    """Load steps from one load factor to the next, as few as possible; most peers' solvers divide them if necessary."""
    more = {"single": (1, 3), "bend": (1, 4), "roll-up 1": (1, 4, 8), "roll-up 2": (2, 8, 16), "roll-up 4": (4, 16, 32)}
    return more.get(problem, (1,))


def _exudyn(problem):
    found = []
    for substeps in _substeps(problem):
        if problem == "sweep":
            meshes = (3, 4, 6, 7, 8, 10, 12, 16, 24, 32, 40, 64)
            found += _grid("planar 3-node", meshes, (1e-3, 3e-4, 1e-4, 1e-5), substeps)
            meshes = (8, 10, 12, 16, 20, 24, 32, 48, 64)
            found += _grid("planar ANCF cable", meshes, (1e-3, 1e-4, 3e-5, 1e-5), substeps)
        elif problem != "bend":
            found += _grid("planar 3-node", (4, 8, 16, 32, 64), (1e-3, 1e-5), substeps)
            found += _grid("planar ANCF cable", (8, 16, 32, 64), (1e-5,), substeps)
        if problem != "bend":  # there a hundred times slower
            found += _grid("spatial 2-node", (16, 48, 64, 128, 256), (1e-4,), substeps)
        if problem == "sweep":
            found += _grid("spatial 2-node", (512,), (1e-5,), substeps)
        else:  # slower for the sweep
            found += _grid("spatial 2-node EP", (8, 16, 64, 256), (1e-4,), substeps)
    return found


def _opensees(problem):
    found, rolled = [], problem.startswith("roll-up")
    for substeps in _substeps(problem)[: 2 if rolled else None]:
        for space in ("spatial",) if problem == "bend" else ("planar", "spatial"):
            if rolled:  # few meshes and tolerances reach full turns
                found += _grid(f"{space} elastic", (8, 32, 128), (1e-4,), substeps)
                found += _grid(f"{space} CBDI", (8, 16, 32), (1e-5,), substeps)
                continue
            found += _grid(f"{space} elastic", (8, 16, 32, 48, 64, 128, 256), (1e-4,), substeps)
            found += _grid(f"{space} CBDI", (3, 4, 6, 8, 10, 12, 16), (1e-3, 1e-5), substeps)
            found += _grid(f"{space} CBDI", (20, 21, 24, 32, 48), (1e-4, 1e-5, 1e-6), substeps, inner=1e-16)
    return found


def _grid(element, meshes, tolerances, substeps, **more):
    step = {"substeps": substeps}
    return [{"element": element, "elements": n, "tol": tol, **step, **more} for n in meshes for tol in tolerances]


def _elastica(problem):
    meshes = {"sweep": (8,), "single": (8, 16, 24), "bend": (8, 16, 32)}.get(problem, (16, 32))
    return [{"element": "spatial rod", "elements": n, "tol": 1e-5} for n in meshes]


def _calculix(problem):
    meshes = {"sweep": (4, 8), "single": (4, 8, 16, 32), "bend": (4, 8, 16)}.get(problem, (16,))
    return [{"element": "spatial B32R", "elements": n, "tol": tol} for n in meshes for tol in (1e-3, 1e-5)]


_OF = {OWN: _own, "Exudyn": _exudyn, "OpenSeesPy": _opensees, "PyElastica": _elastica, "CalculiX": _calculix}
PEERS = tuple(_OF)
