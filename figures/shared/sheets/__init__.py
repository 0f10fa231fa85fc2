"""What is drawn alike: images in rows, point sets, tables of text, curves."""
