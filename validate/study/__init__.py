"""Studies: many runs of an experiment on a grid, on Dask."""

from validate.exports import lazily, names

_HOMES = {
    "engine": ("Finished", "finish"),
    "job": ("Job", "Plan", "Where"),
    "store": ("Record",),
    "filters": ("FilterStudy",),
    "identify": ("IdentifyStudy", "identification"),
    "trade": ("ParetoFront", "Trade", "TradeRow"),
    "choose": ("Choice", "Wanted", "wanted"),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
