"""Triangle meshes, and rays through trees over them."""
