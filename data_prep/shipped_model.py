"""Make the files of a network that csm brings from a checkpoint: thinned, in half precision, at most 3 MB.

python data_prep/shipped_model.py model.ckpt csm/assets/models/humans
"""

from __future__ import annotations

import argparse
from pathlib import Path

import csm
from csm.learning.checkpoint import export_module, load_module
from csm.learning.thinning import thinned
from csm.matching.embedded import spread_vertices


def main() -> None:
    """Read the options, and write the files."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkpoint", type=Path, help="of csm train experiment=humans")
    parser.add_argument("folder", type=Path, help="where model.json and model.safetensors go")
    parser.add_argument("--points", type=int, default=3000, help="of the template that are kept")
    parser.add_argument("--functions", type=int, default=128, help="eigenfunctions of the template that are kept")
    args = parser.parse_args()
    humans = csm.load_humans()
    kept = spread_vertices(humans.mesh(humans.names[0]), args.points)
    print(export_module(thinned(load_module(args.checkpoint), kept, args.functions), args.folder, half=True))


if __name__ == "__main__":
    main()
