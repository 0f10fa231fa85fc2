"""The documentation: pages, and what Sphinx is taught to make of code, docstrings and the ledger."""
