"""How much plates rub: a share between slipping and bonded."""

from validate.scene.scene import Contact as Contact

_HALF = 4.0  # of E over the plates' distance: the stiffness at a share of one half (ours)


def plates_of_share(share: float, E: float, apart: float) -> tuple[Contact, float]:
    """Contact and tangential stiffness N/m^3 of plates `apart` m that rub by a `share` 0..1.

    0 slips, 1 bonds, between them springs of k = 4 E/apart share/(1 - share): the one definition of
    how much plates rub, for what is identified and for what is uncertain (Pa, m).
    """
    if share in (0.0, 1.0):
        return ("slip" if share == 0 else "bonded"), 0.0
    return "partial", _HALF * E / apart * share / (1 - share)


def rubbing_share(contact: str, friction: float, E: float, apart: float) -> float:
    """The share 0..1 of that contact with springs of `friction` N/m^3; see `plates_of_share`."""
    if contact != "partial":
        return float(contact == "bonded")
    return friction / (friction + _HALF * E / apart)
