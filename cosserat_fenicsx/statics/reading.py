"""Saved paths, read again; and the parts of any saved result that models define."""

import cosserat_fenicsx.compat  # noqa: F401, I001  first: its message says what is missing where dolfinx is

from mpi4py import MPI

from cosserat_fenicsx.checks import File
from cosserat_fenicsx.models.connections import Connections
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.base import Scales
from cosserat_fenicsx.ranks import communicator
from cosserat_fenicsx.results.export import saved
from cosserat_fenicsx.results.path import Path
from cosserat_fenicsx.statics.circulatory import conservative_along
from cosserat_fenicsx.statics.critical_points import derivatives_of


def read_path(file: File, *, comm: MPI.Comm | None = None) -> Path:
    """The `Path` that `Path.save` wrote, with the same digits.

    Its scene is a copy: stations are those of `path.rod(name)`, or are given by name.

    Args:
        file: its name.
        comm: MPI communicator of the path, whose ranks all read the file; default all.

    Raises:
        SceneError: it cannot be read, is damaged, holds something else, or is of a newer release.
    """
    path = saved.read(file, Path, assembled, communicator(comm))
    path._potential, path._differentiated = conservative_along, derivatives_of
    return path


def assembled(scene, breaks, scales):
    """The `Layout`, the `Scales` and the `Connections` of a result from what `saved.read` passes."""
    layout = Layout(tuple(breaks))
    return layout, Scales(**scales), Connections.of(scene, layout)
