"""Commands beside the figures: plan, gpu, compilations."""
