"""The public names and their modules: read by type checkers and editors, and by the package itself."""

from cosserat_fenicsx.scene.supports import BodyDisplacement as BodyDisplacement
from cosserat_fenicsx.scene.supports import BodyRotation as BodyRotation
from cosserat_fenicsx.scene.signals import Along as Along
from cosserat_fenicsx.scene.signals import AlongPieces as AlongPieces
from cosserat_fenicsx.scene.signals import AlongTable as AlongTable
from cosserat_fenicsx.scene.signals import Ramp as Ramp
from cosserat_fenicsx.scene.signals import RunUp as RunUp
from cosserat_fenicsx.scene.signals import Sine as Sine
from cosserat_fenicsx.scene.signals import Step as Step
from cosserat_fenicsx.scene.signals import Table as Table
from cosserat_fenicsx.scene.signals import Triangle as Triangle
