"""The kinds of joints and couplings, by name."""

from lagcli.model.machines.belt import BELT
from lagcli.model.machines.cam import CAM
from lagcli.model.machines.drive import DRIVE
from lagcli.model.machines.fixed import FIXED
from lagcli.model.machines.gear import GEAR
from lagcli.model.machines.gearbox import GEARBOX
from lagcli.model.machines.prismatic import PRISMATIC, SLOT
from lagcli.model.machines.rack import RACK
from lagcli.model.machines.revolute import REVOLUTE
from lagcli.model.machines.rod import ROD

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
