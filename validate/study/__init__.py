"""Studies: many runs of an experiment on a grid, on Dask."""

from validate.exports import lazily, names

_HOMES = {
    "filters.study": ("FilterStudy",),
    "identify.study": ("IdentifyStudy", "identification"),
    "tradeoff.study": ("ParetoFront", "Trade", "TradeRow"),
    "choose.study": ("Choice", "Wanted", "wanted"),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
