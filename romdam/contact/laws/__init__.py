"""Joint laws, one file each: the answer of one gap."""

from romdam.contact.laws.barton_bandis import BartonBandis
from romdam.contact.laws.bond import Bond
from romdam.contact.laws.coulomb import Coulomb
from romdam.contact.laws.dashpot import Dashpot
from romdam.contact.laws.fracture import Fracture
from romdam.contact.laws.grouting import Grouting
from romdam.contact.laws.law import Law
from romdam.contact.laws.penalty import Penalty
from romdam.contact.laws.shear_key import ShearKey
from romdam.contact.laws.shear_stiffness import ElasticShear as ElasticShear
from romdam.contact.laws.shear_stiffness import ShearStiffness
from romdam.contact.laws.slip_weakening import SlipWeakening
from romdam.contact.laws.static_friction import StaticFriction
from romdam.contact.laws.tension_stiffness import TensionStiffness
from romdam.contact.laws.velocity_friction import VelocityFriction

# in the order in which their limits apply
LAWS: tuple[type[Law], ...] = (
    Penalty,
    TensionStiffness,
    ShearStiffness,
    Dashpot,
    Grouting,
    Coulomb,
    StaticFriction,
    VelocityFriction,
    SlipWeakening,
    BartonBandis,
    Bond,
    Fracture,
    ShearKey,
)
