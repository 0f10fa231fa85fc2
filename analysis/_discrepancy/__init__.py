"""Star discrepancy: exact in two and three dimensions, bounded in more, and smoothed; L2 discrepancies."""
