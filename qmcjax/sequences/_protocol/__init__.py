"""The interfaces of sequences, and adapters for user-defined objects."""
