"""Random, stratified and progressive random points."""
