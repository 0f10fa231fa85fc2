"""How long it takes and how much memory: ours, and the programs that a user would take instead."""
