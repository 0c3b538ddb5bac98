"""Geometrically exact rods on FEniCSx: equilibrium paths of special Cosserat rods under large displacements.

Modules are imported when their names are first used, so that `import cosserat_fenicsx` and --help stay instant.
"""

import importlib
from os import path as _path

from cosserat_fenicsx.aborting import watch as _watch
from cosserat_fenicsx.homes import HOMES as _HOME

__version__ = "0.1.0"

# As `typing.TYPE_CHECKING`, without that import: True to type checkers and editors alone.
TYPE_CHECKING = False

_checkout = _path.dirname(_path.dirname(_path.realpath(__file__)))
if all(_path.isfile(_path.join(_checkout, *file)) for file in (("forms", "spatial.py"), ("pyproject.toml",))):
    # A plain checkout: forms/ lies beside the package; an installation has it inside.
    __path__.append(_checkout)

_watch()

if TYPE_CHECKING:  # the same names, for editors and type checkers
    from cosserat_fenicsx import analytic as analytic
    from cosserat_fenicsx import units as units
    from cosserat_fenicsx.actions.added_mass import AddedMass as AddedMass
    from cosserat_fenicsx.actions.centrifugal import Centrifugal as Centrifugal
    from cosserat_fenicsx.actions.dashpot import Dashpot as Dashpot
    from cosserat_fenicsx.actions.drag import Drag as Drag
    from cosserat_fenicsx.actions.foundation import Foundation as Foundation
    from cosserat_fenicsx.actions.hole_wall import HoleRing as HoleRing
    from cosserat_fenicsx.actions.hole_wall import HoleWall as HoleWall
    from cosserat_fenicsx.actions.linear_drag import LinearDrag as LinearDrag
    from cosserat_fenicsx.actions.point_mass import PointMass as PointMass
    from cosserat_fenicsx.actions.spring import Spring as Spring
    from cosserat_fenicsx.actions.tube_wall import TubeRing as TubeRing
    from cosserat_fenicsx.actions.tube_wall import TubeWall as TubeWall
    from cosserat_fenicsx.actions.wall import Wall as Wall
    from cosserat_fenicsx.drilling.bit_laws import BitOnRock as BitOnRock
    from cosserat_fenicsx.drilling.bit_laws import Cutting as Cutting
    from cosserat_fenicsx.drilling.bit_laws import Lobes as Lobes
    from cosserat_fenicsx.drilling.bit_laws import Stribeck as Stribeck
    from cosserat_fenicsx.drilling.bit_laws import Wear as Wear
    from cosserat_fenicsx.drilling.bit_torque import BitTorque as BitTorque
    from cosserat_fenicsx.drilling.discs import Discs as Discs
    from cosserat_fenicsx.drilling.history import DrillingHistory as DrillingHistory
    from cosserat_fenicsx.drilling.hook import Hook as Hook
    from cosserat_fenicsx.drilling.linear.bounce import BitBounce as BitBounce
    from cosserat_fenicsx.drilling.linear.bounce import bit_bounce as bit_bounce
    from cosserat_fenicsx.drilling.linear.campbell import Campbell as Campbell
    from cosserat_fenicsx.drilling.linear.campbell import campbell as campbell
    from cosserat_fenicsx.drilling.linear.frequencies import natural_frequencies as natural_frequencies
    from cosserat_fenicsx.drilling.linear.limits import critical_slopes as critical_slopes
    from cosserat_fenicsx.drilling.linear.limits import limit_speed as limit_speed
    from cosserat_fenicsx.drilling.linear.limits import limit_weight as limit_weight
    from cosserat_fenicsx.drilling.linear.lumped import LumpedCutting as LumpedCutting
    from cosserat_fenicsx.drilling.linear.spectrum import Stability as Stability
    from cosserat_fenicsx.drilling.linear.stability import stability as stability
    from cosserat_fenicsx.drilling.linear.tuned import SoftSpeed as SoftSpeed
    from cosserat_fenicsx.drilling.linear.tuned import SoftTorque as SoftTorque
    from cosserat_fenicsx.drilling.mixed import MixedScene as MixedScene
    from cosserat_fenicsx.drilling.mixed import mixed_scene as mixed_scene
    from cosserat_fenicsx.drilling.pipe_above import PipeAbove as PipeAbove
    from cosserat_fenicsx.drilling.scene import Drilling as Drilling
    from cosserat_fenicsx.drilling.scenefile import DrillingScene as DrillingScene
    from cosserat_fenicsx.drilling.scenefile import read_drilling_scene as read_drilling_scene
    from cosserat_fenicsx.drilling.simulate import read_drilling as read_drilling
    from cosserat_fenicsx.drilling.simulate import resume_drilling as resume_drilling
    from cosserat_fenicsx.drilling.simulate import simulate_drilling as simulate_drilling
    from cosserat_fenicsx.drilling.stick_slip import StickSlip as StickSlip
    from cosserat_fenicsx.drilling.top_drive import PI as PI
    from cosserat_fenicsx.drilling.top_drive import Matched as Matched
    from cosserat_fenicsx.drilling.top_drive import Motor as Motor
    from cosserat_fenicsx.drilling.top_drive import Stiff as Stiff
    from cosserat_fenicsx.drilling.top_drive import TopDrive as TopDrive
    from cosserat_fenicsx.drilling.wall_friction import ViscousDrag as ViscousDrag
    from cosserat_fenicsx.drilling.wall_friction import WallFriction as WallFriction
    from cosserat_fenicsx.dynamics.natural_modes import modes as modes
    from cosserat_fenicsx.dynamics.resuming import read_history as read_history
    from cosserat_fenicsx.dynamics.resuming import resume as resume
    from cosserat_fenicsx.dynamics.simulate import simulate as simulate
    from cosserat_fenicsx.errors import CosseratError as CosseratError
    from cosserat_fenicsx.errors import InstallationError as InstallationError
    from cosserat_fenicsx.errors import Interrupted as Interrupted
    from cosserat_fenicsx.errors import NotConverged as NotConverged
    from cosserat_fenicsx.errors import NotStored as NotStored
    from cosserat_fenicsx.errors import SceneError as SceneError
    from cosserat_fenicsx.errors import SceneWarning as SceneWarning
    from cosserat_fenicsx.results.buckling import Buckling as Buckling
    from cosserat_fenicsx.results.history import History as History
    from cosserat_fenicsx.results.modes import Modes as Modes
    from cosserat_fenicsx.results.orbits import Orbit as Orbit
    from cosserat_fenicsx.results.path import Path as Path
    from cosserat_fenicsx.results.records import Event as Event
    from cosserat_fenicsx.results.sensitivity import Sensitivity as Sensitivity
    from cosserat_fenicsx.results.sensitivity import Uncertainty as Uncertainty
    from cosserat_fenicsx.results.whirl import Whirl as Whirl
    from cosserat_fenicsx.scene.action import Action as Action
    from cosserat_fenicsx.scene.action import LineAction as LineAction
    from cosserat_fenicsx.scene.action import PointAction as PointAction
    from cosserat_fenicsx.scene.along import Along as Along
    from cosserat_fenicsx.scene.along import AlongPieces as AlongPieces
    from cosserat_fenicsx.scene.along import AlongTable as AlongTable
    from cosserat_fenicsx.scene.curves import Arc as Arc
    from cosserat_fenicsx.scene.curves import Helix as Helix
    from cosserat_fenicsx.scene.curves import Line as Line
    from cosserat_fenicsx.scene.curves import Spline as Spline
    from cosserat_fenicsx.scene.curves import UniformCurvature as UniformCurvature
    from cosserat_fenicsx.scene.damping import Damping as Damping
    from cosserat_fenicsx.scene.initial import InitialVelocity as InitialVelocity
    from cosserat_fenicsx.scene.joints import Joint as Joint
    from cosserat_fenicsx.scene.loads import EccentricForce as EccentricForce
    from cosserat_fenicsx.scene.loads import FollowerForce as FollowerForce
    from cosserat_fenicsx.scene.loads import FollowerMoment as FollowerMoment
    from cosserat_fenicsx.scene.loads import Force as Force
    from cosserat_fenicsx.scene.loads import LineForce as LineForce
    from cosserat_fenicsx.scene.loads import LineMoment as LineMoment
    from cosserat_fenicsx.scene.loads import Moment as Moment
    from cosserat_fenicsx.scene.loads import Weight as Weight
    from cosserat_fenicsx.scene.materials import Material as Material
    from cosserat_fenicsx.scene.parameters import Parameter as Parameter
    from cosserat_fenicsx.scene.rod import Rod as Rod
    from cosserat_fenicsx.scene.rod import euler_load as euler_load
    from cosserat_fenicsx.scene.rolled import Profile as Profile
    from cosserat_fenicsx.scene.scene import Scene as Scene
    from cosserat_fenicsx.scene.scenefile import read_motion as read_motion
    from cosserat_fenicsx.scene.scenefile import read_scene as read_scene
    from cosserat_fenicsx.scene.sections import Circle as Circle
    from cosserat_fenicsx.scene.sections import Rectangle as Rectangle
    from cosserat_fenicsx.scene.sections import Stiffness as Stiffness
    from cosserat_fenicsx.scene.sections import Tube as Tube
    from cosserat_fenicsx.scene.signals import Ramp as Ramp
    from cosserat_fenicsx.scene.signals import RunUp as RunUp
    from cosserat_fenicsx.scene.signals import Sine as Sine
    from cosserat_fenicsx.scene.signals import Step as Step
    from cosserat_fenicsx.scene.signals import Table as Table
    from cosserat_fenicsx.scene.signals import Triangle as Triangle
    from cosserat_fenicsx.scene.supports import Clamp as Clamp
    from cosserat_fenicsx.scene.supports import Hinge as Hinge
    from cosserat_fenicsx.scene.supports import Pin as Pin
    from cosserat_fenicsx.scene.supports import Prescribed as Prescribed
    from cosserat_fenicsx.scene.supports import Roller as Roller
    from cosserat_fenicsx.statics.linear_buckling import buckling as buckling
    from cosserat_fenicsx.statics.path.load_control import StepControl as StepControl
    from cosserat_fenicsx.statics.reading import read_path as read_path
    from cosserat_fenicsx.statics.solve import solve as solve
    from cosserat_fenicsx.studies.outcome import Study as Study
    from cosserat_fenicsx.studies.study import study as study
    from cosserat_fenicsx.well.answer import TorqueAndDrag as TorqueAndDrag
    from cosserat_fenicsx.well.calibrate import FrictionFit as FrictionFit
    from cosserat_fenicsx.well.calibrate import RigMeasurement as RigMeasurement
    from cosserat_fenicsx.well.calibrate import calibrate_friction as calibrate_friction
    from cosserat_fenicsx.well.components import Bit as Bit
    from cosserat_fenicsx.well.components import Collar as Collar
    from cosserat_fenicsx.well.components import Component as Component
    from cosserat_fenicsx.well.components import DrillPipe as DrillPipe
    from cosserat_fenicsx.well.components import HeavyWeight as HeavyWeight
    from cosserat_fenicsx.well.components import Stabiliser as Stabiliser
    from cosserat_fenicsx.well.depth_sweep import DepthSweep as DepthSweep
    from cosserat_fenicsx.well.depth_sweep import depth_sweep as depth_sweep
    from cosserat_fenicsx.well.hole import Borehole as Borehole
    from cosserat_fenicsx.well.hole import HoleSection as HoleSection
    from cosserat_fenicsx.well.mud import Mud as Mud
    from cosserat_fenicsx.well.operations import BackReam as BackReam
    from cosserat_fenicsx.well.operations import Ream as Ream
    from cosserat_fenicsx.well.operations import RotaryDrilling as RotaryDrilling
    from cosserat_fenicsx.well.operations import RotateOffBottom as RotateOffBottom
    from cosserat_fenicsx.well.operations import Sliding as Sliding
    from cosserat_fenicsx.well.operations import Static as Static
    from cosserat_fenicsx.well.operations import TripIn as TripIn
    from cosserat_fenicsx.well.operations import TripOut as TripOut
    from cosserat_fenicsx.well.path import WellPath as WellPath
    from cosserat_fenicsx.well.scenefile import WellScene as WellScene
    from cosserat_fenicsx.well.scenefile import read_well as read_well
    from cosserat_fenicsx.well.string import DrillString as DrillString
    from cosserat_fenicsx.well.torque_and_drag import torque_and_drag as torque_and_drag

__all__ = sorted(_HOME)


def names_in(subpackage: str) -> list[str]:
    """The public names defined in a subpackage."""
    return [name for name, home in _HOME.items() if home and home.startswith(f"{subpackage}.")]


if not TYPE_CHECKING:  # to type checkers it would say that every name exists

    def __getattr__(name):
        if name not in _HOME:
            raise AttributeError(f"module 'cosserat_fenicsx' has no attribute '{name}'")
        if _HOME[name] is None:
            return importlib.import_module(f"cosserat_fenicsx.{name}")
        from cosserat_fenicsx.arguments import in_words

        home = importlib.import_module(f"cosserat_fenicsx.{_HOME[name]}")
        value = globals()[name] = in_words(getattr(home, name))
        setattr(home, name, value)  # the same object, as pickle expects
        return value


def __dir__():
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
