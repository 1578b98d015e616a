"""Every scheme there is. A new one is one file beside this and its name here."""

from validate.solve.fluid import LINEAR
from validate.solve.newton import StaticNewton
from validate.solve.tabulated import Tabulated
from validate.solve.types import Scheme

SCHEMES: tuple[type[Scheme], ...] = (*LINEAR, StaticNewton, Tabulated)
