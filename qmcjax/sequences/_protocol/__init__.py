"""The interfaces of sequences, and adapters for objects of users."""
