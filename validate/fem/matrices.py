"""Masses and dampings of a system as a scheme takes them: two switches, each with its own price."""

from typing import Literal

from scipy import sparse

from validate.fem.assemble import lumped, stiffness_damping
from validate.fem.assemble import mass as mass_matrix
from validate.fem.system import System

MassName = Literal["consistent", "lumped"]
DampingTerms = Literal["full", "mass"]


def mass_of(system: System, mass: MassName) -> sparse.csr_array:
    """M (N, N) kg as the setting names it."""
    if mass == "consistent":
        return system.M
    return sparse.csr_array(sparse.diags_array(system.masses))


def damping_of(system: System, mass: MassName, terms: DampingTerms) -> sparse.csr_array:
    """C (N, N) N s/m: alpha M of the mass in use, with `terms` "full" plus beta K.

    Without beta K lumped masses leave C diagonal: paper 002's price of explicit steps.
    """
    if (mass, terms) == ("consistent", "full"):
        return system.C
    C = mass_matrix(system.scene, damping=True)
    if mass == "lumped":
        C = sparse.csr_array(sparse.diags_array(lumped(system.scene, C)))
    return C if terms == "mass" else sparse.csr_array(C + stiffness_damping(system.scene))
