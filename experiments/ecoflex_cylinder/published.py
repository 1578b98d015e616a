"""The printed moduli of the ten logs, beside ours of five."""

from validate.compare.published import Figure, Values
from validate.papers.ecoflex.cylinder import DATA_SET

_TEN = f"{DATA_SET}: ten repeats, two specimens"


def _shear_modulus(values: Values) -> float:
    """Of neo-Hooke between slipping plates, nearly incompressible: a third of its modulus."""
    return float(values["identified"]["modulus.neo_slip"]) / 3


PUBLISHED = (
    Figure(
        "modulus.E, 0.5-5 % strain", "identified:modulus.E", 104e3, 9e3, "Pa", "reproduced",
        "within two sd (4.5 kPa) of the scatter between specimens", _TEN, 107.666e3, 10.0,
    ),
    Figure(
        "sd of modulus.E", "identified:modulus.E.sd_repeats", 4.5e3, None, "Pa", "not comparable",
        "ours is of repeats on one specimen: the second one's logs are missing", _TEN,
        1.052e3, 1.0,
    ),
    Figure(
        "neo-Hooke shear modulus over the whole log",
        _shear_modulus, 36.7e3, None, "Pa", "not comparable",
        "theirs is fitted to 66 % strain, ours to 50 % with slipping plates", _TEN, 30.391e3, 10.0,
    ),
)  # fmt: skip
