"""Frames of many rods, with and without joints that are released: balance, the same on several ranks, and cost."""

import time

import numpy as np
import pytest
from frame_scenes import grid_shell
from mpi4py import MPI

import cosserat_fenicsx as cf


def shell(n, released=False):
    """A grid shell; released: every other joint at the end of a rod is a ball joint."""
    rods, supports, loads, joints = grid_shell(n)
    ends = [k for k, joint in enumerate(joints) if joint.second == joint.second.rod.end]
    for k in ends[::2] if released else ():
        joints[k] = cf.Joint(joints[k].first, joints[k].second, "all")
    return cf.Scene(rods, supports, loads, joints)


@pytest.mark.parametrize("released", [False, True])
def test_all_ranks_find_the_equilibrium_of_a_frame(released):
    """Reactions balance the load, and the ranks agree with one alone."""
    scene = shell(6, released)
    together, alone = (cf.solve(scene, [1.0], elements=1, comm=comm) for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
    held = sum(together.reaction(support)[0][0] for support in scene.supports)
    np.testing.assert_allclose(held, -np.array(scene.loads[0].force), atol=1e-8)  # rounding of strains
    assert together.unknowns == alone.unknowns and together.negative_modes.tolist() == alone.negative_modes.tolist()
    for rod in scene.rods[::10]:
        np.testing.assert_allclose(together.position(rod.end), alone.position(rod.end), atol=1e-12)
        np.testing.assert_allclose(together.moment(rod.end), alone.moment(rod.end), atol=1e-8)


@pytest.mark.serial
def test_hinges_cost_no_more_than_rods():
    """Twice the frame takes some two to three times as long; where the equations of all ball joints were one dense
    block, 64 of them took 25 times as long as none, and more grew with the cube."""
    times = {}
    for released in (False, True):
        scene = shell(9, released)
        cf.solve(scene, [1.0], elements=1, comm=MPI.COMM_SELF)
        begun = time.process_time()
        cf.solve(scene, [1.0], elements=1, comm=MPI.COMM_SELF)
        times[released] = time.process_time() - begun
    assert times[True] < 6 * times[False] + 0.1
