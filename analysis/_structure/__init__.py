"""Structure in integers: curves, neighbours, elementary intervals, nets."""
