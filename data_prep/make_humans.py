"""Make the built-in humans, csm/assets/humans.npz: 10 people x 10 poses, one connectivity.

Needs `pip install "csm-correspondence[prep]"` (anny).  The result depends on the seed and on the
versions of anny and torch only.

    python data_prep/make_humans.py --out csm/assets/humans.npz
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from humans.bodies import POSES, SUBJECTS
from humans.close_cavities import close_cavities
from humans.decimate import Decimation
from humans.edge_flips import flip_towards_delaunay
from humans.intersect import untangle
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from tqdm import tqdm

from csm.data.bodies.making import standing
from csm.data.bodies.rig import LOCAL_SHAPES, PHENOTYPES, Rig, pose_matrices
from csm.data.packed import pack
from csm.mesh.intersections import intersecting_pairs

if TYPE_CHECKING:
    import anny

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CAVITIES = ["mouth_cavity", "eye_cavity.L", "eye_cavity.R"]
JITTER = 3.0
"""Standard deviation (degrees) of what each joint angle differs by between subjects in the same pose."""
LOCAL_RANGE = 0.5


def main() -> None:
    """Generate, simplify, repair, report and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("csm/assets/humans.npz"), help="file to write")
    parser.add_argument("--seed", type=int, default=2024, help="seed of the shape details and pose differences")
    parser.add_argument("--vertices", type=int, default=6900, help="at most this many vertices")
    args = parser.parse_args()
    import anny

    model = anny.Anny(local_changes="default")
    template, faces, part, mirror = body_surface(model)
    shapes = people(model, args.seed)[:, part]
    faces = close_cavities(template, faces, cavity_faces(model, part), mirror)
    shapes, faces, mirror, kept = simplify(shapes, faces, mirror, args.vertices)
    shapes = np.stack([standing(repair(v, faces, k)) for k, v in enumerate(tqdm(shapes, desc="untangle"))])
    write(args.out, shapes, faces, mirror, args.seed)
    np.savez_compressed(args.out.with_name("humans_anny.npz"), kept=part[kept].astype(np.uint16))


def body_surface(model: anny.Anny) -> tuple[Floats, Ints, Ints, Ints]:
    """Return template vertices, faces, their numbers in the model, and the mirror map of the largest component."""
    vertices, faces = model.template_vertices.double().numpy(), model.faces.long().numpy()
    n = len(vertices)
    i, j = np.concatenate([faces[:, :2], faces[:, 1:]]).T
    label = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(n, n)), directed=False)[1]
    part = np.flatnonzero(label == np.bincount(label).argmax())
    number = np.full(n, -1)
    number[part] = np.arange(len(part))
    inside = faces[np.isin(faces, part).all(axis=1)]
    distance, mirror = cKDTree(vertices[part]).query(vertices[part] * [-1, 1, 1])
    if distance.max() > 1e-9 or (mirror[mirror] != np.arange(len(part))).any():
        raise SystemExit("the template of this version of anny is not symmetric; use anny==0.6.2")
    return vertices[part], number[inside], part, mirror


def cavity_faces(model: anny.Anny, part: Ints) -> NDArray[np.bool_]:
    """Mark the faces of the body surface that line the mouth and the eye sockets."""
    from anny.face_segmentation import get_face_segmentation_mask

    inside = np.isin(model.faces.numpy(), part).all(axis=1)
    mask: NDArray[np.bool_] = get_face_segmentation_mask(model, CAVITIES).numpy()
    return mask[inside]


def people(model: anny.Anny, seed: int) -> Floats:
    """Return all vertices of all people in all poses, shape (subjects * poses, N, 3), metres."""
    rng = np.random.default_rng(seed)
    result = []
    for row in tqdm(SUBJECTS, desc="subjects"):
        phenotype = dict(zip(PHENOTYPES, row.tolist(), strict=True))
        local = dict(zip(LOCAL_SHAPES, rng.uniform(-LOCAL_RANGE, LOCAL_RANGE, len(LOCAL_SHAPES)).tolist(), strict=True))
        rest = model(phenotype_kwargs=phenotype, local_changes_kwargs=local)
        heads = rest["bone_poses"][0, :, :3, 3].double().numpy()
        rig = Rig(list(model.bone_labels), [int(k) for k in model.bone_parents], heads)
        lift = 40.0 * max(0.0, phenotype["weight"] - 0.5)
        matrices = np.stack([pose_matrices(p, lift, rng.normal(0, JITTER, (20, 3)), rig) for p in POSES])
        posed = model(
            pose_parameters=torch.tensor(matrices, dtype=torch.float32),
            phenotype_kwargs={k: torch.full((len(POSES),), v) for k, v in phenotype.items()},
            local_changes_kwargs={k: torch.full((len(POSES),), v) for k, v in local.items()},
        )
        result.append(posed["vertices"].detach().double().numpy())
    return np.concatenate(result)


def simplify(shapes: Floats, faces: Ints, mirror: Ints, n_vertices: int) -> tuple[Floats, Ints, Ints, Ints]:
    """Decimate by collapses judged on three poses of each subject, then flip edges judged on all shapes.

    Returns also the numbers of the vertices that are kept.
    """
    sample = [s * len(POSES) + (s + p) % len(POSES) for s in range(len(SUBJECTS)) for p in (0, 3, 7)]
    decimation = Decimation(shapes[sample], faces, mirror)
    decimation.run(n_vertices)
    kept = np.array(sorted(decimation.around))
    number = np.full(shapes.shape[1], -1)
    number[kept] = np.arange(len(kept))
    faces = number[np.array([decimation.faces[k] for k in sorted(decimation.faces)])]
    shapes, mirror = shapes[:, kept], number[mirror[kept]]
    return shapes, flip_towards_delaunay(shapes, faces, mirror), mirror, kept


def repair(vertices: Floats, faces: Ints, number: int) -> Floats:
    """Smooth small self-intersections away; say what was moved and what is left."""
    before = len(intersecting_pairs(vertices, faces))
    if not before:
        return vertices
    x = untangle(vertices, faces)
    moved = np.linalg.norm(x - vertices, axis=1)
    left = len(intersecting_pairs(x, faces))
    tqdm.write(
        f"s{number // 10:02d}_p{number % 10:02d}: {before} intersecting pairs -> {left}, "
        f"{(moved > 1e-4).sum()} vertices moved by up to {1000 * moved.max():.1f} mm"
    )
    return x


def write(path: Path, shapes: Floats, faces: Ints, mirror: Ints, seed: int) -> None:
    """Write 16-bit coordinates (one scale and offset per shape), differences along the vertices, and all metadata."""
    arrays = pack(shapes) | {
        "faces": faces.astype(np.uint16),
        "mirror": mirror.astype(np.uint16),
        "subjects": SUBJECTS,
        "phenotypes": np.array(PHENOTYPES),
        "poses": np.array([p.name for p in POSES]),
        "seed": np.array(seed),
    }
    temporary = path.with_name(f".{path.name}.tmp")
    with temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)
    os.replace(temporary, path)
    print(f"{path}: {shapes.shape[0]} shapes of {shapes.shape[1]} vertices, {path.stat().st_size / 2**20:.2f} MiB")


if __name__ == "__main__":
    main()
