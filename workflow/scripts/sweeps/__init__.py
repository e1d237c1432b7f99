"""Tables of runs, runs of the program `willmore`, and what comes of them."""
