"""The vehicles, their world, their instruments and cameras."""
