"""The exact rod in contact beside the soft string: hook loads over the depth of the bit, and the side force."""

from functools import partial

import numpy as np

import cosserat_fenicsx as cf
from cosserat_fenicsx.pictures.charts import beside, draw_both, draw_chart, legend

#: Operations of the hook loads, their colours, and for how many depths of the bit the rod is solved.
OPERATIONS, COLOURS, DEPTHS = (cf.well.TripOut(), cf.well.TripIn()), ("tab:blue", "tab:orange"), 9


def stiff_and_soft(scene, drilling, file):
    """Write the chart.

    Args:
        scene: a `WellScene`; drilling: the answer of the rod for an operation; file: its name.
    """
    depths = np.linspace(scene.sweep["depths"][0], scene.hole.length, DEPTHS)
    soft, stiff = (
        cf.well.depth_sweep(scene.hole, scene.string, OPERATIONS, depths, mud=scene.mud, model=model, tol=1e-3)
        for model in ("soft", "rod")
    )
    draw_both(partial(draw_chart, lambda: _figure(scene, drilling, depths, soft, stiff)), file)


def _figure(scene, drilling, depths, soft, stiff):
    figure, (hook, apart, side), _ = beside([3.6, 3.6, 3.6], 6.0)
    for i, (operation, colour) in enumerate(zip(OPERATIONS, COLOURS, strict=True)):
        loads, given = (sweep.hook_load[i, 0] / 1e3 for sweep in (stiff, soft))
        hook.plot(given, depths, color=colour, label=f"{operation.name}, soft string")
        hook.plot(loads, depths, "o", color=colour, fillstyle="none", label=f"{operation.name}, exact rod")
        apart.plot(loads - given, depths, "o-", color=colour, fillstyle="none", label=operation.name)
    hook.set(xlabel="hook load (kN)", ylabel="measured depth, of the bit or along the string (m)")
    apart.set(xlabel="hook load of the rod less that of the soft string (kN)")
    flexible = cf.well.torque_and_drag(
        scene.hole, scene.string, drilling.operation, mud=scene.mud, depth=drilling.depth, model="soft"
    )
    side.plot(
        drilling.side_force, drilling.md, color="black", linewidth=0.8, label="exact rod, stiff and with clearance"
    )
    side.plot(flexible.side_force, flexible.md, color="tab:red", label="soft string on the axis")
    side.set(
        xlim=(-30, 1.4 * flexible.side_force.max()),
        xlabel=f"side force of the wall, {drilling.operation.name} (N/m), peaks cut off",
    )
    hook.invert_yaxis()
    for panel in (hook, apart, side):
        legend(panel)
    figure.suptitle(f"{scene.title}: the exact rod in contact beside the soft string")
    return figure
