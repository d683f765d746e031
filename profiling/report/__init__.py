"""The report of a sweep: tables, plots, HTML."""
