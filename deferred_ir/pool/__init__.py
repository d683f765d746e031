"""A pool of many VPLs, of which each pixel of a coarser image chooses a few."""
