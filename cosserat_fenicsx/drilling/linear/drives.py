"""What other drives would do to the modes of a steady rotation."""

from dataclasses import replace

import numpy as np

from cosserat_fenicsx.drilling.discs import Discs
from cosserat_fenicsx.drilling.linear.roots import all_roots
from cosserat_fenicsx.drilling.linear.stability_box import box_up_to
from cosserat_fenicsx.drilling.linear.steady import Steady, or_none
from cosserat_fenicsx.drilling.linear.tuned import SoftSpeed, SoftTorque
from cosserat_fenicsx.drilling.top_drive import Matched, Stiff, TopDrive


def usual_drives(scene):
    """{name: TopDrive} to compare with, others than that of the scene; those with an inertia where that has one."""
    inertia, own = scene.drive.inertia, scene.drive.control
    drives = {} if isinstance(own, Stiff) else {"stiff": TopDrive(0.0)}
    if isinstance(scene.string, Discs):
        return drives
    if inertia:
        for name, choose in (("SoftTorque", SoftTorque), ("SoftSpeed", SoftSpeed)):
            drives[name] = TopDrive(0.0, inertia, choose(scene, inertia))
    drives["matched"] = TopDrive(0.0, control=Matched())
    return {name: drive for name, drive in drives.items() if drive.control != own}


def growth_with(answer, i, j, drives=None):
    """See `Stability.with_drives`."""
    own = answer.roots[i, j]
    case = answer.speeds[i], or_none(answer.weights[j])
    found = {}
    for name, drive in (usual_drives(answer.scene) if drives is None else drives).items():
        steady = Steady(replace(answer.scene, drive=drive))
        f = steady.equation(steady.parameters(*case))
        roots, _ = all_roots(f, box_up_to(steady, 2 * np.pi * answer.up_to)(f), f.spacing)
        nearest = np.abs(roots.imag[:, None] - np.where(np.isfinite(own), own.imag, np.inf)[None, :]).argmin(axis=1)
        growth = [roots.real[nearest == k].max(initial=-np.inf) for k in range(len(own))]
        found[name] = np.where(np.isneginf(growth), np.nan, growth)
    return found
