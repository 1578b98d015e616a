"""Results for other programs: tables, Parquet, NetCDF, ParaView, JUnit, LaTeX."""
