"""L2 discrepancies, by pairs and by merging, in float32, float64 and twice float64."""
