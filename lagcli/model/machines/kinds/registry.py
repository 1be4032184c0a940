"""The kinds of joints and couplings, by name."""

from lagcli.model.machines.kinds.belt import BELT
from lagcli.model.machines.kinds.cam import CAM
from lagcli.model.machines.kinds.drive import DRIVE
from lagcli.model.machines.kinds.fixed import FIXED
from lagcli.model.machines.kinds.gear import GEAR
from lagcli.model.machines.kinds.gearbox import GEARBOX
from lagcli.model.machines.kinds.prismatic import PRISMATIC, SLOT
from lagcli.model.machines.kinds.rack import RACK
from lagcli.model.machines.kinds.revolute import REVOLUTE
from lagcli.model.machines.kinds.rod import ROD

KINDS = {
    kind.name: kind
    for kind in (
        *(REVOLUTE, PRISMATIC, SLOT, FIXED, ROD),
        *(GEAR, RACK, BELT, GEARBOX, CAM, DRIVE),
    )
}
#: Kinds of joints that exist in space only.
SPATIAL = ("spherical", "cylindrical", "universal", "planar", "screw", "rolling")
#: Keys of each joint with a coordinate.
OF_COORDINATE = (
    *("damping", "stiffness", "rest", "torque", "force", "armature", "friction"),
    *("min", "max", "restitution"),
)
