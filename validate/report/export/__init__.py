"""Export of results: tables, Parquet, NetCDF, ParaView, JUnit, LaTeX."""
