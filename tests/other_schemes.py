"""Two simple time integration rules for comparison; they fail on stiff thin rods, so the package does not offer them.

Both have the velocities, the momenta and the constraint of the momentum scheme, but another stress.
"""

from cosserat_fenicsx.dynamics import simulate
from cosserat_fenicsx.dynamics.schemes import Momentum
from cosserat_fenicsx.forms.equilibrium import balance, contact
from cosserat_fenicsx.models.moving import MovingSpatial, compile_momentum


def at(motion, section, test):
    """The stress terms of eq. (1) at a configuration."""
    return balance(*contact(motion, section), motion, test)


def midpoint(before, after, middle, section, viscosity, h, test):
    """Plain midpoint rule: the stress of the averaged configuration."""
    return at(middle, section, test)


def trapezoidal(before, after, middle, section, viscosity, h, test):
    """Trapezoidal rule: the forces of both ends averaged."""
    return (at(before, section, test) + at(after, section, test)) / 2


def register(monkeypatch):
    """Register them with `simulate` as the schemes "midpoint" and "trapezoidal", in space, undamped."""
    for stress in (midpoint, trapezoidal):
        name = stress.__name__

        def scheme(step, stress=stress):
            return compile_momentum(step, stress)

        model = type(name, (MovingSpatial,), {"scheme": staticmethod(scheme)})
        monkeypatch.setitem(simulate._MODELS, (name, "spatial"), model)
        monkeypatch.setitem(simulate.SCHEMES, name, type(name, (Momentum,), {"forms": name}))
