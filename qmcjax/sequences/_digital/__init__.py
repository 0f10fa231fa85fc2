"""Digital sequences: generator matrices over F2 and over prime fields."""
