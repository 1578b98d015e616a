"""Studies: many runs of an experiment on a grid, on Dask."""
