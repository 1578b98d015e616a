"""Engine of runs and studies: cells with a key, a store on disk, workers.

A cell is a small description of one computation; its key names everything its value rests on.
`execution` looks the keys up in the store, computes what is missing, here or on workers, and keeps
each record as soon as it is there. The engine knows nothing of experiments: it needs a job with an
identity of the code, and two functions of a module, one that opens what the job names, one that
computes a cell.

Read first `cell` (what flows), then `execution` (the order of work), `store` (files), `cluster`
(workers) and `identity` (which code computed it).
"""

from validate.exports import lazily, names

_HOMES = {
    "cell": ("CellJob", "Keyed", "Plan", "Record", "Where"),
    "execution": ("Finished", "finish"),
    "pool": ("Pool",),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
