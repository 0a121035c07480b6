"""csm: dense correspondence between deformable meshes with spectral descriptors."""

__version__ = "0.1.0"
