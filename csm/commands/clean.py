"""``csm clean a.stl b.ply``: mend a mesh, and write what became of each of its vertices beside it."""

from __future__ import annotations

from csm.commands.main import run_as_program

if __name__ == "__main__":
    run_as_program(__file__)

from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from csm._counts import counted
from csm.commands.app import command, write_json
from csm.commands.outputs import OVERWRITE, require_file_place, require_new_in_sweep
from csm.errors import ConfigError
from csm.evaluation.provenance import provenance
from csm.mesh.check import check
from csm.mesh.clean import Cleaned, clean
from csm.mesh.io import file_digest, read_polygons, write_map, write_mesh
from csm.mesh.io.extras import Extras, read_extras
from csm.mesh.io.owned import require_not_input, require_own


def run(cfg: DictConfig) -> dict[str, Any]:
    """Write the cleaned mesh, both maps between old and new vertices, and an account; return counts."""
    given, out = cfg["in"], cfg.out
    if given is None or out is None:
        raise ConfigError("clean needs a mesh and a place: csm clean IN OUT")
    source, target = Path(given), Path(out)
    files = places(target)
    require_file_place(target)
    require_new_in_sweep(target)
    require_not_input([*files, account_of(target)], [source])
    require_own(files, account_of(target), cfg.overwrite, OVERWRITE)
    mesh = read_polygons(source, choose=cfg.choose)
    done = clean(
        mesh, weld=cfg.weld, split=cfg.split, debris=cfg.debris, orient=cfg.orient, tolerance=float(cfg.tolerance)
    )
    extras = carried(read_extras(source), done, target)
    write_cleaned(done, source, target, len(mesh.sizes), extras)
    report(done, source, target, extras)
    return {"vertices": done.mesh.n_vertices, "faces": done.mesh.n_faces, "steps": len(done.changes)}


def places(target: Path) -> list[Path]:
    """Return the files that are written for a cleaned mesh: the mesh, and the maps old -> new and new -> old."""
    return [target, *(target.with_name(f"{target.stem}.{name}.txt") for name in ("old_to_new", "new_to_old"))]


def account_of(target: Path) -> Path:
    """Return the json that says what was done."""
    return target.with_name(f"{target.stem}.clean.json")


def carried(extras: Extras, done: Cleaned, target: Path) -> Extras:
    """Return the colours of the new vertices, if the format has them, and the names of what is not carried over."""
    if extras.colors is None:
        return extras
    if target.suffix.lower() == ".obj":
        return Extras(others=("colours", *extras.others))
    return Extras(extras.colors[done.origin], extras.others)


def write_cleaned(done: Cleaned, source: Path, target: Path, n_faces: int, extras: Extras) -> None:
    """Write the mesh, the maps and the account."""
    mesh_file, old_to_new, new_to_old = places(target)
    write_mesh(mesh_file, done.mesh, extras.colors)
    forward = f"line i = vertex of {target.name} that vertex i of {source.name} has become"
    backward = f"line i = vertex of {source.name} that vertex i of {target.name} was"
    write_map(old_to_new, done.vertex_map, meaning=forward)
    write_map(new_to_old, done.origin, meaning=backward)
    made = provenance()
    account = {
        "in": str(source),
        "out": str(target),
        "steps": [{"kind": mend.kind, "count": mend.count, "text": mend.text} for mend in done.mends],
        "vertices": {"before": len(done.vertex_map), "after": done.mesh.n_vertices},
        "faces": {"before": n_faces, "after": done.mesh.n_faces},
        "carried_over": [] if extras.colors is None else ["colours"],
        "not_carried_over": list(extras.others),
        "findings": [finding.text for finding in check(done.mesh)],
        "files": {path.name: file_digest(path) for path in places(target)},
        "command": made.command,
        "commit": made.commit,
        "versions": made.versions,
    }
    write_json(account_of(target), account)


def report(done: Cleaned, source: Path, target: Path, extras: Extras) -> None:
    """Print what was done and what remains."""
    for note in done.mesh.notes:
        print(f"note: {source}: {note}")
    if extras.colors is not None:
        print(f"note: {source}: the colours of its vertices are carried over")
    if extras.others:
        print(
            f"note: {source}: what else it says of its vertices is not carried over: {', '.join(extras.others)}; "
            f"{places(target)[2].name} says which vertex each was"
        )
    for mend in done.mends:
        print(f"{mend.kind:<13} {mend.text}")
    remaining = [finding.text for finding in check(done.mesh)]
    print(
        "nothing had to be mended" if not done.changes else f"{counted(len(done.changes), 'step')} changed the mesh",
        end="; ",
    )
    print("no problems remain" if not remaining else f"what remains: {'; '.join(remaining)}")
    written = ", ".join(str(path) for path in [*places(target), account_of(target)])
    print(f"{counted(len(done.vertex_map), 'vertex')} -> {done.mesh.n_vertices}: {written}")


main = command("clean")(run)
