"""Error against run time: many renders, their errors and times, resumed and merged."""
