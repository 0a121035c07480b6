"""The commands, one thin file each; the only room that knows Hydra."""
