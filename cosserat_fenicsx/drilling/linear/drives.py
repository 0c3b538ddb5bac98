"""What other drives would do to the modes of a steady rotation."""

from dataclasses import replace

import numpy as np

from cosserat_fenicsx.drilling.discs import Discs
from cosserat_fenicsx.drilling.linear.roots import all_roots
from cosserat_fenicsx.drilling.linear.stability_box import box_up_to
from cosserat_fenicsx.drilling.linear.steady import Steady, or_none
from cosserat_fenicsx.drilling.linear.tuned import SoftSpeed, SoftTorque, with_rule
from cosserat_fenicsx.drilling.top_drive import Matched, Stiff, TopDrive


def usual_drives(scene):
    """{name: TopDrive} to compare with: others than that of the scene, those with an inertia where that has one; and
    where `SoftTorque` or `SoftSpeed` chose its gains, the drive of the scene itself by the name of that rule."""
    inertia, own = scene.drive.inertia, scene.drive.control
    drives = {} if isinstance(own, Stiff) else {"stiff": TopDrive(0.0)}
    if isinstance(scene.string, Discs):
        return drives
    if inertia:
        for name, choose in (("SoftTorque", SoftTorque), ("SoftSpeed", SoftSpeed)):
            # one tuning: that of the scene, where it has one
            control = with_rule(own, name) if own_rule(scene) else choose(scene, inertia)
            drives[name] = TopDrive(0.0, inertia, control)
    if own != Matched():
        drives["matched"] = TopDrive(0.0, control=Matched())
    return drives


def own_rule(scene):
    """The name of the rule that chose the gains of the scene's drive, or None."""
    return getattr(scene.drive.control, "rule", None)


def growth_with(answer, i, j, drives=None):
    """See `Stability.with_drives`."""
    own, scene = answer.roots[i, j], answer.scene
    case = answer.speeds[i], or_none(answer.weights[j])
    found = {}
    for name, drive in (usual_drives(scene) if drives is None else drives).items():
        if (drive.control, drive.inertia) == (scene.drive.control, scene.drive.inertia):  # the modes as they are
            found[name] = own.real.copy()
            continue
        steady = Steady(replace(scene, drive=drive))
        f = steady.equation(steady.parameters(*case))
        roots, _ = all_roots(f, box_up_to(steady, 2 * np.pi * answer.up_to)(f), f.spacing)
        nearest = np.abs(roots.imag[:, None] - np.where(np.isfinite(own), own.imag, np.inf)[None, :]).argmin(axis=1)
        growth = [roots.real[nearest == k].max(initial=-np.inf) for k in range(len(own))]
        found[name] = np.where(np.isneginf(growth), np.nan, growth)
    return found
