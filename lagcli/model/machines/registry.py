"""The kinds of joints and couplings, by name."""

from lagcli.model.machines.belt import BELT
from lagcli.model.machines.cam import CAM
from lagcli.model.machines.cylindrical import CYLINDRICAL
from lagcli.model.machines.drive import DRIVE
from lagcli.model.machines.fixed import FIXED, FIXED_IN_SPACE
from lagcli.model.machines.gear import GEAR
from lagcli.model.machines.gearbox import GEARBOX
from lagcli.model.machines.planar import PLANAR
from lagcli.model.machines.prismatic import PRISMATIC, PRISMATIC_IN_SPACE, SLOT
from lagcli.model.machines.rack import RACK
from lagcli.model.machines.revolute import REVOLUTE, REVOLUTE_IN_SPACE
from lagcli.model.machines.rod import ROD, ROD_IN_SPACE
from lagcli.model.machines.rolling import ROLLING
from lagcli.model.machines.screw import SCREW
from lagcli.model.machines.spherical import SPHERICAL
from lagcli.model.machines.universal import UNIVERSAL

_COUPLINGS = (GEARBOX, CAM, DRIVE)
_PLANAR = (REVOLUTE, PRISMATIC, SLOT, FIXED, ROD, GEAR, RACK, BELT)
_IN_SPACE = (
    *(SPHERICAL, REVOLUTE_IN_SPACE, CYLINDRICAL, PRISMATIC_IN_SPACE, UNIVERSAL, PLANAR),
    *(FIXED_IN_SPACE, SCREW, ROD_IN_SPACE, ROLLING),
)
#: The kinds by dimension and name.
KINDS = {
    2: {kind.name: kind for kind in (*_PLANAR, *_COUPLINGS)},
    3: {kind.name: kind for kind in (*_IN_SPACE, *_COUPLINGS)},
}
#: Keys of each joint with a coordinate.
OF_COORDINATE = (
    *("damping", "stiffness", "rest", "torque", "force", "armature", "friction"),
    *("min", "max", "restitution"),
)
