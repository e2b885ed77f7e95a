"""Physics of a log: signals of one drive against each other, a line for what cannot be."""
