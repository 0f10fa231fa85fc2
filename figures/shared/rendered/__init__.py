"""Images of scenes: their references, samplers and errors."""
