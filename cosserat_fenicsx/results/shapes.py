"""Shapes of a structure about an equilibrium: base class of `Buckling` and `Modes`, and their tables."""

import math
import numbers
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.numerics import ElementRule, directors
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.results.result import OnNodes, Result, by_name, elements_in_words

# Largest displacement of a mode of pure twist, m (the largest displacement or rotation of a mode is 1).
_TWIST = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class Equilibrium(OnNodes):
    """The state that shapes belong to.

    Attributes:
        scene: the scene; load_factor: of the state.
        layout: the element ends of every rod; rule: the `ElementRule`.
        displacement: (N, 3) m, inertial, of all nodes of all rods in the scene's order.
        quaternion: (N, 4) rotations from the reference, unit quaternions, scalar first.
    """

    scene: object
    load_factor: float
    layout: object
    rule: ElementRule
    displacement: np.ndarray
    quaternion: np.ndarray

    @classmethod
    def of(cls, model, load_factor):
        """The state of a spatial model that is loaded with a scene."""
        rq, length = model.snapshot()[0], model.scales.length
        q = rq[:, 3:7] / np.linalg.norm(rq[:, 3:7], axis=1, keepdims=True)
        return cls(model.scene, float(load_factor), model.layout, model.rule, (rq[:, :3] - model.reference) * length, q)

    elements = property(lambda self: self.layout.counts)
    degree = property(lambda self: len(self.rule.nodes) - 1)

    def s(self, rod=None):
        """(nodes,) arc lengths of the nodes of a rod (default the first), m."""
        i, _ = self._rows(rod)
        return self.layout.nodes_of(i, self.rule.nodes) * self.scene.rods[i].length

    def position(self, rod=None):
        """(nodes, 3) positions of the nodes of a rod (default the first), m, inertial."""
        return self.rod(rod).curve.position(self.s(rod)) + self.displacement[self._rows(rod)[1]]

    def between(self, rod, x, values):
        """(n, k) nodal values (N, k) interpolated to arc lengths x (n,) over a rod's length, in [0, 1]."""
        nodes, weights = self._between(rod, x)
        return np.einsum("nj,njk->nk", weights, values[nodes])

    def sample(self, rod, x):
        """Positions (n, 3), m, and directors (n, 3, 3) as columns, both inertial, at arc lengths x (n,) over a rod's
        length."""
        s, q = x * rod.length, self.between(rod, x, self.quaternion)
        frames = directors(q / np.linalg.norm(q, axis=1, keepdims=True)) @ rod.curve.frame(s)
        return rod.curve.position(s) + self.between(rod, x, self.displacement), frames


def _farthest(found):
    """(modes,) texts: where each mode moves most."""
    return np.array(["sections turn" if (place := found.farthest(k)[0]) is None else str(place)
                     for k in range(len(found))])  # fmt: skip


def _directions(found):
    """(modes, 3) the directions there; NaN where nothing is displaced."""
    along = [found.farthest(k)[1] for k in range(len(found))]
    return np.array([np.full(3, np.nan) if x is None else np.round(x, 9) + 0.0 for x in along]).reshape(-1, 3)


_ON_NODES = ("mode", "node")
_QUANTITIES = by_name(
    Quantity("k", axes=("mode",), getter=lambda found: np.arange(len(found))),
    Quantity("place", "moves most at", axes=("mode",), getter=_farthest),
    Quantity("direction", "direction there", "1", "xyz", "inertial", ("mode",), _directions, digits=3, short="along "),
    Quantity("displacement", unit="m", parts="xyz", frame="inertial", axes=_ON_NODES,
             getter=lambda found: found.at_phase()[:, :, :3]),
    Quantity("rotation", unit="rad", parts="xyz", frame="inertial", axes=_ON_NODES,
             getter=lambda found: found.at_phase()[:, :, 3:]),
    *(Quantity(f"{name}_after", f"{name} a quarter of a period later", unit=unit, parts="xyz", frame="inertial",
               axes=_ON_NODES, getter=lambda found, part=part: found.at_phase(math.pi / 2)[:, :, part]
               if np.iscomplexobj(found.shapes) else None)
      for name, unit, part in (("displacement", "m", slice(0, 3)), ("rotation", "rad", slice(3, 6)))),
    Quantity("rod", axes=("node",), getter=lambda found: np.concatenate(
        [np.full(len(found.equilibrium.s(rod)), i) for i, rod in enumerate(found.scene.rods)])),
    Quantity("s", unit="m", axes=("node",), getter=lambda found: np.concatenate(
        [found.equilibrium.s(rod) for rod in found.scene.rods])),
    Quantity("position", unit="m", parts="xyz", frame="inertial", axes=("node",), getter=lambda found: np.concatenate(
        [found.equilibrium.position(rod) for rod in found.scene.rods])),
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Shapes(Result, OnNodes):
    """Shapes about an equilibrium. Modes are numbered from 0. It can be copied and pickled, as its scene can.

    Attributes:
        equilibrium: the state that the shapes belong to: `position(rod)`, `s(rod)`, `load_factor`.
        shapes: (n, N, 6) displacements (m) and rotations (rad), inertial, of all nodes of all rods in the scene's
            order; the largest displacement has length 1, or the largest rotation times the longest rod's length where
            nothing is displaced. Shapes of equal eigenvalues are combined so that the node which they move most moves
            along one axis, as far as possible, in each of them.
        error: (n,) estimated relative error of the eigenvalues; NaN where the mesh was given.
        conservative: whether the loads have a potential near the state, for all motions that the supports allow.
        comm: the MPI communicator; every rank has the whole result, rank 0 writes files and pictures.

    Subclasses have `label(k)`, the eigenvalue of mode k in words, with its unit, for pictures, and `caution`, the
    limits of the result, in sentences.
    """

    _may_be_empty = True

    equilibrium: Equilibrium
    shapes: np.ndarray
    error: np.ndarray
    conservative: bool
    comm: object

    #: what the shapes are, in titles; under their table
    title = _caption = ""
    _rows_axis, axis = "mode", "mode"
    _quantities = _QUANTITIES

    scene = property(lambda self: self.equilibrium.scene)
    load_factor = property(lambda self: self.equilibrium.load_factor)
    layout = property(lambda self: self.equilibrium.layout)
    elements = property(lambda self: self.layout.counts)
    degree = property(lambda self: self.equilibrium.degree)

    def __len__(self):
        return len(self.error)

    def at_phase(self, phase: float = 0.0) -> np.ndarray:
        """(n, N, 6) the shapes at a phase of their oscillation, rad, real: Re(shape exp(i phase))."""
        return np.real(self.shapes * np.exp(1j * phase)) if np.iscomplexobj(self.shapes) else self.shapes

    def mode(self, k, rod=None, phase=0.0):
        """(nodes, 3) displacements of mode k at the nodes of a rod (default the first), m, inertial; of a complex mode
        at a phase of its oscillation, rad."""
        return self.at_phase(phase)[self.number(k), self._rows(rod)[1], :3]

    def turns(self, k, rod=None, phase=0.0):
        """(nodes, 3) small rotations of mode k at the nodes of a rod (default the first), rad, inertial; phase: see
        `mode`."""
        return self.at_phase(phase)[self.number(k), self._rows(rod)[1], 3:]

    def number(self, k):
        """The number of a mode from 0 on; negative ones count from the last.

        Raises:
            SceneError: there is no such mode.
        """
        if isinstance(k, bool) or not isinstance(k, numbers.Integral) or not -len(self) <= k < len(self):
            known = f"from 0 to {len(self) - 1}" if len(self) else "of which there are none"
            refuse(self, "k", k, f"the number of a mode, {known}")
        return int(k) % len(self)

    def require_modes(self, file):
        """Refuse a file or picture of no mode at all."""
        if not len(self):
            raise SceneError(f"{file or 'picture'}: there is no mode to show")

    def twists(self, k):
        """Whether mode k turns sections and displaces nothing."""
        return np.abs(self.shapes[self.number(k), :, :3]).max() < _TWIST

    def farthest(self, k):
        """The station that mode k displaces most, an end of its rod where that moves by 99 % as much, and its direction
        there (3,), inertial; None, None for a twist."""
        if self.twists(k):
            return None, None
        sizes = [(np.linalg.norm(self.mode(k, rod), axis=1), rod) for rod in self.scene.rods]
        size, rod = max(sizes, key=lambda item: round(item[0].max(), 9))
        end, place = (0 if size[0] > size[-1] else len(size) - 1), int(np.argmax(size))
        place = end if size[end] > 0.99 * size[place] else place
        return rod.at(self.equilibrium.s(rod)[place]), self.mode(k, rod)[place] / size[place]

    # -- tables ------------------------------------------------------------------------------------------------------

    @property
    def _ranks(self):
        return self.comm

    def _about(self):
        told = {"kind": type(self).__name__, "title": self.scene.title, "load_factor": self.load_factor}
        told |= {"elements": list(self.elements), "degree": self.degree, "conservative": self.conservative}
        return told | {"rods": [rod.name for rod in self.scene.rods], "caution": self.caution}

    def _table(self, units, rows):
        return super()._table(units, rows) if len(self) else None

    def _titles(self, units):
        title = f"{self.scene.title or self.title}: degree {self.degree}, {elements_in_words(self.elements)}"
        return title, f"{self._caption}\nk: number of the mode in Python, in files and in pictures."

    # -- files and pictures ------------------------------------------------------------------------------------------

    def write(self, file, k=0, *, units="SI"):
        """Write the shapes (.xdmf with .h5, or a format of meshio), the table of the eigenvalues (.csv), or all (.nc).

        The mesh is that of the equilibrium, whose positions are the field `position`; warp it by `displacement`. In an
        .xdmf the time of a shape is the number of its mode.

        Args:
            file: its name, with the ending .xdmf, .csv, .nc, or .vtu, .vtk or another of meshio's.
            k: the number of the mode, for formats other than .xdmf, .csv and .nc.
            units: of .csv and .nc, see `Result`.

        Raises:
            OSError: the file cannot be written.
            SceneError: an unknown format, or no mode.
        """
        from cosserat_fenicsx.results import xdmf

        if Path(file).suffix in (".csv", ".nc"):
            super().write(file, units=units)
        else:
            xdmf.write_shapes(self, file, k)

    def plot(self, file=None, which=None, *, amplitude=0.1, units="SI"):
        """Picture of the shapes, a panel each, with the equilibrium as a grey line.

        Args:
            file: a .png; None returns the pyvista plotter.
            which: numbers of the modes; None for the first six.
            amplitude: largest displacement in the picture as a share of the structure's size. Shapes with large
                rotations are drawn smaller, and the picture says how large.
            units: "SI", "field", or a dict of units by dimensions, such as {"length": "ft"}.

        Raises:
            SceneError: no mode, an unknown one, another ending, or pyvista is missing.
            OSError: the file cannot be written.
        """
        from cosserat_fenicsx.pictures import shapes

        return shapes.draw(self, file, which, amplitude, units)

    def animate(self, file, k=0, *, fps=25, seconds=2.0, cycles=None, amplitude=0.1, size=(960, 720), progress=None):
        """Film of mode k that swings to both sides of the equilibrium.

        Args:
            file: .gif or .mp4.
            k: the number of the mode.
            fps: frames per second.
            seconds: duration of a cycle in the film.
            cycles: how many; None for one in a .gif, which repeats itself, and three in an .mp4.
            amplitude: see `plot`.
            size: (width, height), pixels.
            progress: whether to show a progress bar; None: only if it takes long.

        Raises:
            SceneError: an unknown mode, another ending, an argument outside its range, or pyvista, Pillow or ffmpeg is
                missing.
            OSError: the file cannot be written.
        """
        from cosserat_fenicsx.pictures import shapes

        shapes.film(
            self, file, k, fps=fps, seconds=seconds, cycles=cycles, amplitude=amplitude, size=size, progress=progress
        )

    def __getstate__(self):
        return {name: value for name, value in vars(self).items() if name != "comm"}

    def __setstate__(self, state):
        vars(self).update(state, comm=MPI.COMM_SELF)


def in_words(values, unit=""):
    """'1.2345, 2.3456 Hz': up to six numbers with their unit."""
    shown = ", ".join(f"{value:.7g}" for value in values[:6])
    return f"{shown}{', ...' if len(values) > 6 else ''}{f' {unit}' if unit else ''}"


def largest_error(errors):
    """The largest of estimated relative errors (n,), in words."""
    worst = max(errors, default=math.nan)
    return "error not estimated" if math.isnan(worst) else f"estimated relative error {worst:.1e}"
