"""L2 discrepancies, by pairs, in twice float64."""
