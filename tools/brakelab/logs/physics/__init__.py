"""Physics of a log: signals of one drive against each other, a line for each contradiction."""
